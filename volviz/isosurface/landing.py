"""Points on a trilinear surface: from the middle of a cell down its slope, never out of it.

The slope through the middle is followed to the side of the cell. Where the surface is not met on
that way it is on the one to the corner that differs most among those of the other side. Along a
straight way the trilinear function is a cubic, whose crossing is bracketed from the start.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from volviz.isosurface.active import Floats

STEPS = 14
"""Of Newton's method; halving and false position in turn where it would leave the bracket."""
_CORNERS = np.array([[c & 1, c >> 1 & 1, c >> 2] for c in range(8)]) - 0.5


def landed(values: Floats, isovalue: float, inside: NDArray[np.bool_], steepest: Floats) -> Floats:
    """float64[n, 3]: a place in each cell, x, y, z from 0 to 1, where the function is the isovalue.

    values: float64[n, 8] at the corners x + 2y + 4z. inside: bool[n, 8], which of them are at
    least the isovalue; some are and some are not. steepest: float64[3, 3], which turns slopes
    along x, y, z into the way of steepest ascent in the world. Nothing hangs on the other cells.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        above = values / 2 - isovalue / 2  # halves: the whole difference may be out of range
        above = above / np.maximum(np.abs(above).max(axis=1, keepdims=True), 1e-300)
    parts = _parts(above)
    high = parts[:, 0] >= 0
    way = np.where(high[:, None], -1.0, 1.0) * _turned(parts, steepest)
    length = 2 * np.abs(way).max(axis=1, keepdims=True)
    way = np.divide(way, length, out=np.zeros_like(way), where=length > 0)
    cubic = _along(parts, way)
    missed = (_value(cubic, 1.0) >= 0) == high
    if missed.any():
        apart = np.where(inside[missed] != high[missed, None], np.abs(above[missed]), -1.0)
        way[missed] = _CORNERS[apart.argmax(axis=1)]
        cubic[missed] = _along(parts[missed], way[missed])
    return 0.5 + _crossing(cubic, high)[:, None] * way


def _parts(values: Floats) -> Floats:
    """float64[n, 8]: the function about the middle of the cell, by 1, x, y, xy, z, xz, yz, xyz."""
    grid = values.reshape(-1, 2, 2, 2)
    for axis in (1, 2, 3):
        a, b = np.split(grid, 2, axis=axis)
        grid = np.concatenate([(a + b) / 2, b - a], axis=axis)
    return grid.reshape(-1, 8)


def _turned(parts: Floats, steepest: Floats) -> Floats:
    x, y, z = parts[:, 1], parts[:, 2], parts[:, 4]
    return np.stack([row[0] * x + row[1] * y + row[2] * z for row in steepest], axis=1)


def _along(parts: Floats, way: Floats) -> Floats:
    """float64[n, 4]: the function at t · way from the middle, by powers of t."""
    x, y, z = way.T
    first = parts[:, 1] * x + parts[:, 2] * y + parts[:, 4] * z
    second = parts[:, 3] * x * y + parts[:, 5] * x * z + parts[:, 6] * y * z
    return np.stack([parts[:, 0], first, second, parts[:, 7] * x * y * z], axis=1)


def _value(cubic: Floats, t: float | Floats) -> Floats:
    a, b, c, d = cubic.T
    return np.asarray(a + t * (b + t * (c + t * d)))


def _crossing(cubic: Floats, high: NDArray[np.bool_]) -> Floats:
    """float64[n], 0 to 1: where it goes from the one side of 0 to the other."""
    _, b, c, d = cubic.T
    low, up = np.zeros(len(cubic)), np.ones(len(cubic))
    first, last = _value(cubic, 0.0), _value(cubic, 1.0)  # at the ends of the bracket
    t = np.full(len(cubic), 0.5)
    for step in range(STEPS):
        value = _value(cubic, t)
        before = (value >= 0) == high
        low, first = np.where(before, t, low), np.where(before, value, first)
        up, last = np.where(before, up, t), np.where(before, last, value)
        between = (low + up) / 2
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            new = t - value / (b + t * (2 * c + 3 * d * t))
            if step % 2:
                secant = low - first * (up - low) / (last - first)
                between = np.where(first == last, between, secant)
        t = np.where((new >= low) & (new <= up), new, np.clip(between, low, up))
    return t
