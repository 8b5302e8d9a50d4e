"""What is shown before anything is open: how to open, what was open lately, samples."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from volviz._version import __version__
from volviz.app.opening import title_of
from volviz.errors import safe_text
from volviz.samples import SAMPLES, Sample
from volviz.ui import theme, widgets
from volviz.ui.commands import COMMANDS, shown_key
from volviz.ui.im import ImVec2, icons, imgui
from volviz.ui.whereabouts import GONE, Whereabouts

if TYPE_CHECKING:
    from volviz.ui.shell import Shell

SHOWN = 6


def draw(shell: Shell) -> None:
    """Into the current ImGui window, in its middle."""
    em = imgui.get_font_size()
    space = imgui.get_content_region_avail()
    width = min(em * 62, space.x - em * 2)
    left = imgui.get_cursor_pos_x() + max((space.x - width) / 2, em)
    top = imgui.get_cursor_pos_y() + max((space.y - em * 27) * 0.42, em)
    imgui.set_cursor_pos(ImVec2(left, top))
    imgui.begin_child("###welcome", ImVec2(width, min(em * 27, space.y - top)))
    _head(shell)
    imgui.dummy(ImVec2(0, em * 1.2))
    beside = width > em * 34  # else one below the other
    whole = imgui.get_content_region_avail().x
    half = (whole - em * 2) / 2 if beside else whole
    # what samples are is said whole where there is room: paths can be cut in front
    wide = min(max(half, _samples_width()), whole - em * 20) if beside else whole
    parts = [("###recent", _recent, whole - em * 2 - wide if beside else whole)]
    parts.append(("###samples", _samples, wide))
    if not beside and not shell.app.settings.recent:
        parts.reverse()
    for index, (name, part, across) in enumerate(parts):
        if index and beside:
            imgui.same_line(0, em * 2)
        elif index:
            imgui.dummy(ImVec2(0, em))
        imgui.begin_child(name, ImVec2(across, 0), imgui.ChildFlags_.auto_resize_y)
        part(shell)
        imgui.end_child()
    imgui.dummy(ImVec2(0, em))
    _keys()
    imgui.end_child()


def _head(shell: Shell) -> None:
    em = imgui.get_font_size()
    imgui.push_font(None, imgui.get_style().font_size_base * 2.6)
    imgui.text("volviz")
    imgui.pop_font()
    imgui.text_disabled(f"See inside 3D data   {__version__}")
    imgui.dummy(ImVec2(0, em * 0.6))
    dark = theme.name() == "dark"
    imgui.push_style_color(imgui.Col_.button, theme.color(theme.ACCENT[theme.name()]))
    imgui.push_style_color(imgui.Col_.text, theme.color(theme.BAR["dark" if dark else "light"]))
    opened = imgui.button(f"{icons.ICON_FA_FOLDER_OPEN}  Open a file…", ImVec2(em * 10, em * 2.2))
    imgui.pop_style_color(2)
    widgets.tip("welcome.open", COMMANDS["open"].help)
    if opened:
        shell.do(COMMANDS["open"])
    imgui.same_line()
    opened = imgui.button(f"{icons.ICON_FA_FOLDER_TREE}  Open a folder…", ImVec2(em * 10, em * 2.2))
    widgets.tip("welcome.folder", COMMANDS["open-folder"].help)
    if opened:
        shell.do(COMMANDS["open-folder"])
    text = "or drop them here"
    right = imgui.get_window_pos().x + imgui.get_window_width()
    if imgui.get_item_rect_max().x + em + imgui.calc_text_size(text).x < right:
        imgui.same_line(0, em)
        lower = (em * 2.2 - imgui.get_frame_height()) / 2  # the button's text is that much lower
        imgui.set_cursor_pos_y(imgui.get_cursor_pos_y() + lower)
    imgui.text_disabled(text)


def _recent(shell: Shell) -> None:
    _title("Recent")
    for index, path in enumerate(shell.app.autosave.orphans()[:2]):
        name = f"{icons.ICON_FA_CLOCK_ROTATE_LEFT}  Recover the scene of a crash###orphan{index}"
        if imgui.selectable(name, False)[0]:
            shell.recover(path)
        widgets.tip(f"welcome.orphan.{index}", safe_text(path, 1000))
    recent = shell.app.settings.recent[:SHOWN]
    if not recent:
        imgui.text_disabled("Nothing yet")
    gone = shell.host.local.of(Whereabouts).gone(recent, shell.app)
    for index, name in enumerate(recent):
        imgui.begin_disabled(name in gone)
        if imgui.selectable(f"###open{index}", False)[0]:
            shell.open([name])
        about = safe_text(name, 1000)
        widgets.tip(f"welcome.recent.{index}", f"{about}\n{GONE}" if name in gone else about)
        imgui.same_line(0, 0)
        imgui.text_unformatted(title_of(name))
        imgui.end_disabled()
        imgui.same_line(0, imgui.get_font_size() * 0.7)
        _fitting("sample" if name.startswith("sample:") else _place(name))


def _samples(shell: Shell) -> None:
    _title("Samples")
    wide = _names_width()
    for name, sample in _shown():
        if imgui.selectable(f"###{name}", False)[0]:
            shell.open([f"sample:{name}"])
        widgets.tip(f"welcome.sample.{name}", sample.about)
        imgui.same_line(0, 0)
        imgui.text(name)
        imgui.same_line(wide)
        _fitting(sample.about)


def _shown() -> list[tuple[str, Sample]]:
    return list(SAMPLES.items())[: SHOWN + 1]


def _names_width() -> float:
    """Of the samples' names, in pixels."""
    return max(imgui.calc_text_size(name).x for name, _ in _shown()) + imgui.get_font_size()


def _samples_width() -> float:
    """Of the samples' names and all that is said of them, in pixels."""
    about = max(imgui.calc_text_size(sample.about).x for _, sample in _shown())
    return _names_width() + about + 1.0


def _keys() -> None:
    """Where to learn more."""
    parts = [f"{shown_key(COMMANDS[c].keys[0])}  {COMMANDS[c].title}" for c in ("help", "palette")]
    imgui.text_disabled("      ".join(parts))


def _fitting(text: str) -> None:
    """Quiet text, as much of it as there is room for."""
    room = imgui.get_content_region_avail().x
    shown = text
    while shown and imgui.calc_text_size(shown if shown == text else shown + "…").x > room:
        shown = shown[:-1]
    imgui.text_disabled(shown if shown == text else shown.rstrip(" ,") + "…")


def _title(text: str) -> None:
    imgui.text_colored(theme.accent(), text)
    imgui.separator()


def _place(name: str) -> str:
    folder = str(Path(name).parent)
    return safe_text(folder if len(folder) <= 34 else "…" + folder[-33:])
