"""The kernels of decimation: what each edge costs, and a round of collapses.

In a round every vertex is an end of at most one collapsed edge. So the edges' costs, found before
the round, stay exact in it, and the faces around an end are those from before with their other
corners renamed: what is checked is the mesh as it is at that moment.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from volviz.compiled import inline, kernel
from volviz.meshes.quadrics import SHORT, best_point, error_at

INSIDE, BORDER, FIXED, LOCKED = 0, 1, 2, 3
"""What a vertex may do: all; move along its boundary; take others in but stay; nothing."""
BAND = 22  # bits of a float32 below those that say its band: two bands in a factor of 2
BANDS = 1 << (31 - BAND)
SPAN = 20  # bands: a factor of 1000
TURN = 0.2
"""Least cosine between a triangle's normal before and after."""


class State(NamedTuple):
    """A mesh in the middle of being decimated, changed in place.

    points: float64[n, 3]; quadrics: float64[n, 11]; packs: float32[n, k], what goes with the
    vertices; kinds: uint8[n].
    """

    points: NDArray[np.float64]
    quadrics: NDArray[np.float64]
    packs: NDArray[np.float32]
    kinds: NDArray[np.uint8]


class Round(NamedTuple):
    """Names of the vertices, int32[n]; whether one has been an end, bool[n]; marks, int32[n, 2];
    room for the faces around an edge, int32[k, 2]."""

    names: NDArray[np.int32]
    ended: NDArray[np.bool_]
    marks: NDArray[np.int32]
    fan: NDArray[np.int32]

    @classmethod
    def of(cls, count: int, most: int) -> Round:
        """Before a round on `count` vertices, at most `most` faces around each."""
        marks = np.full((count, 2), -1, np.int32)
        return cls(
            np.arange(count, dtype=np.int32),
            np.zeros(count, bool),
            marks,
            np.empty((2 * most, 2), np.int32),
        )


@inline
def target(u: int, v: int, points: Any, quadrics: Any, kinds: Any) -> tuple[float, ...]:
    """Where the vertex of the collapsed edge goes, and its error there.

    A boundary is not drawn inwards: the vertex that may do less stays where it is.
    """
    if kinds[u] == kinds[v]:
        return best_point(quadrics, points, u, v)
    stays = u if kinds[u] > kinds[v] else v
    x, y, z = points[stays, 0], points[stays, 1], points[stays, 2]
    return x, y, z, error_at(quadrics, u, v, x, y, z)


@kernel
def edge_costs(
    first: int, last: int, ends: Any, uses: Any, state: Any, limit: float, costs: Any
) -> None:
    """float32 costs of a range of edges: Σ area · distance², and a little for length.

    Infinite where the edge may not be collapsed, or the mean distance would exceed the limit.
    """
    points, quadrics, _, kinds = state
    for e in range(first, last):
        u, v = ends[e, 0], ends[e, 1]
        costs[e] = np.inf
        low, high = min(kinds[u], kinds[v]), max(kinds[u], kinds[v])
        if high == LOCKED or low == FIXED:
            continue
        if low == BORDER and uses[e] != 1:  # an edge across, from boundary to boundary
            continue
        _, _, _, error = target(u, v, points, quadrics, kinds)
        area = quadrics[u, 10] + quadrics[v, 10]
        if error > limit * limit * area:
            continue
        ex, ey = points[v, 0] - points[u, 0], points[v, 1] - points[u, 1]
        ez = points[v, 2] - points[u, 2]
        costs[e] = error + SHORT * area * (ex * ex + ey * ey + ez * ez)


@kernel
def cheapest(costs: Any, share: float, run: int) -> Any:
    """Indices of a share of the finite costs: of each `run` of edges the cheapest bands first.

    A band is a factor of √2, and in it the edges stay as they come. What is near in the mesh is
    worked on together, which is several times as fast as strictly by cost; the order of collapses
    that are far apart, or cost about the same, hardly matters. What costs far more than the
    cheapest eighth waits: cheap ones may be free again in the next round.
    """
    bits = costs.view(np.int32)  # of positive numbers, in their order
    counts = np.zeros(BANDS + 1, np.int32)
    good: Any = 0
    for e in range(costs.size):
        if costs[e] < np.inf:
            counts[bits[e] >> BAND] += 1
            good += 1
    wanted: int = min(int(share * good) + 1, good)
    found, limit, last = 0, 0, BANDS
    while limit < last and found < wanted:
        found += counts[limit]
        limit += 1
        if last == BANDS and 8 * found >= wanted:
            last = min(limit + SPAN, BANDS)
    order = np.empty(found, np.int32)
    base = 0
    for first in range(0, costs.size, run):
        past = min(first + run, costs.size)
        counts[: limit + 1] = 0
        for e in range(first, past):
            counts[min(bits[e] >> BAND, limit)] += 1
        for band in range(limit):
            base, counts[band] = base + counts[band], base
        for e in range(first, past):
            band = bits[e] >> BAND
            if band < limit:
                order[counts[band]] = e
                counts[band] += 1
    return order


@kernel
def collapse(
    chosen: Any, goal: int, sliver: float, tick: int, around: Any, edges: Any, state: Any, work: Any
) -> int:
    """Collapse edges in order, until `goal` faces are gone; how many are gone.

    Edges with an end that has been one are left out, and those that the topology or the shape
    forbids. sliver: least 4√3·area/Σ edge² (1: equilateral) of a triangle, unless it was worse
    before. tick: the last mark that was made. around: (starts, pairs) and edges: (ends, uses),
    from before the round.
    """
    starts, pairs = around
    ends, uses = edges
    points, quadrics, packs, kinds = state
    names, ended, marks, fan = work
    gone = 0
    for e in chosen:
        if gone >= goal:
            break
        tick += 1
        u, v = ends[e, 0], ends[e, 1]
        if ended[u] or ended[v]:
            continue
        mine = gather(starts[u], starts[u + 1], pairs, names, fan, 0)
        both = gather(starts[v], starts[v + 1], pairs, names, fan, mine)
        if not link_holds(u, v, uses[e], tick, fan, mine, both, marks):
            continue
        x, y, z, _ = target(u, v, points, quadrics, kinds)
        if turns(u, v, x, y, z, fan, 0, mine, points, sliver):
            continue
        if turns(v, u, x, y, z, fan, mine, both, points, sliver):
            continue
        merge(u, v, x, y, z, points, quadrics, packs)
        kinds[u] = max(kinds[u], kinds[v])
        names[v] = u
        ended[u] = ended[v] = True
        gone += uses[e]
    return gone


@inline
def gather(first: int, last: int, pairs: Any, names: Any, fan: Any, place: int) -> int:
    """Put the two other corners of each face around a vertex, as it is now, into fan[place:].

    It has not been an end in this round, so that it has no other faces than before it. Returns
    the end of the list.
    """
    for i in range(first, last):
        b, c = names[pairs[i, 0]], names[pairs[i, 1]]
        if b != c:
            fan[place, 0], fan[place, 1] = b, c
            place += 1
    return place


@inline
def merge(
    u: int, v: int, x: float, y: float, z: float, points: Any, quadrics: Any, packs: Any
) -> None:
    """Put v into u: place, quadric, and what goes with it, blended along the edge."""
    ex, ey = points[v, 0] - points[u, 0], points[v, 1] - points[u, 1]
    ez = points[v, 2] - points[u, 2]
    square = ex * ex + ey * ey + ez * ez
    along = (x - points[u, 0]) * ex + (y - points[u, 1]) * ey + (z - points[u, 2]) * ez
    t = min(max(along / square, 0.0), 1.0) if square > 0.0 else 0.5
    for k in range(packs.shape[1]):
        packs[u, k] += t * (packs[v, k] - packs[u, k])
    for k in range(quadrics.shape[1]):
        quadrics[u, k] += quadrics[v, k]
    points[u, 0], points[u, 1], points[u, 2] = x, y, z


@inline
def link_holds(
    u: int, v: int, uses: int, tick: int, fan: Any, mine: int, both: int, marks: Any
) -> bool:
    """The link condition (Dey, Edelsbrunner, Guha and Nekhayev 1999) on the mesh as it is now.

    What is next to both ends is just what is across the edge (a boundary counts as next to a
    point outside, which an edge between two boundary vertices that is not on the boundary would
    pinch: `edge_costs` leaves those out), and the two fans are not a tetrahedron or a lone
    triangle. Then a collapse does not change the topology.
    """
    common = 0
    for i in range(mine):
        marks[fan[i, 0], 0] = marks[fan[i, 1], 0] = tick
    marks[u, 1] = marks[v, 1] = tick
    for i in range(mine, both):
        for k in range(2):
            w = fan[i, k]
            if marks[w, 0] == tick and marks[w, 1] != tick:
                marks[w, 1] = tick
                common += 1
    alone = 3 if uses == 2 else 1
    return common == uses and not (mine == alone and both == 2 * alone)


@inline
def turns(
    u: int,
    v: int,
    x: float,
    y: float,
    z: float,
    fan: Any,
    first: int,
    last: int,
    points: Any,
    sliver: float,
) -> bool:
    """True if moving u to (x, y, z) turns a face of its fan over or flattens it; not those of v."""
    for i in range(first, last):
        b, c = fan[i, 0], fan[i, 1]
        if v in (b, c):
            continue
        bx, by, bz = points[b, 0], points[b, 1], points[b, 2]
        sx, sy, sz = points[c, 0] - bx, points[c, 1] - by, points[c, 2] - bz  # the side that stays
        ox, oy, oz = points[u, 0] - bx, points[u, 1] - by, points[u, 2] - bz
        nx, ny, nz = x - bx, y - by, z - bz
        px, py, pz = sy * oz - sz * oy, sz * ox - sx * oz, sx * oy - sy * ox
        qx, qy, qz = sy * nz - sz * ny, sz * nx - sx * nz, sx * ny - sy * nx
        before, after = px * px + py * py + pz * pz, qx * qx + qy * qy + qz * qz
        dot = px * qx + py * qy + pz * qz
        if dot <= 0.0 < before or dot * dot < TURN * TURN * before * after:
            return True
        side = sx * sx + sy * sy + sz * sz
        fresh = edges_square(side, nx, ny, nz, sx, sy, sz)
        if 12 * after < (sliver * fresh) ** 2:
            old = edges_square(side, ox, oy, oz, sx, sy, sz)
            if after * old * old < before * fresh * fresh:
                return True
    return False


@inline
def edges_square(
    side: float, x: float, y: float, z: float, sx: float, sy: float, sz: float
) -> float:
    """Σ edge² of a triangle with a corner (x, y, z) off the start of a side s of square `side`."""
    return side + x * x + y * y + z * z + (x - sx) ** 2 + (y - sy) ** 2 + (z - sz) ** 2


@kernel
def renamed(faces: Any, names: Any) -> Any:
    """The faces with new names of their corners, without those that lost a corner."""
    out = np.empty_like(faces)
    kept = 0
    for f in range(faces.shape[0]):
        a, b, c = names[faces[f, 0]], names[faces[f, 1]], names[faces[f, 2]]
        if a != b and b != c and c != a:  # noqa: PLR1714
            out[kept, 0], out[kept, 1], out[kept, 2] = a, b, c
            kept += 1
    return out[:kept]
