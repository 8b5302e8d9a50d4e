"""Two slices laid one over the other: where their contours cross, and the clefts between them.

What is inside in slice A reaches half way up to slice B, what is inside in B half way down: the
surface of that is the walls of both and, between the slices, the clefts: the parts of the plane
that are inside in one slice only (Barequet and Sharir 1996). Two clefts meet at every crossing.

Both slices have the same lattice: an edge holds one point of each slice at most, and their order
on it decides what meets. Where both fall on one place, B counts as a little larger, so that regions
that touch are linked. Whatever else rounding does, what is made of clefts is closed.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volviz.isosurface.active import Floats, Ids
from volviz.isosurface.contours import Contours, trace
from volviz.isosurface.crossings import stops
from volviz.isosurface.kernel import kernel


@dataclass(frozen=True, eq=False)
class Overlay:
    """Nodes are the m points of slice A, the n points of slice B, x crossings, y bends.

    Pieces lead from node to node, along the contours of A and against those of B. They run round
    clefts, which lie to their left in A and outside of B, to their right in B and outside of A.
    Pieces start at the nodes in their order, but that x which leave crossings against B come
    before those that leave bends.

    counts: m, n and x. extra: float64[x + y, 2], u and v of crossings and bends, in samples.
    follows: int64[pieces], the next piece round the cleft; at points and bends it is of the same
    contour. goals: int64[pieces], the point at the end of the segment that a piece is of. mates:
    int64[m + n], for a point on a row of the lattice the other end of the part of the row that lies
    in its cleft; −1 for points on columns. sheets: int64[pieces], the connected part of the surface
    between the slices that a piece is of, 0 to k − 1. euler: int64[k], their Euler characteristics.
    """

    counts: tuple[int, int, int]
    extra: Floats
    follows: Ids
    goals: Ids
    mates: Ids
    sheets: Ids
    euler: Ids

    @property
    def nodes(self) -> Ids:
        """int64[pieces]: the node that each piece starts at."""
        m, n, x = self.counts
        start = np.arange(m + n + len(self.extra))
        return np.concatenate([start[: m + n + x], start[m + n :]])


def overlay(a: Contours, b: Contours) -> Overlay:
    """Slice A with slice B above it."""
    m, n = len(a.keys), len(b.keys)
    ranks = _ranks(a, b)
    at = stops(a, b, ranks)
    x, y = len(at.first), at.bent.shape[1]
    before = np.empty_like(b.follows)
    before[b.follows] = np.arange(n)
    out = m + n + np.arange(x)  # leaving a crossing along A; plus x: against B
    bends = m + n + 2 * x + np.arange(2 * y).reshape(2, y)
    follows = np.concatenate([a.follows, m + before, out, out, bends[0], bends[1]])
    goals = follows.copy()
    begins = np.concatenate([at.first, at.bent[0]])
    places = np.concatenate([at.along, at.bends[0]])
    own, other = (np.concatenate([o, bends[0]]) for o in (out, out + x))
    _thread(follows, goals, begins, places, own, other)
    begins = m + b.follows[np.concatenate([at.second, at.bent[1]])]
    places = np.concatenate([at.against, at.bends[1]])
    own, other = (np.concatenate([o, bends[1]]) for o in (out + x, out))
    _thread(follows, goals, begins, places, own, other)
    mates = _mates(a, b, ranks)
    sheets, euler = _sheets(follows, mates, out, x)
    return Overlay((m, n, x), at.points, follows, goals, mates, sheets, euler)


def _sheets(follows: Ids, mates: Ids, out: Ids, x: int) -> tuple[Ids, Ids]:
    """Of `Overlay`."""
    loops = np.full(len(follows), -1, dtype=np.int64)
    count = trace(follows, np.empty_like(follows), loops)
    on_row = np.flatnonzero(mates >= 0)
    one, two = loops[on_row], loops[mates[on_row]]
    faces = united(count, one, two)
    met = loops[out], loops[out + x]
    sheets = united(count, np.concatenate([one, met[0]]), np.concatenate([two, met[1]]))
    parts = int(sheets.max(initial=-1)) + 1
    # a cleft with k borders has χ 2 − k; at a crossing two are glued along an edge
    clefts = sheets[np.unique(faces, return_index=True)[1]]
    euler = 2 * np.bincount(clefts, minlength=parts) - np.bincount(sheets, minlength=parts)
    euler = euler - np.bincount(sheets[met[0]], minlength=parts)
    return sheets[loops], euler


def _ranks(a: Contours, b: Contours) -> tuple[Ids, Ids]:
    """For the points of either slice: 1 if the other's lies before it on the same edge."""
    _, i, j = np.intersect1d(a.keys, b.keys, assume_unique=True, return_indices=True)
    opens = b.inside.ravel()[b.keys[j] // 2]  # B is what lies before its point
    early = (b.places[j] < a.places[i]) | ((b.places[j] == a.places[i]) & ~opens)
    ranks = np.zeros(len(a.keys), np.int64), np.zeros(len(b.keys), np.int64)
    ranks[0][i] = early
    ranks[1][j] = ~early
    return ranks


def _thread(follows: Ids, goals: Ids, starts: Ids, places: Ids, own: Ids, other: Ids) -> None:
    """Put crossings into the segments that begin with pieces `starts`, sorted by place.

    own: the pieces that go on from them along the segment; other: those that leave it, which are
    what follows for who comes along it.
    """
    order = np.lexsort((places, starts))
    begun = np.ones(order.size, np.bool_)
    begun[1:] = starts[order][1:] != starts[order][:-1]
    before = np.where(begun, starts[order], np.roll(own[order], 1))
    goals[own] = goals[starts]
    follows[own] = goals[starts]
    follows[before] = other[order]


def _mates(a: Contours, b: Contours, ranks: tuple[Ids, Ids]) -> Ids:
    """Of `Overlay`."""
    m = len(a.keys)
    keys, rank = np.concatenate([a.keys, b.keys]), np.concatenate(ranks)
    flat = np.flatnonzero(keys % 2 == 0)
    order = flat[np.argsort(2 * keys[flat] + rank[flat])]
    sample, own = keys[order] // 2, order < m
    # the state beyond a point: its own slice's at the next sample, the other's by what is before
    in_a = a.inside.ravel()[sample + np.where(own, 1, rank[order])]
    in_b = b.inside.ravel()[sample + np.where(own, rank[order], 1)]
    left = np.flatnonzero(in_a != in_b)
    mates = np.full(keys.size, -1, dtype=np.int64)
    mates[order[left]] = order[left + 1]
    mates[order[left + 1]] = order[left]
    return mates


def united(count: int, first: Ids, second: Ids) -> Ids:
    """int64[count]: the set of each number, 0 to k − 1, if pairs are in the same."""
    owner = np.arange(count)
    unite(owner, first, second)
    known: NDArray[Any] = np.cumsum(owner == np.arange(count)) - 1
    return np.asarray(known[owner], dtype=np.int64)


@kernel
def unite(owner: Any, first: Any, second: Any) -> None:
    """Union and find; every number's owner becomes the least of its set."""
    for k in range(first.size):
        a, b = first[k], second[k]
        while owner[a] != a:
            owner[a] = owner[owner[a]]
            a = owner[a]
        while owner[b] != b:
            owner[b] = owner[owner[b]]
            b = owner[b]
        owner[max(a, b)] = min(a, b)
    for k in range(owner.size):
        owner[k] = owner[owner[k]]
