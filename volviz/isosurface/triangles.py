"""The last kernel of marching cubes: triangles, by the numbers that the rows' counts give."""

from __future__ import annotations

from typing import Any

import numpy as np

from volviz.isosurface.ambiguity import corner_values, decide
from volviz.isosurface.cases import CENTER
from volviz.isosurface.kernel import (
    add_bytes,
    bare,
    hot,
    inline,
    kernel,
    lowest_bit,
    popcount,
)
from volviz.isosurface.marching import HALF, LOWER, case_of, halves, tube_size
from volviz.isosurface.plain import AMBIGUOUS, MOST
from volviz.isosurface.signs import ONE, cells_in_word, edges_around, load, mixed, place_of, rows_of
from volviz.isosurface.tubes import (
    NECK,
    PLACES,
    middle,
    neck,
    put_inside,
    tube_triangles,
)
from volviz.isosurface.turns import take

LANES = 16  # of a row of `Plain`
TWO = np.uint64(2)


@kernel
def triangles(
    field: Any, cases: Any, plain: Any, place: Any, layout: Any, turns: Any, most: int, out: Any
) -> None:
    """Fill the faces, and the vertices inside cells: out is (vertices, normals, faces)."""
    mask, live, firsts, shape = field.mask, layout.live, layout.triangles, field.signs.shape
    (_, ny, nx), starts, counts = field.data.shape, layout.vertices, layout.counts
    bits, room, flat, size = field.signs.ravel(), _workspace(), out[2].ravel(), plain.size
    tables = plain.turned if place.turned else plain.rows, plain.own, plain.step
    base, counters, ids, into = room[0], room[1], room[3], (out[0], out[1], flat)
    for _ in range(most):
        first, last = take(turns)
        if first < 0:
            return
        stop = firsts[last]
        for turn in range(first, last):
            at, row = firsts[turn], np.int64(layout.rows[turn])
            if at == firsts[turn + 1]:
                continue
            z, y = place_of(row, ny)
            _begin(starts, counts, ny, z, y, base, counters)
            for part in range(live.shape[2]):
                left = live[z, y, part]
                while left:
                    w = 64 * part + lowest_bit(left)
                    left &= left - ONE
                    words = load(bits, rows_of(shape, z, y), np.uint64(w))
                    if mask.size:
                        at = _masked(field, cases, place, words, (z, y, w), at, room, into)
                        continue
                    found = mixed(words) & cells_in_word(nx, w)
                    for half in range(2):
                        some = found >> HALF if half else found & LOWER
                        while some:
                            bit = np.uint64(lowest_bit(some))
                            some &= some - ONE
                            case = case_of(halves(words, half), bit)
                            count = np.int64(size[case])
                            _step(counters, ids, tables, case)
                            if count == AMBIGUOUS:
                                here = (z, y, 64 * w + 32 * half + np.int64(bit))
                                at = _doubtful(field, cases, place, case, here, at, room, into)
                            else:
                                at = _emit_most(flat, at, stop, tables[0], case, count, ids)


@hot
def _step(counters: Any, ids: Any, tables: Any, case: int) -> None:
    """Vertex numbers on the edges of a cell by the counters of its rows of edges, and step on."""
    line = np.uint64(LANES * case)
    add_bytes(ids, counters, tables[1], line)
    add_bytes(counters, counters, tables[2], line)


@hot
def _emit_most(flat: Any, at: int, stop: int, rows: Any, case: int, size: int, ids: Any) -> int:
    """`_emit` without a branch for each: writes more than there are, which the next go over.

    stop: where the next range's begin, which another thread may have written.
    """
    if at + MOST > stop:
        return _emit(flat, at, rows, LANES * case, size, ids)
    k, to = np.uint64(LANES * case), np.uint64(3 * at)
    for i in range(12):
        flat[to + np.uint64(i)] = ids[rows[k + np.uint64(i)]]
    if size > 4:
        for i in range(12, 15):
            flat[to + np.uint64(i)] = ids[rows[k + np.uint64(i)]]
    return at + size


@bare
def _begin(starts: Any, counts: Any, ny: int, z: int, y: int, base: Any, counters: Any) -> None:
    """First vertex number of the eight rows of edges round a row of cells, and of those inside."""
    for k in range(4):
        base[k] = starts[(z + (k >> 1)) * ny + y + (k & 1)]
    for k in range(2):
        row = (z + k) * ny + y
        base[4 + k] = starts[row] + counts[row, 0]
        row = z * ny + y + k
        base[6 + k] = starts[row] + counts[row, 0] + counts[row, 1]
    base[8] = base[6] + counts[z * ny + y, 2]
    for k in range(4):
        counters[k] = base[k]
        counters[4 + 2 * k] = counters[5 + 2 * k] = base[4 + k]


@inline
def _masked(
    field: Any, cases: Any, place: Any, words: Any, here: Any, at: int, room: Any, out: Any
) -> int:
    """The triangles of the cells of a word that the mask allows; where to go on."""
    (z, y, w), (base, _, edges, ids), flat = here, room[:4], out[2]
    mask, cells = field.mask, cells_in_word(field.data.shape[2], here[2])
    edges_around(mask, words, cells, here, edges)
    table = cases.turned if place.turned else cases.triangles
    left = mixed(words) & mask[z, y, w]
    while left:
        bit = np.uint64(lowest_bit(left))
        left &= left - ONE
        half = np.int64(bit >> np.uint64(5))
        case = case_of(halves(words, half), bit & np.uint64(31))
        _number(edges, base, bit, ids)
        if cases.ambiguous[case]:
            x = 64 * w + np.int64(bit)
            at = _doubtful(field, cases, place, case, (z, y, x), at, room, out)
        else:
            entry = np.int64(cases.entry[case, 0])
            begin = np.int64(cases.start[entry])
            size = np.int64(cases.start[entry + 1]) - begin
            at = _emit_rows(flat, at, table, begin, size, ids)
    for k in range(8):
        base[k] += popcount(edges[k])
    return at


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


@hot
def _doubtful(
    field: Any, cases: Any, place: Any, case: int, here: Any, at: int, room: Any, out: Any
) -> int:
    """The triangles of an ambiguous cell, and its vertices inside; where to go on."""
    base, _, _, ids, places, values, found, ways, local = room
    (z, y, x), flat = here, out[2]
    corner_values(field.data, field.isovalue, z, y, x, values)
    entry, tube = decide(values, case, cases, field.rule, found)
    if tube >= 0 or cases.center[entry, 0]:
        begin, end = _inside(values, cases.center[entry], tube, found, places)
        for k in range(begin, end):
            put_inside(
                field.data, field.valid, place, out[0], out[1], base[8], z, y, x, places[k], ways[0]
            )
            ids[k], base[8] = base[8], base[8] + 1
    if tube >= 0:
        tube_triangles(cases.tubes[tube], places, ways, local)
        return _emit_tube(flat, at, local, tube_size(cases.tubes, tube), ids, place.turned)
    table = cases.turned if place.turned else cases.triangles
    first = np.int64(cases.start[entry])
    size = np.int64(cases.start[entry + 1]) - first
    return _emit_rows(flat, at, table, first, size, ids)


@bare
def _emit_rows(flat: Any, at: int, table: Any, first: int, size: int, ids: Any) -> int:
    """Copy triangles from rows of a table."""
    for i in range(size):
        to, row = np.uint64(3 * (at + i)), np.uint64(first + i)
        flat[to] = ids[table[row, 0]]
        flat[to + ONE], flat[to + TWO] = ids[table[row, 1]], ids[table[row, 2]]
    return at + size


@bare
def _emit_tube(flat: Any, at: int, rows: Any, size: int, ids: Any, turned: bool) -> int:
    """Copy the triangles of a cell with a tube, turned round if they must."""
    for i in range(size):
        to, a, b = np.uint64(3 * (at + i)), (1 if turned else 0), (0 if turned else 1)
        flat[to], flat[to + ONE], flat[to + TWO] = ids[rows[i, a]], ids[rows[i, b]], ids[rows[i, 2]]
    return at + size


@bare
def _inside(values: Any, loop: Any, tube: int, found: Any, places: Any) -> Any:
    """Place the vertices inside a cell, of a tube or of a loop; the range of their numbers."""
    if tube >= 0:
        neck(values, found, places)
        return NECK, NECK + 6
    middle(values, loop, places)
    return CENTER, CENTER + 1


@inline
def _workspace() -> Any:
    """First numbers of rows, the counters of edges, words of edges; numbers, places, values,
    saddles of a cell; two vectors and triangles in it."""
    return (
        np.empty(9, np.int64),
        np.zeros(LANES, np.uint32),
        np.empty(8, np.uint64),
        np.empty(PLACES, np.uint32),
        np.empty((PLACES, 3)),
        np.empty(8),
        np.empty((2, 3)),
        np.empty((2, 3)),
        np.empty((32, 3), np.uint8),
    )


@hot
def _emit(flat: Any, at: int, rows: Any, first: int, size: int, ids: Any) -> int:
    """Copy triangles from local to global numbers; where the next ones go.

    Places in the flat arrays are unsigned, which spares the check for negative ones.
    """
    k, end, to = np.uint64(first), np.uint64(first + 3 * size), np.uint64(3 * at)
    while k < end:
        flat[to] = ids[rows[k]]
        k += ONE
        to += ONE
    return at + size
