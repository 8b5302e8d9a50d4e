"""The last kernel of marching cubes: triangles, by the numbers that the rows' counts give."""

from __future__ import annotations

from typing import Any

import numpy as np

from volviz.isosurface.ambiguity import corner_values, decide
from volviz.isosurface.cases import CENTER
from volviz.isosurface.kernel import inline, kernel, lowest_bit, popcount
from volviz.isosurface.marching import case_of, corner_words
from volviz.isosurface.signs import ONE, x_edges, y_edges, z_edges
from volviz.isosurface.tubes import (
    NECK,
    PLACES,
    middle,
    neck,
    put_inside,
    tube_triangles,
)


@inline
def _begin(starts: Any, counts: Any, ny: int, z: int, y: int, base: Any) -> None:
    """First vertex number of the eight rows of edges round a row of cells, and of those inside."""
    for k in range(4):
        base[k] = starts[(z + (k >> 1)) * ny + y + (k & 1)]
    for k in range(2):
        row = (z + k) * ny + y
        base[4 + k] = starts[row] + counts[row, 0]
        row = z * ny + y + k
        base[6 + k] = starts[row] + counts[row, 0] + counts[row, 1]
    base[8] = base[6] + counts[z * ny + y, 2]


@inline
def _crossed(signs: Any, mask: Any, nx: int, z: int, y: int, w: int, words: Any) -> None:
    """The eight words of crossed edges round word w of a row of cells."""
    for k in range(4):
        words[k] = x_edges(signs, mask, nx, z + (k >> 1), y + (k & 1), w)
    for k in range(2):
        words[4 + k] = y_edges(signs, mask, z + k, y, w)
        words[6 + k] = z_edges(signs, mask, z, y + k, w)


@inline
def _number(words: Any, base: Any, bit: Any, ids: Any) -> None:
    """Vertex numbers on the twelve edges of a cell (of those that are crossed)."""
    before = (ONE << bit) - ONE
    for k in range(4):
        ids[k] = base[k] + popcount(words[k] & before)
    for k in range(4):
        n = base[4 + k] + popcount(words[4 + k] & before)
        ids[4 + 2 * k] = n
        ids[5 + 2 * k] = n + np.int64(words[4 + k] >> bit & ONE)


@kernel
def triangles(
    field: Any, cases: Any, place: Any, layout: Any, first: int, last: int, out: Any
) -> None:
    """Fill the faces, and the vertices inside cells: out is (vertices, normals, faces)."""
    data, signs, mask, valid = field.data, field.signs, field.mask, field.valid
    ny, nx = data.shape[1:]
    counts, starts, first_faces = layout.counts, layout.vertices, layout.triangles
    ambiguous, entries, ends, table = cases.ambiguous, cases.entry, cases.start, cases.triangles
    points, normals, faces = out
    base, words = np.empty(9, np.int64), np.empty(8, np.uint64)
    corners = np.empty(8, np.uint64)
    ids, places = np.empty(PLACES, np.int64), np.empty((PLACES, 3))
    values, found, local = np.empty(8), np.empty((2, 3)), np.empty((32, 3), np.uint8)
    for z in range(first, last):
        for y in range(ny - 1):
            at = first_faces[z * ny + y]
            if at == first_faces[z * ny + y + 1]:
                continue
            _begin(starts, counts, ny, z, y, base)
            for w in range(signs.shape[2] - 1):
                left = corner_words(signs, mask, nx, z, y, w, corners)
                _crossed(signs, mask, nx, z, y, w, words)
                while left:
                    bit = np.uint64(lowest_bit(left))
                    left &= left - ONE
                    case = case_of(corners, bit)
                    _number(words, base, bit, ids)
                    entry = np.int64(entries[case, 0])
                    if ambiguous[case]:
                        x = 64 * w + np.int64(bit)
                        corner_values(data, field.isovalue, z, y, x, values)
                        entry, tube = decide(values, case, cases, field.rule, found)
                        inner = _inside(values, entry, tube, cases, found, places)
                        for k in range(inner):
                            n = CENTER + k if tube < 0 else NECK + k
                            ids[n] = base[8]
                            put_inside(
                                data, valid, place, points, normals, base[8], z, y, x, places[n]
                            )
                            base[8] += 1
                        if tube >= 0:
                            n = tube_triangles(cases.tubes[tube], places, local)
                            at = _emit(faces, at, local, 0, n, ids, place.turned)
                            continue
                    a, b = np.int64(ends[entry]), np.int64(ends[entry + 1])
                    at = _emit(faces, at, table, a, b, ids, place.turned)
                for k in range(8):
                    base[k] += popcount(words[k])


@inline
def _inside(values: Any, entry: int, tube: int, cases: Any, found: Any, places: Any) -> int:
    """How many vertices a cell has inside; their places."""
    if tube >= 0:
        neck(values, found, places)
        return 6
    if cases.center[entry, 0] == 0:
        return 0
    middle(values, cases.center[entry], places)
    return 1


@inline
def _emit(
    faces: Any, at: int, rows: Any, start: int, end: int, ids: Any, turned: bool
) -> int:
    second, third = (2, 1) if turned else (1, 2)
    for t in range(start, end):
        faces[at, 0] = ids[rows[t, 0]]
        faces[at, second] = ids[rows[t, 1]]
        faces[at, third] = ids[rows[t, 2]]
        at += 1
    return at
