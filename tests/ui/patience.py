"""Waiting in a driven window without wearing out the processor.

A driven window draws frame after frame. While a script only waits, most of that is of no use to
anybody: on a software rasteriser, painting the panels and showing them takes longer than the
picture, and a worker that is waited for needs the processor, too.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from volviz.ui.desktop import Desktop
from volviz.ui.im import imgui
from volviz.ui.shell import Shell

NAP = 0.03
_blind = [False]
_shown = Desktop.end


def _end(self: Desktop, screen: Any, ground: tuple[float, float, float]) -> None:
    if _blind[0]:
        imgui.render()  # ends ImGui's frame
    else:
        _shown(self, screen, ground)


Desktop.end = _end  # type: ignore[method-assign]


@contextmanager
def unseen() -> Iterator[None]:
    """Frames meanwhile are worked out, the 3D view drawn, but panels not painted, nothing shown."""
    before, _blind[0] = _blind[0], True
    try:
        yield
    finally:
        _blind[0] = before


def seen() -> bool:
    """True if the frame before was shown: only then there is something to look at."""
    return not _blind[0]


def nap(shell: Shell) -> None:
    """Between two frames: a moment for workers, where the window has nothing to draw."""
    at_rest = shell.app.scene is None or shell.viewport.state.done
    if at_rest and any(t.name.startswith("volviz ") for t in threading.enumerate()):
        time.sleep(NAP)
