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
Wanted = tuple[Sequence[int], DTypeLike]


def empty(*wanted: Wanted) -> list[NDArray[Any]]:
    """Arrays of these (shape, dtype), not filled, one after the other in a block of their own.

    The block lives as long as any of them.
    """
    return _cut(_block(int(_places(wanted)[-1])), wanted)


class Scratch:
    """Memory for a while: `arrays` as `empty` gives them, from the last one that was given back.

    So a slider that is dragged touches no fresh pages but those of its meshes. One block is kept.
    """

    def __init__(self, *wanted: Wanted) -> None:
        size = _places(wanted)[-1]
        try:
            block = _spare.pop()
        except IndexError:
            block = None
        if block is None or not size <= block.size <= 2 * max(size, _LARGE):
            block = _block(int(size))
        self._block = block
        self.arrays = _cut(block, wanted)

    def give_back(self) -> None:
        """Say that nobody uses the arrays any more; what a cancelled thread may write is kept."""
        if self._block is not None and self._block.size <= _KEPT:
            _spare.append(self._block)
            del _spare[:-1]
            self._block = None


_KEPT = 1 << 26
_spare: list[NDArray[np.uint8]] = []


def _places(wanted: tuple[Wanted, ...]) -> NDArray[np.int64]:
    """Where the arrays begin in a block, and how large it is."""
    sizes = [int(np.prod(shape)) * np.dtype(kind).itemsize for shape, kind in wanted]
    return np.cumsum([0, *(-(-size // _LINE) * _LINE for size in sizes)], dtype=np.int64)


def _cut(block: NDArray[np.uint8] | None, wanted: tuple[Wanted, ...]) -> list[NDArray[Any]]:
    if block is None:
        return [np.empty(shape, kind) for shape, kind in wanted]
    made = []
    for (shape, kind), at in zip(wanted, _places(wanted), strict=False):
        size = int(np.prod(shape)) * np.dtype(kind).itemsize
        made.append(block[at : at + size].view(kind).reshape(shape))
    return made


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
