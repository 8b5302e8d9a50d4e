"""The nodes of a finder's tree as boxes in the 3D view, by level, with how many were opened."""

from __future__ import annotations

import colorsys
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from volviz.model.volume import Volume
from volviz.ui import widgets
from volviz.ui.facts import Facts
from volviz.ui.im import imgui
from volviz.ui.marks import Boxes, Marks

if TYPE_CHECKING:
    from volviz.isosurface.visits import Nodes, Visits

MOST = 6000
"""Boxes that are drawn at once: more are a thicket, and slow to turn."""
NAME = "nodes"
ALL = "all"
IDLE = 0.3
"""Opacity of nodes in vain, of that of the others."""


@dataclass
class State:
    """on: boxes are shown. side: of which level, "all" for all that fit. idle: also those in vain.

    made: what the boxes were made of."""

    on: bool = False
    side: str = ALL
    idle: bool = False
    made: tuple[object, ...] = ()


def section(volume: Volume, seen: Visits | None, facts: Facts) -> None:
    """The switches, the table of the levels; and the boxes over the view."""
    state, marks = facts.local.of(State), facts.local.of(Marks)
    if seen is None or not seen.levels:
        if seen is not None:
            marks.show(NAME, None)
            widgets.dim("This finder has no nodes in space to show.")
        return
    text = "Boxes in the 3D view: the nodes that the search opens, how the tree narrows."
    state.on = widgets.toggle("span.nodes", "Show nodes", text, state.on)
    if not state.on:
        marks.show(NAME, None)
        return
    idle = "In vain, too"
    widgets.beside(idle, box=True)
    text = "Also nodes that were looked at without a surface in them, fainter."
    state.idle = widgets.toggle("span.idle", idle, text, state.idle)
    _level(seen, state)
    _table(seen)
    boxes = _boxes(volume, seen, state, marks)
    marks.show(NAME, boxes)
    left = _left_out(seen, state)
    if left:
        widgets.wrapped(left, widgets.warning_color())


def chosen(seen: Visits, side: str, *, idle: bool) -> list[Nodes]:
    """The levels that are drawn: the one, or all from the root on that are no more than `MOST`."""
    if side != ALL:
        return [n for n in seen.levels if str(n.side) == side and _count(n, idle=idle) <= MOST]
    found, total = [], 0
    for nodes in seen.levels:
        total += _count(nodes, idle=idle)
        if total > MOST:
            break
        found.append(nodes)
    return found


def level_color(number: int, count: int) -> tuple[float, float, float]:
    """sRGB of a level, the root first: blue over green to yellow."""
    part = number / max(count - 1, 1)
    return colorsys.hls_to_rgb(0.62 - 0.48 * part, 0.62, 0.85)


def _count(nodes: Nodes, *, idle: bool) -> int:
    if nodes.active is None or (idle and nodes.idle is None and nodes.looked_at > nodes.count):
        return nodes.looked_at if idle else nodes.count
    return len(nodes.active) + (len(nodes.idle) if idle and nodes.idle is not None else 0)


def _level(seen: Visits, state: State) -> None:
    sides = [str(n.side) for n in seen.levels]
    if state.side not in (*sides, ALL):
        state.side = ALL
    named = {ALL: "All levels that fit", **{s: f"Nodes of {s}³ cells" for s in sides}}
    options = [("", side, name, "Only these boxes.") for side, name in named.items()]
    imgui.set_next_item_width(widgets.FILL)
    text = "Which nodes are drawn."
    state.side = widgets.choice("span.level", text, state.side, options, shown=named[state.side])


def _table(seen: Visits) -> None:
    """Per level: its colour, how many nodes were looked at, how many have the surface."""
    flags = imgui.TableFlags_.sizing_stretch_prop | imgui.TableFlags_.row_bg
    if not imgui.begin_table("###span.levels", 3, flags.value):
        return
    for column in ("nodes of", "looked at", "with surface"):
        imgui.table_setup_column(column)
    imgui.table_headers_row()
    for number, nodes in enumerate(seen.levels):
        imgui.table_next_row()
        imgui.table_next_column()
        color = level_color(number, len(seen.levels))
        ink = imgui.get_style_color_vec4(imgui.Col_.text)
        imgui.text_colored(type(ink)(*color, 1.0), "■")
        imgui.same_line()
        imgui.text_unformatted(f"{nodes.side}³ cells")
        for count in (nodes.looked_at, nodes.count):
            imgui.table_next_column()
            imgui.text_unformatted(f"{count:,}")
    imgui.end_table()


def _boxes(volume: Volume, seen: Visits, state: State, marks: Marks) -> Boxes | None:
    """Those shown already where nothing has changed: they are on the GPU."""
    key = (seen, state.side, state.idle)
    before = marks.shown(NAME)
    if before is not None and key == state.made:
        return before
    state.made = key
    ends: list[NDArray[np.int32]] = []
    colors: list[NDArray[np.uint8]] = []
    wanted = chosen(seen, state.side, idle=state.idle)
    sides = [n.side for n in seen.levels]
    for nodes in wanted:
        color = np.array(level_color(sides.index(nodes.side), len(sides)))
        for boxes, opacity in ((nodes.active, 0.8), (nodes.idle if state.idle else None, IDLE)):
            if boxes is not None and len(boxes):
                ends.append(boxes)
                paint = np.rint(255 * np.append(color, opacity)).astype(np.uint8)
                colors.append(np.tile(paint, (len(boxes), 1)))
    if not ends:
        return None
    corners = np.concatenate(ends).astype(np.float32)
    return Boxes(volume, seen.isovalue, corners, np.concatenate(colors), "span")


def _left_out(seen: Visits, state: State) -> str:
    """What is not drawn, for people; "" if all is."""
    drawn = {n.side for n in chosen(seen, state.side, idle=state.idle)}
    left = [n for n in seen.levels if n.side not in drawn and state.side in (ALL, str(n.side))]
    if not left:
        return ""
    counts = ", ".join(f"{_count(n, idle=state.idle):,} of {n.side}³ cells" for n in left)
    return f"Not drawn: {counts}. More than {MOST:,} boxes cannot be told apart."
