"""What comes in front: open, save, keys and mouse, find a command, unsaved changes."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from volviz.errors import VolvizError
from volviz.ui import help_overlay, widgets
from volviz.ui.browser import Browser
from volviz.ui.im import ImVec2, imgui
from volviz.ui.layout import to_front
from volviz.ui.palette import Palette
from volviz.ui.picture_dialog import PictureForm
from volviz.ui.surface_dialog import SurfaceForm

if TYPE_CHECKING:
    from volviz.ui.shell import Shell


FRONT_FRAMES = 3


class Dialogs:
    """At most one at a time."""

    def __init__(self, shell: Shell) -> None:
        self.shell = shell
        self._draw: Callable[[], None] | None = None
        self._title = ""
        self._opening = False
        self._browser = Browser("")
        self._picture: PictureForm | None = None
        self._surface: SurfaceForm | None = None
        self._palette: Palette | None = None
        self._replace = ""
        self._front = ("", 0)
        self._last = False

    @property
    def active(self) -> str:
        """The title of what is in front, "" for nothing."""
        return self._title if self._draw else ""

    def draw(self) -> None:
        """The present dialog, if there is one."""
        self._bring_to_front()
        if self._draw is None:
            return
        if self._opening:
            imgui.open_popup(self._title)
            self._opening = False
        middle = imgui.get_main_viewport().get_center()
        imgui.set_next_window_pos(middle, imgui.Cond_.always, ImVec2(0.5, 0.5))
        flags = imgui.WindowFlags_.always_auto_resize | imgui.WindowFlags_.no_saved_settings
        visible, still = imgui.begin_popup_modal(self._title, True, flags)
        if visible:
            if imgui.is_key_pressed(imgui.Key.escape) or not still:
                self.close()
            else:
                self._draw()
            if self._draw is None or self._opening:
                imgui.close_current_popup()
            imgui.end_popup()
        elif not still:
            self._draw = None

    def close(self) -> None:
        """Nothing in front any more."""
        self._draw, self._last = None, False

    # --- files -----------------------------------------------------------------------------------

    def open_file(self) -> None:
        """Choose a file, or type a path."""
        self._browse("Open", self._start(), self._open_body)

    def open_folder(self) -> None:
        """Choose a folder."""
        self._browse("Open Folder", self._start(), self._open_body, folders=True)

    def save_scene(self) -> None:
        """Where to write the scene."""
        name = self.shell.app.file or Path(self._start()) / f"{self.shell.stem()}.volviz.json"
        self._browse("Save Scene", str(name), self._save_body, suffix=".json")

    def save_picture(self) -> None:
        """Where to write a picture, how large."""
        self._picture = PictureForm(self.shell)
        self._browse("Save Picture", str(self.shell.exports.picture_name()), self._picture_body)

    def save_surface(self, number: int = 0) -> None:
        """Where to write a surface."""
        self._surface = SurfaceForm(self.shell, number)
        self._browse("Save Surface", self._surface.name(), self._surface_body)

    def _browse(self, title: str, text: str, body: Callable[[], None], **kinds: Any) -> None:
        self._browser = Browser(text, **kinds)
        self._replace = ""
        self._show(title, body)

    def _start(self) -> str:
        folder = Path(self.shell.app.settings.folder or Path.cwd())
        return str(folder if folder.is_dir() else Path.cwd()) + os.sep

    def _open_body(self) -> None:
        imgui.dummy(ImVec2(_wide(), 0))
        what = "folder" if self._browser.folders else "file, a folder or sample:name"
        imgui.push_text_wrap_pos(_wide())
        widgets.dim(f"Type or paste a {what}, or choose below")
        imgui.pop_text_wrap_pos()
        done = self._browser.draw(_high(20, 14))
        path = self._browser.path
        sample = self._browser.text.strip().startswith("sample:")
        ready = sample or bool(self._browser.kind)
        if self._buttons("Open", ready) or (done and ready):
            name = self._browser.text.strip() if sample else str(path)
            self.shell.open([name])
            self.close()

    def _save_body(self) -> None:
        imgui.dummy(ImVec2(_wide(), 0))
        done = self._browser.draw(_high(18, 12))
        if self._buttons(self._save_label(), self._fits()) or (done and self._fits()):
            self._write(self._save_and_leave if self._last else self.shell.app.save)

    def _picture_body(self) -> None:
        form = self._picture
        assert form is not None
        imgui.dummy(ImVec2(_wide(), 0))
        done = self._browser.draw(_high(11, 19))
        form.draw()
        path = self._browser.path
        problem = form.problem(path)
        ready = self._fits() and not problem
        if problem:
            imgui.text_colored(widgets.warning_color(), problem)
        else:
            widgets.dim(form.cost())
        if self._buttons(self._save_label(), ready) or (done and ready):
            take = self.shell.exports.take_picture
            again = self._replacing()
            self._write(
                lambda p: take(p, form.size, form.transparent, form.samples, overwrite=again)
            )

    def _surface_body(self) -> None:
        form = self._surface
        assert form is not None
        imgui.dummy(ImVec2(_wide(), 0))
        done = self._browser.draw(_high(15, 15))
        form.draw()
        problem = form.problem(self._browser.path)
        ready = self._fits() and not problem
        if problem:
            imgui.text_colored(widgets.warning_color(), problem)
        else:
            widgets.wrapped(form.told())
        if self._buttons(self._save_label(), ready) or (done and ready):
            again = self._replacing()
            self._write(lambda p: form.save(p, overwrite=again))

    def _fits(self) -> bool:
        path = self._browser.path
        fits = bool(path.name) and os.path.isdir(path.parent)
        return fits and self._browser.kind != "folder"

    def _save_label(self) -> str:
        return "Replace" if self._replacing() else "Save"

    def _replacing(self) -> bool:
        """True once the user saw that the file is there."""
        return bool(self._replace) and self._replace == self._browser.text

    def _write(self, act: Callable[[Path], None]) -> None:
        """Do it; a file that is there takes a second click."""
        path = self._browser.path
        if os.path.exists(path) and not self._replacing():
            self._replace = self._browser.text
            return
        self.close()
        try:
            act(path)
        except VolvizError as error:
            self.shell.app.messages.add(error, "error")

    def _buttons(self, label: str, ready: bool) -> bool:
        """Cancel and the button that does it; True if that was clicked."""
        if self._replacing():
            imgui.text_colored(widgets.warning_color(), "This file exists.")
        imgui.spacing()
        about = "Put it in place of the file that is there" if self._replacing() else f"{label} it"
        wide = self._em(7)
        clicked = widgets.button("dialog.do", label, about, width=wide, enabled=ready)
        imgui.same_line()
        if widgets.button("dialog.cancel", "Cancel", "Leave everything as it is", width=wide):
            self.close()
        return clicked

    def show(self, title: str, body: Callable[[], None]) -> None:
        """Anything else in front, drawn by `body` until it is closed."""
        self._show(title, body)

    # --- others ----------------------------------------------------------------------------------

    def _save_and_leave(self, path: Path) -> None:
        """Write the scene; the window closes once it is written, and stays if it is not."""
        self.shell.app.save(path, self.shell.quit)

    def ask_unsaved(self) -> None:
        """The window is to be closed with changes that no file has."""
        self._show("Unsaved changes", self._unsaved_body)

    def toggle_help(self) -> None:
        """Keys and mouse, or away with it."""
        if self.active == "Keys and Mouse":
            self.close()
        else:
            self._show("Keys and Mouse", self._help_body)

    def open_palette(self) -> None:
        """Find a command by typing."""
        self._palette = Palette(self.shell)
        self._show("Find a Command", self._palette_body)

    def show_panel(self, name: str, window: str) -> None:
        """Show a panel in front of those that share its place, also if all were hidden."""
        settings = self.shell.app.settings
        if not settings.panels:
            self.shell.toggle("panels")
        if name in settings.hidden:
            self.shell.show_panel(name, True)
        self._front = (window, FRONT_FRAMES)

    def _bring_to_front(self) -> None:
        """A window that was hidden takes a frame or two until it has its place."""
        window, left = self._front
        if left:
            to_front(window)
            self._front = (window, left - 1)
            self.shell.window.touch()

    def _unsaved_body(self) -> None:
        imgui.text(f"'{self.shell.stem()}' was changed since it was opened.")
        imgui.spacing()
        wide, file = self._em(7), self.shell.app.file
        label, about = "Save As…", "Choose a file for the scene, then close"
        if file is not None:
            label, about = "Save", f"Write {file.name}, then close"
        if widgets.button("unsaved.save", label, about, width=wide):
            if file is None:
                self.save_scene()
                self._last = True
            else:
                self.close()
                self._save_and_leave(file)
        imgui.same_line()
        if widgets.button("unsaved.close", "Close without saving", "Lose what was changed"):
            self.close()
            self.shell.leave()
        imgui.same_line()
        if widgets.button("unsaved.stay", "Stay", "Go on", width=wide):
            self.close()

    def _help_body(self) -> None:
        if help_overlay.draw():
            self.close()

    def _palette_body(self) -> None:
        assert self._palette is not None
        chosen = self._palette.draw()
        if chosen is not None:
            self.close()
            chosen.act()

    def _show(self, title: str, body: Callable[[], None]) -> None:
        self._title, self._draw, self._opening = title, body, True
        self._last = False

    @staticmethod
    def _em(count: float) -> float:
        return float(imgui.get_font_size()) * count


def _wide() -> float:
    """Of a dialog, in pixels: no wider than the window."""
    return float(min(widgets.em(34), imgui.get_main_viewport().work_size.x - widgets.em(4)))


def _high(count: float, others: float) -> float:
    """Of a list, in pixels: so many font sizes, fewer where what is around it needs `others`."""
    room = imgui.get_main_viewport().work_size.y - widgets.em(others)
    return float(min(widgets.em(count), max(room, widgets.em(4))))
