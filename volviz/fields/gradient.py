"""Gradient of a volume, in world units, by the operator of one's choice.

Differences along the index axes become a gradient in world millimetres by the inverse transpose
of the affine, so that anisotropic and oblique grids are right. At the border differences are
one-sided. Where a sample is not valid the result is NaN or infinite, as the difference is.
"""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volviz.errors import UsageError, did_you_mean
from volviz.model.volume import Volume

OPERATORS = ("central", "sobel", "forward", "backward")


def gradient(volume: Volume, operator: str = "central") -> NDArray[np.float32]:
    """float32[z, y, x, 3]: the gradient along world x, y, z, per mm.

    operator: central differences; sobel, the same smoothed by the 3×3×3 weights 1 3 1, 3 6 3,
    1 3 1 across; forward or backward differences to the next sample. Raises UsageError for
    another name.
    """
    if operator not in OPERATORS:
        raise UsageError(
            f"unknown gradient operator '{operator}'",
            field="gradient",
            fix=did_you_mean(operator, OPERATORS),
        )
    data = volume.data.astype(np.float32 if volume.data.dtype.itemsize <= 4 else np.float64)
    steps = np.stack([_slope(data, axis, operator) for axis in (2, 1, 0)], axis=-1)
    inverse = np.linalg.inv(volume.affine[:3, :3])
    return (steps @ inverse.astype(steps.dtype)).astype(np.float32)


def _slope(data: NDArray[Any], axis: int, operator: str) -> NDArray[Any]:
    """Difference per sample along an axis of the array."""
    if data.shape[axis] == 1:
        return np.zeros_like(data)
    if operator == "sobel":
        return _smoothed(_slope(data, axis, "central"), axis)
    step = np.diff(data, axis=axis)
    if operator == "central":
        first, last = step.take([0], axis), step.take([-1], axis)
        inner = (
            step.take(range(1, step.shape[axis]), axis)
            + step.take(range(step.shape[axis] - 1), axis)
        ) / 2
        return np.concatenate([first, inner, last], axis)
    edge = step.take([-1 if operator == "forward" else 0], axis)
    return np.concatenate([step, edge] if operator == "forward" else [edge, step], axis)


def _smoothed(slope: NDArray[Any], axis: int) -> NDArray[Any]:
    """Weighted mean over the 3×3 neighbours across an axis; the border is repeated."""
    padded = np.pad(slope, [(0, 0) if i == axis else (1, 1) for i in range(3)], mode="edge")
    across = [i for i in range(3) if i != axis]
    total = np.zeros_like(slope)
    for a, b in product(range(3), repeat=2):
        weight = (6 if a == b == 1 else 3 if 1 in (a, b) else 1) / 22
        part = [slice(None)] * 3
        part[across[0]] = slice(a, a + slope.shape[across[0]])
        part[across[1]] = slice(b, b + slope.shape[across[1]])
        total += np.asarray(weight, slope.dtype) * padded[tuple(part)]
    return total
