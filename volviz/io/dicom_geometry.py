"""From the positions of DICOM images to one grid: order, step, gaps, duplicates, tilt.

Slices are ordered by the projection of ImagePositionPatient on the normal of the images (PS3.3
C.7.6.2.1.1), never by name or InstanceNumber, and the step between them is measured from the
positions, never taken from SliceThickness. The affine uses the true step vector, so a tilted
gantry gives a sheared grid.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from volviz.io.dicom_frames import Frame

Array = NDArray[np.float64]
TILT = 0.5
"""Degrees between step and normal from which a person is told."""
_EVEN = 0.01
_MULTIPLE = 0.05


@dataclass(frozen=True)
class Stack:
    """One grid.

    slots: the frame of each z, None where a slice is missing; known: positions are a patient's.
    """

    slots: tuple[Frame | None, ...]
    affine: Array
    known: bool
    warnings: tuple[str, ...]

    @property
    def first(self) -> Frame:
        """The first frame that is there."""
        return next(f for f in self.slots if f is not None)

    @property
    def missing(self) -> int:
        """Slices that no file holds."""
        return sum(f is None for f in self.slots)


def axes_of(frame: Frame) -> Array | None:
    """float64[3, 3], as rows: unit row direction, column direction and normal; None if unusable."""
    if frame.orientation is None or frame.position is None:
        return None
    row, column = np.asarray(frame.orientation[:3]), np.asarray(frame.orientation[3:])
    lengths = np.linalg.norm(row), np.linalg.norm(column)
    if min(lengths) < 0.5 or max(lengths) > 2:
        return None
    row, column = row / lengths[0], column / lengths[1]
    if abs(float(row @ column)) > 0.05:
        return None
    normal = np.cross(row, column)
    return np.array([row, column, normal / np.linalg.norm(normal)])


def heights(frames: Sequence[Frame], axes: Array) -> Array:
    """Positions along the normal, mm."""
    return np.array([f.position for f in frames], dtype=np.float64) @ axes[2]


def same_place(spacing: Sequence[float] | None) -> float:
    """Distance in mm below which two slices are at the same place."""
    return min(0.01, 0.01 * min(spacing)) if spacing else 0.01


def levels(frames: Sequence[Frame], axes: Array) -> list[list[Frame]]:
    """The frames ordered along the normal, those at the same place together."""
    place = heights(frames, axes)
    tolerance = same_place(frames[0].spacing)
    found: list[list[Frame]] = []
    last = -np.inf
    for k in np.argsort(place, kind="stable"):
        if place[k] - last > tolerance:
            found.append([])
            last = place[k]
        found[-1].append(frames[k])
    return found


def stack_frames(frames: Sequence[Frame]) -> Stack:
    """The grid of the frames of one series at one time."""
    axes = axes_of(frames[0])
    if axes is None:
        return _without_positions(frames)
    at_levels = levels(frames, axes)
    warnings = _duplicates(at_levels, axes)
    line = [group[0] for group in at_levels]
    indices, more = _indices(heights(line, axes))
    warnings += more
    affine, more = _affine(line, indices, axes)
    slots: list[Frame | None] = [None] * (indices[-1] + 1)
    for frame, k in zip(line, indices, strict=True):
        slots[k] = frame
    warnings += _missing(slots, affine)
    if line[0].spacing is None:
        warnings.append("the pixel spacing is not given: 1 mm is assumed")
    known = line[0].patient_space
    return Stack(tuple(slots), affine, known, (*warnings, *more))


def _duplicates(at_levels: list[list[Frame]], axes: Array) -> list[str]:
    twice = [group for group in at_levels if len(group) > 1]
    if not twice:
        return []
    for group in twice:
        group.sort(key=lambda f: (f.instance is None, f.instance or 0, f.path.name, f.index))
    extra = sum(len(group) - 1 for group in twice)
    z = float(heights(twice[0][:1], axes)[0])
    return [
        f"{extra} duplicate {_slices(extra)} (the first at {z:.2f} mm): the first of each is used"
    ]


def _indices(place: Array) -> tuple[list[int], list[str]]:
    """Which z each slice is, leaving room for missing ones, and what to say of uneven steps."""
    count = len(place)
    if count < 3:
        return list(range(count)), []
    steps = np.diff(place)
    usual = float(np.median(steps))
    even = np.abs(steps - usual) <= max(_EVEN * usual, min(0.01, 0.05 * usual))
    if even.all():
        return list(range(count)), []
    for step in (usual, float(steps.min())):
        counts = np.rint(steps / step)
        multiple = np.abs(steps / step - counts) <= _MULTIPLE * np.maximum(counts, 1)
        if multiple.all() and counts.min() >= 1 and counts.sum() - len(steps) <= count:
            return [0, *np.cumsum(counts).astype(int).tolist()], []
    worst = int(np.argmax(np.abs(steps - usual)))
    return list(range(count)), [
        f"the slices are not evenly spaced ({steps.min():.4g} to {steps.max():.4g} mm, mostly "
        f"{usual:.4g}): between slice {worst + 1} and {worst + 2}, at {place[worst]:.2f} mm, "
        f"the step is {steps[worst]:.4g} mm; they are drawn evenly"
    ]


def _affine(line: Sequence[Frame], indices: Sequence[int], axes: Array) -> tuple[Array, list[str]]:
    first, last = line[0], line[-1]
    assert first.position is not None  # axes_of saw it
    assert last.position is not None
    rows, columns = first.spacing or (1.0, 1.0)
    origin = np.asarray(first.position)
    warnings: list[str] = []
    if len(line) > 1:
        step = (np.asarray(last.position) - origin) / (indices[-1] - indices[0])
        warnings += _shape_notes(line, indices, origin, step, axes)
    else:
        step = axes[2] * (abs(first.thickness or 0.0) or 1.0)
    affine = np.eye(4)
    affine[:3, 0], affine[:3, 1], affine[:3, 2] = axes[0] * columns, axes[1] * rows, step
    affine[:3, 3] = origin
    return affine, warnings


def _shape_notes(
    line: Sequence[Frame], indices: Sequence[int], origin: Array, step: Array, axes: Array
) -> list[str]:
    """Tilt, and slices that are off the straight line."""
    notes = []
    length = float(np.linalg.norm(step))
    angle = float(np.degrees(np.arccos(np.clip(step @ axes[2] / length, -1, 1))))
    if angle > TILT:
        tilt = line[0].head.tilt
        said = f" (the header says a gantry tilt of {tilt:g}°)" if tilt else ""
        notes.append(
            f"the slices are sheared by {angle:.1f}° as by a tilted gantry{said}: drawn as they lie"
        )
    places = np.array([f.position for f in line], dtype=np.float64)
    expected = origin + np.asarray(indices)[:, None] * step
    across = (places - expected) @ axes[:2].T
    worst = int(np.argmax(np.abs(across).max(axis=1)))
    off = float(np.abs(across[worst]).max())
    if off > max(min(line[0].spacing or (1.0, 1.0)), 0.01):
        notes.append(f"slice {worst + 1} lies {off:.2f} mm beside the line of the others")
    return notes


def _missing(slots: Sequence[Frame | None], affine: Array) -> list[str]:
    gone = [k for k, f in enumerate(slots) if f is None]
    if not gone:
        return []
    places = [f"{k + 1} at z = {float((affine @ [0, 0, k, 1])[2]):.2f} mm" for k in gone[:8]]
    more = f" and {len(gone) - 8} more" if len(gone) > 8 else ""
    return [
        f"{len(gone)} {_slices(len(gone))} missing (slice {', '.join(places)}{more}): left empty"
    ]


def _without_positions(frames: Sequence[Frame]) -> Stack:
    """Images that do not say where they are: in the order of location or number, one step apart."""
    located = all(f.location is not None for f in frames) and len(frames) > 1
    numbered = all(f.instance is not None for f in frames)
    line = sorted(
        frames,
        key=lambda f: (
            f.location or 0.0 if located else 0.0,
            f.instance or 0 if numbered else 0,
            _natural(f.path.name),
            f.index,
        ),
    )
    first = line[0]
    rows, columns = first.spacing or (1.0, 1.0)
    step = abs(first.thickness or 0.0) or 1.0
    if located:
        place = np.array([f.location for f in line], dtype=np.float64)
        step = float(np.median(np.diff(place))) or step
    affine = np.diag([columns, rows, step, 1.0])
    how = "SliceLocation" if located else "InstanceNumber" if numbered else "name"
    warnings = ["the images do not say where they lie: orientation and position are unknown"]
    if len(line) > 1 and first.head.frames == 1:
        warnings.append(f"the images are ordered by {how}")
    if first.spacing is None:
        warnings.append("the spacing is unknown: 1 is assumed")
    return Stack(tuple(line), affine, False, tuple(warnings))


def _natural(name: str) -> tuple[tuple[int, int, str], ...]:
    from volviz.io.naming import natural_key

    return natural_key(name)


def _slices(count: int) -> str:
    return "slice" if count == 1 else "slices"
