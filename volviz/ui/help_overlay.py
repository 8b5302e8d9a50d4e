"""Everything that mouse and keys do, on one sheet."""

from __future__ import annotations

from volviz.ui import theme, widgets
from volviz.ui.commands import COMMANDS, MENUS, shown_keys
from volviz.ui.im import ImVec2, imgui

Group = tuple[str, tuple[tuple[str, str], ...]]

GESTURES: tuple[Group, ...] = (
    (
        "Mouse in the picture",
        (
            ("Left drag", "turn"),
            ("Middle or Shift+left drag", "pan"),
            ("Wheel", "zoom to the cursor"),
            ("Right drag", "zoom"),
            ("Shift+right drag", "window and level"),
            ("Ctrl+left drag", "roll"),
            ("Double click", "turn about what is there"),
            ("Cube", "click a side to look from it"),
            ("Drag the lens's middle", "move the lens"),
            ("Alt+left drag", "bring the lens there"),
            ("Alt+wheel", "size of the lens"),
            ("Drop", "open a file or a folder"),
        ),
    ),
    (
        "Mouse in the transfer function",
        (
            ("Double click", "add a point"),
            ("Left drag a point", "move it"),
            ("Shift+click, left drag", "select several"),
            ("Ctrl+left drag", "shift everything"),
            ("Right drag", "window and level"),
            ("Right click a point, Del", "remove it"),
            ("Arrows, Esc", "move, deselect points"),
            ("Wheel", "zoom the values"),
            ("Middle drag", "move the values' axis"),
        ),
    ),
    (
        "Numbers",
        (
            ("Left drag", "change"),
            ("Double or Ctrl+click", "type"),
            ("Esc", "leave as it was"),
        ),
    ),
)
COLUMN = 23.0
KEYS = 10.5


def groups() -> list[Group]:
    """Headings and their rows of (keys, what they do): all gestures and all commands."""
    menus = [
        (
            menu,
            tuple(
                (shown_keys(c), c.title)
                for c in COMMANDS.values()
                if c.menu == menu and not c.series
            ),
        )
        for menu in MENUS
    ]
    return [*GESTURES, *menus]


def columns(parts: list[Group], count: int) -> list[list[Group]]:
    """The parts in their order, in so many columns of nearly the same height."""
    heights = [len(rows) + 2 for _, rows in parts]
    tallest = max(heights)
    while True:
        made: list[list[Group]] = [[]]
        height = 0
        for part, high in zip(parts, heights, strict=True):
            if made[-1] and height + high > tallest:
                made.append([])
                height = 0
            made[-1].append(part)
            height += high
        if len(made) <= count:
            return made
        tallest += 1


def draw() -> bool:
    """Into the current window, as wide and high as there is room; True to close it."""
    room = imgui.get_main_viewport().work_size
    wide = widgets.em(COLUMN)
    most = max(int((room.x * 0.95 - widgets.em(2)) / wide), 1)
    sheet = columns(groups(), min(most, 4))
    tallest = max(sum(len(rows) + 2 for _, rows in column) for column in sheet)
    high = tallest * imgui.get_text_line_height_with_spacing() + widgets.em(1)
    bar = imgui.get_style().scrollbar_size
    size = ImVec2(
        min(wide * len(sheet) + bar, room.x * 0.95 - widgets.em(2)),
        min(high, room.y * 0.95 - widgets.em(5)),
    )
    if imgui.begin_child("###help.sheet", size):
        for index, column in enumerate(sheet):
            if index:
                imgui.same_line(index * wide)
            imgui.begin_group()
            for title, rows in column:
                _part(title, rows)
            imgui.end_group()
    imgui.end_child()
    return any(imgui.is_key_pressed(k, False) for k in (imgui.Key.h, imgui.Key.f1))


def _part(title: str, rows: tuple[tuple[str, str], ...]) -> None:
    imgui.text_colored(theme.accent(), title)
    size = ImVec2(widgets.em(COLUMN - 1), 0)
    if imgui.begin_table(f"###help.{title}", 2, imgui.TableFlags_.sizing_fixed_fit, size):
        imgui.table_setup_column("keys", 0, widgets.em(KEYS))
        imgui.table_setup_column("what", 0, widgets.em(COLUMN - KEYS - 2))
        for keys, what in rows:
            imgui.table_next_column()
            widgets.dim(keys)
            imgui.table_next_column()
            imgui.text_unformatted(what)
        imgui.end_table()
    imgui.spacing()
