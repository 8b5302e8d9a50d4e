"""After a lost OpenGL context: a new window with all that was in it, or a clear end."""

from __future__ import annotations

import contextlib
import gc
import time
from typing import TYPE_CHECKING

from volviz.errors import GraphicsError
from volviz.gpu.checked import ContextLost
from volviz.gpu.contexts import from_window
from volviz.scene import texture_limits
from volviz.ui import theme
from volviz.ui.desktop import Desktop
from volviz.ui.viewport import Viewport

if TYPE_CHECKING:
    from volviz.ui.shell import Shell

AGAIN_SECONDS = 10.0
"""A context lost so soon after another will not stay this time either."""


class Recovery:
    """Remembers the last loss. ended: True once it gave up; the autosaved scene is then kept."""

    def __init__(self) -> None:
        self.ended = False
        self._last: float | None = None

    def frame(self, shell: Shell) -> None:
        """A frame of the window; where its context is lost, of a new window next time."""
        try:
            shell.frame()
        except ContextLost as error:
            self.rebuild(shell, error)

    def refined(self, shell: Shell) -> bool:
        """The view drawn on without the panels; True if the window is to be drawn anew."""
        try:
            return shell.viewport.refine()
        except ContextLost as error:
            self.rebuild(shell, error)
            return True

    def rebuild(self, shell: Shell, error: ContextLost) -> None:
        """Save the scene, build everything on OpenGL again; GraphicsError if that does not help."""
        app = shell.app
        now = time.monotonic()
        again = self._last is not None and now - self._last < AGAIN_SECONDS
        self.ended = True
        notice = app.autosave.tick(app.scene, dirty=True, now=True)
        kept = notice is None and app.autosave.file.exists()
        if again:
            raise GraphicsError(f"{error.what}, again", fix=_fix(kept=kept)) from error
        try:
            _restart(shell)
        except GraphicsError as failed:
            what = f"{error.what}, and cannot be opened again: {failed.what}"
            raise GraphicsError(what, fix=_fix(kept=kept)) from failed
        self.ended = False
        self._last = time.monotonic()
        app.messages.add(f"{error.what}: the window was rebuilt", "warning")


def furnish(shell: Shell) -> None:
    """What a new window needs: fonts, the layout, somebody to take what is dropped."""
    shell.window.on_drop = shell.open
    theme.load_fonts()
    shell.layout.load()


def clear(shell: Shell) -> None:
    """Free the window and what is on it; a lost context has nothing left to free."""
    held = (shell.shelf, shell.chooser, shell.viewport, shell.gpu)
    for act in (shell.exports.drop, *(part.release for part in held)):
        with contextlib.suppress(GraphicsError):
            act()
    shell.window.close()
    gc.unfreeze()  # what goes with the window may have been set aside (app/garbage.py)
    gc.collect()


def _restart(shell: Shell) -> None:
    size = shell.window.size
    shell.dialogs.close()
    clear(shell)
    shell.themed, shell.titled = None, ""
    shell.window = Desktop("volviz", size)
    shell.gpu = from_window(shell.window.handle)
    shell.window.start_imgui()
    shell.viewport = Viewport(shell.app, shell.gpu, texture_limits(shell.gpu))
    shell.shelf.connect(shell.app, shell.gpu)
    shell.trials.connect(shell.viewport)
    shell.marks.connect(shell.viewport)
    furnish(shell)


def _fix(*, kept: bool) -> str:
    saved = "the scene is saved and will be offered at the next start; " if kept else ""
    return f"{saved}update the graphics driver, or set LIBGL_ALWAYS_SOFTWARE=1"
