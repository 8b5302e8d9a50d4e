"""The vertices of marching cubes, on crossed edges: listed, then gathered, then worked out.

A list of edges costs few instructions per bit; what is known of its vertices is then fetched from
all over the volume without a branch between two of them, so that the fetches overlap; and worked
out some hundred at a time, which is what the wide registers of a processor are for.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from volviz.isosurface.kernel import bare, fetch, hot, inline, kernel, lowest_bit
from volviz.isosurface.samples import FLOAT, SIGNED, eight_bytes, number_in, value_at
from volviz.isosurface.signs import LAST, ONE, cells_in_word, near_edges, place_of, rows_of
from volviz.isosurface.slopes import CENTRAL, slopes
from volviz.isosurface.turns import take

HELD = 128  # vertices at a time: all that is known of them stays in the first cache
AHEAD = 16  # vertices: layers further up are asked for before they are needed
_STRIDE = HELD + 8  # not a power of two: those share the same few lines of the cache
_SPAN = np.uint64(_STRIDE)
# what is held of each: samples at both ends, how far along the edge it is, and the slopes along
# the edge and the two axes after it (x after z), at the lower end and at the upper one
LOW, HIGH, SHARE, SLOPE = (np.uint64(k * _STRIDE) for k in range(4))
_KINDS = 9
TWO, THREE, FOUR = np.uint64(2), np.uint64(3), np.uint64(4)


@kernel
def vertices(field: Any, place: Any, layout: Any, turns: Any, most: int, out: Any) -> None:
    """Fill the vertices (and normals) on crossed edges: out is (float32[n, 3], float32[n, 3])."""
    mask, starts, live, counts = field.mask, layout.vertices, layout.live, layout.counts
    (_, ny, nx), shape, words = field.data.shape, field.signs.shape, field.signs.ravel()
    room = 4 * HELD + 3 * nx
    listed = np.empty(room, np.int64), np.empty(room), np.empty(room), np.empty(room)
    held = np.empty(_KINDS * _STRIDE), np.empty((2, 3))
    keys, xs, ys, zs = listed
    for _ in range(most):
        start, last = take(turns)
        if start < 0:
            return
        n: Any = np.int64(0)
        base: Any = np.int64(0)
        for turn in range(start, last + 1):
            row = np.int64(layout.rows[turn]) if turn < last else np.int64(0)
            on_x, on_y = np.int64(counts[row, 0]), np.int64(counts[row, 1])
            more = on_x + on_y + np.int64(counts[row, 2])
            if turn == last or starts[row] != base + n or n + more > room:
                _put_all(field, place, listed, n, base, held, out)
                base, n = starts[row], np.int64(0)
            if turn == last:
                break
            z, y = place_of(row, ny)
            i, j, k, around = n, n + on_x, n + on_x + on_y, rows_of(shape, z, y)
            for part in range(live.shape[2]):
                left = live[z, y, part]
                while left:
                    w = 64 * part + lowest_bit(left)
                    left &= left - ONE
                    p, q, r = _crossed(words, around, nx, w)
                    if mask.size:
                        p &= near_edges(mask, 0, z, y, w)
                        q &= near_edges(mask, 1, z, y, w)
                        r &= near_edges(mask, 2, z, y, w)
                    x, at = 64 * w, 4 * (row * nx + 64 * w)
                    i = _list(keys, xs, ys, zs, i, p, at, x, y, z)
                    j = _list(keys, xs, ys, zs, j, q, at + 1, x, y, z)
                    k = _list(keys, xs, ys, zs, k, r, at + 2, x, y, z)
            n += more


@hot
def _crossed(words: Any, around: Any, nx: int, w: int) -> Any:
    """Bits of the crossed edges of a word along x, y and z."""
    at = np.uint64(w)
    word, after = words[around[0] + at], words[around[0] + at + ONE]
    along_x = (word ^ (word >> ONE | after << LAST)) & cells_in_word(nx, w)
    return along_x, word ^ words[around[1] + at], word ^ words[around[2] + at]


@hot
def _list(
    keys: Any, xs: Any, ys: Any, zs: Any, n: int, left: Any, key: int, x: int, y: int, z: int
) -> int:
    """Add edges to the list: 4 · number of the lower sample + axis (0 is x), and its place."""
    while left:
        bit, i = lowest_bit(left), np.uint64(n)
        left &= left - ONE
        keys[i] = key + 4 * bit
        xs[i], ys[i], zs[i] = x + bit, y, z
        n += 1
    return n


@inline
def _put_all(
    field: Any, place: Any, listed: Any, count: int, base: int, rooms: Any, out: Any
) -> None:
    """Write the listed vertices, numbers base, base + 1 …"""
    points, normals, (held, two) = out[0].ravel(), out[1].ravel(), rooms
    quick = field.valid.size == 0 and place.operator <= CENTRAL
    for first in range(0, count, HELD):
        n, to = min(count - first, HELD), np.uint64(3 * (base + first))
        if quick:
            _gather_all(field.data, listed, first, n, held)
        else:
            _put_slopes(field, place.operator, listed, first, n, two, held)
        _put_points(listed, first, n, to, held, field.isovalue, place.points, points)
        if place.operator >= 0:
            _put_normals(listed[0], first, n, to, held, place.gradients, normals)


@bare
def _gather_all(data: Any, listed: Any, first: int, count: int, held: Any) -> None:
    """Hold ends and slopes where all samples are valid: central differences, or nothing asked."""
    if data.kind == FLOAT and data.size == 4:
        _gather(np.float32(0), data, listed, first, count, held)
    elif data.kind == FLOAT:
        _gather(np.float64(0), data, listed, first, count, held)
    elif data.kind == SIGNED:
        _gather(np.int64(0), data, listed, first, count, held)
    else:
        _gather(np.uint64(0), data, listed, first, count, held)


@hot
def _away(shape: Any, x: Any, y: Any, z: Any) -> Any:
    """Are all samples next to an edge in the volume, and some after them?"""
    nz, ny, nx = shape
    return (x >= 1) & (x < nx - 2) & (y >= 1) & (y < ny - 2) & (z >= 1) & (z < nz - 2)


@bare
def _gather(like: Any, data: Any, listed: Any, first: int, count: int, held: Any) -> None:
    """`_gather_all`; like: of `number_in`.

    Away from the volume's border, central differences stand there doubled: only their direction
    counts.
    """
    octets, size, shift = data.bytes, np.uint64(data.size), np.uint64(64 - 8 * data.size)
    row, most = np.uint64(data.shape[2]) * size, np.uint64(first + count - 1)
    layer = np.uint64(data.shape[1]) * row
    for n in range(count):
        at, i = np.uint64(first + n), np.uint64(n)
        far = np.uint64(listed[0][min(at + np.uint64(AHEAD), most)] >> 2) * size + layer
        fetch(octets, far)
        fetch(octets, far + row)
        fetch(octets, far + layer)
        key, x, y, z = listed[0][at], listed[1][at], listed[2][at], listed[3][at]
        if not _away(data.shape, x, y, z):
            _at_border(data, key & 3, (np.int64(z), np.int64(y), np.int64(x)), held, i)
            continue
        axis, o = key & 3, np.uint64(key >> 2) * size
        s = size if axis == 0 else (row if axis == 1 else layer)
        p = row if axis == 0 else (layer if axis == 1 else size)
        q = layer if axis == 0 else (size if axis == 1 else row)
        e, to = o + s, SLOPE + i
        low = number_in(eight_bytes(octets, o), shift, like)
        high = number_in(eight_bytes(octets, e), shift, like)
        held[LOW + i], held[HIGH + i] = low, high
        held[to] = high - number_in(eight_bytes(octets, o - s), shift, like)
        held[to + _SPAN] = _across(like, octets, o, p, shift)
        held[to + TWO * _SPAN] = _across(like, octets, o, q, shift)
        to += THREE * _SPAN
        held[to] = number_in(eight_bytes(octets, e + s), shift, like) - low
        held[to + _SPAN] = _across(like, octets, e, p, shift)
        held[to + TWO * _SPAN] = _across(like, octets, e, q, shift)


@hot
def _across(like: Any, octets: Any, at: Any, step: Any, shift: Any) -> Any:
    """The sample after a place less the one before it."""
    after, before = eight_bytes(octets, at + step), eight_bytes(octets, at - step)
    return number_in(after, shift, like) - number_in(before, shift, like)


@bare
def _at_border(data: Any, axis: int, at: Any, held: Any, i: Any) -> None:
    """Hold vertex i: differences to one side where there is no other, as `slopes` has them.

    at: z, y, x of the lower end.
    """
    z, y, x = at
    held[LOW + i] = value_at(data, z, y, x)
    held[HIGH + i] = value_at(data, z + (axis == 2), y + (axis == 1), x + (axis == 0))
    for k in range(6):
        along, end = (axis + k) % 3, k // 3
        c, b, a = z + end * (axis == 2), y + end * (axis == 1), x + end * (axis == 0)
        place = a if along == 0 else (b if along == 1 else c)
        low, high = place > 0, place + 1 < data.shape[2 - along]
        m, n = 1 if high else 0, 1 if low else 0
        after = value_at(data, c + m * (along == 2), b + m * (along == 1), a + m * (along == 0))
        before = value_at(data, c - n * (along == 2), b - n * (along == 1), a - n * (along == 0))
        slope = (after - before) * 0.5 if low and high else after - before
        held[SLOPE + np.uint64(k) * _SPAN + i] = slope


@bare
def _put_slopes(
    field: Any, operator: int, listed: Any, first: int, count: int, two: Any, held: Any
) -> None:
    """Hold ends and slopes in any case. two: float64[2, 3] to work in."""
    data = field.data
    for n in range(count):
        at, i = np.uint64(first + n), np.uint64(n)
        x, y, z = np.int64(listed[1][at]), np.int64(listed[2][at]), np.int64(listed[3][at])
        axis = listed[0][at] & 3
        dz, dy, dx = int(axis == 2), int(axis == 1), int(axis == 0)
        held[LOW + i] = value_at(data, z, y, x)
        held[HIGH + i] = value_at(data, z + dz, y + dy, x + dx)
        two[:] = 0.0
        if operator >= 0:
            slopes(data, field.valid, z, y, x, operator, two[0])
            slopes(data, field.valid, z + dz, y + dy, x + dx, operator, two[1])
        for k in range(3):
            to = SLOPE + np.uint64(k) * _SPAN + i
            held[to], held[to + THREE * _SPAN] = two[0, (axis + k) % 3], two[1, (axis + k) % 3]


@bare
def _put_points(
    listed: Any, first: int, count: int, to: Any, held: Any, level: float, p: Any, points: Any
) -> None:
    """Write the held points, and hold how far along their edges they are."""
    keys, xs, ys, zs = listed
    for k in range(count):
        i, j = np.uint64(k), np.uint64(first + k)
        axis, low = keys[j] & 3, held[LOW + i]
        t = (level - low) / (held[HIGH + i] - low)
        held[SHARE + i] = t
        x = xs[j] + (t if axis == 0 else 0.0)
        y = ys[j] + (t if axis == 1 else 0.0)
        z = zs[j] + (t if axis == 2 else 0.0)
        points[to + THREE * i] = p[0] * x + p[1] * y + p[2] * z + p[3]
        points[to + THREE * i + ONE] = p[4] * x + p[5] * y + p[6] * z + p[7]
        points[to + THREE * i + TWO] = p[8] * x + p[9] * y + p[10] * z + p[11]


@bare
def _put_normals(
    keys: Any, first: int, count: int, to: Any, held: Any, g: Any, normals: Any
) -> None:
    """Unit vectors against the gradient between the ends; where there is none, down the edge."""
    odd = 0
    for k in range(count):
        i, axis = np.uint64(k), keys[np.uint64(first + k)] & 3
        t, j = held[SHARE + i], SLOPE + i
        a, b, c = held[j], held[j + _SPAN], held[j + TWO * _SPAN]
        j += THREE * _SPAN
        a += t * (held[j] - a)
        b += t * (held[j + _SPAN] - b)
        c += t * (held[j + TWO * _SPAN] - c)
        x = a if axis == 0 else (c if axis == 1 else b)
        y = b if axis == 0 else (a if axis == 1 else c)
        z = c if axis == 0 else (b if axis == 1 else a)
        u = g[0] * x + g[1] * y + g[2] * z
        v = g[3] * x + g[4] * y + g[5] * z
        w = g[6] * x + g[7] * y + g[8] * z
        square = u * u + v * v + w * w
        scale = -1 / np.sqrt(square)
        odd += not (0 < square < np.inf)
        normals[to + THREE * i] = u * scale
        normals[to + THREE * i + ONE] = v * scale
        normals[to + THREE * i + TWO] = w * scale
    if odd:
        _put_odd_normals(keys, first, count, to, held, g, normals)


@bare
def _put_odd_normals(
    keys: Any, first: int, count: int, to: Any, held: Any, g: Any, normals: Any
) -> None:
    for k in range(count):
        i = np.uint64(k)
        at, axis = to + THREE * i, keys[first + k] & 3
        x, y, z = normals[at], normals[at + ONE], normals[at + TWO]
        if 0.5 < x * x + y * y + z * z < 2:
            continue
        s = 1.0 if held[LOW + i] > held[HIGH + i] else -1.0
        u, v, w = s * g[axis], s * g[3 + axis], s * g[6 + axis]
        scale = 1 / np.sqrt(u * u + v * v + w * w)
        normals[at], normals[at + ONE], normals[at + TWO] = u * scale, v * scale, w * scale
