"""MetaImage (.mha, .mhd), the format of ITK: attached, detached, lists and patterns of files.

https://itk.org/Wiki/ITK/MetaIO/Documentation. Coordinates are ITK's, so LPS, where the header
says anything of orientation (TransformMatrix and its synonyms, AnatomicalOrientation other than
"???") or names a modality; without that the space is unknown. Row i of TransformMatrix is the
direction of index axis i. AnatomicalOrientation itself is informational, as in ITK.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volviz.errors import InputError, UnsupportedError, did_you_mean, safe_text
from volviz.io.choice import choice_note, chosen_index, modality_code, title_of
from volviz.io.geometry import length_unit, matrix, mm_per, usable, with_spacing
from volviz.io.metaimage_header import MetaHeader, files_of, read_meta_header, sizes_of
from volviz.io.options import Limits, ReadOptions
from volviz.io.payload import Part, check_size, part_range, read_parts, resolve_sibling, taken
from volviz.model.volume import Space, Volume, VolumeInfo

_TYPES = {
    "MET_CHAR": "i1",
    "MET_UCHAR": "u1",
    "MET_SHORT": "i2",
    "MET_USHORT": "u2",
    "MET_INT": "i4",
    "MET_UINT": "u4",
    "MET_LONG": "i4",
    "MET_ULONG": "u4",
    "MET_LONG_LONG": "i8",
    "MET_ULONG_LONG": "u8",
    "MET_FLOAT": "f4",
    "MET_DOUBLE": "f8",
}
_MOST_CHANNELS = 1 << 16


@dataclass(frozen=True)
class _File:
    """A header understood. channels come first (fastest) in the data, times last."""

    dims: tuple[int, int, int]
    channels: int
    times: int
    dtype: np.dtype[Any]
    parts: tuple[Part, ...]
    info: VolumeInfo


def probe(path: Path, options: ReadOptions) -> VolumeInfo:
    """Header only. Raises InputError, UnsupportedError or UsageError."""
    return _understand(Path(path), options).info


def read(path: Path, options: ReadOptions) -> Volume:
    """The volume. Raises InputError, UnsupportedError, UsageError, LimitError or Cancelled."""
    file = _understand(Path(path), options)
    info = file.info
    shape = (*info.shape, file.channels)
    nbytes = check_size(shape, file.dtype, options, file=path, field="DimSize")
    parts = part_range(file.parts, info.time * nbytes, nbytes)
    data, notes = read_parts(
        parts, file.dtype, shape, encoding=info.encoding, options=options, file=path
    )
    chosen = taken(data, (slice(None), slice(None), slice(None), info.channel), options.progress)
    return Volume(chosen, info.warn(*notes))


@np.errstate(all="ignore")
def _understand(path: Path, options: ReadOptions) -> _File:
    header = read_meta_header(path, options.limits)
    if (header.text("ObjectType") or "Image").lower() != "image":
        shown = safe_text(header.text("ObjectType"), 30)
        raise UnsupportedError(
            f"a '{shown}' is no image", file=path, field="ObjectType", fix="give a MetaImage"
        )
    sizes = sizes_of(header)
    if len(sizes) > 4:
        raise UnsupportedError(
            f"{len(sizes)} dimensions", file=path, field="NDims", fix="save at most 4"
        )
    dtype = _dtype(header)
    channels = header.integer("ElementNumberOfChannels", 1)
    if not 1 <= channels <= _MOST_CHANNELS:
        raise header.error("ElementNumberOfChannels", f"{channels} channels")
    unlimited = Limits(max_bytes=sys.maxsize)
    total = check_size((channels, *sizes), dtype, unlimited, file=path, field="DimSize")
    encoding = _encoding(header)
    parts = _parts(header, sizes, total=total, encoding=encoding, options=options)
    nx, ny, nz, times = [*sizes, 1, 1, 1][:4]
    stored = total if encoding == "raw" else sum(p.path.stat().st_size - p.offset for p in parts)
    info = _info(header, sizes, channels=channels, dtype=dtype, options=options)
    info = replace(info, encoding=encoding, stored_bytes=stored)
    claimed = header.integer("CompressedDataSize", stored)
    if encoding == "zlib" and claimed != stored and parts[0].path != path:
        info = info.warn(
            f"CompressedDataSize is {claimed}, but there are {stored} bytes; all are read"
        )
    return _File((nx, ny, nz), channels, times, dtype, parts, info)


def _dtype(header: MetaHeader) -> np.dtype[Any]:
    text = header.required("ElementType").upper()
    if text not in _TYPES:
        hint = did_you_mean(text, _TYPES)
        raise header.error("ElementType", f"'{safe_text(text, 40)}' is no type of voxels", hint)
    msb = header.flag("BinaryDataByteOrderMSB", "ElementByteOrderMSB")
    return np.dtype(_TYPES[text]).newbyteorder(">" if msb else "<")


def _encoding(header: MetaHeader) -> str:
    binary = header.text("BinaryData") is None or header.flag("BinaryData")
    if header.flag("CompressedData"):
        return "zlib"
    return "raw" if binary else "ascii"


def _parts(
    header: MetaHeader, sizes: tuple[int, ...], *, total: int, encoding: str, options: ReadOptions
) -> tuple[Part, ...]:
    """Where the voxels lie, in order."""
    names = files_of(header, sizes, options.limits)
    skip = header.integer("HeaderSize", 0)
    if skip < -1 or (skip == -1 and encoding != "raw"):
        raise header.error("HeaderSize", f"{skip} is not usable with {encoding} data")
    if not names:
        parts = [Part(header.path, header.data_offset, total)]
    else:
        each = total // len(names)
        where = [
            resolve_sibling(
                header.path, n, field="ElementDataFile", allow_outside=options.allow_outside
            )
            for n in names
        ]
        parts = [Part(path, 0, each) for path in where]
    return tuple(_skipped(part, skip) for part in parts) if skip else tuple(parts)


def _skipped(part: Part, skip: int) -> Part:
    """The part moved to HeaderSize bytes into its file, or for -1 to the end of it."""
    size = part.path.stat().st_size
    offset = skip if skip > 0 else size - part.nbytes
    if offset < part.offset or offset + 1 > size:
        found = max(size - max(part.offset, skip), 0)
        what = f"expected {part.nbytes} bytes, found {found} ({100 * found / part.nbytes:.3g} %)"
        raise InputError(
            what,
            file=part.path,
            field="HeaderSize",
            fix="correct HeaderSize, or copy the file again",
        )
    return replace(part, offset=offset)


def _geometry(
    header: MetaHeader, dimension: int
) -> tuple[NDArray[np.float64], Space | None, str | None, list[str]]:
    """Affine, space, unit and warnings."""
    axes, notes = min(dimension, 3), []
    spacing = header.numbers(dimension, "ElementSpacing", "ElementSize") or [1.0] * dimension
    origin = header.numbers(dimension, "Offset", "Position", "Origin") or [0.0] * dimension
    turn = ("TransformMatrix", "Rotation", "Orientation")
    rows = header.numbers(dimension * dimension, *turn)
    steps = np.eye(3)
    if rows is not None:
        square = np.array(rows).reshape(dimension, dimension)
        steps[:axes, :axes] = square[:axes, :axes].T
    for axis in range(axes):
        step = spacing[axis]
        if not math.isfinite(step) or step == 0:
            notes.append(f"ElementSpacing: axis {axis + 1} has spacing {step:g}; 1 is used")
            step = 1.0
        steps[:, axis] *= step
    position = np.zeros(3)
    position[:axes] = origin[:axes]
    unit = length_unit(header.text("DistanceUnits") or "")
    factor = mm_per(unit) if unit else 1.0
    affine, more = usable(
        matrix(steps * factor, position * factor), header.find(*turn) or "spacing"
    )
    letters = (header.text("AnatomicalOrientation") or "").strip("? ")
    known = rows is not None or letters or modality_code(header.text("Modality"))
    space: Space | None = "LPS" if known else None
    return affine, space, unit or ("mm" if known else None), [*notes, *more]


def _info(
    header: MetaHeader,
    sizes: tuple[int, ...],
    *,
    channels: int,
    dtype: np.dtype[Any],
    options: ReadOptions,
) -> VolumeInfo:
    nx, ny, nz, times = [*sizes, 1, 1, 1][:4]
    affine, space, unit, notes = _geometry(header, len(sizes))
    time = chosen_index(options.time, times, what="time", file=header.path)
    channel = chosen_index(options.channel, channels, what="channel", file=header.path)
    notes += choice_note(times, time, what="time")
    notes += choice_note(channels, channel, what="channel")
    if len(sizes) < 3:
        notes.append(f"the data are {len(sizes)}D and shown one sample thick")
    slope = header.text("ElementToIntensityFunctionSlope")
    shift = header.text("ElementToIntensityFunctionOffset")
    if slope not in (None, "1", "1.0") or shift not in (None, "0", "0.0"):
        notes.append("ElementToIntensityFunction is not applied, as in ITK; values are as stored")
    modality = modality_code(header.text("Modality"))
    return VolumeInfo(
        format="MetaImage",
        dims=(nx, ny, nz),
        dtype=dtype,
        affine=with_spacing(affine, options.spacing),
        space=space,
        length_unit=unit,
        value_unit="HU" if modality == "CT" else None,
        modality=modality,
        times=times,
        time=time,
        channels=channels,
        channel=channel,
        fields=header.for_display(),
        warnings=tuple(notes),
        source=header.path,
        name=title_of(header.path),
    )
