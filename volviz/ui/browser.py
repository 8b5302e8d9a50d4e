"""A list of files to choose from, with the path as text that can be typed or pasted."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path

from volviz.ui import widgets
from volviz.ui.im import ImVec2, icons, imgui

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

    @property
    def path(self) -> Path:
        """What the text stands for."""
        return Path(os.path.expandvars(self.text.strip().strip("'\""))).expanduser()

    @property
    def folder(self) -> Path:
        """The folder that is listed: the text's own, or its parent."""
        path = self.path
        return path if path.is_dir() else path.parent

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
        if entered and not (self.path.is_dir() and not self.folders):
            return True
        folder = self.folder
        if folder != self._listed:
            self._read(folder)
        chosen = False
        if imgui.begin_child("###files", ImVec2(0, height), imgui.ChildFlags_.borders):
            if folder.parent != folder:
                if imgui.selectable(f"{icons.ICON_FA_ARROW_UP}  ..###up", False)[0]:
                    self.text = str(folder.parent) + os.sep
                widgets.tip("browser.up", f"Up to {folder.parent}")
            chosen = self._list(folder)
            if self._note:
                imgui.text_disabled(self._note)
        imgui.end_child()
        return chosen

    def _list(self, folder: Path) -> bool:
        chosen = False
        current = self.path.name
        for name, is_folder in self._names:
            icon = icons.ICON_FA_FOLDER if is_folder else icons.ICON_FA_FILE
            flags = imgui.SelectableFlags_.allow_double_click
            clicked, _ = imgui.selectable(f"{icon}  {name}###{name}", name == current, flags)
            widgets.tip(f"browser.file.{name}", name)
            if clicked and is_folder:
                self.text = str(folder / name) + os.sep
            elif clicked:
                self.text = str(folder / name)
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
