"""Fields that a formula gives."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from volviz.progress import Progress

Function = Callable[[ArrayLike, ArrayLike, ArrayLike], NDArray[np.float64]]


def sampled(
    function: Function, axes: tuple[NDArray[np.float64], ...], progress: Progress
) -> NDArray[np.float32]:
    """float32[z, y, x]: the function at the grid of three axes x, y, z, a slice at a time."""
    x, y, z = axes
    data = np.empty((len(z), len(y), len(x)), np.float32)
    for k, height in enumerate(z):
        progress(k / len(z), "evaluating the formula")
        data[k] = function(x[None, :], y[:, None], np.float64(height))
    return data
