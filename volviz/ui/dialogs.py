"""What comes in front: open, save, keys and mouse, find a command, unsaved changes."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from volviz.image import FORMATS, MAX_PIXELS
from volviz.ui import theme
from volviz.ui.browser import Browser
from volviz.ui.commands import COMMANDS, MENUS, Command, shown_key
from volviz.ui.im import ImVec2, imgui

if TYPE_CHECKING:
    from volviz.ui.shell import Shell

MOUSE = (
    ("Left drag", "turn"),
    ("Middle or Shift+left drag", "pan"),
    ("Wheel", "zoom to the cursor"),
    ("Right drag", "zoom"),
    ("Ctrl+left drag", "roll"),
    ("Double click", "turn about what is there"),
    ("Cube", "click a side to look from it"),
)


class Dialogs:
    """At most one at a time."""

    def __init__(self, shell: Shell) -> None:
        self.shell = shell
        self._draw: Callable[[], None] | None = None
        self._title = ""
        self._opening = False
        self._browser = Browser("")
        self._size = [1600, 1200]
        self._transparent = False
        self._query = ""
        self._replace = ""

    @property
    def active(self) -> str:
        """The title of what is in front, "" for nothing."""
        return self._title if self._draw else ""

    def draw(self) -> None:
        """The present dialog, if there is one."""
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
        self._draw = None

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
        width, height = self.shell.viewport.size
        self._size = [max(width, 1), max(height, 1)]
        self._browse("Save Picture", str(self.shell.picture_name()), self._picture_body)

    def _browse(self, title: str, text: str, body: Callable[[], None], **kinds: Any) -> None:
        self._browser = Browser(text, **kinds)
        self._replace = ""
        self._show(title, body)

    def _start(self) -> str:
        folder = Path(self.shell.app.settings.folder or Path.cwd())
        return str(folder if folder.is_dir() else Path.cwd()) + os.sep

    def _open_body(self) -> None:
        size = self._em(34)
        imgui.dummy(ImVec2(size, 0))
        what = "folder" if self._browser.folders else "file, a folder or sample:name"
        imgui.text_disabled(f"Type or paste a {what}, or choose below")
        done = self._browser.draw(self._em(20))
        path = self._browser.path
        sample = self._browser.text.strip().startswith("sample:")
        ready = sample or path.is_file() or path.is_dir()
        if self._buttons("Open", ready) or (done and ready):
            name = self._browser.text.strip() if sample else str(path)
            self.shell.open([name])
            self.close()

    def _save_body(self) -> None:
        imgui.dummy(ImVec2(self._em(34), 0))
        done = self._browser.draw(self._em(18))
        if self._buttons(self._save_label(), self._fits()) or (done and self._fits()):
            self._write(self.shell.app.save)

    def _picture_body(self) -> None:
        imgui.dummy(ImVec2(self._em(34), 0))
        done = self._browser.draw(self._em(14))
        imgui.set_next_item_width(self._em(12))
        _, self._size = imgui.input_int2("Width and height", self._size)
        self._size = [min(max(n, 1), 16384) for n in self._size]
        _, self._transparent = imgui.checkbox("Transparent background", self._transparent)
        path = self._browser.path
        ready = self._fits() and path.suffix.lower() in FORMATS
        ready = ready and self._size[0] * self._size[1] <= MAX_PIXELS
        if not ready and path.suffix.lower() not in FORMATS:
            imgui.text_disabled(f"The name must end in {', '.join(FORMATS)}")
        if self._buttons(self._save_label(), ready) or (done and ready):
            width, height = self._size
            self._write(lambda p: self.shell.take_picture(p, (width, height), self._transparent))

    def _fits(self) -> bool:
        path = self._browser.path
        return bool(path.name) and path.parent.is_dir() and not path.is_dir()

    def _save_label(self) -> str:
        return "Replace" if self._replace == self._browser.text else "Save"

    def _write(self, act: Callable[[Path], None]) -> None:
        """Do it; a file that is there takes a second click."""
        path = self._browser.path
        if path.exists() and self._replace != self._browser.text:
            self._replace = self._browser.text
            return
        self.close()
        act(path)

    def _buttons(self, label: str, ready: bool) -> bool:
        """Cancel and the button that does it; True if that was clicked."""
        if self._replace and self._replace == self._browser.text:
            imgui.text_colored(theme.level("warning"), "This file exists.")
        imgui.spacing()
        imgui.begin_disabled(not ready)
        clicked = imgui.button(f"{label}###do", ImVec2(self._em(7), 0))
        imgui.end_disabled()
        imgui.same_line()
        if imgui.button("Cancel", ImVec2(self._em(7), 0)):
            self.close()
        return clicked

    # --- others ----------------------------------------------------------------------------------

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
        self._query = ""
        self._show("Find a Command", self._palette_body)

    def _unsaved_body(self) -> None:
        imgui.text(f"'{self.shell.stem()}' was changed since it was opened.")
        imgui.spacing()
        if imgui.button("Save As…", ImVec2(self._em(7), 0)):
            self.save_scene()
        imgui.same_line()
        if imgui.button("Close without saving"):
            self.close()
            self.shell.leave()
        imgui.same_line()
        if imgui.button("Stay", ImVec2(self._em(6), 0)):
            self.close()

    def _help_body(self) -> None:
        if any(imgui.is_key_pressed(k, False) for k in (imgui.Key.h, imgui.Key.f1)):
            self.close()
        columns = [("Mouse", list(MOUSE))]
        for menu in MENUS:
            rows = [(_keys(c), c.title) for c in COMMANDS.values() if c.menu == menu]
            columns.append((menu, rows))
        for group in (columns[:3], columns[3:]):
            imgui.begin_group()
            for title, rows in group:
                self._help_part(title, rows)
            imgui.end_group()
            imgui.same_line(0, self._em(2))
        imgui.new_line()

    def _help_part(self, title: str, rows: list[tuple[str, str]]) -> None:
        imgui.text_colored(theme.accent(), title)
        size = ImVec2(self._em(25), 0)
        if imgui.begin_table(f"###{title}", 2, imgui.TableFlags_.sizing_fixed_fit, size):
            imgui.table_setup_column("keys", 0, self._em(11.5))
            imgui.table_setup_column("what", 0, self._em(12))
            for keys, what in rows:
                imgui.table_next_column()
                imgui.text_disabled(keys)
                imgui.table_next_column()
                imgui.text(what)
            imgui.end_table()
        imgui.spacing()

    def _palette_body(self) -> None:
        if imgui.is_window_appearing():
            imgui.set_keyboard_focus_here()
        imgui.set_next_item_width(self._em(26))
        flags = imgui.InputTextFlags_.enter_returns_true
        entered, self._query = imgui.input_text_with_hint(
            "###query", "what do you want to do?", self._query, flags
        )
        found = [c for c in COMMANDS.values() if _matches(c, self._query)]
        chosen = found[0] if entered and found else None
        if imgui.begin_child("###found", ImVec2(self._em(26), self._em(16))):
            for index, command in enumerate(found):
                label = f"{command.title}###{index}"
                if imgui.selectable(label, index == 0)[0]:
                    chosen = command
                imgui.same_line(self._em(19))
                imgui.text_disabled(_keys(command))
        imgui.end_child()
        if chosen is not None:
            self.close()
            self.shell.do(chosen)

    def _show(self, title: str, body: Callable[[], None]) -> None:
        self._title, self._draw, self._opening = title, body, True

    @staticmethod
    def _em(count: float) -> float:
        return float(imgui.get_font_size()) * count


def _keys(command: Command) -> str:
    return ", ".join(shown_key(k) for k in command.keys if "keypad" not in k)


def _matches(command: Command, query: str) -> bool:
    text = f"{command.title} {command.menu} {command.help}".casefold()
    return all(word in text for word in query.casefold().split())
