"""The kernels of marching cubes: count, then vertices, then triangles; each row knows its place.

Like Flying Edges (Schroeder, Maynard and Geveci 2015) every crossed edge belongs to the row of
its lower sample and is numbered by counting, so that vertices are shared without a search and the
rows can be worked in any order. Unlike there, a row's crossed edges are the set bits of words,
found and counted 64 at a time (`signs.py`).

A row's vertices are, in this order: on its x-edges, its y-edges, its z-edges, inside its cells.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from volviz.isosurface.ambiguity import corner_values, decide
from volviz.isosurface.kernel import bare, hot, kernel, lowest_bit, popcount, uneven
from volviz.isosurface.samples import Samples
from volviz.isosurface.signs import (
    LAST,
    ONE,
    cells_in_word,
    crossings,
    doubtful,
    first_bits,
    load,
    mixed,
    own_edges,
    place_of,
    rows_of,
)
from volviz.isosurface.turns import take

PAIR, MIDDLE, HALF, LOWER = (np.uint64(n) for n in (3, 31, 32, 0xFFFFFFFF))
TWO, THREE, FOUR = (np.uint64(n) for n in (2, 3, 4))
EMPTY = np.empty((0, 0, 0), dtype=np.uint64)


class Field(NamedTuple):
    """What the kernels read: samples, level, bits (`signs.py`), rule of ambiguous cells."""

    data: Samples
    isovalue: float
    signs: NDArray[np.uint64]
    mask: NDArray[np.uint64]
    valid: NDArray[np.uint64]
    rule: int


class Placing(NamedTuple):
    """Index to world, by rows: 3 × 4 numbers for points, 3 × 3 for gradients.

    operator: of `slopes`, −1: no normals. turned: the map is a mirror, triangles turn round.
    """

    points: tuple[float, ...]
    gradients: tuple[float, ...]
    operator: int
    turned: bool


class Layout(NamedTuple):
    """The rows of samples with something in them (int32[n], in order), and of those: crossed edges
    along x, y, z, all vertices (with those inside cells), triangles (counts: int32[row, 5]); where
    the vertices of a row begin (int64[row], at the end how many there are), where the triangles of
    the n-th listed row do (int64[n + 1]); its words with something in them (`signs.py`)."""

    rows: NDArray[np.int32]
    counts: NDArray[np.int32]
    vertices: NDArray[np.int64]
    triangles: NDArray[np.int64]
    live: NDArray[np.uint64]


@hot
def halves(words: Any, half: int) -> Any:
    """The four rows round 32 cells of a word, so that bits i and i + 1 are the corners of cell i.

    words: of `signs.load`.
    """
    if half == 0:
        return words[0], words[1], words[2], words[3]
    return words[4] >> MIDDLE, words[5] >> MIDDLE, words[6] >> MIDDLE, words[7] >> MIDDLE


@hot
def case_of(rows: Any, bit: Any) -> Any:
    """The eight signs of a cell as a number, corner x + 2y + 4z being a bit; rows: of `halves`."""
    case = rows[0] >> bit & PAIR | (rows[1] >> bit & PAIR) << np.uint64(2)
    case |= (rows[2] >> bit & PAIR) << np.uint64(4) | (rows[3] >> bit & PAIR) << np.uint64(6)
    return np.int64(case)


@bare
def tube_size(tubes: Any, tube: int) -> Any:
    """Triangles of a cell with a tube: a strip from each end to the six vertices of its neck."""
    rest = 1 if tubes[tube, 2] else 0
    return np.int64(tubes[tube, 0]) + np.int64(tubes[tube, 1]) + 12 + rest


@kernel
def count(
    field: Any, cases: Any, everywhere: bool, rows: Any, turns: Any, most: int, live: Any,
    counts: Any,
) -> int:  # fmt: skip
    """Per row that is listed: crossed edges along x, y, z, vertices, triangles.

    live: the words to look at. everywhere: all words of all rows, of which none is listed. Words
    with nothing in them are cleared. Returns how many cells are ambiguous.
    """
    flat, (nz, ny, nx), many = field.signs.ravel(), field.data.shape, 0
    mask, shape, room = field.mask, field.signs.shape, (np.empty(8), np.empty((2, 3)))
    kept = counts.ravel()
    for _ in range(most):
        first, last = take(turns)
        if first < 0:
            break
        for at in range(first, last):
            row = at if everywhere else np.int64(rows[at])
            z, y = place_of(row, ny)
            on_x = on_y = on_z = inside = made = 0
            around, cells = rows_of(shape, z, y), y + 1 < ny and z + 1 < nz
            for part in range(live.shape[2]):
                left = _uneven_words(flat, around, shape[2] - 1, part)
                if not everywhere:
                    left &= live[z, y, part]
                live[z, y, part] = left
                while left:
                    w = 64 * part + lowest_bit(left)
                    left &= left - ONE
                    words, within = load(flat, around, np.uint64(w)), cells_in_word(nx, w)
                    i, j, k = own_edges(mask, words, within, z, y, w)
                    on_x, on_y, on_z = on_x + popcount(i), on_y + popcount(j), on_z + popcount(k)
                    if cells:
                        found = mixed(words) & (mask[z, y, w] if mask.size else within)
                        m, n, o = _in_cells(field, cases, words, found, z, y, w, room)
                        made, inside, many = made + m, inside + n, many + o
            to = np.uint64(5 * row)
            kept[to], kept[to + ONE], kept[to + TWO] = on_x, on_y, on_z
            kept[to + THREE], kept[to + FOUR] = on_x + on_y + on_z + inside, made
    return many


@hot
def _uneven_words(flat: Any, around: Any, words: int, part: int) -> Any:
    """Bits of the words, of a part of a row of cells, in which not all corners are on one side."""
    found = np.uint64(0)
    for first in range(64 * part, min(64 * part + 64, words), 8):
        at = np.uint64(first)
        some = uneven(flat, around[0] + at, around[1] + at, around[2] + at, around[3] + at)
        found |= some << (at & LAST)
    return found & first_bits(words - 64 * part)


@hot
def _in_cells(
    field: Any, cases: Any, words: Any, found: Any, z: int, y: int, w: int, room: Any
) -> Any:
    """(triangles, vertices inside, ambiguous ones) of the cells whose bits are given.

    The surface in a cell is one loop over its crossed edges if it is not ambiguous, and a loop has
    two triangles less than edges.
    """
    left = found & doubtful(words)
    plain, inside = found & ~left, 0
    made, many = crossings(words, plain) - 2 * popcount(plain), popcount(left)
    while left:
        bit = np.uint64(lowest_bit(left))
        left &= left - ONE
        half = np.int64(bit >> np.uint64(5))
        case = case_of(halves(words, half), bit & np.uint64(31))
        size, more = _doubtful(field, cases, case, z, y, 64 * w + np.int64(bit), room)
        made, inside = made + size, inside + more
    return made, inside, many


@hot
def _doubtful(field: Any, cases: Any, case: int, z: int, y: int, x: int, room: Any) -> Any:
    """(triangles, vertices inside) of an ambiguous cell."""
    values, saddles = room
    corner_values(field.data, field.isovalue, z, y, x, values)
    entry, tube = decide(values, case, cases, field.rule, saddles)
    if tube >= 0:
        return tube_size(cases.tubes, tube), np.int64(6)
    size = np.int64(cases.start[entry + 1]) - np.int64(cases.start[entry])
    return size, np.int64(cases.center[entry, 0] > 0)


@kernel
def number(counts: Any, everywhere: bool, listed: int, rows: Any, vertices: Any, faces: Any) -> Any:
    """Where the vertices and the triangles of each row begin: running sums.

    rows: so many are listed, or all are meant; those with nothing in them go. How many are left.
    """
    n: Any = 0
    m: Any = 0
    kept: Any = np.uint64(0)
    for at in range(listed):
        row = np.uint64(at if everywhere else rows[at])
        rows[kept], vertices[row], faces[kept] = row, n, m
        more, made = np.int64(counts[row, 3]), np.int64(counts[row, 4])
        n, m, kept = n + more, m + made, kept + np.uint64(more + made > 0)
    vertices[vertices.size - 1], faces[kept] = n, m
    return np.int64(kept)


@hot
def put(place: Any, points: Any, normals: Any, n: int, at: Any, gradient: Any, down: Any) -> None:
    """Write vertex n at index coordinates `at`; `down` is the way to lower values, as a spare."""
    p, g = place.points, place.gradients
    points[n, 0] = p[0] * at[0] + p[1] * at[1] + p[2] * at[2] + p[3]
    points[n, 1] = p[4] * at[0] + p[5] * at[1] + p[6] * at[2] + p[7]
    points[n, 2] = p[8] * at[0] + p[9] * at[1] + p[10] * at[2] + p[11]
    if place.operator < 0:
        return
    a = -(g[0] * gradient[0] + g[1] * gradient[1] + g[2] * gradient[2])
    b = -(g[3] * gradient[0] + g[4] * gradient[1] + g[5] * gradient[2])
    c = -(g[6] * gradient[0] + g[7] * gradient[1] + g[8] * gradient[2])
    length = np.sqrt(a * a + b * b + c * c)
    if not (length > 0 and length < np.inf):
        a = g[0] * down[0] + g[1] * down[1] + g[2] * down[2]
        b = g[3] * down[0] + g[4] * down[1] + g[5] * down[2]
        c = g[6] * down[0] + g[7] * down[1] + g[8] * down[2]
        length = np.sqrt(a * a + b * b + c * c)
    scale = 1 / length
    normals[n, 0], normals[n, 1], normals[n, 2] = a * scale, b * scale, c * scale
