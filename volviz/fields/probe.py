"""A volume's values and gradient at points of the world, trilinear between samples.

A point has a value where all eight samples round it are valid and it lies between the first and
the last sample of every axis; elsewhere it is NaN. An axis of one sample reaches half its spacing
to both sides.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from volviz.fields.statistics import padding_value
from volviz.model.volume import Volume
from volviz.progress import Progress, silent

Points = NDArray[np.float32] | NDArray[np.float64]
_PIECE = 1 << 17
_EDGE = 1e-4
"""Of a sample: points so far outside are taken to be on the border (rounding of float32)."""


def values_at(
    volume: Volume, points: Points, progress: Progress | None = None
) -> NDArray[np.float32]:
    """float32[n]: the values at points float[n, 3], x, y, z in world mm. Raises Cancelled."""
    return _in_pieces(volume, points, progress, _interpolated)


def gradient_magnitude_at(
    volume: Volume, points: Points, progress: Progress | None = None
) -> NDArray[np.float32]:
    """float32[n], per mm: the length of the gradient, central differences between samples
    (one-sided at the border) interpolated. points: as for `values_at`. Raises Cancelled."""
    inverse = np.linalg.inv(volume.affine[:3, :3])

    def length(volume: Volume, low: Any, high: Any, part: Any) -> NDArray[np.float64]:
        steps = np.zeros((len(part), 3))
        for weight, at in _corners(low, high, part):
            steps += weight[:, None] * np.stack([_slope(volume, at, a) for a in range(3)], axis=1)
        return np.asarray(np.linalg.norm(steps @ inverse, axis=1))

    return _in_pieces(volume, points, progress, length)


def _in_pieces(
    volume: Volume, points: Points, progress: Progress | None, work: Any
) -> NDArray[np.float32]:
    report = progress or silent()
    back = np.linalg.inv(volume.affine)
    last = np.array(volume.dims) - 1
    room = np.where(last > 0, _EDGE, 0.5)
    out = np.full(len(points), np.nan, dtype=np.float32)
    for start in range(0, len(points), _PIECE):
        report(start / len(points), "values on the surface")
        index = points[start : start + _PIECE].astype(np.float64) @ back[:3, :3].T + back[:3, 3]
        inside = np.flatnonzero(((index >= -room) & (index <= last + room)).all(axis=1))
        index = np.clip(index[inside], 0, last)
        low = np.minimum(index.astype(np.int64), np.maximum(last - 1, 0))
        with np.errstate(invalid="ignore"):
            out[start + inside] = work(volume, low, np.minimum(low + 1, last), index - low)
    return out


def _corners(low: Any, high: Any, part: Any) -> Any:
    """(weight [n], (x, y, z)) of the eight samples; those without weight do not count."""
    for corner in np.ndindex(2, 2, 2):
        weight = np.ones(len(part))
        for axis, side in enumerate(corner):
            weight *= part[:, axis] if side else 1 - part[:, axis]
        yield weight, [(high if s else low)[:, a] for a, s in enumerate(corner)]


def _interpolated(volume: Volume, low: Any, high: Any, part: Any) -> NDArray[np.float64]:
    total = np.zeros(len(part))
    for weight, at in _corners(low, high, part):
        total += np.where(weight > 0, weight * _sample(volume, *at), 0.0)
    return total


def _sample(volume: Volume, x: Any, y: Any, z: Any) -> NDArray[np.float64]:
    """The samples, NaN where they are not valid."""
    values = np.asarray(volume.data[z, y, x], dtype=np.float64)
    padding = padding_value(volume)
    bad = ~np.isfinite(values)
    if padding is not None:
        bad |= values == float(padding)
    values[bad] = np.nan
    return values


def _slope(volume: Volume, at: list[Any], axis: int) -> NDArray[np.float64]:
    """Difference per sample along an index axis (0 is x)."""
    before, after = list(at), list(at)
    before[axis] = np.maximum(at[axis] - 1, 0)
    after[axis] = np.minimum(at[axis] + 1, volume.dims[axis] - 1)
    apart = np.maximum(after[axis] - before[axis], 1)
    return np.asarray((_sample(volume, *after) - _sample(volume, *before)) / apart)
