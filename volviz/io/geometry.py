"""What every reader does with a grid's geometry: units to millimetres, no broken matrix."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from volviz.errors import UsageError
from volviz.model.lengths import MM

RAS_TO_LPS = np.diag([-1.0, -1.0, 1.0, 1.0])
_SPELLINGS = {
    "Å": ("å", "angstrom", "angstroms", "ångström", "ångstrom", "a"),
    "nm": ("nm", "nanometer", "nanometers", "nanometre", "nanometres"),
    "µm": ("µm", "μm", "um", "micron", "microns", "micrometer", "micrometers", "micrometre"),
    "mm": ("mm", "millimeter", "millimeters", "millimetre", "millimetres"),
    "cm": ("cm", "centimeter", "centimeters", "centimetre", "centimetres"),
    "m": ("m", "meter", "meters", "metre", "metres"),
    "km": ("km", "kilometer", "kilometers", "kilometre", "kilometres"),
    "inch": ("in", "inch", "inches", '"'),
}
_NAME = {spelling: name for name, group in _SPELLINGS.items() for spelling in group}
_SMALLEST, _LARGEST = 1e-100, 1e100


def length_unit(text: str) -> str | None:
    """The usual short name of a unit of length ("µm" for "micron"), None if it is none."""
    return _NAME.get(text.strip().lower())


def mm_per(unit: str) -> float:
    """Millimetres in one unit, for a name that `length_unit` gave."""
    return MM[unit]


def matrix(directions: ArrayLike, origin: ArrayLike) -> NDArray[np.float64]:
    """float64[4, 4] from float[3, 3], whose columns are steps of the index axes, and an origin."""
    affine = np.eye(4)
    affine[:3, :3] = np.asarray(directions, dtype=np.float64)
    affine[:3, 3] = np.asarray(origin, dtype=np.float64)
    return affine


def usable(affine: NDArray[np.float64], field: str) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    """The affine if it can be drawn, else one with spacing 1 in its place; and warnings.

    Not drawable: steps that are not finite, zero, or not independent of each other.
    """
    steps, origin = affine[:3, :3], affine[:3, 3]
    notes: list[str] = []
    fixed = affine + 0.0  # no negative zeros
    if not np.all(np.isfinite(origin)) or np.any(np.abs(origin) > _LARGEST):
        fixed[:3, 3] = 0
        notes.append(f"{field}: the origin is not a finite position; 0 is used")
    largest = np.abs(steps).max(axis=0)
    finite = bool(np.all(np.isfinite(steps)))
    if not finite or np.any(largest < _SMALLEST) or np.any(largest > _LARGEST):
        singular = True
    else:
        unit = steps / largest
        unit = unit / np.linalg.norm(unit, axis=0)
        singular = abs(float(np.linalg.det(unit))) < 1e-6
    if singular:
        fixed[:3, :3] = np.eye(3)
        notes.append(
            f"{field}: the steps along the axes are zero, not finite or not independent; "
            "spacing 1 along world axes is used"
        )
    return fixed, tuple(notes)


def third_axis(first: NDArray[np.float64], second: NDArray[np.float64]) -> NDArray[np.float64]:
    """A unit step at right angles to two others, for an image of one slice."""
    across = np.cross(first, second)
    length = float(np.linalg.norm(across))
    return across / length if np.isfinite(length) and length > 0 else np.array([0.0, 0.0, 1.0])


def with_spacing(
    affine: NDArray[np.float64], spacing: Sequence[float] | None
) -> NDArray[np.float64]:
    """The affine with the user's spacing (x, y, z in mm) along its own directions."""
    if spacing is None:
        return affine
    steps = np.asarray(spacing, dtype=np.float64)
    if steps.shape != (3,) or not np.all(np.isfinite(steps)) or np.any(steps <= 0):
        raise UsageError(
            f"spacing must be three positive numbers x, y, z, not {list(spacing)}", field="spacing"
        )
    changed = affine.copy()
    changed[:3, :3] *= steps / np.linalg.norm(affine[:3, :3], axis=0)
    return changed
