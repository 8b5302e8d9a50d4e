"""Large arrays on large pages: most of what touching fresh memory costs is its thousands of pages.

A page of 4 KiB costs a microsecond or two when it is first touched and when it is given back, so
that the arrays of a mesh took as long as the mesh. On Linux a block can ask for pages of 2 MiB;
elsewhere, and where it is small, numpy's own memory does.
"""

from __future__ import annotations

import mmap
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

_LARGE = 1 << 21
_LINE = 64


def empty(*wanted: tuple[Sequence[int], DTypeLike]) -> list[NDArray[Any]]:
    """Arrays of these (shape, dtype), not filled, one after the other in a block of their own.

    The block lives as long as any of them.
    """
    sizes = [int(np.prod(shape)) * np.dtype(kind).itemsize for shape, kind in wanted]
    places = np.cumsum([0, *(-(-size // _LINE) * _LINE for size in sizes)])
    block = _block(int(places[-1]))
    if block is None:
        return [np.empty(shape, kind) for shape, kind in wanted]
    return [
        block[at : at + size].view(kind).reshape(shape)
        for (shape, kind), size, at in zip(wanted, sizes, places, strict=False)
    ]


def _block(size: int) -> NDArray[np.uint8] | None:
    """Bytes from the start of a large page; None where that is of no use or not to be had."""
    if size < _LARGE // 2 or not hasattr(mmap, "MADV_HUGEPAGE"):
        return None
    try:
        found = mmap.mmap(-1, size + _LARGE, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
        found.madvise(mmap.MADV_HUGEPAGE)
    except OSError:  # no such pages here; or no memory, which numpy then says
        return None
    block = np.frombuffer(found, dtype=np.uint8)
    start = -block.ctypes.data % _LARGE
    return block[start : start + size]
