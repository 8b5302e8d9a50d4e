"""A driven window draws frame after frame; while it waits, a worker needs the processor."""

from __future__ import annotations

import threading
import time

from volviz.ui.shell import Shell

NAP = 0.03


def nap(shell: Shell) -> None:
    """Between two frames: a moment for workers, where the window itself has nothing to draw."""
    at_rest = shell.app.scene is None or shell.viewport.state.done
    if at_rest and any(t.name.startswith("volviz ") for t in threading.enumerate()):
        time.sleep(NAP)
