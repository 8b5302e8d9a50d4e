"""Memory that is there before a software rasteriser asks for it.

Mesa takes the memory of a texture from malloc and clears it. Fresh from the system every page of
it is a fault: 512³ samples of 16 bits took the thread that asks 140 ms of processor time (4.5 ms
where the pages are there already), and a context that shares its textures waits just as long for
another thread that asks. So a worker touches as much of the heap, and malloc gets it back right
before the driver asks for it. Only glibc can be told so; elsewhere nothing is done.
"""

from __future__ import annotations

import ctypes
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache

WORTH = 32 << 20
"""Bytes of a texture below which its pages are no matter."""
_PIECE = 16 << 20
_SLACK = 1 << 20
_HUGE = 2 << 20
_TRIM_THRESHOLD, _MMAP_MAX = -1, -4  # parameters of mallopt
_NEVER, _LIKE_DYNAMIC, _DEFAULT_MAPS = 2**31 - 1, 64 << 20, 65536
_MADV_HUGEPAGE = 14


class Memory:
    """So many bytes on their way; `done` tells the worker's end. Only the main thread calls it.

    Raises MemoryError where the system has not that much.
    """

    def __init__(self, nbytes: int, done: Callable[[], None] = lambda: None) -> None:
        libc = _libc()
        assert libc is not None, "ask `helps` first"
        self._libc, self._size = libc, nbytes + _SLACK
        self._stopped = threading.Event()
        libc.mallopt(_MMAP_MAX, 0)  # else it would be a mapping of its own, and gone with `free`
        try:
            self._address: int | None = libc.malloc(self._size)
        finally:
            libc.mallopt(_MMAP_MAX, _DEFAULT_MAPS)
        if self._address is None:
            raise MemoryError
        self._worker = threading.Thread(
            target=self._touch, args=(self._address, done), name="volviz memory", daemon=True
        )
        self._worker.start()

    @property
    def ready(self) -> bool:
        """True once all of it is there."""
        return not self._worker.is_alive()

    @contextmanager
    def given(self) -> Iterator[None]:
        """Within, the next call for as much memory in this thread gets this memory."""
        self._worker.join()
        self._libc.mallopt(_TRIM_THRESHOLD, _NEVER)
        self._libc.mallopt(_MMAP_MAX, 0)
        try:
            self.release()
            yield
        finally:
            self._libc.mallopt(_MMAP_MAX, _DEFAULT_MAPS)
            self._libc.mallopt(_TRIM_THRESHOLD, _LIKE_DYNAMIC)

    def release(self) -> None:
        """Give it back. Twice does no harm."""
        self._stopped.set()
        self._worker.join()
        if self._address is not None:
            self._libc.free(self._address)
            self._address = None

    def _touch(self, address: int, done: Callable[[], None]) -> None:
        """In pieces, so that `release` does not wait; without the interpreter's lock."""
        first = -(-address // _HUGE) * _HUGE  # huge pages: a quarter of the time, if there are any
        self._libc.madvise(first, (address + self._size - first) // _HUGE * _HUGE, _MADV_HUGEPAGE)
        for start in range(0, self._size, _PIECE):
            if self._stopped.is_set():
                return
            ctypes.memset(address + start, 0, min(_PIECE, self._size - start))
        done()


def helps(nbytes: int) -> bool:
    """True if a texture of so many bytes is better asked for with `Memory`, in this thread."""
    main = threading.current_thread() is threading.main_thread()
    return nbytes >= WORTH and main and _libc() is not None


def trim() -> None:
    """After a large texture was freed: give its pages back to the system."""
    libc = _libc()
    if libc is not None:
        libc.malloc_trim(0)


@cache
def _libc() -> ctypes.CDLL | None:
    """The C library if it is glibc."""
    if not sys.platform.startswith("linux"):
        return None
    libc = ctypes.CDLL(None)
    try:
        libc.gnu_get_libc_version.restype = ctypes.c_char_p
        libc.malloc.restype = ctypes.c_void_p
        libc.malloc.argtypes = [ctypes.c_size_t]
        libc.free.argtypes = [ctypes.c_void_p]
        libc.madvise.argtypes = [ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int]
        libc.mallopt.argtypes = [ctypes.c_int, ctypes.c_int]
        libc.malloc_trim.argtypes = [ctypes.c_size_t]
    except AttributeError:  # another C library
        return None
    return libc
