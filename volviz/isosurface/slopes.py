"""Gradient at one sample, for kernels: the same numbers as `fields.gradient`, made where needed.

Samples that are not valid do not enter: a difference becomes one-sided, or 0 if there is none.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from volviz.isosurface.kernel import bare
from volviz.isosurface.samples import byte_of, value_at, value_from

NO_NORMALS, CENTRAL, SOBEL, FORWARD, BACKWARD = -1, 0, 1, 2, 3
OPERATORS = {
    "none": NO_NORMALS,
    "central": CENTRAL,
    "sobel": SOBEL,
    "forward": FORWARD,
    "backward": BACKWARD,
}


@bare
def _valid(valid: Any, z: int, y: int, x: int) -> bool:
    return valid.size == 0 or (valid[z, y, x >> 6] >> np.uint64(x & 63) & np.uint64(1)) != 0


@bare
def _slope(data: Any, valid: Any, axis: int, z: int, y: int, x: int, operator: int) -> float:
    """Difference along an axis (0 is x), per sample."""
    place = (x, y, z)[axis]
    length = data.shape[2 - axis]
    dz, dy, dx = int(axis == 2), int(axis == 1), int(axis == 0)
    low = place > 0 and _valid(valid, z - dz, y - dy, x - dx)
    high = place + 1 < length and _valid(valid, z + dz, y + dy, x + dx)
    if low and high:
        low = operator != FORWARD
        high = operator != BACKWARD
    before = value_at(data, z - dz, y - dy, x - dx) if low else value_at(data, z, y, x)
    after = value_at(data, z + dz, y + dy, x + dx) if high else value_at(data, z, y, x)
    return (after - before) * 0.5 if low and high else after - before


@bare
def _smooth_slope(data: Any, valid: Any, axis: int, z: int, y: int, x: int, operator: int) -> float:
    """Sobel 3×3×3: central differences at nine neighbours, weights 1 3 1, 3 6 3, 1 3 1."""
    total = weights = 0.0
    for i in range(-1, 2):
        for j in range(-1, 2):
            a = x if axis == 0 else x + i
            b = y if axis == 1 else (y + i if axis == 0 else y + j)
            c = z if axis == 2 else z + j
            a = min(max(a, 0), data.shape[2] - 1)
            b = min(max(b, 0), data.shape[1] - 1)
            c = min(max(c, 0), data.shape[0] - 1)
            if _valid(valid, c, b, a):
                weight = 6.0 if i == 0 and j == 0 else (3.0 if i == 0 or j == 0 else 1.0)
                total += weight * _slope(data, valid, axis, c, b, a, operator)
                weights += weight
    return total / weights


@bare
def slopes(data: Any, valid: Any, z: int, y: int, x: int, operator: int, out: Any) -> None:
    """Fill float64[3]: differences per sample along x, y, z at a valid sample.

    data: an array or `Samples`.
    """
    for axis in range(3):
        if operator == SOBEL:
            out[axis] = _smooth_slope(data, valid, axis, z, y, x, operator)
        else:
            out[axis] = _slope(data, valid, axis, z, y, x, operator)


@bare
def differences(data: Any, z: int, y: int, x: int, out: Any) -> None:
    """`slopes` of CENTRAL where all samples are valid and the next ones on both sides are there.

    data: `Samples`.
    """
    at, step = byte_of(data, z, y, x), np.uint64(data.size)
    out[0] = 0.5 * (value_from(data, at + step) - value_from(data, at - step))
    step *= np.uint64(data.shape[2])
    out[1] = 0.5 * (value_from(data, at + step) - value_from(data, at - step))
    step *= np.uint64(data.shape[1])
    out[2] = 0.5 * (value_from(data, at + step) - value_from(data, at - step))
