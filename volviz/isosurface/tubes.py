"""The rare cells with vertices inside: a tube between two loops, or a loop round a middle."""

from __future__ import annotations

from typing import Any

import numpy as np

from volviz.isosurface.ambiguity import trilinear
from volviz.isosurface.cases import CENTER, CORNERS, EDGES
from volviz.isosurface.kernel import bare, hot
from volviz.isosurface.marching import put
from volviz.isosurface.slopes import CENTRAL, differences, slopes

_ENDS = np.array(EDGES)
_PLACES = np.array(CORNERS, dtype=np.float64)
NECK = CENTER + 1  # the six vertices of a tube's neck follow
PLACES = NECK + 6
_HEXAGON = np.arange(NECK, PLACES)


@bare
def _on_edges(values: Any, places: Any) -> None:
    """Where the crossed edges of a cell are crossed, 0..1; float64[PLACES, 3]."""
    for e in range(12):
        a, b = _ENDS[e, 0], _ENDS[e, 1]
        t = values[a] / (values[a] - values[b]) if values[a] != values[b] else 0.5
        for i in range(3):
            places[e, i] = _PLACES[a, i] + t * (_PLACES[b, i] - _PLACES[a, i])


@bare
def _settle(values: Any, places: Any, n: int) -> None:
    """Newton steps of place n onto the surface, unless they lead out of the cell."""
    x, y, z = places[n, 0], places[n, 1], places[n, 2]
    for _ in range(4):
        f = trilinear(values, x, y, z)
        gx = trilinear(values, 1.0, y, z) - trilinear(values, 0.0, y, z)
        gy = trilinear(values, x, 1.0, z) - trilinear(values, x, 0.0, z)
        gz = trilinear(values, x, y, 1.0) - trilinear(values, x, y, 0.0)
        square = gx * gx + gy * gy + gz * gz
        if not square > 0:
            return
        x, y, z = x - f * gx / square, y - f * gy / square, z - f * gz / square
        if not (0.05 < x < 0.95 and 0.05 < y < 0.95 and 0.05 < z < 0.95):
            return
    places[n, 0], places[n, 1], places[n, 2] = x, y, z


@bare
def middle(values: Any, loop: Any, places: Any) -> None:
    """Place `CENTER` for a loop (its length, then its edges)."""
    _on_edges(values, places)
    length = np.int64(loop[0])
    for i in range(3):
        places[CENTER, i] = 0.0
        for k in range(length):
            places[CENTER, i] += places[np.int64(loop[1 + k]), i] / length
    _settle(values, places, CENTER)


@bare
def neck(values: Any, found: Any, places: Any) -> None:
    """Place the six vertices of the neck: the two saddles and the corners of lines between."""
    _on_edges(values, places)
    for k in range(6):
        places[NECK + k, 0] = found[0 if k in (0, 4, 5) else 1, 0]
        places[NECK + k, 1] = found[0 if k in (0, 1, 2) else 1, 1]
        places[NECK + k, 2] = found[0 if k in (0, 1, 5) else 1, 2]


@bare
def _apart(places: Any, a: int, b: int) -> float:
    total = 0.0
    for i in range(3):
        total += (places[a, i] - places[b, i]) ** 2
    return total


@bare
def _area(places: Any, ring: Any, count: int, area: Any, sign: float) -> None:
    """Add the vector area of a ring of places."""
    for k in range(count):
        a, b = np.int64(ring[k]), np.int64(ring[(k + 1) % count])
        for i in range(3):
            j, m = (i + 1) % 3, (i + 2) % 3
            area[i] += sign * (places[a, j] * places[b, m] - places[a, m] * places[b, j])


@bare
def _strip(places: Any, ring: Any, count: int, way: int, out: Any, at: int) -> int:
    """Triangles between a ring and the neck, which is walked `way` (±1); returns the next row.

    From the nearest pair on, evenly: no vertex may see the whole other ring, or an edge would be
    there twice.
    """
    start, other, least = 0, 0, np.inf
    for i in range(count):
        for j in range(6):
            apart = _apart(places, np.int64(ring[i]), NECK + j)
            if apart < least:
                start, other, least = i, j, apart
    i = j = 0
    while i < count or j < 6:
        a, b = np.int64(ring[(start + i) % count]), np.int64(ring[(start + i + 1) % count])
        h, k = NECK + (other + way * j) % 6, NECK + (other + way * (j + 1)) % 6
        if (2 * i + 1) * 6 < (2 * j + 1) * count:
            out[at, 0], out[at, 1], out[at, 2] = a, b, h
            i += 1
        else:
            out[at, 0], out[at, 1], out[at, 2] = a, k, h
            j += 1
        at += 1
    return at


@bare
def tube_triangles(row: Any, places: Any, ways: Any, out: Any) -> None:
    """Fill the triangles (local numbers) of a cell whose loops a row of `Cases.tubes` tells.

    ways: float64[2, 3] to work in.
    """
    a, b, rest = np.int64(row[0]), np.int64(row[1]), np.int64(row[2])
    first, second, last = row[3 : 3 + a], row[3 + a : 3 + a + b], row[3 + a + b :]
    ways[:] = 0.0
    _area(places, first, a, ways[0], 1.0)
    _area(places, second, b, ways[0], -1.0)
    _area(places, _HEXAGON, 6, ways[1], 1.0)
    along = ways[0, 0] * ways[1, 0] + ways[0, 1] * ways[1, 1] + ways[0, 2] * ways[1, 2]
    way = 1 if along >= 0 else -1
    at = _strip(places, first, a, way, out, 0)
    at = _strip(places, second, b, -way, out, at)
    if rest:
        for k in range(3):
            out[at, k] = last[k]


@hot
def _away(shape: Any, x: int, y: int, z: int) -> Any:
    """Have all corners of a cell samples on both sides?"""
    nz, ny, nx = shape
    return x > 0 and x + 2 < nx and y > 0 and y + 2 < ny and z > 0 and z + 2 < nz


@bare
def put_inside(
    data: Any, valid: Any, place: Any, points: Any, normals: Any, n: int,
    z: int, y: int, x: int, local: Any, g: Any,
) -> None:  # fmt: skip
    """Write vertex n at a place (0..1) inside a cell, with the gradient between the corners'.

    g: float64[3] to work in.
    """
    at = (x + local[0], y + local[1], z + local[2])
    gx = gy = gz = 0.0
    if place.operator >= 0:
        quick = valid.size == 0 and place.operator == CENTRAL and _away(data.shape, x, y, z)
        for c in range(8):
            i, j, k = c & 1, c >> 1 & 1, c >> 2
            weight = (local[0] if i else 1 - local[0]) * (local[1] if j else 1 - local[1])
            weight *= local[2] if k else 1 - local[2]
            if quick:
                differences(data, z + k, y + j, x + i, g)
            else:
                slopes(data, valid, z + k, y + j, x + i, place.operator, g)
            gx, gy, gz = gx + weight * g[0], gy + weight * g[1], gz + weight * g[2]
    put(place, points, normals, n, at, (gx, gy, gz), (1.0, 0.0, 0.0))
