"""Which samples are inside, one bit each, and what follows from 64 of them at a time.

`signs` is uint64[z, y, words + 1]: bit i of word w says whether sample 64 w + i of the row is at
least the isovalue; the last word is 0, so that the next sample of any is at hand. `mask` has the
same shape and says which cells may be used: those that the caller gave, without those that have a
sample that is not valid. Where all cells may be, it has no words at all. A crossed edge is one
whose ends differ and that bounds a cell that may be used.

`live` is uint64[z, y, parts]: bit w of a row says whether word w of it may have a cell with
different corners; 64 words are a part. Only of those words, and of the first bit of the ones
after them, something is made. Bits that a volume has no words for are 0.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from volviz.isosurface.kernel import (
    at_least,
    finite,
    hot,
    inline,
    kernel,
    lowest_bit,
    popcount,
)
from volviz.isosurface.turns import take

ONE = np.uint64(1)
LAST = np.uint64(63)
SIXTY_FOUR = np.uint64(64)
_PACK = np.uint64(0x0102040810204080)  # gathers the lowest bits of 8 bytes in the highest byte
_TOP = np.uint64(56)


@hot
def _packed(flags: Any, bytes8: Any, out: Any) -> None:
    """Bits of uint8 flags (0 or 1; `bytes8` is the same memory as uint64) into uint64 words."""
    for w in range(flags.size // 64):
        word = np.uint64(0)
        for k in range(8):
            word |= ((bytes8[8 * w + k] * _PACK) >> _TOP) << np.uint64(8 * k)
        out[w] = word


@kernel
def pack_signs(data: Any, limit: Any, turns: Any, most: int, signs: Any) -> bool:
    """Signs of all samples, in turns of rows; returns whether one is NaN or infinite."""
    nx, words = data.shape[2], signs.shape[2]
    flat, out = data.ravel(), signs.ravel()
    good, odd = ~np.uint64(0), False
    for _ in range(most):
        first, last = take(turns)
        if first < 0:
            break
        at, to = np.uint64(first * nx), np.uint64(first * words)
        for _ in range(first, last):
            for _ in range(nx >> 6):
                out[to] = at_least(flat, at, limit)
                good &= finite(flat, at)
                at, to = at + SIXTY_FOUR, to + ONE
            if nx & 63:
                out[to] = _few_at_least(flat, at, nx & 63, limit)
                for k in range(nx & 63):
                    value = flat[at + np.uint64(k)]
                    odd |= (value - value) != 0
                at, to = at + np.uint64(nx & 63), to + ONE
            out[to] = np.uint64(0)
            to += ONE
    return odd or good != ~np.uint64(0)


@kernel
def pack_near(
    data: Any, limit: Any, live: Any, rows: Any, turns: Any, most: int, signs: Any
) -> None:
    """The signs that rows of cells need whose live words are given, no others.

    rows: of `live_rows`.
    """
    (_, ny, nx), words = data.shape, signs.shape[2]
    flat, out, marks, parts = data.ravel(), signs.ravel(), live.ravel(), np.uint64(live.shape[2])
    for _ in range(most):
        first, last = take(turns)
        if first < 0:
            return
        n, row = _first_from(rows, first - ny - 1), first
        for _ in range(first, last):
            while n < rows.size and np.int64(rows[np.uint64(n)]) < row - ny - 1:
                n += 1
            row = max(row, np.int64(rows[np.uint64(n)]) if n < rows.size else last)
            if row >= last:
                break
            begin, to = np.uint64(row * nx), np.uint64(row * words)
            for part in range(live.shape[2]):
                left = _needed(marks, parts, row, ny, part)
                while left:
                    w = 64 * part + lowest_bit(left)
                    left &= left - ONE
                    at, count = begin + np.uint64(64 * w), nx - 64 * w
                    if count >= 64:
                        out[to + np.uint64(w)] = at_least(flat, at, limit)
                    else:
                        out[to + np.uint64(w)] = _few_at_least(flat, at, count, limit)
                    # of the next word a cell needs the first bit only
                    ahead = count > 64 and flat[at + SIXTY_FOUR] >= limit
                    out[to + np.uint64(w + 1)] = np.uint64(ahead)
            row += 1


@hot
def _first_from(rows: Any, least: int) -> Any:
    """Where the first number stands that is at least so great; rows: in order."""
    low, high = np.int64(0), np.int64(rows.size)
    while low < high:
        middle = (low + high) >> 1
        if np.int64(rows[np.uint64(middle)]) < least:
            low = middle + 1
        else:
            high = middle
    return low


@hot
def _few_at_least(flat: Any, at: Any, count: int, limit: Any) -> Any:
    """The signs of less than 64 samples."""
    word = np.uint64(0)
    for k in range(count):
        word |= np.uint64(flat[at + np.uint64(k)] >= limit) << np.uint64(k)
    return word


@hot
def _needed(flat: Any, parts: Any, row: int, ny: int, part: int) -> Any:
    """The live words (flat, so many parts a row) of the four rows of cells that a row bounds.

    Of a first row in y, also those of the last one of the layer below: some words too many.
    """
    at = np.uint64(row) * parts + np.uint64(part)
    found = flat[at]
    if row > ny:
        layer = np.uint64(ny) * parts
        return found | flat[at - parts] | flat[at - layer] | flat[at - layer - parts]
    if row > 0:
        found |= flat[at - parts]
    if row == ny:
        found |= flat[at - np.uint64(ny) * parts]
    return found


@kernel
def live_rows(live: Any, rows: Any) -> int:
    """List the rows with a live word, in order; how many there are."""
    flat, parts, n = live.ravel(), live.shape[2], 0
    for row in range(live.shape[0] * live.shape[1]):
        some = flat[np.uint64(row * parts)]
        for part in range(1, parts):
            some |= flat[np.uint64(row * parts + part)]
        rows[np.uint64(n)] = row
        n += some != 0
    return n


@kernel
def pack_valid(data: Any, padding: Any, padded: bool, first: int, last: int, valid: Any) -> None:
    """Bits of the samples that are finite and, if `padded`, not the padding value."""
    width = data.shape[2]
    flags = np.zeros(64 * (valid.shape[2] - 1), dtype=np.uint8)
    bytes8 = flags.view(np.uint64)
    for z in range(first, last):
        for y in range(data.shape[1]):
            row = data[z, y]
            for x in range(width):
                flags[x] = (row[x] - row[x]) == 0 and not (padded and row[x] == padding)
            _packed(flags, bytes8, valid[z, y])


@kernel
def live_near(ids: Any, cells_x: int, cells_y: int, live: Any) -> None:
    """Mark the words that edges of cells may be in, by the cells' sorted ids."""
    end, start, z, y, done = -1, 0, 0, 0, -1
    for id in ids:
        if id >= end:
            row = id // cells_x
            start, end, done = row * cells_x, (row + 1) * cells_x, -1
            z, y = row // cells_y, row % cells_y
        for w in range(max((id - start) >> 6, done + 1), ((id - start + 1) >> 6) + 1):
            bit = ONE << np.uint64(w & 63)
            for k in range(4):
                live[z + (k >> 1), y + (k & 1), w >> 6] |= bit
            done = w


@kernel
def mark_cells(ids: Any, cells_x: int, cells_y: int, mask: Any) -> None:
    """Set the bits of cells by their sorted ids."""
    end, start, z, y = -1, 0, 0, 0
    for id in ids:
        if id >= end:
            row = id // cells_x
            start, end = row * cells_x, (row + 1) * cells_x
            z, y = row // cells_y, row % cells_y
        x = id - start
        mask[z, y, x >> 6] |= ONE << np.uint64(x & 63)


@kernel
def mask_valid(valid: Any, width: int, given: bool, first: int, last: int, mask: Any) -> int:
    """Clear (or, if none were given, set) cells by their samples; returns how many are left out."""
    left_out = 0
    for z in range(first, last):
        for y in range(valid.shape[1] - 1):
            for w in range(valid.shape[2] - 1):
                a = valid[z, y, w] & valid[z, y + 1, w]
                b = valid[z + 1, y, w] & valid[z + 1, y + 1, w]
                c = valid[z, y, w + 1] & valid[z, y + 1, w + 1]
                d = valid[z + 1, y, w + 1] & valid[z + 1, y + 1, w + 1]
                good = a & b & ((a & b) >> ONE | (c & d) << LAST)
                before = mask[z, y, w] if given else cells_in_word(width, w)
                mask[z, y, w] = before & good
                left_out += popcount(before & ~good)
    return left_out


@hot
def cells_in_word(width: int, w: int) -> Any:
    """Bits of the cells that word w of a row of `width` samples has."""
    return first_bits(width - 1 - 64 * w)


@hot
def first_bits(count: int) -> Any:
    """A word with so many of its lowest bits set, from 0 to all 64."""
    if count >= 64:
        return ~np.uint64(0)
    return (ONE << np.uint64(max(count, 0))) - ONE


@inline
def _near_x(mask: Any, z: int, y: int, w: int) -> Any:
    """Samples of a row whose edges to their next in x bound a cell of the mask."""
    found = mask[z, y, w]
    if y > 0:
        found |= mask[z, y - 1, w]
    if z > 0:
        found |= mask[z - 1, y, w]
        if y > 0:
            found |= mask[z - 1, y - 1, w]
    return found


@inline
def _beside(mask: Any, z: int, y: int, w: int) -> Any:
    """Samples of a row of cells: a cell's own and its next."""
    found = mask[z, y, w] | mask[z, y, w] << ONE
    if w > 0:
        found |= mask[z, y, w - 1] >> LAST
    return found


@hot
def place_of(row: int, ny: int) -> Any:
    """(z, y) of a row; unsigned, which spares the checks for negative ones."""
    z = np.int64(np.uint64(row) // np.uint64(ny))
    return z, row - z * ny


@hot
def rows_of(shape: Any, z: int, y: int) -> Any:
    """Where four rows begin in the flat words: a row's own, its next in y, in z, in both.

    At the border a row is its own next, so that no edge between them is crossed.
    """
    ny, words = np.uint64(shape[1]), np.uint64(shape[2])
    own = (np.uint64(z) * ny + np.uint64(y)) * words
    in_y = words if y + 1 < shape[1] else np.uint64(0)
    in_z = ny * words if z + 1 < shape[0] else np.uint64(0)
    return own, own + in_y, own + in_z, own + in_y + in_z


@hot
def load(flat: Any, rows: Any, w: Any) -> Any:
    """Eight words of the corners of a row of cells: of its four rows, of the next samples there.

    Corner x + 2y + 4z is the word y + 2z + 4x.
    """
    p, q, r, s = rows[0] + w, rows[1] + w, rows[2] + w, rows[3] + w
    a, b, c, d = flat[p], flat[q], flat[r], flat[s]
    i, j, k, m = flat[p + ONE], flat[q + ONE], flat[r + ONE], flat[s + ONE]
    e, f = a >> ONE | i << LAST, b >> ONE | j << LAST
    g, h = c >> ONE | k << LAST, d >> ONE | m << LAST
    return a, b, c, d, e, f, g, h


@hot
def mixed(words: Any) -> Any:
    """Bits of the cells whose corners are not all on one side; of words as `load` gives them."""
    a, b, c, d, e, f, g, h = words
    return (a | b | c | d | e | f | g | h) & ~(a & b & c & d & e & f & g & h)


@hot
def doubtful(words: Any) -> Any:
    """Bits of the cells whose corners can be joined in several ways (`Cases.ambiguous`).

    On a face, corners that stand diagonally across are equal and differ from the other two; or
    the two ends of a diagonal of the cell differ from all others.
    """
    a, b, c, d, e, f, g, h = words
    found = (a ^ b) & ~(a ^ d | b ^ c) | (e ^ f) & ~(e ^ h | f ^ g)
    found |= (a ^ e) & ~(a ^ g | e ^ c) | (b ^ d) & ~(b ^ h | d ^ f)
    found |= (a ^ b) & ~(a ^ f | b ^ e) | (c ^ g) & ~(c ^ h | g ^ d)
    return found | (a ^ b ^ c ^ d) & ~(a ^ h | b ^ g | c ^ f | d ^ e)


@hot
def crossings(words: Any, cells: Any) -> Any:
    """How many edges of these cells are crossed; those of two cells count twice."""
    a, b, c, d, e, f, g, h = words
    on_x = popcount((a ^ e) & cells) + popcount((b ^ f) & cells)
    on_x += popcount((c ^ g) & cells) + popcount((d ^ h) & cells)
    on_y = popcount((a ^ b) & cells) + popcount((c ^ d) & cells)
    on_y += popcount((e ^ f) & cells) + popcount((g ^ h) & cells)
    on_z = popcount((a ^ c) & cells) + popcount((b ^ d) & cells)
    return on_x + on_y + on_z + popcount((e ^ g) & cells) + popcount((f ^ h) & cells)


@hot
def own_edges(mask: Any, words: Any, cells: Any, z: int, y: int, w: int) -> Any:
    """Bits of the crossed edges from the samples of a word to their next in x, y and z."""
    a = words[0]
    on_x, on_y, on_z = (a ^ words[4]) & cells, a ^ words[1], a ^ words[2]
    if mask.size:
        on_x &= _near_x(mask, z, y, w)
        on_y &= _near_y(mask, z, y, w)
        on_z &= _near_z(mask, z, y, w)
    return on_x, on_y, on_z


@inline
def near_edges(mask: Any, axis: int, z: int, y: int, w: int) -> Any:
    """Bits of the samples of a word whose edges along an axis (0 is x) bound a cell of the mask."""
    if axis == 0:
        return _near_x(mask, z, y, w)
    return _near_y(mask, z, y, w) if axis == 1 else _near_z(mask, z, y, w)


@hot
def edges_around(mask: Any, words: Any, cells: Any, at: Any, edges: Any) -> None:
    """Fill the eight words of crossed edges round a row of cells: four in x, two in y, two in z."""
    z, y, w = at
    a, b, c, d, e, f, g, h = words
    edges[0], edges[1], edges[2], edges[3] = a ^ e, b ^ f, c ^ g, d ^ h
    edges[4], edges[5], edges[6], edges[7] = a ^ b, c ^ d, a ^ c, b ^ d
    for k in range(4):
        edges[k] &= cells & _near_x(mask, z + (k >> 1), y + (k & 1), w)
    for k in range(2):
        edges[4 + k] &= _near_y(mask, z + k, y, w)
        edges[6 + k] &= _near_z(mask, z, y + k, w)


@inline
def _near_y(mask: Any, z: int, y: int, w: int) -> Any:
    """Samples of a row whose edges to their next in y bound a cell of the mask."""
    found = _beside(mask, z, y, w)
    return found | _beside(mask, z - 1, y, w) if z > 0 else found


@inline
def _near_z(mask: Any, z: int, y: int, w: int) -> Any:
    """The same of edges to their next in z."""
    found = _beside(mask, z, y, w)
    return found | _beside(mask, z, y - 1, w) if y > 0 else found
