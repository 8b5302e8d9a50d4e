"""NIfTI-1, NIfTI-2 and Analyze 7.5: .nii, .hdr with .img, gzipped or not, either byte order.

https://nifti.nimh.nih.gov. nibabel unpacks the header; voxels go through `payload`. Values are
`scl_slope · stored + scl_inter` where the header has a usable slope other than 1 and 0: float32
for 8- and 16-bit integers and float32, float64 for wider types. Otherwise they stay as stored.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volviz.errors import LimitError, UnsupportedError
from volviz.io.choice import choice_note, chosen_index, title_of
from volviz.io.geometry import with_spacing
from volviz.io.nifti_grid import grid_of
from volviz.io.nifti_header import NiftiHeader, read_nifti_header
from volviz.io.options import Limits, ReadOptions
from volviz.io.payload import Part, binary_size, check_size, part_range, read_parts, taken
from volviz.model.volume import Volume, VolumeInfo
from volviz.progress import Progress

_LABEL_INTENT = 1002
_COLOURS = ("red", "green", "blue", "alpha")
_CHUNK = 1 << 20


@dataclass(frozen=True)
class _File:
    """A header understood. slope, inter: (1, 0) where values stay as stored."""

    header: NiftiHeader
    info: VolumeInfo
    slope: float
    inter: float


def probe(path: Path, options: ReadOptions) -> VolumeInfo:
    """Header only. Raises InputError, UnsupportedError or UsageError."""
    return _understand(Path(path), options).info


def read(path: Path, options: ReadOptions) -> Volume:
    """The volume. Raises InputError, UnsupportedError, UsageError, LimitError or Cancelled."""
    file = _understand(Path(path), options)
    header, info = file.header, file.info
    nx, ny, nz, times, _ = header.dims
    shape = (nz, ny, nx, header.colours) if header.colours > 1 else (nz, ny, nx)
    nbytes = check_size(shape, header.dtype, options, file=path, field="dim")
    _check_result(info, options, path)
    total = math.prod((*header.dims, header.colours)) * header.dtype.itemsize
    if header.gzipped:
        whole = Part(header.data_path, 0, total, skip=header.data_offset)
    else:
        whole = Part(header.data_path, header.data_offset, total)
    vector = 0 if header.colours > 1 else info.channel
    parts = part_range([whole], (info.time + times * vector) * nbytes, nbytes)
    data, notes = read_parts(
        parts, header.dtype, shape, encoding=info.encoding, options=options, file=path
    )
    if header.colours > 1:
        data = taken(data, (slice(None),) * 3 + (info.channel,), options.progress)
    return Volume(_values(data, file, options.progress), info.warn(*notes))


def _values(data: NDArray[Any], file: _File, progress: Progress) -> NDArray[Any]:
    """Stored to real values: slope and intercept, magnitude of complex numbers. In pieces."""
    if (file.slope, file.inter) == (1.0, 0.0) and data.dtype.kind != "c":
        return data
    out = np.empty(data.shape, dtype=file.info.dtype)
    flat, result = data.reshape(-1), out.reshape(-1)
    wide = np.complex128 if data.dtype.kind == "c" else np.float64
    with np.errstate(all="ignore"):
        for start in range(0, flat.size, _CHUNK):
            progress(None, "scaling values")
            piece = flat[start : start + _CHUNK].astype(wide)
            if (file.slope, file.inter) != (1.0, 0.0):
                piece = piece * file.slope + file.inter
            result[start : start + _CHUNK] = np.abs(piece) if wide is np.complex128 else piece
    return out


def _check_result(info: VolumeInfo, options: ReadOptions, path: Path) -> None:
    """The scaled voxels must fit as well."""
    if info.nbytes > options.limits.max_bytes:
        raise LimitError(
            f"the scaled voxels need {binary_size(info.nbytes)}; "
            f"the limit is {binary_size(options.limits.max_bytes)}",
            file=path,
            field="dim",
            fix="raise it with --max-memory if the machine has that much",
        )


@np.errstate(all="ignore")
def _understand(path: Path, options: ReadOptions) -> _File:
    header = read_nifti_header(path, options)
    unlimited = Limits(max_bytes=sys.maxsize)
    check_size((*header.dims, header.colours), header.dtype, unlimited, file=path, field="dim")
    if header.colours > 1 and header.dims[4] > 1:
        raise UnsupportedError(
            "vectors of colours", file=path, field="dim", fix="save one colour per voxel"
        )
    notes: list[str] = []
    slope, inter = (1.0, 0.0) if header.colours > 1 else _scaling(header, notes)
    info = _info(path, header, dtype=_delivered(header, slope, inter), options=options)
    if header.dtype.kind == "c":
        notes.append("the voxels are complex numbers; their magnitude is shown")
    if header.format == "Analyze 7.5" and (slope, inter) != (1.0, 0.0):
        notes.append(f"values are multiplied by {slope:g}, SPM's scale factor in this header")
    return _File(header, info.warn(*notes), slope, inter)


def _scaling(header: NiftiHeader, notes: list[str]) -> tuple[float, float]:
    """Slope and intercept; identity for a slope that is 0, NaN or infinite."""
    names = header.raw.keys()
    slope = header.number("scl_slope") if "scl_slope" in names else 1.0
    inter = header.number("scl_inter") if "scl_inter" in names else 0.0
    if not math.isfinite(slope) or slope == 0:
        return 1.0, 0.0
    if not math.isfinite(inter):
        notes.append(f"scl_inter is {inter:g}; 0 is used")
        inter = 0.0
    return slope, inter


def _delivered(header: NiftiHeader, slope: float, inter: float) -> np.dtype[Any]:
    """The type of the values that a person gets."""
    stored = header.dtype.newbyteorder("=")
    if stored.kind == "c":
        return np.dtype(np.float32 if stored.itemsize == 8 else np.float64)
    if (slope, inter) == (1.0, 0.0):
        return stored
    single = stored.itemsize <= 2 or (stored.kind == "f" and stored.itemsize == 4)
    return np.dtype(np.float32 if single else np.float64)


def _info(
    path: Path, header: NiftiHeader, *, dtype: np.dtype[Any], options: ReadOptions
) -> VolumeInfo:
    nx, ny, nz, times, vectors = header.dims
    grid = grid_of(header)
    channels = header.colours if header.colours > 1 else vectors
    time = chosen_index(options.time, times, what="time", file=path)
    channel = chosen_index(options.channel, channels, what="channel", file=path)
    notes = [
        *choice_note(times, time, what="time"),
        *choice_note(channels, channel, what="channel"),
    ]
    if header.dimension < 3:
        notes.append(f"the data are {header.dimension}D and shown one sample thick")
    size = header.data_path.stat().st_size
    total = math.prod((*header.dims, header.colours)) * header.dtype.itemsize
    info = VolumeInfo(
        format=header.format,
        dims=(nx, ny, nz),
        dtype=dtype,
        affine=with_spacing(grid.affine, options.spacing),
        space=grid.space,
        length_unit=grid.length_unit,
        times=times,
        time=time,
        channels=channels,
        channel=channel,
        channel_names=_COLOURS[:channels] if header.colours > 1 else (),
        window=_window(header),
        fields=header.for_display(),
        warnings=(*notes, *grid.warnings),
        encoding="gzip" if header.gzipped else "raw",
        stored_bytes=size if header.gzipped else total,
        source=path,
        name=title_of(path),
    )
    labels = "intent_code" in header.raw.keys() and header.number("intent_code") == _LABEL_INTENT  # noqa: SIM118
    return replace(info, kind="labels") if labels and dtype.kind in "iu" else info


def _window(header: NiftiHeader) -> tuple[float, float] | None:
    """Centre and width from cal_min and cal_max, None where they say nothing."""
    low, high = header.number("cal_min"), header.number("cal_max")
    if not math.isfinite(high - low) or high <= low:
        return None
    return (low + high) / 2, high - low
