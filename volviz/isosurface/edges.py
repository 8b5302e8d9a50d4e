"""The vertices of marching cubes, on crossed edges: gathered some hundred at a time, then worked
out together, which is what the wide registers of a processor are for.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from volviz.isosurface.kernel import hot, inline, kernel, lowest_bit, popcount, take
from volviz.isosurface.signs import LAST, ONE, cells_in_word, near_edges, rows_of
from volviz.isosurface.slopes import CENTRAL, slopes

HELD = 256  # vertices at a time: all that is known of them stays in the first cache
_STRIDE = HELD + 8  # not a power of two: those share the same few lines of the cache
_SPAN = np.uint64(_STRIDE)
# what is held of each: samples at both ends, place of the lower one, axis of the edge, how far
# along it the vertex is, and slopes along x, y, z at the lower end and at the upper one
LOW, HIGH, PLACE, AXIS, SHARE, SLOPE = (np.uint64(k * _STRIDE) for k in (0, 1, 2, 5, 6, 7))
_KINDS = 13
_UPPER = np.uint64(3 * _STRIDE)
TWO, THREE = np.uint64(2), np.uint64(3)


@kernel
def vertices(field: Any, place: Any, layout: Any, turns: Any, out: Any) -> None:
    """Fill the vertices (and normals) on crossed edges: out is (float32[n, 3], float32[n, 3])."""
    mask, starts, live, counts = field.mask, layout.vertices, layout.live, layout.counts
    (nz, ny, nx), shape, level = field.data.shape, field.signs.shape, field.isovalue
    flat, words, points, normals = _flat(field, out)
    held, two = np.empty(_KINDS * _STRIDE), np.empty((2, 3))
    quick = field.valid.size == 0 and place.operator <= CENTRAL
    while True:
        first = take(turns)
        if first >= nz:
            return
        n = base = 0
        for row in range(first * ny, min(first + turns[1], nz) * ny):
            if starts[row] == starts[row + 1]:
                continue
            if starts[row] != base + n:
                _put(held, n, base, level, place, points, normals)
                base, n = starts[row], 0
            z, y = row // ny, row % ny
            around = rows_of(shape, z, y)
            inner = quick and 0 < z < nz - 2 and 0 < y < ny - 2
            for axis in range(3):
                if counts[row, axis] == 0:
                    continue
                for part in range(live.shape[2]):
                    left = live[z, y, part]
                    while left:
                        w = 64 * part + lowest_bit(left)
                        left &= left - ONE
                        crossed = _crossed(words, mask, around, axis, nx, z, y, w)
                        if n + popcount(crossed) > HELD:
                            _put(held, n, base, level, place, points, normals)
                            base, n = base + n, 0
                        away = crossed & _away(nx, w) if inner else np.uint64(0)
                        low = crossed & (away - ONE) & ~away  # those before, or all
                        for some in (low, away, crossed ^ low ^ away):
                            if some and some == away:
                                n = _gather(flat, nx, ny, held, n, axis, z, y, w, some)
                            elif some:
                                n = _gather_any(field, place, held, n, axis, z, y, w, some, two)
        _put(held, n, base, level, place, points, normals)


@inline
def _flat(field: Any, out: Any) -> Any:
    return field.data.ravel(), field.signs.ravel(), out[0].ravel(), out[1].ravel()


@hot
def _crossed(
    words: Any, mask: Any, around: Any, axis: int, nx: int, z: int, y: int, w: int
) -> Any:
    """Bits of the crossed edges along an axis (0 is x) of a word."""
    at = around[0] + np.uint64(w)
    word = words[at]
    if axis == 0:
        found = (word ^ (word >> ONE | words[at + ONE] << LAST)) & cells_in_word(nx, w)
    else:
        found = word ^ words[(around[1] if axis == 1 else around[2]) + np.uint64(w)]
    return found & near_edges(mask, axis, z, y, w) if mask.size else found


@hot
def _away(width: int, w: int) -> Any:
    """Bits of the samples of a word that are not among the first one or the last two of a row."""
    n = width - 2 - 64 * w
    bits = ~np.uint64(0) if n >= 64 else (ONE << np.uint64(max(n, 0))) - ONE
    return bits & ~ONE if w == 0 else bits


@hot
def _gather(
    flat: Any, nx: int, ny: int, held: Any, n: int, axis: int, z: int, y: int, w: int, left: Any
) -> int:
    """Hold the vertices of a word of crossed edges, none at the volume's border.

    The slopes are central differences, all of them doubled: only their direction counts.
    """
    layer = nx * ny
    begin = np.uint64(z * layer + y * nx + 64 * w)
    steps = (1, nx, layer, 1, nx)
    s, p, q = np.uint64(steps[axis]), np.uint64(steps[axis + 1]), np.uint64(steps[axis + 2])
    to_s = SLOPE + np.uint64(axis) * _SPAN
    to_p = SLOPE + np.uint64(0 if axis == 2 else axis + 1) * _SPAN
    to_q = SLOPE + np.uint64(2 if axis == 0 else axis - 1) * _SPAN
    while left:
        bit, i = np.uint64(lowest_bit(left)), np.uint64(n)
        left &= left - ONE
        o = begin + bit
        e = o + s
        low, high = np.float64(flat[o]), np.float64(flat[e])
        held[LOW + i], held[HIGH + i] = low, high
        held[to_s + i] = high - np.float64(flat[o - s])
        held[to_s + _UPPER + i] = np.float64(flat[e + s]) - low
        held[to_p + i] = np.float64(flat[o + p]) - np.float64(flat[o - p])
        held[to_p + _UPPER + i] = np.float64(flat[e + p]) - np.float64(flat[e - p])
        held[to_q + i] = np.float64(flat[o + q]) - np.float64(flat[o - q])
        held[to_q + _UPPER + i] = np.float64(flat[e + q]) - np.float64(flat[e - q])
        _hold_place(held, i, axis, z, y, 64 * w + np.int64(bit))
        n += 1
    return n


@inline
def _gather_any(
    field: Any, place: Any, held: Any, n: int, axis: int, z: int, y: int, w: int, left: Any,
    two: Any,
) -> int:  # fmt: skip
    """The same in any case. two: float64[2, 3] to work in."""
    data, dz, dy, dx = field.data, int(axis == 2), int(axis == 1), int(axis == 0)
    two[:] = 0.0
    while left:
        x, i = 64 * w + lowest_bit(left), np.uint64(n)
        left &= left - ONE
        held[LOW + i] = np.float64(data[z, y, x])
        held[HIGH + i] = np.float64(data[z + dz, y + dy, x + dx])
        if place.operator >= 0:
            slopes(data, field.valid, z, y, x, place.operator, two[0])
            slopes(data, field.valid, z + dz, y + dy, x + dx, place.operator, two[1])
        for k in range(3):
            held[SLOPE + np.uint64(k) * _SPAN + i] = two[0, k]
            held[SLOPE + _UPPER + np.uint64(k) * _SPAN + i] = two[1, k]
        _hold_place(held, i, axis, z, y, x)
        n += 1
    return n


@hot
def _hold_place(held: Any, i: Any, axis: int, z: int, y: int, x: int) -> None:
    held[PLACE + i] = x
    held[PLACE + _SPAN + i] = y
    held[PLACE + _SPAN + _SPAN + i] = z
    held[AXIS + i] = axis


@inline
def _put(
    held: Any, count: int, base: int, level: float, place: Any, points: Any, normals: Any
) -> None:
    """Write the held vertices, numbers base, base + 1 …"""
    p, to = place.points, np.uint64(3 * base)
    for k in range(count):
        i = np.uint64(k)
        axis, low = held[AXIS + i], held[LOW + i]
        t = (level - low) / (held[HIGH + i] - low)
        held[SHARE + i] = t
        x = held[PLACE + i] + (t if axis == 0.0 else 0.0)
        y = held[PLACE + _SPAN + i] + (t if axis == 1.0 else 0.0)
        z = held[PLACE + _SPAN + _SPAN + i] + (t if axis == 2.0 else 0.0)
        points[to + THREE * i] = p[0] * x + p[1] * y + p[2] * z + p[3]
        points[to + THREE * i + ONE] = p[4] * x + p[5] * y + p[6] * z + p[7]
        points[to + THREE * i + TWO] = p[8] * x + p[9] * y + p[10] * z + p[11]
    if place.operator >= 0:
        _put_normals(held, count, to, place.gradients, normals)


@hot
def _put_normals(held: Any, count: int, to: Any, g: Any, normals: Any) -> None:
    """Unit vectors against the gradient between the ends; where there is none, down the edge."""
    odd = 0
    for k in range(count):
        i = np.uint64(k)
        t, j = held[SHARE + i], SLOPE + i
        a, b, c = held[j], held[j + _SPAN], held[j + TWO * _SPAN]
        j += _UPPER
        a += t * (held[j] - a)
        b += t * (held[j + _SPAN] - b)
        c += t * (held[j + TWO * _SPAN] - c)
        u = g[0] * a + g[1] * b + g[2] * c
        v = g[3] * a + g[4] * b + g[5] * c
        w = g[6] * a + g[7] * b + g[8] * c
        square = u * u + v * v + w * w
        scale = -1 / np.sqrt(square)
        odd += not (0 < square < np.inf)
        normals[to + THREE * i] = u * scale
        normals[to + THREE * i + ONE] = v * scale
        normals[to + THREE * i + TWO] = w * scale
    if odd:
        _put_odd_normals(held, count, to, g, normals)


@inline
def _put_odd_normals(held: Any, count: int, to: Any, g: Any, normals: Any) -> None:
    for k in range(count):
        i = np.uint64(k)
        at, axis = to + THREE * i, np.int64(held[AXIS + i])
        x, y, z = normals[at], normals[at + ONE], normals[at + TWO]
        if 0.5 < x * x + y * y + z * z < 2:
            continue
        s = 1.0 if held[LOW + i] > held[HIGH + i] else -1.0
        u, v, w = s * g[axis], s * g[3 + axis], s * g[6 + axis]
        scale = 1 / np.sqrt(u * u + v * v + w * w)
        normals[at], normals[at + ONE], normals[at + TWO] = u * scale, v * scale, w * scale
