"""The cases of marching cubes, derived and not copied: corners in, triangles out.

A cell's corners are numbered x + 2y + 4z, its edges as in `EDGES` (four along x, four along y,
four along z). On each face the contour leaves through an edge where the boundary of the face,
walked round seen from outside, goes from inside to outside, and comes back through one where it
goes from outside to inside. A face with four such edges is ambiguous: a bit says whether its
inside corners are joined across the face or cut off one by one. The segments of the six faces
chain into closed loops, and each loop is cut into triangles by the shortest diagonals of which
none lies in a face, so that the neighbour can never use the same one: the mesh is a manifold
whatever the values are (`tests/isosurface/test_cases.py` proves all of this for every case).

The historic table (Lorensen and Cline 1987, 15 cases by rotation and complement) is one fixed
choice of bits per case: cut off at most four inside corners, otherwise the complement's choice.
That choice is not the same seen from both sides of a face, hence its holes.
"""

from __future__ import annotations

from functools import cache
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Loop = tuple[int, ...]
Triangle = tuple[int, int, int]

CORNERS = tuple((c & 1, c >> 1 & 1, c >> 2 & 1) for c in range(8))
"""(x, y, z) of each corner."""

EDGES: tuple[tuple[int, int], ...] = (
    *((c, c + 1) for c in (0, 2, 4, 6)),
    *((c, c + 2) for c in (0, 1, 4, 5)),
    *((c, c + 4) for c in (0, 1, 2, 3)),
)
"""The corners that each edge joins, the lower one first."""

FACES: tuple[tuple[int, int, int, int], ...] = (
    (0, 4, 6, 2),
    (1, 3, 7, 5),
    (0, 1, 5, 4),
    (2, 6, 7, 3),
    (0, 2, 3, 1),
    (4, 5, 7, 6),
)
"""Corners of the faces −x, +x, −y, +y, −z, +z, counter-clockwise seen from outside."""

CENTER = 12
"""Number of the vertex inside the cell, after those on its edges."""

_MIDDLES = np.array([np.add(CORNERS[a], CORNERS[b]) / 2 for a, b in EDGES])
_EDGE_OF = {frozenset(e): i for i, e in enumerate(EDGES)}
_FACES_OF = tuple(frozenset(f for f in range(6) if {a, b} <= set(FACES[f])) for a, b in EDGES)


class Cases(NamedTuple):
    """Flat arrays for the kernels; an *entry* is a case with its faces decided.

    ambiguous: uint8[256], bit f set where face f of the case is ambiguous, bit 6 where none is
    but two loops may be one tube (two opposite corners). entry: uint16[256, 64],
    by case and by the bits of the ambiguous faces that join their inside corners. historic:
    uint16[256], the entry of the 15-case table. start: int32[entries + 1] into triangles:
    uint8[·, 3], edge numbers, `CENTER` is a vertex inside the cell; turned: the same, wound the
    other way. center: uint8[entries, 13],
    the loop round that vertex, preceded by its length (0: there is none). tube: int32[entries, 2],
    where in `tubes` two loops stand that may be the ends of one tube, by what fills the tube
    (0 outside, 1 inside), −1: none. tubes: uint8[·, 15], the lengths of both loops and of the
    loop that is left over, then their edges.
    """

    ambiguous: NDArray[np.uint8]
    entry: NDArray[np.uint16]
    historic: NDArray[np.uint16]
    start: NDArray[np.int32]
    triangles: NDArray[np.uint8]
    turned: NDArray[np.uint8]
    center: NDArray[np.uint8]
    tube: NDArray[np.int32]
    tubes: NDArray[np.uint8]


def inside(case: int, corner: int) -> bool:
    """True if the corner's value is at least the isovalue."""
    return bool(case >> corner & 1)


def ambiguous_faces(case: int) -> int:
    """Bit f is set where two inside corners of face f stand diagonally across."""
    bits = 0
    for f, corners in enumerate(FACES):
        signs = [inside(case, c) for c in corners]
        if signs[0] == signs[2] != signs[1] == signs[3]:
            bits |= 1 << f
    return bits


def segments(case: int, joined: int) -> dict[int, list[tuple[int, int]]]:
    """The contour on each face: (edge it comes from, edge it goes to), inside on its left."""
    found: dict[int, list[tuple[int, int]]] = {}
    for f, corners in enumerate(FACES):
        ring = [(corners[i], corners[(i + 1) % 4]) for i in range(4)]
        leaves = [i for i, (a, b) in enumerate(ring) if inside(case, a) and not inside(case, b)]
        enters = [i for i, (a, b) in enumerate(ring) if inside(case, b) and not inside(case, a)]
        for i in leaves:
            ahead = min(enters, key=lambda j: (j - i) % 4)
            behind = min(enters, key=lambda j: (i - j) % 4)
            to = ahead if joined >> f & 1 else behind
            pair = _EDGE_OF[frozenset(ring[i])], _EDGE_OF[frozenset(ring[to])]
            found.setdefault(f, []).append(pair)
    return found


def loops(case: int, joined: int) -> list[Loop]:
    """Closed polygons of edges, wound so that their right-hand normal points outside."""
    follows = {b: a for pairs in segments(case, joined).values() for a, b in pairs}
    found: list[Loop] = []
    while follows:
        edge = min(follows)
        ring = []
        while edge in follows:
            ring.append(edge)
            edge = follows.pop(edge)
        found.append(tuple(ring))
    return found


def in_one_face(a: int, b: int) -> bool:
    """True if two edges bound the same face."""
    return bool(_FACES_OF[a] & _FACES_OF[b])


@cache
def triangulated(loop: Loop) -> list[Triangle]:
    """Triangles of a loop, wound as it is; round a vertex inside the cell where there must be one.

    Shortest diagonals between the middles of edges (dynamic programming over the polygon), none
    in a face. Where every triangulation has one in a face, a fan round `CENTER`.
    """
    n = len(loop)
    best: dict[tuple[int, int], tuple[float, list[Triangle]]] = {}
    for span in range(1, n):
        for i in range(n - span):
            j = i + span
            if span == 1:
                best[i, j] = (0.0, [])
                continue
            price = 0.0
            if span < n - 1:
                price = float(np.linalg.norm(_MIDDLES[loop[i]] - _MIDDLES[loop[j]]))
                price += 1e3 * in_one_face(loop[i], loop[j])
            at = min(range(i + 1, j), key=lambda k: (round(best[i, k][0] + best[k, j][0], 6), k))
            left, right = best[i, at], best[at, j]
            corner = (loop[i], loop[at], loop[j])
            best[i, j] = (price + left[0] + right[0], [*left[1], *right[1], corner])
    total, triangles = best[0, n - 1]
    if total < 1e3:
        return triangles
    return [(CENTER, loop[i - 1], loop[i]) for i in range(n)]


def historic_bits(case: int) -> int:
    """The faces that the 15-case table joins: all of them where most corners are inside."""
    return ambiguous_faces(case) if case.bit_count() > 4 else 0


def _tubes(case: int, rings: list[Loop]) -> list[list[int]]:
    """Rows of `Cases.tubes` by what fills the tube; empty where no tube is possible.

    Two loops can be the two ends of one tube. Of three, only the long one of (3, 3, 6) can, with
    the corner that is cut off from its like: an inside corner if the tube is filled with inside.
    """
    if len(rings) == 2:
        row = [len(rings[0]), len(rings[1]), 0, *rings[0], *rings[1]]
        return [row, row]
    if sorted(map(len, rings)) != [3, 3, 6]:
        return []
    long = next(r for r in rings if len(r) == 6)
    short = [r for r in rings if len(r) == 3]
    short.sort(key=lambda r: inside(case, _corner_of(r)))
    return [[3, 6, 3, *one, *long, *other] for one, other in (short, reversed(short))]


def _corner_of(ring: Loop) -> int:
    """The corner that a loop of three edges cuts off."""
    (corner,) = set.intersection(*(set(EDGES[e]) for e in ring))
    return corner


@cache
def cases() -> Cases:
    """Every case with every decision of its ambiguous faces, as arrays."""
    ambiguous = np.array([ambiguous_faces(c) for c in range(256)], dtype=np.uint8)
    entry = np.zeros((256, 64), dtype=np.uint16)
    start, triangles = [0], list[Triangle]()
    tube, tubes = list[list[int]](), list[list[int]]()
    center: list[list[int]] = []
    for case, bits in _decisions():
        entry[case, bits] = len(tube)
        rings = loops(case, bits)
        found = [triangulated(r) for r in rings]
        triangles += [t for part in found for t in part]
        start.append(len(triangles))
        round_center = next((r for r, t in zip(rings, found, strict=True) if CENTER in t[0]), ())
        center.append([len(round_center), *round_center, *[0] * (12 - len(round_center))])
        rows = _tubes(case, rings)
        tube.append([len(tubes), len(tubes) + 1] if rows else [-1, -1])
        tubes += [[*row, *[0] * (15 - len(row))] for row in rows]
    for lone in np.flatnonzero(ambiguous == 0):
        if tube[entry[lone, 0]][0] >= 0:
            ambiguous[lone] = 1 << 6
    historic = [entry[c, historic_bits(c)] for c in range(256)]
    return Cases(
        ambiguous,
        entry,
        np.array(historic, dtype=np.uint16),
        np.array(start, dtype=np.int32),
        np.array(triangles, dtype=np.uint8),
        np.array(triangles, dtype=np.uint8)[:, ::-1].copy(),
        np.array(center, dtype=np.uint8),
        np.array(tube, dtype=np.int32),
        np.array(tubes, dtype=np.uint8),
    )


def _decisions() -> list[tuple[int, int]]:
    """(case, bits) for every subset of every case's ambiguous faces."""
    found = []
    for case in range(256):
        faces = [f for f in range(6) if ambiguous_faces(case) >> f & 1]
        for n in range(len(faces) + 1):
            found += [(case, sum(1 << f for f in some)) for some in combinations(faces, n)]
    return found
