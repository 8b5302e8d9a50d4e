"""What is shown before anything is open: how to open, what was open lately, samples."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from volviz._version import __version__
from volviz.app.opening import title_of
from volviz.errors import safe_text
from volviz.samples import SAMPLES
from volviz.ui import theme
from volviz.ui.commands import COMMANDS
from volviz.ui.im import ImVec2, icons, imgui

if TYPE_CHECKING:
    from volviz.ui.shell import Shell

SHOWN = 6


def draw(shell: Shell) -> None:
    """Into the current ImGui window, in its middle."""
    em = imgui.get_font_size()
    space = imgui.get_content_region_avail()
    width = min(em * 44, space.x - em * 2)
    left = imgui.get_cursor_pos_x() + max((space.x - width) / 2, em)
    top = imgui.get_cursor_pos_y() + max((space.y - em * 27) * 0.42, em)
    imgui.set_cursor_pos(ImVec2(left, top))
    imgui.begin_child("###welcome", ImVec2(width, em * 27))
    _head(shell)
    imgui.dummy(ImVec2(0, em))
    half = ImVec2((width - em * 2) / 2, em * 16)
    imgui.begin_child("###recent", half)
    _recent(shell)
    imgui.end_child()
    imgui.same_line(0, em * 2)
    imgui.begin_child("###samples", half)
    _samples(shell)
    imgui.end_child()
    imgui.end_child()


def _head(shell: Shell) -> None:
    em = imgui.get_font_size()
    imgui.push_font(None, imgui.get_style().font_size_base * 2.2)
    imgui.text("volviz")
    imgui.pop_font()
    imgui.text_disabled(f"See inside 3D data   {__version__}")
    imgui.dummy(ImVec2(0, em * 0.6))
    if imgui.button(f"{icons.ICON_FA_FOLDER_OPEN}  Open a file…", ImVec2(em * 10, em * 2.2)):
        shell.do(COMMANDS["open"])
    imgui.same_line()
    if imgui.button(f"{icons.ICON_FA_FOLDER_TREE}  Open a folder…", ImVec2(em * 10, em * 2.2)):
        shell.do(COMMANDS["open-folder"])
    imgui.same_line(0, em)
    imgui.align_text_to_frame_padding()
    imgui.set_cursor_pos_y(imgui.get_cursor_pos_y() + em * 0.3)
    imgui.text_disabled("or drop them here")


def _recent(shell: Shell) -> None:
    _title("Recent")
    for index, path in enumerate(shell.app.autosave.orphans()[:2]):
        name = f"{icons.ICON_FA_CLOCK_ROTATE_LEFT}  Recover the scene of a crash###orphan{index}"
        if imgui.selectable(name, False)[0]:
            shell.recover(path)
        imgui.set_item_tooltip(safe_text(path, 1000))
    recent = shell.app.settings.recent[:SHOWN]
    if not recent:
        imgui.text_disabled("nothing yet")
    for index, name in enumerate(recent):
        if imgui.selectable(f"###open{index}", False)[0]:
            shell.open([name])
        imgui.set_item_tooltip(safe_text(name, 1000))
        imgui.same_line(0, 0)
        imgui.text_unformatted(title_of(name))
        imgui.same_line(0, imgui.get_font_size() * 0.7)
        imgui.text_disabled("sample" if name.startswith("sample:") else _place(name))


def _samples(shell: Shell) -> None:
    _title("Samples")
    for name, sample in list(SAMPLES.items())[: SHOWN + 1]:
        if imgui.selectable(f"###{name}", False)[0]:
            shell.open([f"sample:{name}"])
        imgui.set_item_tooltip(sample.about)
        imgui.same_line(0, 0)
        imgui.text(name)


def _title(text: str) -> None:
    imgui.text_colored(theme.color(theme.ACCENT["dark"]), text)
    imgui.separator()


def _place(name: str) -> str:
    folder = str(Path(name).parent)
    return safe_text(folder if len(folder) <= 34 else "…" + folder[-33:])
