"""Where NIfTI voxels lie: sform, else qform, else voxel sizes alone; from RAS to LPS millimetres.

https://nifti.nimh.nih.gov/pub/dist/src/niftilib/nifti1.h, "3D IMAGE (VOLUME) ORIENTATION AND
LOCATION IN SPACE", methods 1 to 3.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from volviz.io.geometry import RAS_TO_LPS, usable
from volviz.io.nifti_header import NiftiHeader
from volviz.model.volume import Space

_UNITS = {1: ("m", 1000.0), 2: ("mm", 1.0), 3: ("µm", 1e-3)}
_TOLERANCE_MM = 1.0


@dataclass(frozen=True)
class Grid:
    """affine: float64[4, 4] in mm. space: None where the file has no orientation."""

    affine: NDArray[np.float64]
    space: Space | None
    length_unit: str | None
    warnings: tuple[str, ...]


def grid_of(header: NiftiHeader) -> Grid:
    """The geometry; a broken sform gives way to the qform and that to the voxel sizes."""
    notes: list[str] = []
    if header.format == "Analyze 7.5":
        notes.append("Analyze 7.5 does not say which side is left; left and right may be swapped")
        return Grid(_sizes_alone(header, notes), None, "mm", tuple(notes))
    unit, factor = _UNITS.get(int(header.number("xyzt_units")) & 7, (None, 1.0))
    scale = np.diag([factor, factor, factor, 1.0])
    found = {
        name: m for name in ("sform", "qform") if (m := _form(header, name, notes)) is not None
    }
    if not found:
        notes.append("neither sform nor qform is set: which way is left, front and up is unknown")
        return Grid(scale @ _sizes_alone(header, notes), None, unit, tuple(notes))
    used = next(iter(found))
    if len(found) == 2:
        apart = factor * _apart(found["sform"], found["qform"], header.dims[:3])
        if apart > _TOLERANCE_MM:
            notes.append(f"sform and qform differ by up to {apart:.3g} mm; the sform is used")
    affine = scale @ RAS_TO_LPS @ found[used]
    return Grid(affine + 0.0, "LPS", unit or "mm", tuple(notes))


def _form(header: NiftiHeader, name: str, notes: list[str]) -> NDArray[np.float64] | None:
    """float64[4, 4] to RAS in the file's unit, None where it is not set or of no use."""
    if int(header.number(f"{name}_code")) <= 0:
        return None
    with np.errstate(all="ignore"):
        try:
            given = header.raw.get_sform() if name == "sform" else header.raw.get_qform()
        except Exception:
            given = np.full((4, 4), np.nan)
    affine, faults = usable(np.asarray(given, dtype=np.float64), name)
    if any("steps" in fault for fault in faults):
        notes.append(f"the {name} is set but is no usable matrix; it is ignored")
        return None
    notes += faults
    return affine


def _sizes_alone(header: NiftiHeader, notes: list[str]) -> NDArray[np.float64]:
    """Method 1: voxel sizes along the world axes, first sample in the origin."""
    affine = np.eye(4)
    for axis in range(3):
        size = abs(header.number("pixdim", axis + 1))
        if not math.isfinite(size) or size == 0:
            if axis < header.dimension:
                notes.append(f"pixdim: axis {axis + 1} has spacing {size:g}; 1 is used")
            size = 1.0
        affine[axis, axis] = size
    return affine


def _apart(
    one: NDArray[np.float64], other: NDArray[np.float64], dims: tuple[int, int, int]
) -> float:
    """The largest distance between where two matrices put a corner of the grid."""
    corners = np.array([(*c, 1) for c in itertools.product(*((0, n - 1) for n in dims))], float)
    return float(np.linalg.norm((corners @ (one - other).T)[:, :3], axis=1).max())
