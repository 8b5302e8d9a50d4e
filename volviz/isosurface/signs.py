"""Which samples are inside, one bit each, and what follows from 64 of them at a time.

`signs` is uint64[z, y, words + 1]: bit i of word w says whether sample 64 w + i of the row is at
least the isovalue; the last word is 0, so that the next sample of any is at hand. `mask` has the
same shape and says which cells may be used: those that the caller gave, without those that have a
sample that is not valid. Where all cells may be, it has no words at all. A crossed edge is one
whose ends differ and that bounds a cell that may be used.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from volviz.isosurface.kernel import hot, inline, kernel, popcount

ONE = np.uint64(1)
LAST = np.uint64(63)
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
def pack_signs(data: Any, threshold: Any, first: int, last: int, signs: Any) -> int:
    """Signs of the layers first..last; returns how many samples there are NaN or infinite."""
    width = data.shape[2]
    flags = np.zeros(64 * (signs.shape[2] - 1), dtype=np.uint8)
    bytes8 = flags.view(np.uint64)
    bad = 0
    for z in range(first, last):
        for y in range(data.shape[1]):
            row = data[z, y]
            odd = 0
            for x in range(width):
                flags[x] = row[x] >= threshold
            for x in range(width):
                odd += (row[x] - row[x]) != 0
            bad += odd
            _packed(flags, bytes8, signs[z, y])
    return bad


@kernel
def pack_signs_near(
    data: Any, threshold: Any, needed: Any, first: int, last: int, signs: Any
) -> None:
    """The same, reading only the needed words (bool[z, y, words]).

    The others have no crossed edge, so they go on as the word before them ends.
    """
    words, width = signs.shape[2] - 1, data.shape[2]
    flags = np.zeros(64, dtype=np.uint8)
    bytes8 = flags.view(np.uint64)
    for z in range(first, last):
        for y in range(data.shape[1]):
            before = data[z, y, 0] >= threshold
            for w in range(words):
                n = min(64, width - 64 * w)
                if needed[z, y, w]:
                    row = data[z, y, 64 * w : 64 * w + n]
                    for x in range(n):
                        flags[x] = row[x] >= threshold
                    for x in range(n, 64):
                        flags[x] = 0
                    _packed(flags, bytes8, signs[z, y, w : w + 1])
                    before = flags[n - 1] != 0
                elif before:
                    signs[z, y, w] = ~np.uint64(0) >> np.uint64(64 - n)


@kernel
def need_words(ids: Any, cells_x: int, cells_y: int, needed: Any) -> None:
    """Mark the words that have the corners of cells, by their sorted ids."""
    end, start, z, y, done = -1, 0, 0, 0, -1
    for id in ids:
        if id >= end:
            row = id // cells_x
            start, end, done = row * cells_x, (row + 1) * cells_x, -1
            z, y = row // cells_y, row % cells_y
        for w in range(max((id - start) >> 6, done + 1), ((id - start + 1) >> 6) + 1):
            needed[z, y, w] = needed[z, y + 1, w] = True
            needed[z + 1, y, w] = needed[z + 1, y + 1, w] = True
            done = w


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
    n = width - 1 - 64 * w
    if n >= 64:
        return ~np.uint64(0)
    return (ONE << np.uint64(max(n, 0))) - ONE


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
def load(flat: Any, rows: Any, w: Any, corners: Any) -> bool:
    """The words of the corners x + 2y + 4z of a row of cells; False if they are all alike."""
    some, every = np.uint64(0), ~np.uint64(0)
    for k in range(4):
        at = rows[k] + w
        word = flat[at]
        after = word >> ONE | flat[at + ONE] << LAST
        corners[2 * k], corners[2 * k + 1] = word, after
        some, every = some | word | after, every & word & after
    return some != np.uint64(0) and every != ~np.uint64(0)


@hot
def own_edges(mask: Any, corners: Any, cells: Any, z: int, y: int, w: int) -> Any:
    """Bits of the crossed edges from the samples of a word to their next in x, y and z."""
    a = corners[0]
    on_x, on_y, on_z = (a ^ corners[1]) & cells, a ^ corners[2], a ^ corners[4]
    if mask.size:
        on_x &= _near_x(mask, z, y, w)
        on_y &= _near_y(mask, z, y, w)
        on_z &= _near_z(mask, z, y, w)
    return on_x, on_y, on_z


@hot
def edges_around(mask: Any, corners: Any, cells: Any, at: Any, words: Any) -> None:
    """Fill the eight words of crossed edges round a row of cells: four in x, two in y, two in z."""
    z, y, w = at
    for k in range(4):
        words[k] = (corners[2 * k] ^ corners[2 * k + 1]) & cells
    words[4], words[5] = corners[0] ^ corners[2], corners[4] ^ corners[6]
    words[6], words[7] = corners[0] ^ corners[4], corners[2] ^ corners[6]
    if mask.size:
        for k in range(4):
            words[k] &= _near_x(mask, z + (k >> 1), y + (k & 1), w)
        for k in range(2):
            words[4 + k] &= _near_y(mask, z + k, y, w)
            words[6 + k] &= _near_z(mask, z, y + k, w)


@hot
def active(mask: Any, corners: Any, cells: Any, z: int, y: int, w: int) -> Any:
    """Bits of the cells whose corners are not all on one side, and that may be used."""
    some, every = np.uint64(0), ~np.uint64(0)
    for k in range(8):
        some, every = some | corners[k], every & corners[k]
    return some & ~every & (mask[z, y, w] if mask.size else cells)


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
