"""Triangles between two closed polylines."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from volviz.isosurface.active import Floats, Ids
from volviz.isosurface.kernel import inline, kernel

BEST = 1 << 22  # triangles weighed for the best tiling of all
FIXED = 1 << 24  # for the best one from a given start: pairs of points


def tile(points: Floats, low: Ids, high: Ids) -> Ids:
    """int64[m + n, 3]: triangles between a ring of m points and one of n, of the least area.

    points: float64[·, 3], mm. By shortest paths in the graph of Fuchs, Kedem and Uselton (1977),
    over all starts where m n² is at most `BEST`; otherwise from the two points that are nearest
    and whose rings run alike there. Work and memory grow with m n; rings of more than `FIXED` are
    not for this. low, then high, lies to the left when looked at from outside, with both rings
    going to the right.
    """
    m, n = len(low), len(high)
    first, second = nearest(_courses(points[low]), _courses(points[high]))
    low, high = np.roll(low, -first), np.roll(high, -second)
    p, q = points[low], points[high]
    came = np.empty((m + 1, n + 1), dtype=np.bool_)
    starts = range(n) if m * n * n <= BEST else range(1)
    costs = [shortest(p, np.roll(q, -s, axis=0), came) for s in starts]
    best = int(np.argmin(costs))
    high = np.roll(high, -best)
    shortest(p, points[high], came)
    steps = np.array(_path(came))
    i: Ids = np.cumsum(steps) - steps
    j: Ids = np.arange(m + n) - i
    a, b = low[i % m], high[j % n]
    third = np.where(steps, low[(i + 1) % m], high[(j + 1) % n])
    return np.stack([a, third, b], axis=1)


def _courses(ring: Floats) -> Floats:
    """float64[m, 6]: points, and how the ring runs through them, as long as four of its steps.

    The other side of a thin wall is as near, but runs the other way; so does a bridge's way back.
    """
    ahead = np.roll(ring, -1, axis=0) - ring
    lengths = np.linalg.norm(ahead, axis=1, keepdims=True)
    ahead = np.divide(ahead, lengths, out=np.zeros_like(ahead), where=lengths > 0)
    return np.concatenate([ring, 2 * lengths.mean() * (ahead + np.roll(ahead, 1, axis=0))], axis=1)


def _path(came: NDArray[np.bool_]) -> list[bool]:
    """Which steps go along the first ring, from the start on."""
    i, j = came.shape[0] - 1, came.shape[1] - 1
    steps = []
    while i or j:
        along = bool(came[i, j])
        steps.append(along)
        i, j = (i - 1, j) if along else (i, j - 1)
    return steps[::-1]


@inline
def _area(p: Any, a: int, q: Any, b: int, r: Any, c: int) -> float:
    ux, uy, uz = q[b, 0] - p[a, 0], q[b, 1] - p[a, 1], q[b, 2] - p[a, 2]
    vx, vy, vz = r[c, 0] - p[a, 0], r[c, 1] - p[a, 1], r[c, 2] - p[a, 2]
    x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    return np.sqrt(x * x + y * y + z * z)


@kernel
def shortest(p: Any, q: Any, came: Any) -> float:
    """Twice the least area of a tiling from (0, 0) round; came: whether along p, per place."""
    m, n = len(p), len(q)
    cost = np.empty(n + 1)
    for i in range(m + 1):
        for j in range(n + 1):
            if i == 0 and j == 0:
                cost[0] = 0.0
                continue
            along = across = np.inf
            if i > 0:
                along = cost[j] + _area(p, i - 1, p, i % m, q, j % n)
            if j > 0:
                across = cost[j - 1] + _area(p, i % m, q, j - 1, q, j % n)
            came[i, j] = along < across
            cost[j] = min(along, across)
    return cost[n]


@kernel
def nearest(p: Any, q: Any) -> Any:
    """Numbers of the nearest two points of two rings."""
    best, first, second = np.inf, 0, 0
    for i in range(len(p)):
        for j in range(len(q)):
            total = 0.0
            for k in range(p.shape[1]):
                total += (p[i, k] - q[j, k]) ** 2
            if total < best:
                best, first, second = total, i, j
    return first, second
