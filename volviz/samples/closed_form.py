"""Fields that a formula gives, and what measuring surfaces needs to know of a field."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from volviz.model.volume import Volume
from volviz.progress import Progress

Floats = NDArray[np.float64]
Function = Callable[[ArrayLike, ArrayLike, ArrayLike], Floats]
Field = Callable[[Floats], tuple[Floats, Floats]]
"""Value float64[n] and gradient float64[n, 3] (per mm) at world positions float64[n, 3]."""


def sampled(
    function: Function, axes: tuple[Floats, ...], progress: Progress
) -> NDArray[np.float32]:
    """float32[z, y, x]: the function at the grid of three axes x, y, z, a slice at a time."""
    x, y, z = axes
    data = np.empty((len(z), len(y), len(x)), np.float32)
    for k, height in enumerate(z):
        progress(k / len(z), "evaluating the formula")
        data[k] = function(x[None, :], y[:, None], np.float64(height))
    return data


def interpolated(volume: Volume) -> Field:
    """The trilinear function through the samples of a volume; beyond them its border goes on.

    The gradient is that of the cell that a position is in, 0 across where the border goes on.
    """
    to_index = np.linalg.inv(volume.affine)
    data = volume.data
    last = np.array(volume.dims) - 1

    def field(points: Floats) -> tuple[Floats, Floats]:
        index = points @ to_index[:3, :3].T + to_index[:3, 3]
        inner = np.clip(index, 0, last)
        cell = np.minimum(inner.astype(np.int64), np.maximum(last - 1, 0))
        t = inner - cell
        low, slopes = 1 - t, np.zeros_like(points)
        value = np.zeros(len(points))
        for corner in range(8):
            far = np.array([corner >> axis & 1 for axis in range(3)], bool)
            x, y, z = np.minimum(cell + far, last).T
            there = data[z, y, x].astype(np.float64)
            share = np.where(far, t, low)
            value += there * share.prod(axis=1)
            for axis in range(3):
                rest = share[:, [i for i in range(3) if i != axis]].prod(axis=1)
                slopes[:, axis] += (1 if far[axis] else -1) * there * rest
        slopes[inner != index] = 0
        return value, slopes @ to_index[:3, :3]

    return field
