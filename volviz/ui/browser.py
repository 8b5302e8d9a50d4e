"""A list of files to choose from, with the path as text that can be typed or pasted."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path

from volviz.app.opening import typed
from volviz.errors import safe_text
from volviz.ui import widgets
from volviz.ui.im import ImVec2, icons, imgui

LONGEST = 8000
MAX_ENTRIES = 5000


@dataclass
class Browser:
    """What is typed and which folder is listed. folders: only folders are of interest."""

    text: str
    folders: bool = False
    suffix: str = ""
    _listed: Path | None = None
    _names: list[tuple[str, bool]] = field(default_factory=list)
    _note: str = ""
    _fresh: bool = True
    _exact: tuple[str, str] = ("", "")

    def __post_init__(self) -> None:
        self.put(self.text)

    def put(self, text: str) -> None:
        """Another text. What no screen can show in it is shown otherwise, and known again."""
        self.text = safe_text(text, LONGEST)
        self._exact = (self.text, text)

    @property
    def path(self) -> Path:
        """What the text stands for."""
        shown, exact = self._exact
        if shown != exact and self.text.startswith(shown):
            return Path(exact + self.text[len(shown) :])
        return typed(self.text)

    @property
    def kind(self) -> str:
        """ "file", "folder", or "" where nothing is or can be."""
        place = self.path
        if os.path.isdir(place):  # Path.is_dir raises for names that are too long
            return "folder"
        return "file" if os.path.isfile(place) else ""

    @property
    def folder(self) -> Path:
        """The folder that is listed: the text's own, or its parent."""
        path = self.path
        return path if self.kind == "folder" else path.parent

    def draw(self, height: float) -> bool:
        """The path, the way up and the list; True if a file was double-clicked or entered."""
        if self._fresh:
            imgui.set_keyboard_focus_here()
            self._fresh = False
        imgui.set_next_item_width(-1)
        entered, self.text = imgui.input_text(
            "###path", self.text, imgui.InputTextFlags_.enter_returns_true
        )
        widgets.tip("browser.path", "Type or paste a path; Enter takes it", show=not self.text)
        if entered and (self.folders or self.kind != "folder"):
            return True
        folder = self.folder
        if folder != self._listed:
            self._read(folder)
        chosen = False
        if imgui.begin_child("###files", ImVec2(0, height), imgui.ChildFlags_.borders):
            if folder.parent != folder:
                if imgui.selectable(f"{icons.ICON_FA_ARROW_UP}  ..###up", False)[0]:
                    self.put(str(folder.parent) + os.sep)
                widgets.tip("browser.up", f"Up to {safe_text(str(folder.parent))}")
            chosen = self._list(folder)
            if self._note:
                imgui.text_disabled(self._note)
        imgui.end_child()
        return chosen

    def _list(self, folder: Path) -> bool:
        chosen = False
        current = self.path.name
        for index, (name, is_folder) in enumerate(self._names):
            icon = icons.ICON_FA_FOLDER if is_folder else icons.ICON_FA_FILE
            flags = imgui.SelectableFlags_.allow_double_click
            label = safe_text(name).replace("##", "# #")
            clicked, _ = imgui.selectable(f"{icon}  {label}###{index}", name == current, flags)
            widgets.tip(f"browser.file.{index}", safe_text(name))
            if clicked and is_folder:
                self.put(str(folder / name) + os.sep)
            elif clicked:
                self.put(str(folder / name))
                chosen = imgui.is_mouse_double_clicked(0)
        return chosen

    def _read(self, folder: Path) -> None:
        self._listed, self._note = folder, ""
        try:
            with os.scandir(folder) as entries:
                found = [(e.name, e.is_dir()) for e in entries if not e.name.startswith(".")]
        except OSError as error:
            self._names, self._note = [], error.strerror or str(error)
            return
        if self.suffix:
            found = [(n, d) for n, d in found if d or n.lower().endswith(self.suffix)]
        found.sort(key=lambda e: (not e[1], e[0].casefold()))
        if len(found) > MAX_ENTRIES:
            self._note = f"… and {len(found) - MAX_ENTRIES} more"
        elif not found:
            self._note = "nothing here"
        self._names = found[:MAX_ENTRIES]
