"""Contours of a slice by marching squares: closed polylines, and which regions they part.

A slice has a border of samples outside round it, so that every contour is closed; it has what is
inside on its left: outer contours run counter-clockwise, contours of holes clockwise. A region is
a connected part of the inside or of the outside; a contour parts one of each, and contours nest as
the regions do.
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
    """points: float64[n, 2], u and v in samples. rings: numbers of points, one array a contour.
    solid, empty: int64[contours], the regions inside and outside of each. regions: int64[v, u] of
    the samples with their border; inside: bool of the same shape. Regions of the inside and of
    the outside are numbered apart; the outermost has the number `len(rings)`."""

    points: Floats
    rings: list[Ids]
    solid: Ids
    empty: Ids
    regions: Ids
    inside: NDArray[np.bool_]


class Sets:
    """Numbers that are the same for a reason: union and find."""

    def __init__(self, count: int) -> None:
        self.owner = list(range(count))

    def root(self, a: int) -> int:
        """The number that stands for all of a's set."""
        while self.owner[a] != a:
            self.owner[a] = self.owner[self.owner[a]]
            a = self.owner[a]
        return a

    def join(self, first: Any, second: Any) -> None:
        """Make pairs the same."""
        pairs = np.unique(np.stack([np.asarray(first), np.asarray(second)], axis=-1), axis=0)
        for a, b in pairs.tolist():
            one, two = self.root(a), self.root(b)
            self.owner[max(one, two)] = min(one, two)

    def roots(self) -> Ids:
        """int64[count]: what stands for each."""
        return np.array([self.root(a) for a in range(len(self.owner))], dtype=np.int64)


def contours(values: Floats, inside: NDArray[np.bool_], isovalue: float) -> Contours:
    """The contours of a slice [v, u]. values: NaN where not valid; such samples are outside.

    A vertex lies where linear interpolation has the isovalue, halfway where one end is not valid.
    Of a square with two opposite corners inside the bilinear saddle decides.
    """
    signs, field = np.pad(inside, 1), np.pad(values, 1, constant_values=np.nan)
    start, end = _segments(field, signs, isovalue)
    keys = np.sort(start)
    follows = np.empty(keys.size, dtype=np.int64)
    follows[np.searchsorted(keys, start)] = np.searchsorted(keys, end)
    order, ring = np.empty_like(follows), np.full(keys.size, -1, dtype=np.int64)
    count = trace(follows, order, ring)
    rings = np.split(order, np.flatnonzero(np.diff(ring[order])) + 1) if count else []
    width = signs.shape[1]
    v, u = np.divmod(keys // 2, width)
    upright = keys % 2
    low, high = field[v, u], field[v + upright, u + 1 - upright]
    rise = high - low
    t = np.where(np.isfinite(rise), (isovalue - low) / np.where(rise == 0, 1, rise), 0.5)
    points = np.stack([u + t * (1 - upright), v + t * upright], axis=1) - 1.0
    solid, empty = _parted(v, u, upright, ring, signs, count)
    regions = _regions(v, u, upright, ring, signs, solid, empty)
    at = np.asarray(points, dtype=np.float64)
    return Contours(at, rings, solid[:count], empty[:count], regions, signs)


def _segments(field: Floats, signs: NDArray[np.bool_], isovalue: float) -> tuple[Ids, Ids]:
    """Keys of the edges that segments start and end on: 2 sample + (0 along u, 1 along v)."""
    width = signs.shape[1]
    corners = [signs[:-1, :-1], signs[:-1, 1:], signs[1:, 1:], signs[1:, :-1]]
    case = np.zeros(corners[0].shape, dtype=np.int64)
    for k, corner in enumerate(corners):
        case |= corner.astype(np.int64) << k
    v, u = np.nonzero((case > 0) & (case < 15))
    case = case[v, u]
    a, b, c, d = field[v, u], field[v, u + 1], field[v + 1, u + 1], field[v + 1, u]
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        joined = (a * c - b * d) / (a + c - b - d) >= isovalue
    keys = np.stack([2 * ((v + i) * width + u + j) + k for i, j, k in _STEPS], axis=1)
    bits = case[:, None] >> np.arange(4) & 1
    after = np.roll(bits, -1, axis=1)
    leaves, enters = (bits == 1) & (after == 0), (bits == 0) & (after == 1)
    doubtful = leaves.sum(axis=1) == 2
    square, edge = np.nonzero(leaves)
    only = np.argmax(enters[square], axis=1)
    turn = np.where(joined[square], 1, 3)
    goal = np.where(doubtful[square], (edge + turn) % 4, only)
    return keys[square, edge], keys[square, goal]


@kernel
def trace(follows: Any, order: Any, ring: Any) -> int:
    """Closed chains: fills their points in order and the chain of each; returns how many."""
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


def _parted(
    v: Ids, u: Ids, upright: Ids, ring: Ids, signs: NDArray[np.bool_], count: int
) -> tuple[Ids, Ids]:
    """Regions inside and outside of each contour, and of the border (number `count`)."""
    flat = upright == 0  # in the order of rows, and within them of columns
    rows, columns, own = v[flat], u[flat], ring[flat]
    solid, empty = Sets(count + 1), Sets(count + 1)
    together = rows[1:] == rows[:-1]
    full = signs[rows[:-1], columns[:-1] + 1]
    solid.join(own[:-1][together & full], own[1:][together & full])
    empty.join(own[:-1][together & ~full], own[1:][together & ~full])
    ends = np.concatenate([own[:1], own[1:][~together], own[:-1][~together], own[-1:]])
    empty.join(ends, np.full(ends.size, count))
    roots = empty.roots()
    return solid.roots(), np.where(roots == roots[count], count, roots)


def _regions(
    v: Ids, u: Ids, upright: Ids, ring: Ids, signs: NDArray[np.bool_], solid: Ids, empty: Ids
) -> Ids:
    """The region of every sample, from the last contour that its row has crossed."""
    flat = upright == 0
    last = np.zeros(signs.shape, dtype=np.int64)
    last[v[flat], u[flat] + 1] = u[flat] + 1
    last = np.maximum.accumulate(last, axis=1)
    crossed = np.full(signs.shape, len(empty) - 1, dtype=np.int64)
    crossed[v[flat], u[flat] + 1] = ring[flat]
    own = np.take_along_axis(crossed, last, axis=1)
    return np.where(signs, solid[own], empty[own])
