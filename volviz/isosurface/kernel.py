"""Compiled functions: how they are compiled, kept, and run on several threads.

A kernel works on a range of z-slabs without the interpreter's lock; `in_slabs` runs the ranges on
a small pool of threads. So progress and cancel work between ranges, two extractions may run at
once, and no threading library beyond Python's is needed. Compiled code is kept in the user's
cache folder under a hash of this package's sources: numba alone would not notice that a function
called by a kept one has changed.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import numba
import numpy as np
from llvmlite import ir
from numba.extending import intrinsic

from volviz.progress import Progress

F = TypeVar("F", bound=Callable[..., Any])
_SAMPLES = 1 << 20  # a range holds about as many samples: some milliseconds of work


@cache
def cache_folder() -> Path:
    """Where compiled kernels of these very sources are kept."""
    import platformdirs

    digest = hashlib.sha256(numba.__version__.encode())
    for path in sorted(Path(__file__).parent.rglob("*.py")):
        digest.update(path.read_bytes())
    return (
        Path(platformdirs.user_cache_dir("volviz", appauthor=False))
        / "kernels"
        / digest.hexdigest()[:16]
    )


def kernel(function: F) -> F:
    """Compile on first call, per dtype; kept on disk where the disk lets us."""
    before = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = str(cache_folder())
    try:
        return numba.njit(cache=True, nogil=True, error_model="numpy")(function)
    except RuntimeError:  # no folder can be written: compiled anew in each process
        return numba.njit(nogil=True, error_model="numpy")(function)
    finally:
        numba.config.CACHE_DIR = before


inline = numba.njit(nogil=True, inline="never", error_model="numpy")
"""A helper of kernels in the same or another file: compiled into each of them."""


hot = numba.njit(nogil=True, forceinline=True, error_model="numpy")
"""A helper in the innermost loops: put in line wherever it is called."""


@intrinsic
def popcount(context: Any, word: Any) -> Any:
    """How many bits of a uint64 are set, as int64."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.ctpop(arguments[0])

    return numba.types.int64(numba.types.uint64), generate


@intrinsic
def lowest_bit(context: Any, word: Any) -> Any:
    """Index of the lowest set bit of a uint64 that is not 0, as int64."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.cttz(arguments[0], ir.Constant(ir.IntType(1), 1))

    return numba.types.int64(numba.types.uint64), generate


def threads() -> int:
    """How many threads work at once: NUMBA_NUM_THREADS, or the processors we may use."""
    asked = os.environ.get("NUMBA_NUM_THREADS", "")
    if asked.isdigit() and int(asked) > 0:
        return int(asked)
    if hasattr(os, "sched_getaffinity"):
        return max(1, len(os.sched_getaffinity(0)))
    return os.cpu_count() or 1


def in_slabs(
    task: Callable[[int, int], Any],
    layers: int,
    layer_size: int,
    progress: Progress,
    message: str,
) -> list[Any]:
    """task(first, last) for consecutive ranges of `layers`, results in order.

    layer_size: samples per layer; a range holds about a million of them, so that a cancel takes
    effect between two ranges, within some milliseconds.
    """
    step = max(1, min(_SAMPLES // max(layer_size, 1), -(-layers // (2 * threads()))))
    ranges = [(a, min(a + step, layers)) for a in range(0, layers, step)]
    futures = [_pool().submit(task, a, b) for a, b in ranges]
    results = []
    try:
        for i, future in enumerate(futures):
            progress(i / len(ranges), message)
            while not future.done():
                wait([future], timeout=0.1)
                progress(i / len(ranges), message)
            results.append(future.result())
    except BaseException:
        for future in futures:
            future.cancel()
        raise
    return results


@cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(threads(), thread_name_prefix="volviz-isosurface")


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_pool.cache_clear)


def threshold(dtype: np.dtype[Any], isovalue: float) -> Any | None:
    """The least value of this dtype that is at least the isovalue; None if there is none.

    So that a kernel compares samples in their own dtype: value ≥ isovalue ⇔ value ≥ threshold.
    """
    if dtype.kind == "f":
        with np.errstate(over="ignore"):
            near = dtype.type(isovalue)
        if float(near) < isovalue:
            near = np.nextafter(near, dtype.type(np.inf))
        return near if np.isfinite(near) else None
    limits = np.iinfo(dtype)
    least = int(np.ceil(isovalue))
    if least > limits.max:
        return None
    return dtype.type(max(least, limits.min))
