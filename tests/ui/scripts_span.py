"""What panels tell of surfaces, in the window: `python -m tests.ui.scripts_span NAME FOLDER`."""

from __future__ import annotations

import sys
from pathlib import Path

from tests.ui import injected
from tests.ui.injected import Driver, Script
from tests.ui.scripts_surfaces import extracted, ready, where
from volviz.ui.im import imgui


def reported(d: Driver) -> Script:
    """The report of a surface unfolds, and follows its isovalue."""
    yield from ready(d)
    yield from d.key(imgui.Key.i)
    yield from extracted(d)
    imgui.set_window_focus("Surfaces###surfaces")
    yield
    x, y, _ = yield from where(d, "surfaces.0.report")
    yield from d.click(x, y)
    yield from answered(d)
    yield from where(d, "surfaces.0.report.json")
    d.screen("report")


def answered(d: Driver) -> Script:
    """Until nothing is worked out for the panels."""
    for _ in range(2000):
        yield
        slots = d.shell.answers._slots.values()
        if all(s.answer.job is None for s in slots):
            break
    yield from d.rest()


SCRIPTS = (reported,)

if __name__ == "__main__":
    injected.run({s.__name__: s for s in SCRIPTS}[sys.argv[1]], Path(sys.argv[2]))
