"""Which DICOM series a folder holds, which images belong together, and which one is meant.

A series in the sense of this list has one SeriesInstanceUID, one image size, one pixel spacing and
one orientation: a localiser's three planes are three entries. Images at the same place that differ
in echo, time, b-value or the like become `times` of one series.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from volviz.errors import InputError, LimitError, UnsupportedError, UsageError, safe_text
from volviz.io import sniff
from volviz.io.dicom_files import numbers_of, open_dicom, text_of
from volviz.io.dicom_frames import Frame, Skipped, scan_file
from volviz.io.dicom_geometry import axes_of, levels
from volviz.io.options import ReadOptions

_SAME_DIRECTION = 1e-3
_SAME_SPACING = 1e-4
NEIGHBOURS = 1024
_LEVELS = 5
_LIST_TEXT = 320
_ORDER = (
    "TemporalPositionIdentifier",
    "TemporalPositionIndex",
    "EchoNumbers",
    "EffectiveEchoTime",
    "EchoTime",
    "DiffusionBValue",
    "NominalPercentageOfCardiacPhase",
    "TriggerTime",
    "FrameReferenceTime",
    "ImageType",
    "AcquisitionNumber",
    "Frame",
    "AcquisitionTime",
    "ContentTime",
)


@dataclass(frozen=True)
class SeriesInfo:
    """One entry of the list of series. number: what `--series` takes, from 1; images: slices times
    `times`; series_number: the header's own number.
    """

    number: int
    uid: str
    description: str
    modality: str
    images: int
    rows: int
    columns: int
    times: int = 1
    series_number: int | None = None

    def __str__(self) -> str:
        what = safe_text(self.description, 60) or "no description"
        size = f"{self.columns} × {self.rows}"
        images = f"{self.images} image{'s' if self.images != 1 else ''}"
        return f"{self.number}: {self.modality or '?'} '{what}', {images} of {size}"


@dataclass(frozen=True)
class Series:
    """A SeriesInfo with its images: `times[t]` are those of time t, `axis` what differs."""

    info: SeriesInfo
    times: tuple[tuple[Frame, ...], ...]
    axis: str = ""
    notes: tuple[str, ...] = ()


@dataclass
class Scan:
    """What was found in a folder or file."""

    frames: list[Frame] = field(default_factory=list)
    skipped: Counter[str] = field(default_factory=Counter)
    broken: list[str] = field(default_factory=list)
    cut_off: bool = False

    def notes(self) -> list[str]:
        """What a person should know of the files that gave no image."""
        notes = []
        if self.skipped:
            kinds = ", ".join(f"{n} × {safe_text(k, 60)}" for k, n in self.skipped.most_common(4))
            notes.append(f"files without an image were skipped: {kinds}")
        if self.broken:
            more = f" and {len(self.broken) - 3} more" if len(self.broken) > 3 else ""
            notes.append(
                f"{len(self.broken)} damaged files left out: {', '.join(self.broken[:3])}{more}"
            )
        return notes


def scan(path: Path, options: ReadOptions) -> Scan:
    """Read the headers of a file, or of the files in a folder and in the folders right below it.

    Where those hold no image, folders further down are searched, as a CD has them. Links in the
    folder are followed if they lead to a regular file: the person put them there, and no header
    can name them. Linked folders are not entered.
    """
    found = Scan()
    if not path.is_dir():
        _add(found, scan_file(path, options.limits))
        return found
    level, total = [path], 0
    for depth in range(_LEVELS):
        files = sorted(file for folder in level for file in sniff.files_in(folder))
        total += len(files)
        if total > options.limits.max_files:
            raise LimitError(
                f"more than {options.limits.max_files} files",
                file=path,
                fix="give the folder of one examination",
            )
        _scan_files(found, files, options)
        if found.frames and depth >= 1:
            break
        level = sorted(below for folder in level for below in sniff.folders_in(folder))
    return found


def _scan_files(found: Scan, files: Sequence[Path], options: ReadOptions) -> None:
    for k, file in enumerate(files):
        options.progress(k / len(files), f"reading header {k + 1} of {len(files)}")
        try:
            if sniff.is_dicom(sniff.head(file)):
                _add(found, scan_file(file, options.limits))
        except InputError:
            found.broken.append(safe_text(file.name, 60))


def _add(found: Scan, result: tuple[Frame, ...] | Skipped) -> None:
    if isinstance(result, Skipped):
        found.skipped[result.reason] += 1
        found.cut_off |= result.cut_off
    else:
        found.frames.extend(result)


def group(found: Scan, path: Path) -> tuple[Series, ...]:
    """The series of a scan, in the order of their numbers."""
    kept, copies = _without_copies(found.frames)
    clusters: dict[tuple[object, ...], list[list[Frame]]] = {}
    for frame in kept:
        s = frame.stored
        sized = (frame.rows, frame.columns, s.samples, s.real, s.photometric)
        key = (frame.head.uid, frame.position is None, *sized)
        for cluster in clusters.setdefault(key, []):
            if _fits(frame, cluster[0]):
                cluster.append(frame)
                break
        else:
            clusters[key].append([frame])
    members = [c for found_here in clusters.values() for c in found_here]
    members.sort(key=_rank)
    return tuple(_series(k + 1, frames, copies) for k, frames in enumerate(members))


def _rank(frames: list[Frame]) -> tuple[object, ...]:
    head = frames[0].head
    number = head.number if head.number is not None else 1 << 40
    return number, head.uid, -len(frames), head.path.name


def _without_copies(frames: Iterable[Frame]) -> tuple[list[Frame], Counter[str]]:
    seen: set[tuple[str, int]] = set()
    kept: list[Frame] = []
    copies: Counter[str] = Counter()
    for frame in frames:
        key = (frame.sop, frame.index)
        if frame.sop and key in seen:
            copies[frame.head.uid] += 1
            continue
        seen.add(key)
        kept.append(frame)
    return kept, copies


def _fits(frame: Frame, other: Frame) -> bool:
    """Same orientation and pixel spacing."""
    return _near(frame.orientation, other.orientation, _SAME_DIRECTION) and _near(
        frame.spacing, other.spacing, _SAME_SPACING * max(other.spacing or (1.0,))
    )


def _near(one: Sequence[float] | None, two: Sequence[float] | None, tolerance: float) -> bool:
    if one is None or two is None:
        return one is two
    return all(abs(a - b) <= tolerance for a, b in zip(one, two, strict=True))


def _series(number: int, frames: list[Frame], copies: Counter[str]) -> Series:
    axis, times = split_times(frames)
    head = frames[0].head
    info = SeriesInfo(
        number,
        head.uid,
        head.description,
        head.modality,
        sum(map(len, times)),
        frames[0].rows,
        frames[0].columns,
        len(times),
        head.number,
    )
    notes = []
    if twice := copies[head.uid]:
        notes.append(
            f"{twice} duplicate {'file' if twice == 1 else 'files'} of the same image left out"
        )
    if len(times) > 1:
        notes.append(f"{len(times)} images at each place, told apart by {axis}: they are times")
    return Series(info, times, axis, tuple(notes))


def split_times(frames: Sequence[Frame]) -> tuple[str, tuple[tuple[Frame, ...], ...]]:
    """What tells images at the same place apart, and the images of each value, in order.

    A tag counts if it gives as many groups as the fullest place has images, each with
    no place twice, and none much smaller than the series has places. Otherwise, if all places have
    equally many, the order of acquisition counts; else there is one time and there are duplicates.
    """
    axes = axes_of(frames[0])
    if axes is None:
        if frames[0].head.moments:
            return "frame time", tuple((f,) for f in frames)
        return "", (tuple(frames),)
    at_levels = levels(frames, axes)
    most = max(map(len, at_levels))
    if most == 1:
        return "", (tuple(frames),)
    place = {id(f): k for k, group_ in enumerate(at_levels) for f in group_}
    for tag in _ORDER:
        groups: dict[str, list[Frame]] = {}
        for frame in frames:
            groups.setdefault(frame.labels.get(tag, ""), []).append(frame)
        full = all(
            len(g) > len(at_levels) / 2 and len({place[id(f)] for f in g}) == len(g)
            for g in groups.values()
        )
        if len(groups) == most and full:
            return tag, tuple(tuple(groups[v]) for v in sorted(groups, key=_value))
    if all(len(g) == most for g in at_levels):
        ordered = [sorted(g, key=_acquired) for g in at_levels]
        return "InstanceNumber", tuple(tuple(g[t] for g in ordered) for t in range(most))
    return "", (tuple(frames),)


def _value(text: str) -> tuple[int, float, str]:
    try:
        number = float(text)
    except ValueError:
        return 1, 0.0, text
    return (0, number, "") if np.isfinite(number) else (1, 0.0, text)


def _acquired(frame: Frame) -> tuple[float, int, str, int]:
    acquisition = _value(frame.labels.get("AcquisitionNumber", ""))[1]
    return acquisition, frame.instance or 0, frame.path.name, frame.index


def choose(series: Sequence[Series], path: Path, options: ReadOptions) -> tuple[Series, list[str]]:
    """The series that is meant, and a note of others. Raises UsageError that lists them."""
    if options.series is not None:
        return _named(series, path, options.series), []
    if len(series) == 1:
        return series[0], []
    real = [s for s in series if s.info.images >= 2]
    if len(real) == 1:
        rest = len(series) - 1
        return real[0], [
            f"{rest} other series of one image each in this folder (see --series)"
            if rest > 1
            else "one other series of one image in this folder (see --series)"
        ]
    raise UsageError(
        f"{len(series)} series: {_listed(series)}",
        file=path,
        field="series",
        fix="choose one with --series NUMBER",
    )


def _named(series: Sequence[Series], path: Path, wanted: str) -> Series:
    text = wanted.strip()
    if text.isdecimal() and 1 <= int(text[:9]) <= len(series):
        return series[int(text[:9]) - 1]
    folded = text.casefold()
    found = [s for s in series if text and text == s.info.uid] or [
        s
        for s in series
        if folded and (folded in s.info.description.casefold() or folded in s.info.uid)
    ]
    if len(found) == 1:
        return found[0]
    how = "several series match" if found else "no series matches"
    raise UsageError(
        f"{how} '{safe_text(text, 60)}'; there are {_listed(series)}",
        file=path,
        field="series",
        fix="give a number of this list",
    )


def _listed(series: Sequence[Series]) -> str:
    lines = [str(s.info) for s in series]
    shown = [line for k, line in enumerate(lines) if len("; ".join(lines[: k + 1])) <= _LIST_TEXT]
    more = len(lines) - len(shown)
    return "; ".join(shown) + (f"; and {more} more" if more else "")


def no_images(found: Scan, path: Path) -> Exception:
    """The error for a file or folder in which no image was found."""
    if path.is_dir():
        what = "; ".join(found.notes()) or "no DICOM image"
        return InputError(f"no image in this folder: {what}", file=path, fix="give another folder")
    reason = next(iter(found.skipped), "no image")
    if found.cut_off:
        return InputError(
            reason, file=path, field="PixelData", fix="the file may be cut off: copy it again"
        )
    directory = reason.startswith("Media Storage Directory")
    return UnsupportedError(
        f"{reason}: nothing to show",
        file=path,
        fix="open the folder with the images" if directory else "give an image object",
    )


def neighbours(path: Path, uid: str, options: ReadOptions) -> int:
    """How many files in the folder of this one belong to its series (of the first thousand)."""
    count = 0
    for file in sniff.files_in(path.parent)[:NEIGHBOURS]:
        options.progress(None, "looking at the other files of the folder")
        try:
            if sniff.is_dicom(sniff.head(file)):
                with open_dicom(file, options.limits, ("SeriesInstanceUID", "Rows")) as (
                    dataset,
                    _,
                ):
                    same = text_of(dataset, "SeriesInstanceUID") == uid
                    count += same and numbers_of(dataset, "Rows") is not None
        except (InputError, LimitError):
            continue
    return count
