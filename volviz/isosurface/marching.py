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
from volviz.isosurface.kernel import hot, inline, kernel, lowest_bit, popcount
from volviz.isosurface.signs import ONE, active, cells_in_word, load, own_edges, rows_of
from volviz.isosurface.slopes import CENTRAL, NO_NORMALS, slopes

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
    """Per row of samples: crossed edges along x, y, z (int32[rows, 3]); where its vertices and
    its triangles begin (int64[rows + 1])."""

    counts: NDArray[np.int32]
    vertices: NDArray[np.int64]
    triangles: NDArray[np.int64]


@hot
def case_of(corners: Any, bit: Any) -> Any:
    """The eight signs of a cell as a number, corner x + 2y + 4z being a bit."""
    case = np.uint64(0)
    for k in range(8):
        case |= (corners[k] >> bit & ONE) << np.uint64(k)
    return np.int64(case)


@inline
def tube_size(tubes: Any, tube: int) -> Any:
    """Triangles of a cell with a tube: a strip from each end to the six vertices of its neck."""
    rest = 1 if tubes[tube, 2] else 0
    return np.int64(tubes[tube, 0]) + np.int64(tubes[tube, 1]) + 12 + rest


@kernel
def count(field: Any, cases: Any, first: int, last: int, edges: Any, inner: Any, faces: Any) -> int:
    """Per row: crossed edges, vertices inside cells, triangles; returns ambiguous cells."""
    data, signs, mask = field.data, field.signs, field.mask
    flat, (nz, ny, nx) = signs.ravel(), data.shape
    ambiguous, entries, starts = cases.ambiguous, cases.entry, cases.start
    values, found, corners = np.empty(8), np.empty((2, 3)), np.empty(8, np.uint64)
    doubtful = 0
    for z in range(first, last):
        for y in range(ny):
            row, rows = z * ny + y, y + 1 < ny and z + 1 < nz
            on_x = on_y = on_z = inside = made = 0
            around = rows_of(signs.shape, z, y)
            for w in range(signs.shape[2] - 1):
                if not load(flat, around, np.uint64(w), corners):
                    continue
                within = cells_in_word(nx, w)
                i, j, k = own_edges(mask, corners, within, z, y, w)
                on_x, on_y, on_z = on_x + popcount(i), on_y + popcount(j), on_z + popcount(k)
                left = active(mask, corners, within, z, y, w) if rows else np.uint64(0)
                while left:
                    bit = np.uint64(lowest_bit(left))
                    left &= left - ONE
                    case = case_of(corners, bit)
                    entry = np.int64(entries[case, 0])
                    if ambiguous[case] == 0:
                        made += starts[entry + 1] - starts[entry]
                        continue
                    doubtful += 1
                    x = 64 * w + np.int64(bit)
                    corner_values(data, field.isovalue, z, y, x, values)
                    entry, tube = decide(values, case, cases, field.rule, found)
                    if tube >= 0:
                        inside += 6
                        made += tube_size(cases.tubes, tube)
                    else:
                        inside += cases.center[entry, 0] > 0
                        made += starts[entry + 1] - starts[entry]
            edges[row, 0], edges[row, 1], edges[row, 2] = on_x, on_y, on_z
            inner[row], faces[row] = inside, made
    return doubtful


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


@inline
def _on_edge(
    data: Any, valid: Any, isovalue: float, place: Any, points: Any, normals: Any, n: int,
    axis: int, z: int, y: int, x: int, two: Any,
) -> None:  # fmt: skip
    """The vertex on the edge from a sample to its next along an axis (0 is x): in any case.

    two: float64[2, 3] to work in.
    """
    dz, dy, dx = int(axis == 2), int(axis == 1), int(axis == 0)
    low, high = np.float64(data[z, y, x]), np.float64(data[z + dz, y + dy, x + dx])
    t = (isovalue - low) / (high - low)
    at = (x + t * dx, y + t * dy, z + t * dz)
    s = 1.0 if low > high else -1.0
    down = (s * dx, s * dy, s * dz)
    mixed = down
    if place.operator >= 0:
        for end in range(2):
            c, b, a = z + end * dz, y + end * dy, x + end * dx
            slopes(data, valid, c, b, a, place.operator, two[end])
        mixed = (
            two[0, 0] + t * (two[1, 0] - two[0, 0]),
            two[0, 1] + t * (two[1, 1] - two[0, 1]),
            two[0, 2] + t * (two[1, 2] - two[0, 2]),
        )
    put(place, points, normals, n, at, mixed, down)


@hot
def _on_inner_edge(flat: Any, o: Any, steps: Any, isovalue: float) -> Any:
    """(how far along the edge, slopes along it and across it), central differences.

    o: index of its lower sample in the flat samples; steps: to the next along it, and across.
    """
    s, p, q = steps
    low, high = np.float64(flat[o]), np.float64(flat[o + s])
    t = (isovalue - low) / (high - low)
    along = (high - np.float64(flat[o - s])) * (1 - t) + (np.float64(flat[o + s + s]) - low) * t
    e = o + s
    a = (np.float64(flat[o + p]) - np.float64(flat[o - p])) * (1 - t)
    a += (np.float64(flat[e + p]) - np.float64(flat[e - p])) * t
    b = (np.float64(flat[o + q]) - np.float64(flat[o - q])) * (1 - t)
    b += (np.float64(flat[e + q]) - np.float64(flat[e - q])) * t
    return t, along, a, b, low > high


@hot
def _inner_edges(
    shape: Any, flat: Any, isovalue: float, place: Any, points: Any, normals: Any, n: int,
    axis: int, z: int, y: int, w: int, left: Any,
) -> int:  # fmt: skip
    """The vertices on a word of crossed edges along an axis, none at the volume's border."""
    nx = np.uint64(shape[2])
    layer = nx * np.uint64(shape[1])
    begin = np.uint64(z) * layer + np.uint64(y) * nx + np.uint64(64 * w)
    one = np.uint64(1)
    while left:
        bit = lowest_bit(left)
        left &= left - ONE
        o, x = begin + np.uint64(bit), 64.0 * w + bit
        if axis == 0:
            t, a, b, c, falls = _on_inner_edge(flat, o, (one, nx, layer), isovalue)
            s = 1.0 if falls else -1.0
            put(place, points, normals, n, (x + t, float(y), float(z)), (a, b, c), (s, 0.0, 0.0))
        elif axis == 1:
            t, a, b, c, falls = _on_inner_edge(flat, o, (nx, one, layer), isovalue)
            s = 1.0 if falls else -1.0
            put(place, points, normals, n, (x, y + t, float(z)), (b, a, c), (0.0, s, 0.0))
        else:
            t, a, b, c, falls = _on_inner_edge(flat, o, (layer, one, nx), isovalue)
            s = 1.0 if falls else -1.0
            put(place, points, normals, n, (x, float(y), z + t), (b, c, a), (0.0, 0.0, s))
        n += 1
    return n


@kernel
def vertices(field: Any, place: Any, layout: Any, first: int, last: int, out: Any) -> None:
    """Fill the vertices (and normals) on crossed edges: out is (float32[n, 3], float32[n, 3])."""
    data, signs, mask, valid = field.data, field.signs, field.mask, field.valid
    nz, ny, nx = data.shape
    level, starts, (points, normals) = field.isovalue, layout.vertices, out
    two = np.empty((2, 3))
    corners, n = np.empty(8, np.uint64), np.empty(3, np.int64)
    plain = valid.size == 0 and place.operator in (CENTRAL, NO_NORMALS)
    flat, words = data.ravel(), signs.ravel()
    for z in range(first, last):
        for y in range(ny):
            row = z * ny + y
            if starts[row] == starts[row + 1]:
                continue
            n[0], n[1] = starts[row], starts[row] + layout.counts[row, 0]
            n[2] = n[1] + layout.counts[row, 1]
            inner = plain and 0 < z < nz - 2 and 0 < y < ny - 2
            around = rows_of(signs.shape, z, y)
            for w in range(signs.shape[2] - 1):
                if not load(words, around, np.uint64(w), corners):
                    continue
                edges = own_edges(mask, corners, cells_in_word(nx, w), z, y, w)
                away = _away(nx, w)
                for axis in range(3):
                    left = edges[axis]
                    if inner and left & away == left:
                        n[axis] = _inner_edges(
                            data.shape, flat, level, place, points, normals, n[axis],
                            axis, z, y, w, left,
                        )  # fmt: skip
                        continue
                    while left:
                        x, m = 64 * w + lowest_bit(left), n[axis]
                        left &= left - ONE
                        _on_edge(data, valid, level, place, points, normals, m, axis, z, y, x, two)
                        n[axis] += 1


@hot
def _away(width: int, w: int) -> Any:
    """Bits of the samples of a word that are not among the first one or the last two of a row."""
    n = width - 2 - 64 * w
    bits = ~np.uint64(0) if n >= 64 else (ONE << np.uint64(max(n, 0))) - ONE
    return bits & ~ONE if w == 0 else bits
