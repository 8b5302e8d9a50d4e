"""Compiled functions: how they are compiled, and where they are kept.

Compiled code is kept in the user's cache folder under a hash of the sources beside it: numba
alone would not notice that a function called by a kept one has changed. Kernels let go of the
interpreter's lock, so that the window goes on while one runs.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import numba

F = TypeVar("F", bound=Callable[..., Any])


@cache
def _cache_folder(package: Path) -> Path:
    """Where the compiled kernels of these very sources are kept."""
    import platformdirs

    digest = hashlib.sha256(numba.__version__.encode())
    for path in sorted(package.rglob("*.py")):
        digest.update(path.read_bytes())
    return Path(platformdirs.user_cache_dir("volviz")) / "kernels" / digest.hexdigest()[:16]


def kernel(function: F) -> F:
    """Compile on first call, per dtype; kept on disk where the disk lets us."""
    before = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = str(_cache_folder(Path(function.__code__.co_filename).parent))
    try:
        return numba.njit(cache=True, nogil=True, error_model="numpy")(function)
    except RuntimeError:  # no folder can be written: compiled anew in each process
        return numba.njit(nogil=True, error_model="numpy")(function)
    finally:
        numba.config.CACHE_DIR = before


inline = numba.njit(nogil=True, inline="never", error_model="numpy")
"""A helper of kernels in the same or another file: compiled into each of them."""
