"""Triangles between closed polylines and within them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from volviz.isosurface.active import Floats, Ids
from volviz.isosurface.kernel import inline, kernel

BEST = 1 << 22  # triangles weighed for the best tiling of all
FIXED = 1 << 24  # for the best one from a given start; beyond, each step takes the smaller
DETOUR = 20.0  # a bridge counts so many times where it runs outside what changes


def tile(points: Floats, low: Ids, high: Ids) -> Ids:
    """int64[m + n, 3]: triangles between a ring of m points and one of n, of the least area.

    points: float64[·, 3], mm. By shortest paths in the graph of Fuchs, Kedem and Uselton (1977),
    over all starts where m n² is at most `BEST`; otherwise from the two points that are nearest
    and whose rings run alike there; where m n is more than `FIXED`, by taking the smaller of the
    two next triangles. low, then high, lies to the left when looked at from outside, with both
    rings going to the right.
    """
    m, n = len(low), len(high)
    first, second = nearest(_courses(points[low]), _courses(points[high]))
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


def joined(
    points: Floats,
    rings: list[Ids],
    flat: Floats | None = None,
    free: NDArray[np.bool_] | None = None,
    bridges: list[tuple[int, int]] | None = None,
) -> Ids:
    """One ring of several, by bridges there and back, the cheapest first.

    points: float64[·, 2 or 3], in which lengths are measured. flat: float64[·, 2], the u and v of
    points, in samples; free: bool[v, u], where bridges may run. What runs elsewhere, or across one
    of `bridges`, counts `DETOUR` times. New bridges are added to those. Without flat and free,
    every bridge is between the nearest two points.
    """
    flat = np.zeros((len(points), 2)) if flat is None else flat
    free = np.ones((1, 1), np.bool_) if free is None else free
    bridges = [] if bridges is None else bridges
    whole, rest = rings[0], list(rings[1:])
    while rest:
        known = flat[np.array(bridges, dtype=np.int64).reshape(-1, 2)]
        ends = [bridge(points[whole], points[r], flat[whole], flat[r], free, known) for r in rest]
        k = min(range(len(rest)), key=lambda r: ends[r][2])
        (i, j, _), ring = ends[k], rest.pop(k)
        bridges.append((int(whole[i]), int(ring[j])))
        whole = np.concatenate([whole[: i + 1], ring[j:], ring[: j + 1], whole[i:]])
    return whole


@inline
def _side(a: Any, b: Any, c: Any) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


@inline
def _astray(a: Any, b: Any, free: Any, known: Any) -> float:
    """The share of the way from a to b (u, v) that is not free; 1 across another bridge."""
    for k in range(len(known)):
        c, d = known[k, 0], known[k, 1]
        if _side(a, b, c) * _side(a, b, d) < 0 and _side(c, d, a) * _side(c, d, b) < 0:
            return 1.0
    steps = int(2 * max(abs(b[0] - a[0]), abs(b[1] - a[1]))) + 1
    off = 0
    for k in range(steps):
        t = (k + 0.5) / steps
        u, v = int(a[0] + t * (b[0] - a[0]) + 0.5), int(a[1] + t * (b[1] - a[1]) + 0.5)
        off += not free[min(v, free.shape[0] - 1), min(u, free.shape[1] - 1)]
    return off / steps


@kernel
def bridge(p: Any, q: Any, s: Any, t: Any, free: Any, known: Any) -> Any:
    """Numbers of the two points of rings p and q (s and t in samples) to join, and the cost."""
    best, first, second = np.inf, 0, 0
    for i in range(len(p)):
        for j in range(len(q)):
            total = 0.0
            for k in range(p.shape[1]):
                total += (p[i, k] - q[j, k]) ** 2
            if total >= best * best:
                continue
            length = np.sqrt(total)
            length *= 1 + (DETOUR - 1) * _astray(s[i], t[j], free, known)
            if length < best:
                best, first, second = length, i, j
    return first, second, best


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
