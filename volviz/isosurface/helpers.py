"""Threads that work beside the one that calls them, on other processors than it.

A thread that is woken begins where its waker runs, and Linux moves one of the two to an idle
processor only after some milliseconds: work of that length would be done one after the other
(measured on two cores: both threads on one core in most calls). So a helper may run anywhere but
there.
"""

from __future__ import annotations

import ctypes
import os
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from functools import cache
from typing import Any


class Helpers:
    """A pool whose threads keep away from the processor of the caller."""

    def __init__(self, count: int) -> None:
        self._numbers: list[int] = []
        self._away: tuple[int, int] | None = None  # from which processor, how many of them
        self._pool = ThreadPoolExecutor(count, "volviz-helper", initializer=self._known)

    def call(self, tasks: Sequence[Callable[[], Any]]) -> list[Future[Any]]:
        """Ask a helper for each to do it, all at once."""
        if tasks:
            self._send_away()
        return [self._pool.submit(task) for task in tasks]

    def _known(self) -> None:
        self._numbers.append(threading.get_native_id())

    def _send_away(self) -> None:
        here = current_processor()
        if here is None or self._away == (here, len(self._numbers)):
            return
        numbers = list(self._numbers)
        self._away = here, len(numbers)
        rest = os.sched_getaffinity(0) - {here}
        with suppress(OSError):  # not allowed here: they run where they are put
            for number in numbers if rest else ():
                os.sched_setaffinity(number, rest)


@cache
def _asked() -> Callable[[], int] | None:
    if not hasattr(os, "sched_setaffinity"):
        return None
    found = getattr(ctypes.CDLL(None), "sched_getcpu", None)
    return found if found is not None and found() >= 0 else None


def current_processor() -> int | None:
    """The number of the processor that runs this thread; None where nobody can say."""
    ask = _asked()
    return None if ask is None else ask()
