"""Coplanar triangles merged into polygons, and those cut into as few triangles as may be.

In integers, so that "coplanar" and "straight" are exact. A vertex within a polygon, or on a
straight border between two, is moved onto a neighbour if no triangle turns over and the surface
stays a manifold; so polygons with holes need no special care, and every step leaves a right mesh.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from volviz.isosurface.kernel import aside, inline, kernel
from volviz.progress import Progress

_STEP = 1 << 17  # vertices between two looks at a cancel
_WIDEST = 64  # neighbours of a vertex that is still looked at
_PASSES = 30


def merge(
    points: NDArray[np.int32], faces: NDArray[np.int64], report: Progress
) -> tuple[NDArray[np.int64], int]:
    """(triangles that cover the same surface, the number of its polygons).

    points: int32[n, 3]. faces: int64[m, 3], a manifold with or without border, no triangle without
    area; changed in place. Vertices on the border stay. Raises Cancelled.
    """
    twins = aside(lambda: _twins(faces, len(points)), report, "merging")
    start = np.full(len(points), -1, dtype=np.int64)
    start[faces.ravel()] = np.arange(faces.size)
    alive = np.ones(len(faces), dtype=np.bool_)
    work = _Work(len(points))
    moved = 1
    for n in range(_PASSES):
        if not moved:
            break
        moved = 0
        for a in range(0, len(points), _STEP):
            report(1 - 0.7**n, "merging")
            b = min(a + _STEP, len(points))
            moved += collapse(points, faces, twins, start, alive, a, b, *work.arrays)
    owner = np.arange(len(faces), dtype=np.int64)
    return faces[alive], int(polygons(points, faces, twins, alive, owner))


class _Work:
    """Arrays to work in: two rings of half-edges, and stamps of vertices."""

    def __init__(self, count: int) -> None:
        rings = np.empty((2, _WIDEST + 1), dtype=np.int64)
        self.arrays = (rings[0], rings[1], np.full(count, -1, dtype=np.int64))


def _twins(faces: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    """int64[3 m]: of each half-edge 3 t + k (corner k of triangle t to the next), or −1."""
    a, b = faces.ravel(), faces[:, [1, 2, 0]].ravel()
    there, back = a * count + b, b * count + a
    order = np.argsort(there, kind="stable")
    found = np.minimum(np.searchsorted(there[order], back), max(a.size - 1, 0))
    return np.where(there[order[found]] == back, order[found], -1).astype(np.int64)


@inline
def _next(h: int) -> int:
    return h - 2 if h % 3 == 2 else h + 1


@inline
def _before(h: int) -> int:
    return h + 2 if h % 3 == 0 else h - 1


@inline
def _ring(twins: Any, first: int, ring: Any) -> int:
    """Half-edges out of a vertex, in turn; how many, or −1 at the border or if too many."""
    h, n = first, 0
    while n < ring.size:
        ring[n] = h
        n += 1
        h = twins[_before(h)]
        if h == first:
            return n
        if h < 0:
            return -1
    return -1


@inline
def _normal(points: Any, a: int, b: int, c: int) -> Any:
    x, y, z = np.int64(points[a, 0]), np.int64(points[a, 1]), np.int64(points[a, 2])
    ux, uy, uz = points[b, 0] - x, points[b, 1] - y, points[b, 2] - z
    vx, vy, vz = points[c, 0] - x, points[c, 1] - y, points[c, 2] - z
    return uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx


@inline
def _alike(p: Any, q: Any) -> bool:
    """Two vectors point the same way."""
    crossed = p[1] * q[2] != p[2] * q[1] or p[2] * q[0] != p[0] * q[2] or p[0] * q[1] != p[1] * q[0]
    return not crossed and p[0] * q[0] + p[1] * q[1] + p[2] * q[2] > 0


@inline
def _normal_of(points: Any, faces: Any, h: int) -> Any:
    t = h // 3
    return _normal(points, faces[t, 0], faces[t, 1], faces[t, 2])


@inline
def _end(faces: Any, h: int) -> int:
    """The vertex that a half-edge leads to."""
    return faces[h // 3, (h + 1) % 3]


@inline
def _creases(points: Any, faces: Any, ring: Any, n: int) -> Any:
    """(how many edges of a ring the surface bends at, two of them, by place in the ring)."""
    count, one, two = 0, 0, 0
    last = _normal_of(points, faces, ring[0])
    for i in range(n - 1, -1, -1):  # the edge ring[i + 1] lies between triangles i and i + 1
        normal = _normal_of(points, faces, ring[i])
        if not _alike(normal, last):
            one, two = (i + 1) % n, one
            count += 1
        last = normal
    return count, one, two


@inline
def _straight(points: Any, v: int, a: int, b: int) -> bool:
    """v lies between a and b."""
    x, y, z = np.int64(points[v, 0]), np.int64(points[v, 1]), np.int64(points[v, 2])
    p = (x - points[a, 0], y - points[a, 1], z - points[a, 2])
    return _alike(p, (points[b, 0] - x, points[b, 1] - y, points[b, 2] - z))


@inline
def _fits(
    points: Any, faces: Any, twins: Any, ring: Any, n: int, c: int, other: Any, stamps: Any
) -> bool:
    """The vertex of a ring may be moved to the end of its half-edge number c."""
    u = _end(faces, ring[c])
    for i in range(n):
        x, y = faces[ring[i] // 3, (ring[i] + 1) % 3], faces[ring[i] // 3, (ring[i] + 2) % 3]
        if u in (x, y):
            continue
        if not _alike(_normal(points, u, x, y), _normal_of(points, faces, ring[i])):
            return False
    m = _ring(twins, twins[ring[c]], other)
    if m < 0:
        return False
    v = faces[ring[c] // 3, ring[c] % 3]
    for i in range(n):
        stamps[_end(faces, ring[i])] = v
    common = 0
    for i in range(m):
        common += stamps[_end(faces, other[i])] == v
    for i in range(n):
        stamps[_end(faces, ring[i])] = -1
    return common == 2


@inline
def _join(twins: Any, a: int, b: int) -> None:
    twins[a] = b
    if b >= 0:
        twins[b] = a


@inline
def _move(faces: Any, twins: Any, start: Any, alive: Any, ring: Any, n: int, c: int) -> None:
    """Move the vertex of a ring to the end of its half-edge number c; two triangles vanish."""
    h = ring[c]
    g, u = twins[h], _end(faces, h)
    for i in range(n):
        faces[ring[i] // 3, ring[i] % 3] = u
    alpha, beta = twins[_before(h)], twins[_next(h)]
    gamma, delta = twins[_next(g)], twins[_before(g)]
    _join(twins, alpha, beta)
    _join(twins, gamma, delta)
    start[u], start[_end(faces, alpha)] = alpha, _next(alpha)
    start[faces[gamma // 3, gamma % 3]] = gamma
    alive[h // 3] = alive[g // 3] = False


@kernel
def collapse(
    points: Any, faces: Any, twins: Any, start: Any, alive: Any, first: int, last: int,
    ring: Any, other: Any, stamps: Any,
) -> int:  # fmt: skip
    """Move the vertices first..last that may be moved onto a neighbour; returns how many."""
    moved = 0
    for v in range(first, last):
        if start[v] < 0:
            continue
        n = _ring(twins, start[v], ring)
        if n < 0:
            continue
        creases, one, two = _creases(points, faces, ring, n)
        if creases == 2:
            if not _straight(points, v, _end(faces, ring[one]), _end(faces, ring[two])):
                continue
        elif creases != 0:
            continue
        for c in range(n):
            if creases == 2 and c not in (one, two):
                continue
            if _fits(points, faces, twins, ring, n, c, other, stamps):
                _move(faces, twins, start, alive, ring, n, c)
                start[v] = -1
                moved += 1
                break
    return moved


@inline
def _root(owner: Any, t: int) -> int:
    while owner[t] != t:
        owner[t] = owner[owner[t]]
        t = owner[t]
    return t


@kernel
def polygons(points: Any, faces: Any, twins: Any, alive: Any, owner: Any) -> int:
    """How many sets of adjacent coplanar triangles there are; owner: int64[m], 0, 1, 2, …"""
    count = 0
    for t in range(len(faces)):
        count += alive[t]
    for h in range(3 * len(faces)):
        g = twins[h]
        if not alive[h // 3] or g < h:
            continue
        if _alike(_normal_of(points, faces, h), _normal_of(points, faces, g)):
            a, b = _root(owner, h // 3), _root(owner, g // 3)
            if a != b:
                owner[a] = b
                count -= 1
    return count
