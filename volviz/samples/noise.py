"""Smooth random fields with a seed, and the separable Gaussian that scanners blur with."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from volviz.samples.shapes import Array, Grid

_SPREAD = (151 / 315) ** 1.5
"""Standard deviation of a cubic B-spline field of unit normal coefficients, on average."""


class Lattice:
    """A cubic B-spline field over all of space between `low` and `high` mm, about unit variance.

    Its bumps are about two `pitch` mm apart; the same seed gives the same field at a point,
    whatever the grid it is sampled on.
    """

    def __init__(self, seed: int, pitch: float, low: float = -160.0, high: float = 160.0) -> None:
        self.pitch, self.low = pitch, low
        count = math.ceil((high - low) / pitch) + 4
        noise = np.random.default_rng(seed).standard_normal((count,) * 3, dtype=np.float32)
        self.coefficients = noise / np.float32(_SPREAD)

    def sample(self, grid: Grid) -> Array:
        """float32[z, y, x]: the field on a grid."""
        field: Array = self.coefficients
        for axis, positions in enumerate((grid.z, grid.y, grid.x)):
            rows, weights = self._weights(positions.ravel())
            field = np.moveaxis(
                np.tensordot(weights, np.take(field, rows, axis=axis), axes=(1, axis)), 0, axis
            )
        return np.ascontiguousarray(field)

    def _weights(self, positions: Array) -> tuple[NDArray[np.intp], Array]:
        """Lattice rows that matter, and their B-spline weights float32[position, row]."""
        u = (positions.astype(np.float64) - self.low) / self.pitch
        u = np.clip(u, 0, self.coefficients.shape[0] - 4.001)
        cell = np.floor(u).astype(np.intp)
        t = u - cell
        basis = (
            (1 - t) ** 3 / 6,
            (3 * t**3 - 6 * t**2 + 4) / 6,
            (-3 * t**3 + 3 * t**2 + 3 * t + 1) / 6,
            t**3 / 6,
        )
        first, last = int(cell.min()), int(cell.max()) + 3
        weights = np.zeros((len(u), last - first + 1), np.float32)
        for k, part in enumerate(basis):
            weights[np.arange(len(u)), cell - first + k] = part
        return np.arange(first, last + 1), weights


def gaussian_taps(sigma: float) -> NDArray[np.float32]:
    """Weights of a Gaussian at 0, 1, 2 … samples; with their mirror images they sum to 1."""
    radius = max(1, math.ceil(2.5 * sigma))
    taps = np.exp(-0.5 * (np.arange(radius + 1) / sigma) ** 2)
    return (taps / (2 * taps.sum() - taps[0])).astype(np.float32)


def blur(field: Array, taps: NDArray[np.float32], axis: int) -> Array:
    """`field` smoothed along one axis; beyond the border its last sample goes on."""
    radius = min(len(taps) - 1, field.shape[axis] - 1)
    taps = taps[: radius + 1] / np.float32(2 * taps[: radius + 1].sum() - taps[0])
    pad = [(0, 0)] * 3
    pad[axis] = (radius, radius)
    wide = np.pad(field, pad, mode="edge")
    moved = np.moveaxis(wide, axis, 0)
    count = field.shape[axis]
    result = np.moveaxis(field, axis, 0) * taps[0]
    for k in range(1, radius + 1):
        pair = moved[radius - k : radius - k + count] + moved[radius + k : radius + k + count]
        pair *= taps[k]
        result += pair
    return np.ascontiguousarray(np.moveaxis(result, 0, axis))
