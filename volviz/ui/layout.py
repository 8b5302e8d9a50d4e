"""Where the panels are docked: the first layout, and the one the user made, kept in a file."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path
from typing import Any

from volviz.app.settings import write_quietly
from volviz.ui.im import ImVec2, imgui, internal

FILE = "layout.ini"
VERSION = 1
VIEW = "3D###scene"
SHARES = {"left": 0.28, "right": 0.31}
SIDES = {"left": imgui.Dir.left, "right": imgui.Dir.right}
BELOW = {"right": ("right below",), "left": ("bottom",)}
"""Panels of these areas share a column, below: so the picture keeps the whole height."""
UPPER = 0.58


class Layout:
    """The dock space and its file. areas: window name to a key of SHARES or BELOW."""

    def __init__(self, folder: Path, areas: dict[str, str]) -> None:
        self.file = folder / FILE
        self.areas = areas
        self.notice: str | None = None
        self._fresh = True
        self._written = ""
        self._id = internal.im_hash_str("volviz")

    def load(self) -> None:
        """The user's layout, if there is one of this version."""
        try:
            if not self.file.exists():
                return
            text = self.file.read_text("utf-8")
            if not text.startswith(f"; volviz layout {VERSION}") or "[Docking]" not in text:
                raise ValueError("not a layout of this version")
        except (OSError, ValueError) as error:
            self.notice = f"the window layout could not be read ({error}); it starts afresh"
            with contextlib.suppress(OSError):  # it is written anew when the window closes
                os.replace(self.file, self.file.with_name(FILE + ".bad"))
            return
        imgui.load_ini_settings_from_memory(text)
        self._fresh = False

    def save(self) -> str | None:
        """Write the layout if it changed; a notice if that failed."""
        text = f"; volviz layout {VERSION}\n" + imgui.save_ini_settings_to_memory()
        if text == self._written:
            return None
        self._written = text
        return write_quietly(self.file, text.encode())

    def reset(self) -> None:
        """Build the first layout again with the next frame."""
        self._fresh = True

    def space(self) -> Any:
        """The dock space over the window; returns the id of its central node."""
        viewport = imgui.get_main_viewport()
        flags = imgui.DockNodeFlags_.no_docking_over_central_node
        space = self._id
        if self._fresh:
            self._fresh = False
            self._build(space, viewport.work_size)
        imgui.dock_space_over_viewport(space, viewport, flags)
        central = internal.dock_builder_get_central_node(space)
        return 0 if central is None else central.id_

    def aspect(self, extent: Any, *, panels: bool) -> float:
        """Width / height that the 3D view will have in a window of this size, about."""
        kept = (1 - SHARES["left"]) * (1 - SHARES["right"]) if panels else 1.0
        return float(max(extent.x * kept, 1.0) / max(extent.y, 1.0))

    def hide(self) -> None:
        """Instead of `space`, within any window: the panels keep their places for later."""
        if not self._fresh:
            imgui.dock_space(self._id, ImVec2(0, 0), imgui.DockNodeFlags_.keep_alive_only)

    def _build(self, space: Any, size: Any) -> None:
        internal.dock_builder_remove_node(space)
        internal.dock_builder_add_node(space, internal.DockNodeFlagsPrivate_.dock_space)
        internal.dock_builder_set_node_size(space, ImVec2(size.x, size.y))
        rest = space
        for side in ("right", "left"):
            names = {a: self._named(a) for a in (side, *BELOW[side])}
            if any(names.values()):
                split = internal.dock_builder_split_node(rest, SIDES[side], SHARES[side])
                rest = split.id_at_opposite_dir
                _dock_column(split.id_at_dir, [n for n in names.values() if n])
        internal.dock_builder_dock_window(VIEW, rest)
        node = internal.dock_builder_get_node(rest)
        node.set_local_flags(node.local_flags | internal.DockNodeFlagsPrivate_.no_tab_bar)
        internal.dock_builder_finish(space)

    def _named(self, area: str) -> list[str]:
        return [name for name, where in self.areas.items() if where == area]


def _dock_column(node: Any, stacks: list[list[str]]) -> None:
    """Stacks of tabs, one below the other."""
    for names in stacks[:-1]:
        split = internal.dock_builder_split_node(node, imgui.Dir.up, UPPER)
        for name in names:
            internal.dock_builder_dock_window(name, split.id_at_dir)
        node = split.id_at_opposite_dir
    for name in stacks[-1]:
        internal.dock_builder_dock_window(name, node)
