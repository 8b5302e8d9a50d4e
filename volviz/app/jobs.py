"""Long work beside the window: one thread per job, progress, an estimate, cancel."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

from volviz.errors import Cancelled, VolvizError
from volviz.progress import Progress

ESTIMATE_AFTER = 0.7


class Job:
    """`work(progress)` on a thread of its own; the main thread asks `finished` and takes it.

    wake: called from the worker when there is something to show; must be safe in any thread.
    on_result: called by `deliver` in the main thread with what `work` returned.
    """

    def __init__(
        self,
        title: str,
        work: Callable[[Progress], Any],
        on_result: Callable[[Any], None],
        wake: Callable[[], None],
    ) -> None:
        self.title = title
        self.fraction: float | None = None
        self.message = ""
        self.error: Exception | None = None
        self.finished = False
        self._work = work
        self._on_result = on_result
        self._wake = wake
        self._progress = Progress(self._report)
        self._result: Any = None
        self._told = 0.0
        self.started = time.monotonic()
        threading.Thread(target=self._run, name=f"volviz {title}", daemon=True).start()

    @property
    def cancelled(self) -> bool:
        """True once it was told to stop."""
        return self._progress.cancelled

    @property
    def elapsed(self) -> float:
        """Seconds since the start."""
        return time.monotonic() - self.started

    @property
    def remaining(self) -> float | None:
        """Estimated seconds to go, or None while nobody can know."""
        if self.fraction is None or self.fraction < 0.02 or self.elapsed < ESTIMATE_AFTER:
            return None
        return self.elapsed * (1 - self.fraction) / self.fraction

    def cancel(self) -> None:
        """Tell it to stop; it ends at its next report."""
        self._progress.cancel()

    def deliver(self) -> None:
        """In the main thread, once finished: hand over the result or raise what went wrong."""
        if self.error is not None:
            raise self.error
        if self.cancelled:
            raise Cancelled
        result, self._result = self._result, None
        self._on_result(result)

    def _run(self) -> None:
        try:
            self._result = self._work(self._progress)
        except VolvizError as error:
            self.error = error
        except MemoryError:
            self.error = VolvizError("out of memory", fix="close other programs, or read less")
        except Exception as error:
            self.error = error
        self.finished = True
        self._wake()

    def _report(self, fraction: float | None, message: str) -> None:
        self.fraction, self.message = fraction, message or self.message
        now = time.monotonic()
        if now - self._told > 0.05:
            self._told = now
            self._wake()
