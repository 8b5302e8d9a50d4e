"""The last kernel of marching cubes: triangles, by the numbers that the rows' counts give."""

from __future__ import annotations

from typing import Any

import numpy as np

from volviz.isosurface.ambiguity import corner_values, decide
from volviz.isosurface.cases import CENTER
from volviz.isosurface.kernel import hot, inline, kernel, lowest_bit, popcount
from volviz.isosurface.marching import case_of, tube_size
from volviz.isosurface.signs import ONE, active, cells_in_word, edges_around, load, rows_of
from volviz.isosurface.tubes import (
    NECK,
    PLACES,
    middle,
    neck,
    put_inside,
    tube_triangles,
)

THREE = np.uint64(3)


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


@hot
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
    (_, ny, nx), counts, starts = data.shape, layout.counts, layout.vertices
    ambiguous, entries, ends = cases.ambiguous, cases.entry, cases.start
    points, normals, flat, bits = out[0], out[1], out[2].ravel(), signs.ravel()
    firsts, table = layout.triangles, (cases.turned if place.turned else cases.triangles).ravel()
    base, words, corners, ids, places, values, found = _workspace()
    for z in range(first, last):
        for y in range(ny - 1):
            at, end = firsts[z * ny + y], firsts[z * ny + y + 1]
            if at == end:
                continue
            _begin(starts, counts, ny, z, y, base)
            around = rows_of(signs.shape, z, y)
            for w in range(signs.shape[2] - 1):
                if not load(bits, around, np.uint64(w), corners):
                    continue
                cells = cells_in_word(nx, w)
                edges_around(mask, corners, cells, (z, y, w), words)
                left = active(mask, corners, cells, z, y, w)
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
                        begin, end = _inside(values, entry, tube, cases, found, places)
                        for k in range(begin, end):
                            v, spot = base[8], places[k]
                            put_inside(data, valid, place, points, normals, v, z, y, x, spot)
                            ids[k], base[8] = v, v + 1
                        if tube >= 0:
                            at = _emit_tube(flat, at, cases.tubes, tube, places, ids, place.turned)
                            continue
                    at = _emit(flat, at, table, ends[entry], ends[entry + 1], ids, False)
                for k in range(8):
                    base[k] += popcount(words[k])


@inline
def _emit_tube(
    flat: Any, at: Any, tubes: Any, tube: int, places: Any, ids: Any, turned: bool
) -> Any:
    """The triangles of a cell with a tube; where the next ones go."""
    local = np.empty((32, 3), np.uint8)
    tube_triangles(tubes[tube], places, local)
    return _emit(flat, at, local.ravel(), 0, tube_size(tubes, tube), ids, turned)


@inline
def _inside(values: Any, entry: int, tube: int, cases: Any, found: Any, places: Any) -> Any:
    """Place the vertices inside a cell; the range of their local numbers."""
    if tube >= 0:
        neck(values, found, places)
        return NECK, NECK + 6
    if cases.center[entry, 0] == 0:
        return CENTER, CENTER
    middle(values, cases.center[entry], places)
    return CENTER, CENTER + 1


@inline
def _workspace() -> Any:
    """First numbers of rows, words of edges and of corners; numbers, places, values, saddles."""
    return (
        np.empty(9, np.int64),
        np.empty(8, np.uint64),
        np.empty(8, np.uint64),
        np.empty(PLACES, np.uint32),
        np.empty((PLACES, 3)),
        np.empty(8),
        np.empty((2, 3)),
    )


@hot
def _emit(flat: Any, at: int, rows: Any, first: int, last: int, ids: Any, turned: bool) -> int:
    """Copy triangles from local to global numbers; where the next ones go.

    Places in the flat arrays are unsigned, which spares the check for negative ones.
    """
    k, end, to = np.uint64(3 * first), np.uint64(3 * last), np.uint64(3 * at)
    begin = to
    while k < end:
        flat[to] = ids[rows[k]]
        k += ONE
        to += ONE
    if turned:
        while begin < to:
            flat[begin], flat[begin + ONE] = flat[begin + ONE], flat[begin]
            begin += THREE
    return at + last - first
