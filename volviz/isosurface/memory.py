"""Large arrays on large pages: most of what touching fresh memory costs is its thousands of pages.

A page of 4 KiB costs a microsecond or two when it is first touched and when it is given back, so
that the arrays of a mesh took as long as the mesh. On Linux a block can ask for pages of 2 MiB;
elsewhere, and where it is small, numpy's own memory does. A block that nobody uses any more waits
for the next one who wants as much, so that a slider that is dragged touches no fresh pages.
"""

from __future__ import annotations

import mmap
import weakref
from collections.abc import Sequence
from math import prod
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

_LARGE = 1 << 21
_LINE = 64
_KEPT = 1 << 26
"""Bytes of the largest block that waits; one of arrays does, and one of scratch."""
Wanted = tuple[Sequence[int], DTypeLike]


def empty(*wanted: Wanted) -> list[NDArray[Any]]:
    """Arrays of these (shape, dtype), not filled, one after the other in a block of their own.

    The block lives as long as any of them.
    """
    places = _places(wanted)
    block = _taken(_idle, places[-1])
    if block is None:
        return _cut(None, wanted, places)
    view = np.frombuffer(block.data, np.uint8)  # goes with the last of the arrays
    weakref.finalize(view, _keep, _idle, block).atexit = False
    return _cut(view, wanted, places)


class Scratch:
    """Memory for a while: `arrays` as `empty` gives them, from the last one that was given back."""

    def __init__(self, *wanted: Wanted) -> None:
        places = _places(wanted)
        self._block = _taken(_spare, places[-1])
        self.arrays = _cut(self._block, wanted, places)

    def give_back(self) -> None:
        """Say that nobody uses the arrays any more; what a cancelled thread may write is kept."""
        if self._block is not None:
            _keep(_spare, self._block)
            self._block = None


_spare: list[NDArray[np.uint8]] = []
_idle: list[NDArray[np.uint8]] = []


def _taken(waiting: list[NDArray[np.uint8]], size: int) -> NDArray[np.uint8] | None:
    """One that waits, if it has the size and not much more, or a new one."""
    try:
        block = waiting.pop()
    except IndexError:
        return _block(size)
    return block if size <= block.size <= 2 * max(size, _LARGE) else _block(size)


def _keep(waiting: list[NDArray[np.uint8]], block: NDArray[np.uint8]) -> None:
    if block.size <= _KEPT:
        waiting.append(block)
        del waiting[:-1]


def _places(wanted: tuple[Wanted, ...]) -> list[int]:
    """Where the arrays begin in a block, and how large it is."""
    places = [0]
    for shape, kind in wanted:
        size = prod(shape) * np.dtype(kind).itemsize
        places.append(places[-1] + -(-size // _LINE) * _LINE)
    return places


def _cut(
    block: NDArray[np.uint8] | None, wanted: tuple[Wanted, ...], places: list[int]
) -> list[NDArray[Any]]:
    if block is None:
        return [np.empty(shape, kind) for shape, kind in wanted]
    return [
        np.ndarray(shape, kind, block, at)
        for (shape, kind), at in zip(wanted, places, strict=False)
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
