"""What a file or folder holds that can be opened by itself: series, arrays, times, channels.

`parts` reads headers only; `middle_slice` reads one slice where the format allows.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volviz.errors import InputError, LimitError, UnsupportedError, safe_text
from volviz.io import identify, load, probe
from volviz.io.options import ReadOptions
from volviz.model.volume import Dims, VolumeInfo

LISTED = 2000
LARGEST_LOADED = 512 << 20
"""Bytes of a volume that is read whole for its middle slice; beyond, there is no picture."""

Choices = tuple[tuple[str, Any], ...]


@dataclass(frozen=True, eq=False)
class Slice:
    """One slice. values: [rows, columns]; spacing: mm between columns, between rows; window: centre
    and width that the file suggests.
    """

    values: NDArray[Any]
    spacing: tuple[float, float]
    window: tuple[float, float] | None = None


@dataclass(frozen=True, eq=False)
class Part:
    """One volume of a file or folder that has several.

    kind: "series", "array" or "part" (a time and channel of one array). choices: what `ReadOptions`
    takes to read it. dims, spacing: along x, y, z in mm, None if not known. files: how many it lies
    in. date: as the file writes it, ISO 8601 where it can be told. times: how many it has itself.
    read: its middle slice.
    """

    kind: str
    title: str
    choices: Choices
    read: Callable[[ReadOptions], Slice]
    modality: str = ""
    dims: Dims | None = None
    spacing: tuple[float, float, float] | None = None
    files: int = 1
    date: str = ""
    times: int = 1

    def middle_slice(self, options: ReadOptions) -> Slice:
        """The slice halfway along z. Raises VolvizError, LimitError where it would take long."""
        return self.read(options)


def parts(path: str | Path, options: ReadOptions | None = None) -> tuple[Part, ...]:
    """All that can be opened from this path; one part, or none, where there is no choice.

    Series of a DICOM folder or arrays of an archive where there are several, else the times and
    channels of the one. Raises as `probe` does.
    """
    options = replace(options or ReadOptions(), series=None, time=0, channel=0)
    where = Path(path)
    kind = identify(where, options)
    found: tuple[Part, ...] = ()
    if kind == "dicom":
        found = _series(where, options)
    elif kind == "numpy":
        found = _arrays(where, options)
    if len(found) > 1:
        return found
    return _times_and_channels(where, probe(where, options))


def _times_and_channels(path: Path, info: VolumeInfo) -> tuple[Part, ...]:
    """The times and channels of the one array in a file."""
    made = []
    for channel in range(info.channels):
        for time in range(info.times):
            named = (("time", time, info.times), ("channel", channel, info.channels))
            title = ", ".join(f"{w} {k + 1} of {n}" for w, k, n in named if n > 1)
            if len(info.channel_names) == info.channels > 1:
                title += f" ({info.channel_names[channel]})" if info.channel_names[channel] else ""
            choices = tuple((w, k) for w, k, _ in named if k)
            read = _whole(path, choices, info)
            made.append(Part("part", title or info.name, choices, read, info.modality or "",
                             info.dims, info.spacing))  # fmt: skip
            if len(made) == LISTED:
                return tuple(made)
    return tuple(made)


def _whole(path: Path, choices: Choices, info: VolumeInfo) -> Callable[[ReadOptions], Slice]:
    """The middle slice of a volume that must be read whole for it."""

    def read(options: ReadOptions) -> Slice:
        if info.nbytes > LARGEST_LOADED:
            raise LimitError("too large for a preview", file=path)
        chosen: dict[str, Any] = dict(choices)
        volume = load(path, replace(options, **chosen))
        x, y, _ = volume.spacing
        middle = volume.data[volume.data.shape[0] // 2].copy()
        return Slice(middle, (x, y), volume.info.window)

    return read


# ------------------------------------------------------------------ DICOM


def _series(path: Path, options: ReadOptions) -> tuple[Part, ...]:
    from volviz.io.dicom_series import group, no_images, scan

    found = scan(path, options)
    listed = group(found, path)
    if not listed:
        raise no_images(found, path)
    return tuple(_series_part(s, options) for s in listed)


def _series_part(series: Any, options: ReadOptions) -> Part:
    from volviz.io.dicom_geometry import stack_frames

    stack = stack_frames(series.times[len(series.times) // 2])
    info, first = series.info, stack.first
    x, y, z = (float(s) for s in np.linalg.norm(stack.affine[:3, :3], axis=0))
    present = [f for f in stack.slots if f is not None]
    middle = present[len(present) // 2]
    described = info.description.strip() and info.description.strip().lower() != "none"

    def read(options: ReadOptions) -> Slice:
        return _dicom_slice(middle, options)

    return Part(
        "series",
        safe_text(info.description, 80) if described else "no description",
        (("series", str(info.number)),),
        read,
        info.modality,
        (first.columns, first.rows, len(stack.slots)),
        (x, y, z) if first.spacing is not None else None,
        len({f.path for time in series.times for f in time}),
        _date(first.path, options),
        len(series.times),
    )


def _dicom_slice(frame: Any, options: ReadOptions) -> Slice:
    """One image, from its file alone."""
    from volviz.io.dicom_geometry import stack_frames
    from volviz.io.dicom_pixels import plan_stack, read_stack

    stack = stack_frames((frame,))
    values = read_stack(stack, plan_stack(stack), options)[0]
    rows, columns = frame.spacing or (1.0, 1.0)
    return Slice(values, (columns, rows), frame.head.window)


def _date(path: Path, options: ReadOptions) -> str:
    """When the images were taken, "" if the header does not say."""
    from volviz.io.dicom_files import open_dicom, text_of

    tags = ("AcquisitionDate", "SeriesDate", "StudyDate", "ContentDate")
    try:
        with open_dicom(path, options.limits, tags) as (dataset, _):
            texts = [text_of(dataset, tag).strip() for tag in tags]
    except (InputError, LimitError):
        return ""
    date = next((t for t in texts if t), "")
    date = date.replace(".", "")  # ACR-NEMA wrote 1999.05.24
    if len(date) == 8 and date.isdecimal():
        return f"{date[:4]}-{date[4:6]}-{date[6:]}"
    return safe_text(date, 20)


# ------------------------------------------------------------------ archives of arrays


def _arrays(path: Path, options: ReadOptions) -> tuple[Part, ...]:
    from volviz.io.numpy_file import grids

    return tuple(
        Part("array", name, (("series", name),), _whole(path, (("series", name),), info), "",
             info.dims, None, 1, "", info.times)
        for name, info in _readable(path, grids(path, options), options)
    )  # fmt: skip


def _readable(
    path: Path, names: Sequence[str], options: ReadOptions
) -> list[tuple[str, VolumeInfo]]:
    found = []
    for name in names[:LISTED]:
        try:
            found.append((name, probe(path, replace(options, series=name))))
        except (InputError, UnsupportedError):
            continue
    return found
