"""Where the panels are docked: the first layout, and the one the user made, kept in a file."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from volviz.app.settings import write_quietly
from volviz.ui.im import ImVec2, imgui, internal
from volviz.ui.theme import FONT_SIZE

FILE = "layout.ini"
VERSION = 3
VIEW = "3D###scene"
SHARES = {"right": 0.29, "left": 0.31}  # each of what the one before leaves
WIDEST = {"right": 36.0, "left": 27.0}
"""Font sizes that these get at most: a large screen is for the picture."""
NARROW = 60.0
"""Font sizes of width below which all panels share one column."""
ALONE = 0.46
VIEW_SHARE = 0.4
"""The picture keeps at least this part of the width."""
SIDES = {"left": imgui.Dir.left, "right": imgui.Dir.right}
BELOW = {"right": ("right below",), "left": ("bottom",)}
"""Panels of these areas share a column, below: so the picture keeps the whole height."""
UPPER = 0.58
ORDER = ("right", "right below", "left", "bottom")
"""Of the tabs where all panels share one column."""


class Layout:
    """The dock space and its file. areas: window name to a key of SHARES or BELOW."""

    def __init__(self, folder: Path, areas: dict[str, str]) -> None:
        self.file = folder / FILE
        self.areas = areas
        self.notice: str | None = None
        self._fresh = True
        self._written = ""
        self._narrow = False
        self._wide = ""
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
        self._wide, self._fresh = text, False

    def fit(self, width: float) -> None:
        """Before a frame: take the layout that suits a window so many font sizes wide.

        A narrow one is made anew each time; the user's own comes back with the room for it.
        """
        narrow = width < NARROW
        if narrow == self._narrow:
            return
        if narrow and not self._fresh:
            self._wide = imgui.save_ini_settings_to_memory()
        self._narrow, self._fresh = narrow, True
        if not narrow and self._wide:
            imgui.load_ini_settings_from_memory(self._wide)
            self._fresh = False

    def save(self) -> str | None:
        """Write the layout if it changed; a notice if that failed. A narrow one is not kept."""
        if self._narrow:
            return None
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
        central: Any = internal.dock_builder_get_central_node(space)
        if central is None:
            return 0
        self._make_room(central, viewport.work_size.x)
        return central.id_

    def _make_room(self, central: Any, width: float) -> None:
        """Columns keep their width when the window gets smaller: leave some for the picture."""
        if central.size.x >= VIEW_SHARE * width - 1:
            return
        around = {n.id_ for n in _upwards(central)}
        windows = (internal.find_window_by_name(name) for name in self.areas)
        docked = [w.dock_node for w in windows if w is not None]
        beside = {
            n.id_: n
            for dock in docked
            for n in _upwards(dock)
            if n.id_ not in around and n.parent_node is not None and n.parent_node.id_ in around
        }
        columns = [n for n in beside.values() if n.parent_node.split_axis == internal.Axis.x]
        taken = sum(n.size.x for n in columns)
        for column in columns:
            share = (1 - VIEW_SHARE) * width * column.size.x / taken
            internal.dock_builder_set_node_size(column.id_, ImVec2(share, column.size.y))

    def aspect(self, extent: Any, *, panels: bool) -> float:
        """Width / height that the 3D view will have in a window of this size, about."""
        width = extent.x
        for side in SHARES if panels else ():
            width *= 1 - _share(side, width)
        return float(max(width, 1.0) / max(extent.y, 1.0))

    def hide(self) -> None:
        """Instead of `space`, within any window: the panels keep their places for later."""
        if not self._fresh:
            imgui.dock_space(self._id, ImVec2(0, 0), imgui.DockNodeFlags_.keep_alive_only)

    def _build(self, space: Any, size: Any) -> None:
        internal.dock_builder_remove_node(space)
        internal.dock_builder_add_node(space, internal.DockNodeFlagsPrivate_.dock_space)
        internal.dock_builder_set_node_size(space, ImVec2(size.x, size.y))
        rest, width = space, size.x
        if self._narrow:
            split = internal.dock_builder_split_node(rest, imgui.Dir.right, ALONE)
            rest = split.id_at_opposite_dir
            _dock_column(split.id_at_dir, [sorted(self.areas, key=self._rank)])
        for side in SHARES if not self._narrow else ():
            names = {a: self._named(a) for a in (side, *BELOW[side])}
            if any(names.values()):
                share = _share(side, width)
                split = internal.dock_builder_split_node(rest, SIDES[side], share)
                rest, width = split.id_at_opposite_dir, width * (1 - share)
                _dock_column(split.id_at_dir, [n for n in names.values() if n])
        internal.dock_builder_dock_window(VIEW, rest)
        node = internal.dock_builder_get_node(rest)
        node.set_local_flags(node.local_flags | internal.DockNodeFlagsPrivate_.no_tab_bar)
        internal.dock_builder_finish(space)

    def _rank(self, name: str) -> int:
        return list(ORDER).index(self.areas[name])

    def _named(self, area: str) -> list[str]:
        return [name for name, where in self.areas.items() if where == area]


def _share(side: str, width: float) -> float:
    """The part of so many pixels that a column gets."""
    font = imgui.get_font_size() or FONT_SIZE
    return min(SHARES[side], WIDEST[side] * font / max(width, 1.0))


def to_front(window: str) -> None:
    """Bring a window in front of those that share its place, its tab into sight."""
    imgui.set_window_focus(window)
    found = internal.find_window_by_name(window)
    node = None if found is None else found.dock_node
    if found is not None and node is not None and node.tab_bar is not None:
        node.tab_bar.next_selected_tab_id = found.tab_id


def _upwards(node: Any) -> Iterator[Any]:
    """A dock node and those it lies in."""
    while node is not None:
        yield node
        node = node.parent_node


def _dock_column(node: Any, stacks: list[list[str]]) -> None:
    """Stacks of tabs, one below the other; the first of each is in front."""
    for names in stacks[:-1]:
        split = internal.dock_builder_split_node(node, imgui.Dir.up, UPPER)
        _dock_stack(split.id_at_dir, names)
        node = split.id_at_opposite_dir
    _dock_stack(node, stacks[-1])


def _dock_stack(node: Any, names: list[str]) -> None:
    for name in names:
        internal.dock_builder_dock_window(name, node)
    stack = internal.dock_builder_get_node(node)
    stack.selected_tab_id = internal.im_hash_str("#TAB", 0, internal.im_hash_str(names[0]))
    bare = internal.DockNodeFlagsPrivate_.no_close_button  # each tab has one
    stack.set_local_flags(stack.local_flags | bare)
