"""Compiled functions: how they are compiled, and where they are kept.

Compiled code is kept in the user's cache folder under a hash of the room's sources: numba alone
would not notice that a function called by a kept one has changed. What other sources left there
goes when new ones come. Kernels let go of the interpreter's lock, so that the window goes on while
one runs.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import threading
import time
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import numba

F = TypeVar("F", bound=Callable[..., Any])
_HERE = Path(__file__).parent
_DAY = 86400.0
_choosing = threading.Lock()  # numba has one folder for all, and threads import at once
KEPT, MOST = 8, 30.0
"""Folders of kernels that are kept in any case, and days without use after which none is."""


@cache
def cache_folder(room: str) -> Path:
    """Where the compiled kernels of these very sources of a room are kept."""
    import platformdirs

    digest = hashlib.sha256(numba.__version__.encode())
    for path in (Path(__file__), *sorted((_HERE / room).rglob("*.py"))):
        digest.update(path.read_bytes())
    caches = platformdirs.user_cache_path("volviz", appauthor=False) / "kernels"
    folder = caches / digest.hexdigest()[:16]
    try:
        os.utime(folder)  # in use now
    except OSError:  # new: the only time at which the cache grows
        prune(caches, time.time())
    return folder


def prune(caches: Path, now: float) -> None:
    """Remove the folders not used for MOST days, and for a day those beyond the newest KEPT.

    now: seconds since the epoch. Other processes may use the cache and prune it at the same time:
    a folder is renamed before it is emptied, so none is found half empty, and one that loses its
    folder compiles anew. What cannot be removed is left.
    """
    found = []
    try:
        for folder in caches.iterdir():
            found.append((folder.stat().st_mtime, folder))
    except OSError:  # none yet, or another process is at it
        return
    for place, (used, folder) in enumerate(sorted(found, reverse=True)):
        if now - used > (MOST if place < KEPT else 1.0) * _DAY:
            gone = folder.with_name(f"{folder.name.split('.')[0]}.{os.getpid()}")
            try:
                folder.rename(gone)
            except OSError:
                continue
            shutil.rmtree(gone, ignore_errors=True)


def kernel(function: F) -> F:
    """Compile on first call, per dtype; kept on disk where the disk lets us."""
    room = Path(function.__code__.co_filename).relative_to(_HERE).parts[0]
    with _choosing:
        before = numba.config.CACHE_DIR
        numba.config.CACHE_DIR = str(cache_folder(room))
        try:
            return numba.njit(cache=True, nogil=True, error_model="numpy")(function)
        except RuntimeError:  # no folder can be written: compiled anew in each process
            return numba.njit(nogil=True, error_model="numpy")(function)
        finally:
            numba.config.CACHE_DIR = before


inline = numba.njit(nogil=True, inline="never", error_model="numpy")
"""A helper of kernels in the same or another file: compiled into each of them."""

hot = numba.njit(nogil=True, forceinline=True, error_model="numpy", _nrt=False)
"""A helper in the innermost loops: put in line wherever it is called."""

bare = numba.njit(nogil=True, inline="never", error_model="numpy", _nrt=False)
"""`inline` for helpers that make no arrays: references to those they are given are not counted,
which takes longer than a short helper itself, most of all where two threads do it at once."""
