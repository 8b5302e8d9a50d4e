"""Runs the panels: each in a window of its own, its mistakes kept within, its changes undoable."""

from __future__ import annotations

import traceback
from typing import TYPE_CHECKING

from volviz.model.scene import SceneState
from volviz.resolve import statistics_at_hand
from volviz.ui import edit, theme, widgets
from volviz.ui.facts import Busy, Facts, Local, Message
from volviz.ui.im import imgui, internal
from volviz.ui.panels import PANELS, Entry
from volviz.ui.surface_dialog import Wish

if TYPE_CHECKING:
    from volviz.ui.shell import Shell

BELOW = ("rendering", "view", "compare", "span")
"""Panels of the right side that start below the others."""


class PanelHost:
    """The panels of one window."""

    def __init__(self, shell: Shell) -> None:
        self.shell = shell
        self.local = Local()
        self.broken: dict[str, str] = {}
        self._seen: set[str] = set()
        """Panels in front: their tabs alone have a cross, others are as narrow as their title."""

    def areas(self) -> dict[str, str]:
        """Window names and where they are docked at first."""
        return {
            _window(name, entry): "right below" if name in BELOW else entry.area
            for name, entry in PANELS.items()
        }

    def draw(self) -> None:
        """All panels that are shown; the first change of the scene wins."""
        app = self.shell.app
        assert app.scene is not None
        facts = self._facts(app.scene)
        for name, entry in PANELS.items():
            if name in app.settings.hidden:
                continue
            # without the focus, which would bring the last of a stack of tabs to the front
            quiet = imgui.WindowFlags_.no_focus_on_appearing
            closable = True if name in self._seen else None
            visible, still = imgui.begin(_window(name, entry), closable, quiet)
            try:
                if visible and app.scene is not None:
                    self._call(name, entry, app.scene, facts)
            finally:
                imgui.end()
            (self._seen.add if visible else self._seen.discard)(name)
            if closable and not still:
                self.shell.show_panel(name, False)
        wish = self.local.of(Wish)
        if wish.number is not None:
            self.shell.dialogs.save_surface(wish.number)
            wish.number = None

    def _call(self, name: str, entry: Entry, scene: SceneState, facts: Facts) -> None:
        if name in self.broken:
            self._broken(name)
            return
        opened = internal.ErrorRecoveryState()
        internal.error_recovery_store_state(opened)
        try:
            after = entry.function(scene, facts)
        except Exception:
            internal.error_recovery_try_to_recover_state(opened)  # close what it left open
            self.broken[name] = traceback.format_exc(limit=6)
            last = self.broken[name].strip().splitlines()[-1]
            self.shell.app.messages.add(f"the panel {entry.title} failed: {last}", "error")
            return
        if after is not scene:
            self._take(after, scene, name)

    def _take(self, after: SceneState, scene: SceneState, name: str) -> None:
        """A step of the history, or a new one; while a button is held, one step in all."""
        app = self.shell.app
        assert app.history is not None
        known = [i for i, step in enumerate(app.history.steps) if step.state is after]
        if known:
            app.go(known[-1])
        elif after != scene:
            what = edit.difference(scene, after)
            app.change(after, what[:1].upper() + what[1:], f"{name}.{what}")

    def _broken(self, name: str) -> None:
        imgui.text_colored(theme.level("error"), "This panel failed.")
        again = imgui.button("Try again")
        widgets.tip(f"broken.{name}.again", "Draw the panel once more")
        imgui.same_line()
        if imgui.button("Copy report"):
            imgui.set_clipboard_text(self.broken[name])
        widgets.tip(f"broken.{name}.copy", "Copy what went wrong, for a bug report")
        if again:
            del self.broken[name]
            return
        widgets.wrapped(self.broken[name].strip().splitlines()[-1])
        imgui.separator()
        widgets.dim(self.broken[name])

    def _facts(self, scene: SceneState) -> Facts:
        shell = self.shell
        viewport, history, job = shell.viewport, shell.app.history, shell.app.job
        assert history is not None
        frame, state = viewport.frame, viewport.state
        return Facts(
            statistics=statistics_at_hand(scene.volume),
            renderer=shell.gpu.renderer,
            aspect=viewport.aspect,
            frame_ms=1000 * shell.times[-1] if shell.times else 0.0,
            frame_times=tuple(shell.times),
            rays=state.rays,
            step=scene.raycast.step * state.step,
            samples=state.samples,
            cpu_bytes=_memory(),
            gpu_bytes=None if frame is None else frame.voxels.nbytes,
            texture=None if frame is None else frame.voxels.dims,
            notes=() if frame is None else frame.notes,
            messages=tuple(Message(m.level, m.text, m.when) for m in shell.app.messages.all),
            history=history.steps,
            present=len(history.past),
            busy=None if job is None else Busy(job.fraction, job.message or job.title),
            parts=shell.app.choosing.listed,
            wanted=shell.app.choosing.wanted,
            surfaces=viewport.frames.surfaces,
            local=self.local,
        )


def _window(name: str, entry: Entry) -> str:
    return f"{entry.tab or entry.title}###{name}"


def _memory() -> int | None:
    """Bytes that this process holds in memory, where the system tells."""
    try:
        with open("/proc/self/statm", encoding="ascii") as file:
            pages = int(file.read().split()[1])
    except (OSError, ValueError, IndexError):
        return None
    return pages * 4096
