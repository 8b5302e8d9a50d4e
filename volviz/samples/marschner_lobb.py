"""The test signal of Marschner and Lobb: rings that are just fine enough to be sampled.

S. Marschner, R. Lobb, "An evaluation of reconstruction filters for volume rendering", IEEE
Visualization 1994, equation 5, with their fM = 6 and α = 0.25 on [−1, 1]³. World coordinates are
those of the formula. Their grid has 40³ samples; ours has 41³, so that one lies in the middle.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from volviz.model.volume import Volume
from volviz.progress import Progress
from volviz.samples.closed_form import Field, Floats, Function, sampled

FREQUENCY = 6.0
ALPHA = 0.25


def marschner_lobb(size: int | None, seed: int, progress: Progress) -> Volume:
    """float32[z, y, x] in 0..1; `size` samples along each axis (41). Nothing in it is random."""
    del seed
    count = 41 if size is None else size
    step = 2 / (count - 1)
    axis = (-1 + step * np.arange(count)).astype(np.float64)
    data = sampled(signal, (axis, axis, axis), progress)
    return Volume.from_array(
        data, (step,) * 3, (-1.0,) * 3, name="marschner-lobb", length_unit=None
    )


def truth(size: int | None = None) -> Function:
    """`signal`."""
    del size
    return signal


def signal(x: ArrayLike, y: ArrayLike, z: ArrayLike) -> NDArray[np.float64]:
    """The value at world positions, which broadcast against each other."""
    radius = np.hypot(x, y)
    rings = np.cos(2 * np.pi * FREQUENCY * np.cos(np.pi * radius / 2))
    slope = 1 - np.sin(np.pi * np.asarray(z, float) / 2)
    return (slope + ALPHA * (1 + rings)) / (2 * (1 + ALPHA))


def field(volume: Volume) -> Field:
    """`signal` and its gradient."""
    del volume

    def signal_and_slope(points: Floats) -> tuple[Floats, Floats]:
        x, y, z = points.T
        radius = np.hypot(x, y)
        turn = 2 * np.pi * FREQUENCY
        falling = turn * np.sin(turn * np.cos(np.pi * radius / 2)) * np.pi / 2
        # sin(π r / 2) / r, which is π / 2 on the axis
        outwards = falling * ALPHA * np.pi / 2 * np.sinc(radius / 2)
        slope = np.stack([outwards * x, outwards * y, -np.pi / 2 * np.cos(np.pi * z / 2)], axis=1)
        return signal(x, y, z), slope / (2 * (1 + ALPHA))

    return signal_and_slope
