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

from volviz.isosurface.kernel import inline, kernel, popcount

ONE = np.uint64(1)
LAST = np.uint64(63)
_PACK = np.uint64(0x0102040810204080)  # gathers the lowest bits of 8 bytes in the highest byte
_TOP = np.uint64(56)


@inline
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
    data: Any, threshold: Any, mask: Any, first: int, last: int, signs: Any
) -> int:
    """The same, only in words that a cell of the mask needs."""
    words, width = signs.shape[2] - 1, data.shape[2]
    flags = np.zeros(64, dtype=np.uint8)
    bytes8 = flags.view(np.uint64)
    bad = 0
    for z in range(first, last):
        for y in range(data.shape[1]):
            carry = np.uint64(0)
            for w in range(words):
                cells = _rows_around(mask, z, y, w)
                if cells | carry:
                    n = min(64, width - 64 * w)
                    row = data[z, y, 64 * w : 64 * w + n]
                    odd = 0
                    for x in range(n):
                        flags[x] = row[x] >= threshold
                    for x in range(n, 64):
                        flags[x] = 0
                    for x in range(n):
                        odd += (row[x] - row[x]) != 0
                    bad += odd
                    _packed(flags, bytes8, signs[z, y, w : w + 1])
                carry = cells >> LAST
    return bad


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
    """Clear (or, if none were given, set) the cells by their samples; returns how many are left out."""
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


@inline
def cells_in_word(width: int, w: int) -> Any:
    """Bits of the cells that word w of a row of `width` samples has."""
    n = width - 1 - 64 * w
    if n >= 64:
        return ~np.uint64(0)
    return (ONE << np.uint64(max(n, 0))) - ONE


@inline
def _rows_around(mask: Any, z: int, y: int, w: int) -> Any:
    """Cells that have the x-edges of a row of samples."""
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


@inline
def shifted(signs: Any, z: int, y: int, w: int) -> Any:
    """The word of each sample's next one in x."""
    return signs[z, y, w] >> ONE | signs[z, y, w + 1] << LAST


@inline
def x_edges(signs: Any, mask: Any, width: int, z: int, y: int, w: int) -> Any:
    """Bits of the crossed edges from samples of a word to their next in x."""
    found = (signs[z, y, w] ^ shifted(signs, z, y, w)) & cells_in_word(width, w)
    return found & _rows_around(mask, z, y, w) if mask.size else found


@inline
def y_edges(signs: Any, mask: Any, z: int, y: int, w: int) -> Any:
    """Bits of the crossed edges from samples of a word to their next in y."""
    if y + 1 >= signs.shape[1]:
        return np.uint64(0)
    found = signs[z, y, w] ^ signs[z, y + 1, w]
    if mask.size and found:
        near = _beside(mask, z, y, w)
        if z > 0:
            near |= _beside(mask, z - 1, y, w)
        found &= near
    return found


@inline
def z_edges(signs: Any, mask: Any, z: int, y: int, w: int) -> Any:
    """Bits of the crossed edges from samples of a word to their next in z."""
    if z + 1 >= signs.shape[0]:
        return np.uint64(0)
    found = signs[z, y, w] ^ signs[z + 1, y, w]
    if mask.size and found:
        near = _beside(mask, z, y, w)
        if y > 0:
            near |= _beside(mask, z, y - 1, w)
        found &= near
    return found
