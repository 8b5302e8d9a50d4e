"""NRRD (Nearly Raw Raster Data), versions 1 to 5: attached, detached, lists and patterns of files.

http://teem.sourceforge.net/nrrd/format.html. Lengths in a patient space without `space units` are
millimetres, as everywhere in that field.
"""

from __future__ import annotations

import math
import re
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from volviz.errors import UnsupportedError, did_you_mean, safe_text
from volviz.io.choice import choice_note, chosen_index, modality_code, title_of
from volviz.io.geometry import with_spacing
from volviz.io.nrrd_files import parts_of
from volviz.io.nrrd_grid import Grid, grid_of
from volviz.io.nrrd_header import NrrdHeader, read_nrrd_header
from volviz.io.options import Limits, ReadOptions
from volviz.io.payload import Part, check_size, part_range, read_parts, taken
from volviz.model.volume import Volume, VolumeInfo

_TYPES = {
    "i1": ("signed char", "int8", "int8_t"),
    "u1": ("uchar", "unsigned char", "uint8", "uint8_t"),
    "i2": ("short", "short int", "signed short", "signed short int", "int16", "int16_t"),
    "u2": ("ushort", "unsigned short", "unsigned short int", "uint16", "uint16_t"),
    "i4": ("int", "signed int", "int32", "int32_t"),
    "u4": ("uint", "unsigned int", "uint32", "uint32_t"),
    "i8": (
        "longlong",
        "long long",
        "long long int",
        "signed long long",
        "signed long long int",
        "int64",
        "int64_t",
    ),
    "u8": ("ulonglong", "unsigned long long", "unsigned long long int", "uint64", "uint64_t"),
    "f4": ("float",),
    "f8": ("double",),
}
_TYPE = {name: code for code, names in _TYPES.items() for name in names}
_ENCODING = {
    "raw": "raw",
    "txt": "ascii",
    "text": "ascii",
    "ascii": "ascii",
    "hex": "hex",
    "gz": "gzip",
    "gzip": "gzip",
    "bz2": "bzip2",
    "bzip2": "bzip2",
}
_MODALITY_KEYS = ("modality", "dicom_0008_0060", "(0008,0060)", "0008|0060")
_MOST_AXES = 16


@dataclass(frozen=True)
class _File:
    """A header understood: everything that reading the voxels needs."""

    header: NrrdHeader
    sizes: tuple[int, ...]
    dtype: np.dtype[Any]
    encoding: str
    parts: tuple[Part, ...]
    grid: Grid
    info: VolumeInfo


def probe(path: Path, options: ReadOptions) -> VolumeInfo:
    """Header only. Raises InputError, UnsupportedError or UsageError."""
    return _understand(Path(path), options).info


def read(path: Path, options: ReadOptions) -> Volume:
    """The volume. Raises InputError, UnsupportedError, UsageError, LimitError or Cancelled."""
    file = _understand(Path(path), options)
    start, sizes, axes = _wanted(file)
    check_size(sizes, file.dtype, options, file=file.header.path, field="sizes")
    nbytes = math.prod(sizes) * file.dtype.itemsize
    parts = file.parts
    from_end = any(part.skip < 0 for part in parts)
    if from_end:
        start, sizes, axes = 0, list(file.sizes), list(range(len(file.sizes)))
    else:
        parts = part_range(parts, start * nbytes, nbytes)
    data, notes = read_parts(
        parts,
        file.dtype,
        sizes[::-1],
        encoding=file.encoding,
        options=options,
        file=file.header.path,
    )
    pick = tuple(
        slice(None) if file.grid.roles[a] == "space" else _index(file, a) for a in reversed(axes)
    )
    chosen = taken(data, pick, options.progress).reshape(file.info.shape)
    return Volume(chosen, file.info.warn(*notes))


def _wanted(file: _File) -> tuple[int, list[int], list[int]]:
    """The contiguous block to read: its number in the data, its sizes, its axes (fastest first)."""
    start, axes = 0, list(range(len(file.sizes)))
    while file.grid.roles[axes[-1]] != "space":
        axis = axes.pop()
        start = start * file.sizes[axis] + _index(file, axis)
    return start, [file.sizes[a] for a in axes], axes


def _index(file: _File, axis: int) -> int:
    if file.sizes[axis] == 1:
        return 0
    return file.info.time if file.grid.roles[axis] == "time" else file.info.channel


@np.errstate(all="ignore")
def _understand(path: Path, options: ReadOptions) -> _File:
    header = read_nrrd_header(path, options.limits)
    sizes = _sizes(header)
    encoding = _encoding(header)
    dtype = _dtype(header, encoding)
    check_size(sizes, dtype, Limits(max_bytes=sys.maxsize), file=path, field="sizes")
    grid = grid_of(header, sizes)
    total = math.prod(sizes) * dtype.itemsize
    parts = parts_of(header, sizes, total=total, encoding=encoding, options=options)
    info = _info(header, sizes=sizes, dtype=dtype, encoding=encoding, grid=grid, options=options)
    stored = total if encoding == "raw" else sum(p.path.stat().st_size - p.offset for p in parts)
    info = replace(info, stored_bytes=stored)
    return _File(header, sizes, dtype, encoding, parts, grid, info)


def _sizes(header: NrrdHeader) -> tuple[int, ...]:
    tokens = header.required("sizes").split()
    text = header.required("dimension")
    if not re.fullmatch(r"\+?0*\d{1,3}", text) or not 1 <= int(text) <= _MOST_AXES:
        raise header.error("dimension", f"'{safe_text(text, 30)}' is no number from 1 to 16")
    dimension = int(text)
    if dimension != len(tokens):
        raise header.error("sizes", f"{len(tokens)} sizes for dimension {dimension}")
    for token in tokens:
        if not re.fullmatch(r"\+?\d{1,30}", token) or int(token) == 0:
            raise header.error("sizes", f"'{safe_text(token, 30)}' is no positive whole number")
    if dimension > 5:
        raise UnsupportedError(
            f"{dimension} axes",
            file=header.path,
            field="dimension",
            fix="save at most three axes of space, one of time and one of channels",
        )
    return tuple(int(token) for token in tokens)


def _encoding(header: NrrdHeader) -> str:
    text = header.required("encoding").lower()
    if text == "zrl":
        raise UnsupportedError(
            "encoding zrl is not read", file=header.path, field="encoding", fix="save it as gzip"
        )
    if text not in _ENCODING:
        hint = did_you_mean(text, _ENCODING)
        raise header.error("encoding", f"'{safe_text(text, 30)}' is no encoding", hint)
    return _ENCODING[text]


def _dtype(header: NrrdHeader, encoding: str) -> np.dtype[Any]:
    text = " ".join(header.required("type").lower().split())
    if text == "block":
        raise UnsupportedError(
            "type block has no values to show",
            file=header.path,
            field="type",
            fix="save it with a type of numbers",
        )
    if text not in _TYPE:
        hint = did_you_mean(text, _TYPE)
        raise header.error("type", f"'{safe_text(text, 30)}' is no type", hint)
    dtype = np.dtype(_TYPE[text])
    if dtype.itemsize == 1 or encoding == "ascii":
        return dtype
    endian = header.fields.get("endian", "").lower()
    if endian not in ("little", "big"):
        what = f"'{safe_text(endian, 20)}' is no byte order" if endian else "it is missing"
        raise header.error(
            "endian", f"{what}, and {text} has {dtype.itemsize} bytes", "write 'endian: little'"
        )
    return dtype.newbyteorder("<" if endian == "little" else ">")


def _info(
    header: NrrdHeader,
    *,
    sizes: tuple[int, ...],
    dtype: np.dtype[Any],
    encoding: str,
    grid: Grid,
    options: ReadOptions,
) -> VolumeInfo:
    spatial = [n for n, role in zip(sizes, grid.roles, strict=True) if role == "space"]
    times, channels = (
        math.prod(n for n, role in zip(sizes, grid.roles, strict=True) if role == kind)
        for kind in ("time", "channel")
    )
    time = chosen_index(options.time, times, what="time", file=header.path)
    channel = chosen_index(options.channel, channels, what="channel", file=header.path)
    notes = [*choice_note(times, time, what="time")]
    notes += choice_note(channels, channel, what="channel")
    if len(spatial) < 3:
        notes.append(f"the data are {len(spatial)}D and shown one sample thick")
    nx, ny, nz = [*spatial, 1, 1][:3]
    return VolumeInfo(
        format="NRRD",
        dims=(nx, ny, nz),
        dtype=dtype,
        affine=with_spacing(grid.affine, options.spacing),
        space=grid.space,
        length_unit=grid.length_unit,
        times=times,
        time=time,
        channels=channels,
        channel=channel,
        fields=header.for_display(),
        warnings=(*notes, *grid.warnings),
        encoding=encoding,
        source=header.path,
        name=title_of(header.path),
        **_meaning(header, dtype),
    )


def _meaning(header: NrrdHeader, dtype: np.dtype[Any]) -> dict[str, Any]:
    """What the header says of the values: unit, modality, kind, padding, window."""
    keys = {key.lower(): value for key, value in header.keys.items()}
    modality = next((c for k in _MODALITY_KEYS if (c := modality_code(keys.get(k)))), None)
    unit = header.fields.get("sample units", "").strip('"? ')
    if unit.lower() in ("hu", "hounsfield", "hounsfield unit", "hounsfield units"):
        unit = "HU"
    named = (
        header.path.name.lower().endswith(".seg.nrrd")
        or keys.get("kind", "").lower() in ("label", "labels")
        or any(re.fullmatch(r"segment\d+_id", key) for key in keys)
    )
    labels = named and dtype.kind in "iu"
    padding = _floats(keys.get("volviz padding"), 1)
    window = _floats(keys.get("volviz window"), 2)
    return {
        "value_unit": unit or ("HU" if modality == "CT" and not labels else None),
        "modality": None if modality == "SEG" else modality,
        "kind": "labels" if labels else "scalar",
        "padding": padding[0] if padding else None,
        "window": (window[0], window[1]) if window and window[1] > 0 else None,
    }


def _floats(text: str | None, count: int) -> list[float]:
    """Exactly this many finite numbers, or none."""
    try:
        values = [float(word) for word in (text or "").split()[: count + 1]]
    except ValueError:
        return []
    return values if len(values) == count and all(map(math.isfinite, values)) else []
