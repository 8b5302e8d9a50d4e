"""Progress and cancel, passed down into long work as one object."""

from __future__ import annotations

import threading
from collections.abc import Callable

from volviz.errors import Cancelled

Report = Callable[[float | None, str], None]


class Progress:
    """Call it with a fraction (0..1, or None if unknown) and a message; it raises `Cancelled`.

    Long loops call it often enough that a cancel takes effect within half a second. `part` gives
    a sub-task its share of the bar. report: called with both in the thread that works, such as
    `volviz.load("head.nrrd", progress=volviz.Progress(print))`.
    """

    def __init__(self, report: Report | None = None) -> None:
        self._report = report
        self._stop = threading.Event()
        self._span = (0.0, 1.0)

    def __call__(self, fraction: float | None = None, message: str = "") -> None:
        """Report, or raise `Cancelled`."""
        if self._stop.is_set():
            raise Cancelled
        if self._report is not None:
            low, high = self._span
            shown = None if fraction is None else low + (high - low) * min(max(fraction, 0.0), 1.0)
            self._report(shown, message)

    def cancel(self) -> None:
        """Make the next call raise `Cancelled`, in whichever thread the work runs."""
        self._stop.set()

    @property
    def cancelled(self) -> bool:
        """True once `cancel` was called."""
        return self._stop.is_set()

    def part(self, low: float, high: float) -> Progress:
        """A Progress that reports into [low, high] of this one and shares its cancel."""
        child = object.__new__(Progress)  # without a cancel of its own, which takes some time
        child._report, child._stop = self._report, self._stop
        start, end = self._span
        child._span = (start + (end - start) * low, start + (end - start) * high)
        return child


def silent() -> Progress:
    """A Progress nobody listens to, for callers that gave none."""
    return Progress()
