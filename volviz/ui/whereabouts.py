"""Which of the recent files are gone: looked at on a worker, for a network drive may take long."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from typing import TYPE_CHECKING

from volviz.app.jobs import Job
from volviz.sources import is_sample

if TYPE_CHECKING:
    from volviz.app import App

AGAIN_SECONDS = 3.0
"""What was seen holds so long while somebody looks at the list."""
GONE = "It is not there any more, or its drive is not connected."


class Whereabouts:
    """One per window. A file that nobody looked for yet counts as there."""

    def __init__(self) -> None:
        self._gone: frozenset[str] = frozenset()
        self._looked: tuple[tuple[str, ...], float] = ((), 0.0)
        self._job: Job | None = None

    def gone(self, names: Sequence[str], app: App) -> frozenset[str]:
        """Those of the names that were not there when last looked for."""
        job = self._job
        if job is not None and job.finished:
            self._job = None
            job.deliver()
        wanted, now = tuple(n for n in names if not is_sample(n)), time.monotonic()
        stale = wanted != self._looked[0] or now - self._looked[1] > AGAIN_SECONDS
        if self._job is None and wanted and stale:
            self._looked = wanted, now
            self._job = Job("recent files", lambda _: _missing(wanted), self._take, app.wake)
        return self._gone

    def _take(self, found: frozenset[str]) -> None:
        self._gone = found


def _missing(names: Sequence[str]) -> frozenset[str]:
    return frozenset(n for n in names if not os.path.lexists(n))
