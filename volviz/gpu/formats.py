"""Texel formats: moderngl's names, the numpy dtypes they are filled from, sizes and slabs."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volviz.errors import LimitError

SLAB_BYTES = 4 << 20
"""So little that a window that uploads between two frames can stop when its time is spent."""

# "f", "nu" and "ni" texels read as floats in shaders, "u" and "i" as integers. "nu" is stored as a
# fraction of the type's range; int16 goes biased into "nu2" (moderngl would store "ni2" unsigned
# and lose the negatives).
TEXEL_DTYPES: dict[str, np.dtype[Any]] = {
    "f1": np.dtype(np.uint8),
    "f2": np.dtype(np.float16),
    "f4": np.dtype(np.float32),
    "nu1": np.dtype(np.uint8),
    "nu2": np.dtype(np.uint16),
    "u1": np.dtype(np.uint8),
    "u2": np.dtype(np.uint16),
    "u4": np.dtype(np.uint32),
    "i1": np.dtype(np.int8),
    "i2": np.dtype(np.int16),
    "i4": np.dtype(np.int32),
}


def texture_bytes(
    size: tuple[int, ...], components: int, dtype: str, *, linear: bool, limit: int, owner: str
) -> int:
    """Bytes of a texture, after checking that it can be made.

    size: texels per axis; limit: the most per side; owner: the renderer's name for the message.
    Raises LimitError over the limit, ValueError for a format that does not exist.
    """
    if dtype not in TEXEL_DTYPES or components not in (1, 2, 3, 4):
        raise ValueError(f"no texture format for {components} components of '{dtype}'")
    if linear and dtype[0] in "ui":
        raise ValueError(f"integer texels ('{dtype}') cannot be filtered linearly")
    if min(size) < 1:
        raise ValueError(f"a texture needs at least one texel per side, not {times(size)}")
    if max(size) > limit:
        raise LimitError(
            f"a texture of {times(size)} is larger than the limit of {owner}, "
            f"{limit} texels per side",
            fix="reduce the volume, or choose another device with --backend",
        )
    return math.prod(size) * components * TEXEL_DTYPES[dtype].itemsize


def expect(array: NDArray[Any], size: tuple[int, ...], components: int, dtype: str) -> None:
    """Raise ValueError unless `array` fills a texture of `size` (x first) in that format.

    The axes are the texture's, reversed, and the components last; with one component that axis
    may be left out.
    """
    needed = TEXEL_DTYPES[dtype]
    if array.dtype != needed:
        raise ValueError(f"'{dtype}' texels are filled from {needed}, not {array.dtype}")
    shape = size[::-1] if components == 1 and array.ndim == len(size) else (*size[::-1], components)
    if array.shape != shape:
        raise ValueError(f"the texture needs an array of shape {shape}, not {array.shape}")


def slabs(array: NDArray[Any]) -> Iterator[tuple[int, int, int, int]]:
    """(z, z_end, y, y_end) of pieces of at most SLAB_BYTES: whole slices, else rows of one."""
    nz, ny = array.shape[:2]
    row = math.prod(array.shape[2:]) * array.itemsize
    if row * ny <= SLAB_BYTES:
        step = max(1, SLAB_BYTES // (row * ny))
        yield from ((z, min(z + step, nz), 0, ny) for z in range(0, nz, step))
        return
    step = max(1, SLAB_BYTES // row)
    for z in range(nz):
        yield from ((z, z + 1, y, min(y + step, ny)) for y in range(0, ny, step))


def times(size: tuple[int, ...]) -> str:
    """(3, 4, 5) as "3×4×5"."""
    return "×".join(map(str, size))
