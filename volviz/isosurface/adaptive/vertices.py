"""The vertices of an adaptive surface: each once, those of the picture before as they are."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from volviz.errors import LimitError
from volviz.isosurface.kernel import hot, kernel

FREE = np.iinfo(np.int64).min
_SPREAD = np.uint64(0x9E3779B97F4A7C15)  # 2⁶⁴ / golden ratio: multiplicative hashing (Knuth)


class Welded(NamedTuple):
    """faces: uint32[m, 3]. keys: int64[n], the number (`dual`) of each vertex, below 0 inside
    cells. origin: int64[n], which it was in the picture before, or −1."""

    faces: NDArray[np.uint32]
    keys: NDArray[np.int64]
    origin: NDArray[np.int64]


def welded(
    spans: NDArray[np.int64], source: NDArray[np.int64], corners: NDArray[np.int64],
    faces_before: NDArray[np.uint32], keys_before: NDArray[np.int64],
) -> Welded:  # fmt: skip
    """Number the vertices of all blocks.

    spans, source: triangles of each block; where those of the run before begin, or −1. corners:
    int64[m, 3], numbers of the corners of new triangles. Raises LimitError where 32 bits do not
    number the vertices.
    """
    count = len(corners)
    bits = max(int(2 * count).bit_length(), 4)
    while True:  # a closed surface has half as many vertices as triangles
        table, numbers = np.full(1 << bits, FREE), np.empty(1 << bits, np.int64)
        names = np.full(len(keys_before), -1, np.int64)
        made = Welded(
            np.empty((count, 3), np.uint32),
            np.empty(3 * count, np.int64),
            np.empty(3 * count, np.int64),
        )
        n = _weld(spans, source, corners, faces_before, keys_before, names, table, numbers, made)
        if n >= 0:
            break
        bits += 1
    if n >= 1 << 32:
        raise LimitError(
            f"the surface has {n} vertices, more than 32 bits can number",
            fix="choose another isovalue or a smaller region",
        )
    return Welded(made.faces, made.keys[:n].copy(), made.origin[:n].copy())


@kernel
def _weld(
    spans: Any, source: Any, corners: Any, faces_before: Any, keys_before: Any, names: Any,
    table: Any, numbers: Any, out: Any,
) -> int:  # fmt: skip
    """How many vertices there are, −1 if the table is too small. names: −1, to work in."""
    count, most, found = 0, table.size // 4 * 3, 0
    for b in range(spans.shape[0]):
        for t in range(spans[b, 0], spans[b, 1]):
            if found + 3 > most:
                return -1
            for c in range(3):
                old: Any = -1
                if source[b] >= 0:
                    old = np.int64(faces_before[source[b] + t - spans[b, 0], c])
                    if names[old] >= 0:
                        out.faces[t, c] = names[old]
                        continue
                key = keys_before[old] if old >= 0 else corners[t, c]
                at = 0
                if old < 0 or key >= 0:  # else inside a cell of the run before: no other has it
                    at = _place(table, key)
                    if table[at] == key:
                        out.faces[t, c] = numbers[at]
                        if old >= 0:
                            names[old] = numbers[at]
                        continue
                    table[at], numbers[at] = key, count
                    found += 1
                if old >= 0:
                    names[old] = count
                out.faces[t, c], out.keys[count], out.origin[count] = count, key, old
                count += 1
    return count


@hot
def _place(table: Any, key: int) -> int:
    """Where a key is in the table, or would be."""
    mask = table.size - 1
    mixed = np.uint64(key) * _SPREAD
    at = np.int64(mixed >> np.uint64(20)) & mask
    while table[at] not in (FREE, key):
        at = (at + 1) & mask
    return int(at)


@kernel
def in_world(
    index: Any, gradients: Any, affine: Any, turn: Any, points: Any, normals: Any
) -> None:  # fmt: skip
    """Points and unit normals (float32[n, 3]; NaN where there is no gradient) of float64[n, 3]
    index coordinates and gradients per sample.

    affine: float64[3, 4], index to mm. turn: float64[9], gradients per sample to those per mm.
    """
    way = np.empty(3)
    for n in range(index.shape[0]):
        square = 0.0
        for r in range(3):
            place = affine[r, 3]
            way[r] = 0.0
            for c in range(3):
                place += affine[r, c] * index[n, c]
                way[r] -= turn[3 * r + c] * gradients[n, c]
            points[n, r] = place
            square += way[r] * way[r]
        length = np.sqrt(square) if 0 < square < np.inf else np.nan
        for r in range(3):
            normals[n, r] = way[r] / length


@kernel
def fill_normals(vertices: Any, faces: Any, normals: Any) -> None:
    """Where a normal (float32[n, 3]) is NaN, the mean of those of the vertex's triangles, weighted
    by area; 0 where they have none. vertices: float32[n, 3]."""
    total = np.zeros((vertices.shape[0], 3))
    size = 0.0
    for f in range(faces.shape[0]):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        if not np.isnan(normals[a, 0] + normals[b, 0] + normals[c, 0]):
            continue
        ux, uy, uz = _way(vertices, a, b)
        vx, vy, vz = _way(vertices, a, c)
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        for v in (a, b, c):
            total[v, 0] += nx
            total[v, 1] += ny
            total[v, 2] += nz
            size = max(size, abs(np.float64(vertices[v, 0])), abs(np.float64(vertices[v, 1])))
            size = max(size, abs(np.float64(vertices[v, 2])))
    for v in range(vertices.shape[0]):
        if not np.isnan(normals[v, 0]):
            continue
        x, y, z = total[v, 0], total[v, 1], total[v, 2]
        length = np.sqrt(x * x + y * y + z * z)
        if length <= (1e-7 * size) ** 2:
            x = y = z = 0.0
            length = 1.0
        normals[v, 0], normals[v, 1], normals[v, 2] = x / length, y / length, z / length


@hot
def _way(vertices: Any, a: int, b: int) -> Any:
    return (
        np.float64(vertices[b, 0]) - np.float64(vertices[a, 0]),
        np.float64(vertices[b, 1]) - np.float64(vertices[a, 1]),
        np.float64(vertices[b, 2]) - np.float64(vertices[a, 2]),
    )
