"""MRC2014 and CCP4 maps (Cheng et al. 2015, J. Struct. Biol. 192:146; header by mrcfile).

Columns, rows and sections are put back to x, y, z after MAPC, MAPR, MAPS. The grid follows the
cell, sheared where its angles are not right ones. Ångström become mm; there is no patient space.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volviz.errors import InputError, UnsupportedError, safe_text
from volviz.io import sniff
from volviz.io.choice import choice_note, chosen_index
from volviz.io.dtypes import delivered
from volviz.io.geometry import mm_per, usable, with_spacing
from volviz.io.options import ReadOptions
from volviz.io.payload import Part, check_size, read_parts
from volviz.model.volume import Volume, VolumeInfo

HEADER = 1024
_MODES = {0: "i1", 1: "i2", 2: "f4", 6: "u2", 12: "f2"}
_OTHER_MODES = {
    3: "complex 16-bit integers",
    4: "complex 32-bit floats",
    16: "RGB bytes",
    101: "4-bit integers",
}
_IMOD_STAMP = 1146047817
_STACK_OF_VOLUMES = 401


@dataclass(frozen=True)
class _Map:
    """What the header says.

    order: file axis (0 = columns) of x, y, z. counts: columns, rows, sections of one volume.
    """

    header: Any
    dtype: np.dtype[Any]
    counts: tuple[int, int, int]
    order: tuple[int, int, int]
    volumes: int
    packed: bool
    warnings: tuple[str, ...]


def probe(path: Path, options: ReadOptions) -> VolumeInfo:
    """What `read` gives, from the header alone. Raises InputError, UnsupportedError, UsageError."""
    return _info(_header(path), path, options)


def read(path: Path, options: ReadOptions) -> Volume:
    """The map `[z, y, x]`; of a stack of volumes the one that `options.time` names.

    Raises as `probe` does; LimitError, Cancelled.
    """
    found = _header(path)
    info = _info(found, path, options)
    columns, rows, sections = found.counts
    shape = (sections, rows, columns)
    size = check_size(shape, found.dtype, options, file=path, field="NX, NY, NZ")
    start = HEADER + max(0, int(found.header.nsymbt)) + info.time * size
    part = Part(path, 0 if found.packed else start, size, skip=start if found.packed else 0)
    rest = (found.volumes - 1 - info.time) * size
    data, notes = read_parts(
        [Part(part.path, part.offset, part.nbytes, part.skip, rest)],
        found.dtype,
        shape,
        encoding="gzip" if found.packed else "raw",
        options=options,
        file=path,
        field="map",
    )
    axes = tuple(2 - found.order[k] for k in (2, 1, 0))
    return Volume(np.ascontiguousarray(data.transpose(axes)), info.warn(*notes))


def _header(path: Path) -> _Map:
    from mrcfile.dtypes import HEADER_DTYPE

    head = sniff.head(path)
    if len(head) < HEADER:
        raise InputError(
            f"the header has {HEADER} bytes, the file only {len(head)}",
            file=path,
            fix="the file is cut off: copy it again",
        )
    header = np.frombuffer(head[:HEADER], dtype=HEADER_DTYPE.newbyteorder(_byte_order(head)))[0]
    header = header.view(np.recarray) if isinstance(header, np.ndarray) else np.rec.array(header)
    counts = tuple(int(header[k]) for k in ("nx", "ny", "nz"))
    for name, count in zip(("NX", "NY", "NZ"), counts, strict=True):
        if count < 1:
            raise InputError(
                f"{count} is no size",
                file=path,
                field=name,
                fix="the header is wrong: write the map again",
            )
    dtype, warnings = _dtype(header, head, path)
    order, more = _order(header, path)
    volumes, sections = _volumes(header, counts[2], path)
    if int(header["nsymbt"]) < 0:
        raise InputError(
            "the extended header has a negative size",
            file=path,
            field="NSYMBT",
            fix="the header is wrong: write the map again",
        )
    packed = sniff.is_gzip(path)
    shape = (counts[0], counts[1], sections)
    return _Map(header, dtype, shape, order, volumes, packed, (*warnings, *more))


def _byte_order(head: bytes) -> str:
    """< or >: by the machine stamp, else by which order gives a known mode and axis order."""
    stamp = head[212]
    if stamp in (0x44, 0x11):
        return "<" if stamp == 0x44 else ">"
    mode, first = head[12:16], head[64:68]
    for order in "<>":
        known = struct.unpack(f"{order}i", mode)[0] in {**_MODES, **_OTHER_MODES}
        if known and 0 <= struct.unpack(f"{order}i", first)[0] <= 3:
            return order
    return "<"


def _dtype(header: Any, head: bytes, path: Path) -> tuple[np.dtype[Any], list[str]]:
    mode = int(header["mode"])
    order = header.dtype["mode"].byteorder
    little = order == "<" or (order == "=" and np.little_endian)
    if mode in _OTHER_MODES:
        raise UnsupportedError(
            f"mode {mode} ({_OTHER_MODES[mode]}) is not read",
            file=path,
            field="MODE",
            fix="save it as 8-bit, 16-bit or float",
        )
    if mode not in _MODES:
        known = ", ".join(map(str, _MODES))
        raise InputError(f"there is no mode {mode}", file=path, field="MODE", fix=f"one of {known}")
    stamp, flags = struct.unpack("<2i" if little else ">2i", head[152:160])
    if mode == 0 and stamp == _IMOD_STAMP and not flags & 1:
        return np.dtype("u1"), ["bytes are unsigned, as IMOD's mark in the header says"]
    return np.dtype(_MODES[mode]).newbyteorder("<" if little else ">"), []


def _order(header: Any, path: Path) -> tuple[tuple[int, int, int], list[str]]:
    axes = [int(header[k]) for k in ("mapc", "mapr", "maps")]
    if axes == [0, 0, 0]:
        return (0, 1, 2), ["the order of axes is not given: columns, rows, sections are x, y, z"]
    if sorted(axes) != [1, 2, 3]:
        raise InputError(
            f"{axes[0]}, {axes[1]}, {axes[2]} is no order of the axes 1, 2, 3",
            file=path,
            field="MAPC, MAPR, MAPS",
            fix="the header is wrong: write the map again",
        )
    return (axes.index(1), axes.index(2), axes.index(3)), []


def _volumes(header: Any, sections: int, path: Path) -> tuple[int, int]:
    """How many volumes the sections make up, and the sections of each."""
    each = int(header["mz"])
    if int(header["ispg"]) < _STACK_OF_VOLUMES:
        return 1, sections
    if each < 1 or sections % each:
        raise InputError(
            f"{sections} sections are no whole number of volumes of {each}",
            file=path,
            field="NZ, MZ",
            fix="the header is wrong: write the map again",
        )
    return sections // each, each


def _info(found: _Map, path: Path, options: ReadOptions) -> VolumeInfo:
    time = chosen_index(options.time, found.volumes, what="time", file=path)
    chosen_index(options.channel, 1, what="channel", file=path)
    affine, known, notes = _affine(found)
    affine, more = usable(affine, "CELLA, CELLB")
    nx, ny, nz = (found.counts[k] for k in found.order)
    return VolumeInfo(
        format="MRC/CCP4",
        dims=(nx, ny, nz),
        dtype=delivered(found.dtype),
        affine=with_spacing(affine, options.spacing),
        length_unit="mm" if options.spacing else "Å" if known else None,
        times=found.volumes,
        time=time,
        fields=_fields(found.header),
        warnings=(
            *choice_note(found.volumes, time, what="time"),
            *found.warnings,
            *notes,
            *more,
        ),
        encoding="gzip" if found.packed else "raw",
        stored_bytes=path.stat().st_size,
        source=path,
        name=path.name.split(".")[0],
    )


def _affine(found: _Map) -> tuple[NDArray[np.float64], bool, list[str]]:
    """float64[4, 4], index x, y, z to mm, and whether the cell is given."""
    header = found.header
    cell = np.array([header["cella"][k] for k in "xyz"], dtype=np.float64)
    angles = np.array([header["cellb"][k] for k in ("alpha", "beta", "gamma")], dtype=np.float64)
    grid = np.array([int(header[k]) for k in ("mx", "my", "mz")], dtype=np.float64)
    start = np.array([int(header[k]) for k in ("nxstart", "nystart", "nzstart")])[list(found.order)]
    origin = np.array([header["origin"][k] for k in "xyz"], dtype=np.float64)
    counts = np.array([found.counts[k] for k in found.order], dtype=np.float64)
    grid = np.where(grid > 0, grid, counts)
    notes = []
    known = bool(np.all(np.isfinite(cell)) and np.all(cell > 0))
    if not known:
        notes.append("the size of the cell is not given: 1 Å per voxel is assumed")
        cell = grid.copy()
    basis = _cell_basis(cell, angles)
    if basis is None:
        basis = np.diag(cell)
        if np.any(angles != 0):
            notes.append("the angles of the cell are impossible: right ones are assumed")
    steps = basis / grid
    place = steps @ start
    if np.all(np.isfinite(origin)) and np.any(origin != 0):
        if np.any(start != 0) and not np.allclose(origin, place, atol=1e-3 * float(cell.max())):
            notes.append("ORIGIN and NXSTART differ: ORIGIN is used")
        place = origin
    affine = np.eye(4)
    affine[:3, :3], affine[:3, 3] = steps * mm_per("Å"), place * mm_per("Å")
    return affine, known, notes


def _cell_basis(
    lengths: NDArray[np.float64], angles: NDArray[np.float64]
) -> NDArray[np.float64] | None:
    """Columns a, b, c of a cell: a along x, b in the x-y plane (as in PDB); None if impossible."""
    if not np.all(np.isfinite(angles)) or np.any(angles <= 0) or np.any(angles >= 180):
        return None
    right = np.abs(angles - 90) < 1e-6
    cos = np.where(right, 0.0, np.cos(np.radians(angles)))
    sin_gamma = 1.0 if right[2] else float(np.sin(np.radians(angles[2])))
    along = (cos[0] - cos[1] * cos[2]) / sin_gamma
    height = 1 - cos[1] ** 2 - along**2
    if height <= 1e-9:
        return None
    a, b, c = lengths
    return np.array(
        [
            [a, b * cos[2], c * cos[1]],
            [0, b * sin_gamma, c * along],
            [0, 0, c * np.sqrt(height)],
        ]
    )


def _fields(header: Any) -> dict[str, str]:
    """The header as text, labels last."""
    fields = {
        name: _text(header[name])
        for name in header.dtype.names
        if not name.startswith("extra") and name not in ("label", "machst")
    }
    for k in range(max(0, min(int(header["nlabl"]), 10))):
        fields[f"label {k + 1}"] = _text(header["label"][k])
    return fields


def _text(value: Any) -> str:
    plain = value.tolist() if hasattr(value, "tolist") else value
    if isinstance(plain, bytes):
        return safe_text(plain.decode("latin-1").strip("\0 "))
    return safe_text(" ".join(map(str, plain)) if isinstance(plain, tuple) else plain)
