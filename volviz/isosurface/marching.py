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
from volviz.isosurface.kernel import hot, inline, kernel, lowest_bit, popcount, take
from volviz.isosurface.plain import AMBIGUOUS
from volviz.isosurface.signs import (
    ONE,
    cells_in_word,
    first_bits,
    load,
    mixed,
    own_edges,
    rows_of,
)

PAIR, MIDDLE, HALF, LOWER = (np.uint64(n) for n in (3, 31, 32, 0xFFFFFFFF))
EMPTY = np.empty((0, 0, 0), dtype=np.uint64)


class Field(NamedTuple):
    """What the kernels read: samples, level, bits (`signs.py`), rule of ambiguous cells."""

    data: NDArray[Any]
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
    """Per row of samples: crossed edges along x, y, z, vertices inside its cells, triangles
    (int32[rows, 5]); where its vertices and its triangles begin (int64[rows + 1]); its words with
    something in them (`signs.py`)."""

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


@inline
def tube_size(tubes: Any, tube: int) -> Any:
    """Triangles of a cell with a tube: a strip from each end to the six vertices of its neck."""
    rest = 1 if tubes[tube, 2] else 0
    return np.int64(tubes[tube, 0]) + np.int64(tubes[tube, 1]) + 12 + rest


@kernel
def count(
    field: Any, cases: Any, plain: Any, everywhere: bool, turns: Any, live: Any, counts: Any
) -> int:
    """Per row: crossed edges along x, y, z, vertices inside cells, triangles.

    live: the words to look at (all of them if `everywhere`); those with nothing in them are
    cleared. Returns how many cells are ambiguous.
    """
    mask, shape, sizes = field.mask, field.signs.shape, plain.size
    flat, (nz, ny, nx) = field.signs.ravel(), field.data.shape
    room, doubtful = (np.empty(8), np.empty((2, 3))), 0
    while True:
        first = take(turns)
        if first >= nz:
            return doubtful
        for row in range(first * ny, min(first + turns[1], nz) * ny):
            z, y = row // ny, row % ny
            on_x = on_y = on_z = inside = made = 0
            around, cells = rows_of(shape, z, y), y + 1 < ny and z + 1 < nz
            for part in range(live.shape[2]):
                left = live[z, y, part]
                if everywhere:
                    left = first_bits(shape[2] - 1 - 64 * part)
                kept = left
                while left:
                    low = left & (~left + ONE)
                    w = 64 * part + lowest_bit(left)
                    left ^= low
                    words = load(flat, around, np.uint64(w))
                    found = mixed(words)
                    if not found:
                        kept ^= low
                        continue
                    within = cells_in_word(nx, w)
                    i, j, k = own_edges(mask, words, within, z, y, w)
                    on_x, on_y, on_z = on_x + popcount(i), on_y + popcount(j), on_z + popcount(k)
                    if cells:
                        found &= mask[z, y, w] if mask.size else within
                        m, n, o = _in_cells(field, cases, sizes, words, found, z, y, w, room)
                        made, inside, doubtful = made + m, inside + n, doubtful + o
                live[z, y, part] = kept
            counts[row, 0], counts[row, 1], counts[row, 2] = on_x, on_y, on_z
            counts[row, 3], counts[row, 4] = inside, made


@hot
def _in_cells(
    field: Any, cases: Any, sizes: Any, words: Any, found: Any, z: int, y: int, w: int, room: Any
) -> Any:
    """(triangles, vertices inside, ambiguous ones) of the cells whose bits are given."""
    made = inside = doubtful = 0
    for half in range(2):
        rows = halves(words, half)
        left = found >> HALF if half else found & LOWER
        while left:
            bit = np.uint64(lowest_bit(left))
            left &= left - ONE
            case = case_of(rows, bit)
            size: Any = np.int64(sizes[case])
            if size == AMBIGUOUS:
                size, more = _doubtful(
                    field, cases, case, z, y, 64 * w + 32 * half + np.int64(bit), room
                )
                inside += more
                doubtful += 1
            made += size
    return made, inside, doubtful


@inline
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
def number(counts: Any, vertices: Any, triangles: Any) -> None:
    """Where the vertices and the triangles of each row begin: running sums, rows + 1 of them."""
    n: Any = 0
    m: Any = 0
    for row in range(counts.shape[0]):
        vertices[row], triangles[row] = n, m
        for k in range(4):
            n += np.int64(counts[row, k])
        m += np.int64(counts[row, 4])
    vertices[counts.shape[0]], triangles[counts.shape[0]] = n, m


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
