"""Triangles in clefts, whose corners are the points of two slices' contours and where they cross.

A cleft is cut along the rows of the lattice. What lies between two rows is met by every column
once at most, and no hole of a cleft lies between rows: those parts are polygons, monotone along
the rows, and a sweep makes triangles of them whatever rounding does. Then edges are flipped for
better triangles. Work and memory are that of the number of points.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from volviz.isosurface.active import Floats, Ids
from volviz.isosurface.contours import trace
from volviz.isosurface.kernel import inline, kernel
from volviz.isosurface.overlay import Overlay

BETTER = 1.000001  # what a flip gains at least, so that they end
CONVEX = 1e-6  # the least share of a quadrilateral's area that a triangle has after a flip


def triangles(
    over: Overlay, pieces: NDArray[np.bool_], flat: Floats, world: Floats, level: NDArray[np.int8]
) -> tuple[Ids, Ids]:
    """Triangles in the clefts that some pieces run round: (int64[k, 3] nodes, int64[s, 2]).

    flat: float64[nodes, 2], world: float64[nodes, 3]. level: int8[nodes], 0 or 1 of a slice's
    points, 2 of others. An edge across a cleft between two points of one slice would lie flat in
    it, where the clefts on its other side may have the same: it is split by a new node, and so are
    edges that rounding gave the same ends. New nodes follow the others; the second array holds the
    ends of the edges that they are on.
    """
    corners, starts = _polygons(over, pieces)
    made = np.empty((max(corners.size - 2 * (starts.size - 1), 0), 3), dtype=np.int64)
    ways = np.empty(len(made), dtype=np.int8)
    sweep(flat, corners, starts, made, ways)
    twins = _twins(over, made, np.repeat(np.arange(starts.size - 1), np.diff(starts) - 2))
    flip(flat, world, made, ways, twins)
    one, two = made.ravel(), np.roll(made, -1, axis=1).ravel()
    h = np.flatnonzero((twins < 0) | (twins > np.arange(twins.size)))
    keys = np.minimum(one[h], two[h]) * len(flat) + np.maximum(one[h], two[h])
    _, which, count = np.unique(keys, return_inverse=True, return_counts=True)
    flat_ones = (level[one[h]] == level[two[h]]) & (level[one[h]] < 2)
    h = h[(twins[h] >= 0) & (flat_ones | (count[which] > 1))]
    middles = np.full(twins.size, -1, dtype=np.int64)
    middles[h] = middles[twins[h]] = len(flat) + np.arange(h.size)
    return _split(made, middles.reshape(-1, 3)), np.stack([one[h], two[h]], axis=1)


def _split(made: Ids, middles: Ids) -> Ids:
    """The triangles, their edges split where there is a node in the middle (−1: there is none)."""
    marked = middles >= 0
    count = marked.sum(axis=1)
    found = [made[count == 0]]
    for many, first in ((1, marked), (2, ~marked), (3, marked)):
        own = count == many  # turned so that the first edge is split, or is not
        turn = (np.argmax(first[own], axis=1)[:, None] + np.arange(3)) % 3
        a, b, c = np.take_along_axis(made[own], turn, axis=1).T
        ab, bc, ca = np.take_along_axis(middles[own], turn, axis=1).T
        rows = {
            1: ((a, ab, c), (ab, b, c)),
            2: ((bc, c, ca), (a, b, bc), (a, bc, ca)),
            3: ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)),
        }[many]
        found += [np.stack(row, axis=1) for row in rows]
    return np.concatenate(found)


def _polygons(over: Overlay, pieces: NDArray[np.bool_]) -> tuple[Ids, Ids]:
    """Nodes of the parts of clefts between rows, and where each part begins."""
    kept = np.flatnonzero(pieces)
    m, n, _ = over.counts
    goal = over.follows[kept]
    point = goal < m + n
    turns = np.zeros(kept.size, np.bool_)
    turns[point] = over.mates[goal[point]] >= 0
    number = np.empty(pieces.size, dtype=np.int64)
    number[kept] = np.arange(kept.size)
    follows = goal.copy()
    follows[turns] = over.mates[goal[turns]]
    follows = number[follows]
    order, ring = np.empty_like(follows), np.full(follows.size, -1, dtype=np.int64)
    count = trace(follows, order, ring)
    many = 1 + turns[order].astype(np.int64)
    corners = np.repeat(over.nodes[kept[order]], many)
    ends = np.cumsum(many)
    corners[ends[turns[order]] - 1] = goal[order][turns[order]]
    first = np.searchsorted(ring[order], np.arange(count))
    return corners, np.append(np.concatenate([[0], ends])[first], corners.size)


def _twins(over: Overlay, made: Ids, parts: Ids) -> Ids:
    """int64[3 k]: for half-edge 3 t + corner the other half, −1 on the borders of clefts.

    parts: int64[k], the polygon that a triangle is of. Halves are in the same one, or on a row.
    """
    a, b = made.ravel(), np.roll(made, -1, axis=1).ravel()
    mates = np.full(over.nodes.max() + 1, -1, dtype=np.int64)
    mates[: over.mates.size] = over.mates
    where = np.where(mates[a] == b, -1, np.repeat(parts, 3))
    low, high = np.minimum(a, b), np.maximum(a, b)
    order = np.lexsort((high, low, where))
    alike = np.ones(max(order.size - 1, 0), np.bool_)
    for key in (low, high, where):
        alike &= key[order][1:] == key[order][:-1]
    one, two = order[:-1][alike], order[1:][alike]
    twins = np.full(a.size, -1, dtype=np.int64)
    twins[one], twins[two] = two, one
    return twins


@inline
def _turn(p: Any, a: int, b: int, c: int) -> float:
    return (p[b, 0] - p[a, 0]) * (p[c, 1] - p[a, 1]) - (p[b, 1] - p[a, 1]) * (p[c, 0] - p[a, 0])


@kernel
def sweep(flat: Any, corners: Any, starts: Any, made: Any, ways: Any) -> None:
    """Fill the triangles of polygons that are monotone along u, and which way they run: ±1.

    A polygon of k corners makes k − 2 triangles, also where rounding has bent or folded it.
    """
    longest = 0
    for part in range(starts.size - 1):
        longest = max(longest, starts[part + 1] - starts[part])
    stack = np.empty(longest, np.int64)
    done = 0
    for part in range(starts.size - 1):
        ring = corners[starts[part] : starts[part + 1]]
        low, high, way = _extent(flat, ring)
        ways[done : done + ring.size - 2] = way
        ahead, back = (low + 1) % ring.size, (low - 1) % ring.size
        stack[0], size, upper = ring[low], 1, True
        for _ in range(ring.size - 1):
            last = ahead == high and back == high
            forward = back == high
            if ahead != high and not forward:
                forward = flat[ring[ahead], 0] <= flat[ring[back], 0]
            at = ring[ahead if forward else back]
            if size == 1:
                upper = forward
            if last or forward != upper:
                for k in range(size - 1):
                    done = _fill(made, done, stack[k], stack[k + 1], at, upper)
                stack[0], size, upper = stack[size - 1], 1, forward
            else:
                while size > 1:
                    turn = _turn(flat, stack[size - 2], stack[size - 1], at)
                    if not (turn * way > 0 if upper else turn * way < 0):
                        break
                    done = _fill(made, done, stack[size - 2], stack[size - 1], at, upper)
                    size -= 1
            stack[size], size = at, size + 1
            ahead = (ahead + forward) % ring.size
            back = (back - (not forward)) % ring.size


@inline
def _extent(flat: Any, ring: Any) -> Any:
    """The least and the greatest corner of a ring along u, and which way it runs: ±1."""
    low, high, area = 0, 0, 0.0
    for k in range(ring.size):
        at, after = ring[k], ring[(k + 1) % ring.size]
        area += flat[at, 0] * flat[after, 1] - flat[at, 1] * flat[after, 0]
        if flat[at, 0] < flat[ring[low], 0]:
            low = k
        if flat[at, 0] > flat[ring[high], 0]:
            high = k
    return low, high if high != low else (low + 1) % ring.size, 1 if area >= 0 else -1


@inline
def _fill(made: Any, row: int, a: int, b: int, c: int, upper: bool) -> int:
    """A triangle of the sweep, in the order of its polygon; returns the next row."""
    made[row, 0] = a if upper else b
    made[row, 1] = b if upper else a
    made[row, 2] = c
    return row + 1


@inline
def _quality(p: Any, a: int, b: int, c: int) -> float:
    """The area by the squares of the sides."""
    ux, uy, uz = p[b, 0] - p[a, 0], p[b, 1] - p[a, 1], p[b, 2] - p[a, 2]
    vx, vy, vz = p[c, 0] - p[a, 0], p[c, 1] - p[a, 1], p[c, 2] - p[a, 2]
    wx, wy, wz = vx - ux, vy - uy, vz - uz
    x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    total = ux * ux + uy * uy + uz * uz + vx * vx + vy * vy + vz * vz
    total += wx * wx + wy * wy + wz * wz
    return np.sqrt(x * x + y * y + z * z) / total if total > 0 else 0.0


@inline
def _put(made: Any, t: int, a: int, b: int, c: int) -> None:
    made[t, 0], made[t, 1], made[t, 2] = a, b, c


@inline
def _link(twins: Any, h: int, other: int) -> None:
    twins[h] = other
    if other >= 0:
        twins[other] = h


@kernel
def flip(flat: Any, world: Any, made: Any, ways: Any, twins: Any) -> None:
    """Flip edges while that makes the worse of two triangles better.

    Where both are seen from above they stay side by side: a flip asks for a convex quadrilateral.
    """
    todo = np.empty(8 * twins.size + 8, np.int64)
    size = 0
    for h in range(twins.size):
        if twins[h] > h:
            todo[size] = h
            size += 1
    left = 64 * twins.size
    while size > 0 and left > 0:
        size, left = size - 1, left - 1
        h = todo[size]
        g = twins[h]
        if g < 0:
            continue
        s, t, i, j = h // 3, g // 3, h % 3, g % 3
        a, b, c, d = made[s, i], made[s, (i + 1) % 3], made[s, (i + 2) % 3], made[t, (j + 2) % 3]
        one, two = ways[s] * _turn(flat, a, d, c), ways[s] * _turn(flat, d, b, c)
        least = CONVEX * (one + two)
        if not (s != t and c != d and one > least and two > least):
            continue
        before = min(_quality(world, a, b, c), _quality(world, b, a, d))
        after = min(_quality(world, a, d, c), _quality(world, d, b, c))
        if not after > before * BETTER:
            continue
        bc, ca = twins[3 * s + (i + 1) % 3], twins[3 * s + (i + 2) % 3]
        ad, db = twins[3 * t + (j + 1) % 3], twins[3 * t + (j + 2) % 3]
        _put(made, s, a, d, c)
        _put(made, t, d, b, c)
        _link(twins, 3 * s, ad)
        _link(twins, 3 * s + 1, 3 * t + 2)
        _link(twins, 3 * s + 2, ca)
        _link(twins, 3 * t, db)
        _link(twins, 3 * t + 1, bc)
        for edge in (3 * s, 3 * s + 2, 3 * t, 3 * t + 1):
            if size < todo.size:
                todo[size] = edge
                size += 1
