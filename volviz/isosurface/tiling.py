"""Triangles between closed polylines and within them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from volviz.isosurface.active import Floats, Ids
from volviz.isosurface.kernel import inline, kernel

BEST = 1 << 22  # triangles weighed for the best tiling of all
FIXED = 1 << 24  # for the best one from a given start; beyond, each step takes the smaller


def tile(points: Floats, low: Ids, high: Ids) -> Ids:
    """int64[m + n, 3]: triangles between a ring of m points and one of n, of the least area.

    points: float64[·, 3], mm. By shortest paths in the graph of Fuchs, Kedem and Uselton (1977),
    over all starts where m n² is at most `BEST`; otherwise from the nearest two points; where m n
    is more than `FIXED`, by taking the smaller of the two next triangles. low, then high, lies to
    the left when looked at from outside, with both rings going to the right.
    """
    m, n = len(low), len(high)
    first, second = nearest(points[low], points[high])
    low, high = np.roll(low, -first), np.roll(high, -second)
    p, q = points[low], points[high]
    if m * n > FIXED:
        steps = np.empty(m + n, dtype=np.bool_)
        greedy(p, q, steps)
    else:
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
def greedy(p: Any, q: Any, steps: Any) -> None:
    """Fill bool[m + n]: whether each step goes along p, taking the smaller triangle."""
    m, n, i, j = len(p), len(q), 0, 0
    for k in range(m + n):
        along = j == n
        if i < m and j < n:
            one = _area(p, i, p, (i + 1) % m, q, j)
            along = one < _area(p, i, q, j, q, (j + 1) % n)
        steps[k] = along
        i, j = i + along, j + (not along)


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


def joined(points: Floats, rings: list[Ids]) -> Ids:
    """One ring of several, by bridges there and back between their nearest points (2D or 3D)."""
    whole, rest = rings[0], list(rings[1:])
    while rest:
        ends = [nearest(points[whole], points[r]) for r in rest]
        gaps = [
            float(np.sum((points[whole[i]] - points[r[j]]) ** 2))
            for (i, j), r in zip(ends, rest, strict=True)
        ]
        k = int(np.argmin(gaps))
        (i, j), ring = ends[k], rest.pop(k)
        whole = np.concatenate([whole[: i + 1], ring[j:], ring[: j + 1], whole[i:]])
    return whole


def filled(points: Floats, ring: Ids) -> Ids:
    """int64[n − 2, 3]: triangles within a counter-clockwise ring, by cutting off ears.

    points: float64[·, 2]. A ring that crosses itself is filled too, by triangles that overlap.
    """
    out = np.empty((len(ring) - 2, 3), dtype=np.int64)
    ears(points[ring], out)
    return ring[out]


@inline
def _turn(p: Any, a: int, b: int, c: int) -> float:
    return (p[b, 0] - p[a, 0]) * (p[c, 1] - p[a, 1]) - (p[b, 1] - p[a, 1]) * (p[c, 0] - p[a, 0])


@inline
def _same(p: Any, a: int, b: int) -> bool:
    return p[a, 0] == p[b, 0] and p[a, 1] == p[b, 1]


@inline
def _ear(p: Any, after: Any, a: int, b: int, c: int) -> bool:
    """No point of the ring lies in the triangle."""
    if _turn(p, a, b, c) <= 0:
        return False
    k = after[c]
    while k != a:
        within = _turn(p, a, b, k) >= 0 and _turn(p, b, c, k) >= 0 and _turn(p, c, a, k) >= 0
        if within and not (_same(p, k, a) or _same(p, k, b) or _same(p, k, c)):
            return False
        k = after[k]
    return True


@kernel
def ears(p: Any, out: Any) -> None:
    """Fill int64[n − 2, 3] with the triangles of a ring float64[n, 2]."""
    n = len(p)
    after, before = np.empty(n, np.int64), np.empty(n, np.int64)
    for k in range(n):
        after[k], before[k] = (k + 1) % n, (k - 1) % n
    left, at, tried, done = n, 0, 0, 0
    while left > 2:
        a, b, c = before[at], at, after[at]
        flat = tried >= left and _turn(p, a, b, c) == 0
        if flat or tried >= 2 * left or _ear(p, after, a, b, c):
            out[done, 0], out[done, 1], out[done, 2] = a, b, c
            after[a], before[c] = c, a
            done, left, tried = done + 1, left - 1, 0
            at = after[c]
        else:
            at, tried = c, tried + 1
