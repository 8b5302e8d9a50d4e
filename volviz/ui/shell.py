"""The window's program: its parts, one frame of it, the loop that sleeps when nothing changes."""

from __future__ import annotations

import os
import time
from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from volviz.app import App
from volviz.app.answers import Answers
from volviz.app.garbage import Garbage
from volviz.app.opening import title_of, typed
from volviz.errors import VolvizError
from volviz.gpu.contexts import from_window
from volviz.model.scene import SceneState
from volviz.scene import texture_limits
from volviz.ui import bars, fonts, recovery, theme, time_bar, welcome
from volviz.ui.chooser import Chooser
from volviz.ui.commands import Command
from volviz.ui.desktop import Desktop, hovering, wake
from volviz.ui.dialogs import Dialogs
from volviz.ui.exports import Exports
from volviz.ui.im import ImVec2, imgui
from volviz.ui.layout import VIEW, Layout
from volviz.ui.marks import Marks
from volviz.ui.panel_host import PanelHost
from volviz.ui.panels import PANELS
from volviz.ui.raw_dialog import RawDialog
from volviz.ui.shelf import Shelf
from volviz.ui.shortcuts import Shortcuts
from volviz.ui.trials import Trials
from volviz.ui.viewport import Viewport

SETTLE_SECONDS = 0.6
"""Changes in a row without a mouse button (wheel, keys) are one step of undo within this time."""
MOMENT = 0.0005
"""For events, before rays are cast on."""
IDLE_SECONDS = 20.0


class Shell:
    """A window with the app in it. Only the main thread calls it."""

    app: App
    window: Desktop
    dialogs: Dialogs
    exports: Exports
    viewport: Viewport

    def __init__(self, app: App) -> None:
        self.app = app
        app.wake = wake
        self.window = Desktop("volviz", app.settings.size)
        try:
            self.gpu = from_window(self.window.handle)
            self.window.start_imgui()
        except BaseException:
            self.window.close()
            raise
        self.panels = PANELS
        self.dialogs = Dialogs(self)
        self.chooser = Chooser(self)
        self.raw_dialog = RawDialog(self)
        self.shortcuts = Shortcuts()
        self.viewport = Viewport(app, self.gpu, texture_limits(self.gpu))
        self.host = PanelHost(self)
        self.shelf = self.host.local.of(Shelf).connect(app, self.gpu)
        self.trials = self.host.local.of(Trials).connect(self.viewport)
        self.marks = self.host.local.of(Marks).connect(self.viewport)
        self.answers = self.host.local.of(Answers)
        self.answers.wake = wake
        self.layout = Layout(app.folder, self.host.areas())
        self.times: deque[float] = deque(maxlen=120)
        self.exports = Exports(self)
        self.fonts = fonts.Fallback()
        self.place = (0.0, 0.0, 0.0, 0.0)
        self.themed: tuple[str, float] | None = None
        self.titled = ""
        self._leaving = False
        self._changed: tuple[SceneState | None, float] = (None, 0.0)
        self.recovery = recovery.Recovery()
        self.garbage = Garbage()
        recovery.furnish(self)
        app.aspect = self.layout.aspect(ImVec2(*self.window.size), panels=app.settings.panels)
        if self.layout.notice:
            app.messages.add(self.layout.notice, "warning")

    # --- the loop --------------------------------------------------------------------------------

    def run(self) -> None:
        """Until the window is closed."""
        self.garbage.begin()
        try:
            while not self._leaving:
                if self.window.wait(self._wait()):
                    self.recovery.frame(self)
                elif self.app.poll() or self.viewport.watch():
                    self.window.touch()
                elif self.recovery.refined(self):
                    self.recovery.frame(self)
                if self.window.closing and not self._leaving:
                    self._ask_to_leave()
        finally:
            self.garbage.end()
            self.close()

    def _wait(self) -> float | None:
        """Seconds to sleep unless something happens."""
        if min(self.window.pixels) < 1:
            return 0.5
        if self.exports.drawing or self.shelf.eager or hovering():
            return 0.0
        wait = self.viewport.wait
        waits = [IDLE_SECONDS if wait is None else wait]
        if self.app.job is not None or self.exports.busy:
            waits.append(0.1)
        if self.app.choosing.wait is not None:
            waits.append(self.app.choosing.wait)
        if self.app.messages.recent(bars.TOAST_SECONDS):
            waits.append(0.5)
        alone = len(waits) == 1 and wait == 0.0
        return MOMENT if alone and self.viewport.refining else min(waits)

    def frame(self) -> None:
        """Draw everything once."""
        start = time.perf_counter()
        self.app.poll()
        self._tell_title()
        if min(self.window.pixels) < 1:
            return
        look = (self.app.settings.theme, self.app.settings.scale * self.window.scale)
        if look != self.themed:
            theme.apply(*look)
            self.themed = look
        self.fonts.cover(fonts.names(self.app), self.app.wake)
        self.layout.fit(self.window.size[0] / (theme.FONT_SIZE * look[1]))
        self.window.begin()
        self._draw()
        self.window.end(self.gpu.ctx.detect_framebuffer(0), theme.BAR[look[0]])
        self.exports.advance()
        self._settle()
        self.times.append(time.perf_counter() - start)
        self.viewport.took(self.times[-1])
        self.trials.advance()
        self.shelf.advance(free=self._resting())
        if self._resting():
            self.garbage.rest()

    def _resting(self) -> bool:
        """True if nothing moves and nothing else is drawn: a moment for thumbnails."""
        busy = self.app.job is not None or self.exports.picture is not None
        still = self.app.scene is None or self.viewport.state.done
        return still and not busy and not imgui.is_any_mouse_down()

    def _draw(self) -> None:
        bars.menu_bar(self)
        bars.status_bar(self)
        alone = not self.app.settings.panels or self.app.scene is None
        node = 0 if alone else self.layout.space()
        if not alone:
            self.host.draw()  # before the view, so that this frame shows already what they change
        self.answers.sweep(None if self.app.scene is None else self.app.scene.volume)
        self.place = place = self._view(node, alone)
        free_place = time_bar.draw(self, place)
        bars.progress(self, place)
        bars.export_progress(self, place)
        bars.toasts(self, free_place)
        self.chooser.follow()
        self.raw_dialog.follow()
        free = not self.dialogs.active  # a key that closes a dialog does nothing else
        self.dialogs.draw()
        if free:
            self.shortcuts.dispatch(self)
        if imgui.get_io().want_save_ini_settings:
            imgui.get_io().want_save_ini_settings = False
            notice = self.layout.save()
            if notice:
                self.app.messages.once(notice)

    def _view(self, node: Any, alone: bool) -> tuple[float, float, float, float]:
        """The 3D view, or the welcome; its place on the screen. alone: without panels."""
        if alone:
            area = imgui.get_main_viewport()
            imgui.set_next_window_pos(area.work_pos)
            imgui.set_next_window_size(area.work_size)
        else:
            imgui.set_next_window_dock_id(node, imgui.Cond_.appearing)
        kinds = imgui.WindowFlags_
        flags = kinds.no_scrollbar | kinds.no_scroll_with_mouse | kinds.no_collapse
        if alone:
            flags |= kinds.no_decoration | kinds.no_docking | kinds.no_saved_settings
            flags |= kinds.no_bring_to_front_on_focus
        imgui.push_style_var(imgui.StyleVar_.window_padding, ImVec2(0, 0))
        imgui.push_style_var(imgui.StyleVar_.window_border_size, 0.0)
        imgui.push_style_var(imgui.StyleVar_.window_rounding, 0.0)
        name = "3D###whole" if alone else VIEW
        visible, _ = imgui.begin(name, None, flags)
        imgui.pop_style_var(3)
        corner, extent = imgui.get_window_pos(), imgui.get_window_size()
        if alone:
            self.layout.hide()
        if visible and self.app.scene is None:
            self.app.aspect = self.layout.aspect(extent, panels=self.app.settings.panels)
            welcome.draw(self)
        elif visible:
            self.viewport.draw()
        imgui.end()
        return corner.x, corner.y, extent.x, extent.y

    def _settle(self) -> None:
        """End a step of undo when the mouse is released, or some time after the last change."""
        scene = self.app.scene
        now = time.perf_counter()
        if scene is not self._changed[0]:
            self._changed = (scene, now)
        held = any(imgui.is_mouse_down(b) for b in range(3))
        released = any(imgui.is_mouse_released(b) for b in range(3))
        if released or (not held and now - self._changed[1] > SETTLE_SECONDS):
            self.app.settle()

    def _tell_title(self) -> None:
        text = "volviz" if self.app.scene is None else f"{self.stem()} – volviz"
        if text != self.titled:
            self.titled = text
            self.window.title(text)

    # --- what commands do ------------------------------------------------------------------------

    def do(self, command: Command) -> None:
        """Run a command; what goes wrong is told."""
        if not command.enabled(self):
            return
        try:
            command.action(self)
        except VolvizError as error:
            self.app.messages.add(error, "error")

    def open(self, names: Sequence[str]) -> None:
        """Open what was dropped, chosen or given."""
        self.app.open(names)
        self.keep_folder(names)

    def keep_folder(self, names: Sequence[str]) -> None:
        """Where the next dialog begins: with the first of these."""
        first = typed(names[0]) if names else Path()
        if os.path.exists(first):
            folder = first if first.is_dir() else first.parent
            self.app.keep(replace(self.app.settings, folder=str(folder.absolute())))

    def recover(self, path: Path) -> None:
        """Open an autosaved scene; it stays until it was opened."""
        self.open([str(path)])

    def save(self) -> None:
        """To the scene's file, or ask for one."""
        if self.app.file is None:
            self.dialogs.save_scene()
        else:
            self.app.save(self.app.file)

    def stem(self) -> str:
        """A short name of what is open."""
        scene = self.app.scene
        if scene is None:
            return "volviz"
        source = scene.source.path if scene.source else scene.volume.name
        name = title_of(source or "volume")
        return name.split(".")[0] or name

    def toggle(self, name: str) -> None:
        """Turn a setting that is on or off."""
        settings = self.app.settings
        turned: dict[str, Any] = {name: not getattr(settings, name)}
        self.app.keep(replace(settings, **turned))

    def toggle_theme(self) -> None:
        """Dark or light."""
        other = "dark" if self.app.settings.theme == "light" else "light"
        self.app.keep(replace(self.app.settings, theme=other))

    def zoom_text(self, factor: float) -> None:
        """Everything larger or smaller."""
        scale = min(max(self.app.settings.scale * factor, 0.6), 3.0)
        self.app.keep(replace(self.app.settings, scale=round(scale, 3)))

    def show_panel(self, name: str, shown: bool) -> None:
        """Show or hide a panel."""
        hidden = [n for n in self.app.settings.hidden if n != name]
        names = tuple(hidden if shown else [*hidden, name])
        self.app.keep(replace(self.app.settings, hidden=names))

    def reset_layout(self) -> None:
        """All panels shown, where they were at first."""
        self.app.keep(replace(self.app.settings, hidden=(), panels=True, scale=1.0))
        self.layout.reset()

    # --- the end ---------------------------------------------------------------------------------

    def quit(self) -> None:
        """Close, unless the user wants to save first."""
        self.window.closing = True

    def leave(self) -> None:
        """Close without asking."""
        self._leaving = True

    def _ask_to_leave(self) -> None:
        if self.app.dirty and self.dialogs.active != "Unsaved changes":
            self.window.closing = False
            self.dialogs.ask_unsaved()
            self.window.touch()
        elif not self.app.dirty:
            self._leaving = True

    def close(self) -> None:
        """Keep what is to be kept, free the rest."""
        if not self.window.closed:
            self.layout.save()
            if not self.window.full_screen and min(self.window.pixels) > 0:
                self.app.keep(replace(self.app.settings, size=self.window.size))
        if self.recovery.ended:
            self.app.cancel()  # what was autosaved stays
        else:
            self.app.close()
        self.exports.close()
        self.answers.close()
        recovery.clear(self)
