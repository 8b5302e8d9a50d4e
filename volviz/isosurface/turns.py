"""Ranges of items that several threads share, each with its own part of them first.

One kernel after the other works on the same rows, within milliseconds. What a processor has
written is near it and far from the others, so a thread begins where it began the time before, and
takes ranges of others only when it is done with its own.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from concurrent.futures import Future
from functools import cache, partial
from typing import Any, NamedTuple

import numba
import numpy as np
from numba.extending import intrinsic
from numpy.typing import NDArray

from volviz.isosurface.helpers import Helpers
from volviz.isosurface.kernel import hot, threads
from volviz.progress import Progress

_AT_ONCE = 1 << 17  # samples that a range holds at most
_WORTH = 1 << 18  # samples for which a second thread is called: a tenth of a millisecond
_SILENT = 0.03  # seconds
Ints = NDArray[np.int64]


class Turns(NamedTuple):
    """The ranges as one thread sees them.

    taken: int64[n], not 0 where a thread has the range. bounds: int64[n + 1], where they begin.
    looked: int64[1], at how many this thread has looked; begin: at which it looked first.
    """

    taken: Ints
    bounds: Ints
    looked: Ints
    begin: int


@intrinsic
def _claim(context: Any, taken: Any, at: Any) -> Any:
    """What stood at a place of a flat array of int64, where 1 stands from then on."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        array = context.make_array(signature.args[0])(context, builder, value=arguments[0])
        place = builder.gep(array.data, [arguments[1]])
        one = context.get_constant(numba.types.int64, 1)
        return builder.atomic_rmw("xchg", place, one, "monotonic")

    return numba.types.int64(taken, numba.types.uint64), generate


@hot
def take(turns: Any) -> Any:
    """(first, end) of a range of items that no other thread gets; first is −1 if none is left."""
    while turns.looked[0] < turns.taken.size:
        at = np.uint64((turns.begin + turns.looked[0]) % turns.taken.size)
        turns.looked[0] += 1
        if turns.taken[at] == 0 and _claim(turns.taken, at) == 0:
            return turns.bounds[at], turns.bounds[at + np.uint64(1)]
    return np.int64(-1), np.int64(-1)


def in_turns(
    task: Callable[[Turns, int], Any],
    items: int,
    size: int,
    progress: Progress,
    message: str,
    among: NDArray[np.int32] | None = None,
) -> list[Any]:
    """task(turns, most) on this thread and on the others at once, results in any order.

    items: rows, say; size: samples of each. among: the items in which there is something to do, in
    order; others are not called for little. The task is a kernel that asks `take(turns)` for
    ranges, and is done when there is none, or after `most` of them. A call of a kernel costs some
    microseconds and the interpreter's lock, and a thread that sleeps wakes late: so this one works
    as well, as long at a time as progress may be silent, and each other one is called once.
    """
    worked = items if among is None else len(among)
    step = max(1, min(_AT_ONCE // max(size, 1), -(-worked // (32 * threads()))))
    ranges = -(-worked // step) if items else 0
    bounds = _bounds(items, among, ranges)
    taken = np.zeros(ranges, np.int64)
    progress(0, message)
    count = min(threads(), ranges) if size * worked >= _WORTH else 1
    mine, *theirs = (
        Turns(taken, bounds, np.zeros(1, np.int64), ranges * k // max(count, 1))
        for k in range(max(count, 1))
    )
    futures = _helpers().call([partial(task, turns, ranges) for turns in theirs])
    results, most = [], 1
    try:
        while mine.looked[0] < ranges:
            start = time.perf_counter()
            results.append(task(mine, most))
            progress(np.count_nonzero(taken) / ranges, message)
            most = max(1, int(most * _SILENT / max(time.perf_counter() - start, 1e-6)))
        for future in futures:
            if not future.cancel():
                _await(future, lambda: progress(1, message))
                results.append(future.result())
        progress(1, message)  # a cancel since the last word is heard here
        return results
    except BaseException:
        taken[:] = 1
        for future in futures:
            future.cancel()
        raise


def _bounds(items: int, among: NDArray[np.int32] | None, ranges: int) -> Ints:
    """Where ranges begin that hold as many items each, or as many of some."""
    if among is None or not ranges:
        return np.arange(ranges + 1) * items // max(ranges, 1)
    firsts = among[np.arange(ranges) * len(among) // ranges].astype(np.int64)
    firsts[0] = 0
    return np.append(firsts, items)


def _await(future: Future[Any], meanwhile: Callable[[], None]) -> None:
    """Wait for a future, doing something every now and then."""
    while True:
        try:
            future.exception(timeout=0.05)
            return
        except TimeoutError:
            meanwhile()


@cache
def _helpers() -> Helpers:
    return Helpers(max(threads() - 1, 1))


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_helpers.cache_clear)
