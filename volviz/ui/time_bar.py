"""A film's bar below the picture: back, play, on, and a slider over all times of the open file."""

from __future__ import annotations

from typing import TYPE_CHECKING

from volviz.ui import widgets
from volviz.ui.im import ImVec2, icons, imgui

if TYPE_CHECKING:
    from volviz.ui.shell import Shell


Place = tuple[float, float, float, float]


def draw(shell: Shell, place: Place) -> Place:
    """Over the lower edge of the 3D view; the place that is left above. place: x, y, w, h."""
    scene, choosing = shell.app.scene, shell.app.choosing
    if scene is None or scene.source is None or scene.volume.info.times < 2:
        return place
    em = float(imgui.get_font_size())
    x, y, w, h = place
    width = min(em * 30, w - em * 16)
    if width < em * 12:
        return place
    imgui.set_next_window_pos(ImVec2(x + w / 2, y + h - em * 0.8), 0, ImVec2(0.5, 1.0))
    imgui.set_next_window_size(ImVec2(width, 0))
    imgui.set_next_window_bg_alpha(0.82)
    kinds = imgui.WindowFlags_
    flags = kinds.no_decoration | kinds.no_saved_settings | kinds.no_docking | kinds.no_move
    flags |= kinds.no_focus_on_appearing | kinds.no_nav
    if imgui.begin("###times", None, flags)[0]:
        _buttons(shell)
        info = scene.volume.info
        wanted = dict(choosing.wanted or scene.source.choices).get("time", 0)
        imgui.set_next_item_width(widgets.FILL)
        new = widgets.slide_whole(
            "times.slider",
            "Which time is shown. Ctrl+click to type.",
            wanted + 1,
            low=1,
            high=info.times,
            form=f"time %d of {info.times}",
        )
        if new != wanted + 1:
            choosing.play(False)
            choosing.want({"time": new - 1})
    taken = float(imgui.get_window_height())
    imgui.end()
    return x, y, w, h - taken - em * 0.8


def _buttons(shell: Shell) -> None:
    choosing = shell.app.choosing
    if widgets.button("times.back", icons.ICON_FA_BACKWARD_STEP, "The time before (comma)."):
        choosing.play(False)
        choosing.step(-1)
    imgui.same_line()
    mark = icons.ICON_FA_PAUSE if choosing.playing else icons.ICON_FA_PLAY
    wide = imgui.get_frame_height() * 1.4
    text = "Stop (space)." if choosing.playing else "Show one time after the other (space)."
    if widgets.button("times.play", mark, text, width=wide):
        choosing.play(not choosing.playing)
    imgui.same_line()
    if widgets.button("times.on", icons.ICON_FA_FORWARD_STEP, "The next time (full stop)."):
        choosing.play(False)
        choosing.step(1)
    imgui.same_line()
