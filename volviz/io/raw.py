"""RAW voxels without a header: layout from flags, the file's name, or a descriptor beside it.

The size of the file must fit exactly; where it does not, the layouts that would fit are named.
"""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volviz.errors import InputError, UsageError, VolvizError, did_you_mean, safe_text
from volviz.io import sniff
from volviz.io.choice import chosen_index
from volviz.io.dtypes import COMMON, delivered, sample_type
from volviz.io.geometry import usable, with_spacing
from volviz.io.options import ReadOptions
from volviz.io.payload import Part, check_size, read_parts, resolve_sibling
from volviz.io.raw_header import read_raw_header
from volviz.io.raw_layout import GUESS, fitting_layouts, layout_from_name
from volviz.model.volume import Volume, VolumeInfo

_HEADERS = (".nhdr", ".nrrd", ".mhd", ".mha", ".dat", ".json")
_MAX_BESIDE = 512
_PEEK = 8192


@dataclass(frozen=True)
class _Layout:
    """A RAW file's layout. stored: with byte order; given: the user said shape or type."""

    file: Path
    dims: tuple[int, int, int]
    stored: np.dtype[Any]
    offset: int
    packed: bool
    affine: NDArray[np.float64]
    spaced: bool
    given: bool = False
    notes: tuple[str, ...] = ()
    fields: dict[str, str] | None = None


def probe(path: Path, options: ReadOptions) -> VolumeInfo:
    """What `read` gives; the size of the file is compared, no voxel read.

    Raises UsageError where shape or type are missing or wrong, InputError where the name or a
    descriptor does not fit the file.
    """
    return _info(_layout(path, options), path, options)


def read(path: Path, options: ReadOptions) -> Volume:
    """The volume `[z, y, x]`. Raises as `probe` does; LimitError, Cancelled."""
    layout = _layout(path, options)
    info = _info(layout, path, options)
    nbytes = check_size(layout.dims, layout.stored, options, file=path, field="shape")
    skip = layout.offset if layout.packed else 0
    try:
        data, notes = read_parts(
            [Part(layout.file, 0 if layout.packed else layout.offset, nbytes, skip=skip)],
            layout.stored,
            layout.dims[::-1],
            encoding="gzip" if layout.packed else "raw",
            options=options,
            file=path,
            field="voxels",
        )
    except InputError:
        if layout.packed:
            _check_fit(layout, _decoded_size(layout.file))
        raise
    return Volume(data, info.warn(*notes))


def _layout(path: Path, options: ReadOptions) -> _Layout:
    if options.shape is None and sniff.is_raw_header(sniff.head(path)):
        return _described(path, options)
    name = layout_from_name(path.name)
    dims = _wanted_dims(options) or name.dims
    if dims is None:
        raise _no_shape(path)
    offset, endian = _wanted_offset(options), _wanted_endian(options) or name.endian
    packed = sniff.is_gzip(path)
    size = _decoded_size(path) if packed else path.stat().st_size
    notes: list[str] = []
    dtype = _wanted_type(options) or name.dtype
    if dtype is None:
        dtype = _guessed_type(path, dims, size - offset)
        notes.append(f"the type is not given: {dtype.name} is assumed from the size (--dtype)")
    given = options.shape is not None or options.dtype is not None or options.offset is not None
    header = _header_beside(path)
    if header is not None:
        notes.append(f"{safe_text(header.name, 80)} beside it describes this file: open that one")
    layout = _Layout(
        path,
        dims,
        dtype.newbyteorder(">" if endian == "big" else "<"),
        offset,
        packed,
        np.eye(4),
        False,
        given,
        tuple(notes),
    )
    if not packed:
        _check_fit(layout, size)
    return layout


def _described(path: Path, options: ReadOptions) -> _Layout:
    """The layout that a descriptor gives for a file beside it."""
    header = read_raw_header(path, options.limits)
    file = resolve_sibling(path, header.file, field="RawFile", allow_outside=options.allow_outside)
    dtype = header.dtype.newbyteorder(">" if header.big else "<")
    packed = sniff.is_gzip(file)
    layout = _Layout(
        file,
        header.dims,
        dtype,
        header.offset,
        packed,
        header.affine,
        header.spaced,
        fields={k: safe_text(v) for k, v in header.fields.items()},
    )
    if not packed:
        _check_fit(layout, file.stat().st_size)
    return layout


def _wanted_dims(options: ReadOptions) -> tuple[int, int, int] | None:
    if options.shape is None:
        return None
    if len(options.shape) != 3 or any(int(n) != n or n < 1 for n in options.shape):
        raise UsageError(
            f"{list(options.shape)} are no three positive sizes x, y, z",
            field="shape",
            fix="e.g. --shape 256,256,128",
        )
    x, y, z = (int(n) for n in options.shape)
    return x, y, z


def _wanted_offset(options: ReadOptions) -> int:
    offset = options.offset or 0
    if offset < 0:
        raise UsageError(f"{offset} is no count of bytes", field="offset", fix="give 0 or more")
    return offset


def _wanted_endian(options: ReadOptions) -> str | None:
    if options.endian not in (None, "little", "big"):
        raise UsageError(
            f"there is no byte order '{safe_text(options.endian, 20)}'",
            field="endian",
            fix=did_you_mean(options.endian, ("little", "big")),
        )
    return options.endian


def _wanted_type(options: ReadOptions) -> np.dtype[Any] | None:
    if options.dtype is None:
        return None
    dtype = sample_type(options.dtype)
    if dtype is None:
        raise UsageError(
            f"there is no sample type '{safe_text(options.dtype, 30)}'",
            field="dtype",
            fix=did_you_mean(options.dtype, COMMON),
        )
    return dtype


def _guessed_type(path: Path, dims: tuple[int, int, int], nbytes: int) -> np.dtype[Any]:
    """The usual type of as many bytes per voxel as there are."""
    width, rest = divmod(nbytes, math.prod(dims))
    if rest or width not in GUESS:
        raise _misfit(path, dims, None, nbytes, given=False)
    return np.dtype(GUESS[width])


def _check_fit(layout: _Layout, size: int) -> None:
    needed = layout.offset + math.prod(layout.dims) * layout.stored.itemsize
    fits = size == needed % (1 << 32) if layout.packed else size == needed
    if not fits:
        raise _misfit(
            layout.file, layout.dims, layout.stored, size - layout.offset, given=layout.given
        )


def _misfit(
    path: Path,
    dims: tuple[int, int, int],
    dtype: np.dtype[Any] | None,
    nbytes: int,
    *,
    given: bool,
) -> VolvizError:
    """The error for a size that does not fit, with the layouts that would."""
    plain = None if dtype is None else dtype.newbyteorder("=")
    asked = f"{dims[0]}x{dims[1]}x{dims[2]}" + (f" {plain.name}" if plain is not None else "")
    needed = math.prod(dims) * plain.itemsize if plain is not None else None
    what = f"{nbytes} bytes of voxels do not fit {asked}"
    if needed is not None:
        what += f", which needs {needed}"
    hints = fitting_layouts(nbytes, dims, plain)
    extra = nbytes - needed if needed is not None else 0
    if 0 < extra <= 65536:
        hints.insert(0, f"the same with --offset {extra} (a header before the voxels)")
    fix = f"it fits {', '.join(hints)}" if hints else "give --shape, --dtype and --offset that fit"
    kind = UsageError if given else InputError
    return kind(what, file=path, field="shape" if given else "file name", fix=fix)


def _no_shape(path: Path) -> VolvizError:
    """The error for a file that nothing says the shape of."""
    header = _header_beside(path)
    if header is not None:
        return InputError(
            f"these are the voxels of {safe_text(header.name, 80)}",
            file=path,
            fix=f"open {safe_text(header, 200)}",
        )
    size = path.stat().st_size
    hints = [] if sniff.is_gzip(path) else fitting_layouts(size, None, None)
    fits = f"; {size} bytes fit {', '.join(hints)}" if hints else ""
    return UsageError(
        f"neither the name nor a header says the shape{fits}",
        file=path,
        field="shape",
        fix="give --shape X,Y,Z and --dtype",
    )


def _header_beside(path: Path) -> Path | None:
    """A small header in the same folder that names this file."""
    name = path.name.encode()
    try:
        beside = sorted(p for p in path.parent.iterdir() if p.suffix.lower() in _HEADERS)
    except OSError:
        return None
    for file in beside[:_MAX_BESIDE]:
        if file == path or not file.is_file():
            continue
        try:
            with file.open("rb") as stream:
                head = stream.read(_PEEK)
        except OSError:
            continue
        at = head.find(name)
        if at > 0 and not head[at - 1 : at].isalnum():
            return file
    return None


def _decoded_size(path: Path) -> int:
    """What a gzip file's last four bytes say it holds, modulo 2**32: a hint, no proof."""
    with path.open("rb") as file:
        file.seek(0, 2)
        if file.tell() < 18:
            return 0
        file.seek(-4, 2)
        (size,) = struct.unpack("<I", file.read(4))
    return int(size)


def _info(layout: _Layout, path: Path, options: ReadOptions) -> VolumeInfo:
    chosen_index(options.time, 1, what="time", file=path)
    chosen_index(options.channel, 1, what="channel", file=path)
    affine, notes = usable(layout.affine, "Spacing")
    spaced = layout.spaced or options.spacing is not None
    unknown = [] if spaced else ["spacing unknown: 1 is assumed along every axis"]
    return VolumeInfo(
        format="RAW" if layout.fields is None else "RAW with a descriptor",
        dims=layout.dims,
        dtype=delivered(layout.stored),
        affine=with_spacing(affine, options.spacing),
        length_unit="mm" if options.spacing is not None else None,
        fields=layout.fields
        or {
            "shape": "x".join(map(str, layout.dims)),
            "dtype": layout.stored.name,
            "endian": "big" if layout.stored.str.startswith(">") else "little",
            "offset": str(layout.offset),
        },
        warnings=(*layout.notes, *notes, *unknown),
        encoding="gzip" if layout.packed else "raw",
        stored_bytes=layout.file.stat().st_size,
        source=path,
        name=path.name.split(".")[0],
    )
