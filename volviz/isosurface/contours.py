"""Contours of a slice by marching squares: closed polylines.

A slice has a border of samples outside round it, so that every contour is closed; it has what is
inside on its left: outer contours run counter-clockwise, contours of holes clockwise.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volviz.isosurface.active import Floats, Ids
from volviz.isosurface.kernel import kernel

# Edges of a square: 0 below, 1 right, 2 above, 3 left; corners counter-clockwise from the lowest.
_STEPS = ((0, 0, 0), (0, 1, 1), (1, 0, 0), (0, 0, 1))  # v, u of an edge's first sample; its axis


@dataclass(frozen=True, eq=False)
class Contours:
    """The contours of a slice, point by point in the order of their keys.

    points: float64[n, 2], u and v in samples. keys: int64[n], sorted: the edge of the lattice that
    a point lies on, as 2 (v width + u) + (0 along u, 1 along v), v and u those of its first sample
    in `inside`. places: float64[n], 0..1, how far along its edge. follows: int64[n], the next
    point of the contour. squares: int64[n], where the segment to it runs, by the lowest sample,
    v width + u. order: int64[n], points contour by contour; starts: int64[contours + 1], where in
    it they begin. values: float64[v + 2, u + 2], of the samples with their border, NaN where not
    valid; inside: bool, likewise.
    """

    points: Floats
    keys: Ids
    places: Floats
    follows: Ids
    squares: Ids
    order: Ids
    starts: Ids
    values: Floats
    inside: NDArray[np.bool_]
    isovalue: float

    @property
    def rings(self) -> list[Ids]:
        """Numbers of the points of each contour, in its order."""
        return np.split(self.order, self.starts[1:-1]) if self.order.size else []


def contours(values: Floats, inside: NDArray[np.bool_], isovalue: float) -> Contours:
    """The contours of a slice [v, u]. values: NaN where not valid; such samples are outside.

    A vertex lies where linear interpolation has the isovalue, halfway where one end is not valid.
    Of a square with two opposite corners inside the bilinear saddle decides.
    """
    signs, field = np.pad(inside, 1), np.pad(values, 1, constant_values=np.nan)
    start, end, square = _segments(field, signs, isovalue)
    by_key = np.argsort(start)
    keys, squares = start[by_key], square[by_key]
    follows: Ids = np.searchsorted(keys, end[by_key])
    order, ring = np.empty_like(follows), np.full(keys.size, -1, dtype=np.int64)
    count = trace(follows, order, ring)
    v, u = np.divmod(keys // 2, signs.shape[1])
    upright = keys % 2
    low, high = field[v, u], field[v + upright, u + 1 - upright]
    rise = high - low
    t = np.where(np.isfinite(rise), (isovalue - low) / np.where(rise == 0, 1, rise), 0.5)
    t = np.clip(t, 0.0, 1.0)
    points = np.stack([u + t * (1 - upright), v + t * upright], axis=1).astype(np.float64) - 1.0
    starts: Ids = np.searchsorted(ring[order], np.arange(count + 1))
    return Contours(points, keys, t, follows, squares, order, starts, field, signs, isovalue)


def _segments(field: Floats, signs: NDArray[np.bool_], isovalue: float) -> tuple[Ids, Ids, Ids]:
    """Keys of the edges that segments start and end on, and the squares that they are in."""
    width = signs.shape[1]
    corners = [signs[:-1, :-1], signs[:-1, 1:], signs[1:, 1:], signs[1:, :-1]]
    case = np.zeros(corners[0].shape, dtype=np.uint8)
    for k, corner in enumerate(corners):
        case |= corner.astype(np.uint8) << k
    v, u = np.nonzero((case > 0) & (case < 15))
    kinds = case[v, u].astype(np.int64)
    a, b, c, d = field[v, u], field[v, u + 1], field[v + 1, u + 1], field[v + 1, u]
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        joined = (a * c - b * d) / (a + c - b - d) >= isovalue
    keys = np.stack([2 * ((v + i) * width + u + j) + k for i, j, k in _STEPS], axis=1)
    bits = kinds[:, None] >> np.arange(4) & 1
    after = np.roll(bits, -1, axis=1)
    leaves, enters = (bits == 1) & (after == 0), (bits == 0) & (after == 1)
    doubtful = leaves.sum(axis=1) == 2
    square, edge = np.nonzero(leaves)
    only = np.argmax(enters[square], axis=1)
    turn = np.where(joined[square], 1, 3)
    goal = np.where(doubtful[square], (edge + turn) % 4, only)
    return keys[square, edge], keys[square, goal], (v * width + u)[square]


@kernel
def trace(follows: Any, order: Any, ring: Any) -> int:
    """Closed chains: fills their points in order and the chain of each; returns how many.

    ring: int64[n], negative on entry.
    """
    count, n = 0, 0
    for first in range(follows.size):
        if ring[first] >= 0:
            continue
        at = first
        while ring[at] < 0:
            ring[at] = count
            order[n] = at
            n += 1
            at = follows[at]
        count += 1
    return count
