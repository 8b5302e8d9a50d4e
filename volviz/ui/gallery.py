"""Pictures to choose from, in rows that fill the panel: each with its name, a mark, a star."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from volviz.errors import safe_text
from volviz.ui import widgets
from volviz.ui.im import ImVec2, icons, imgui

LEAST = 6.4
"""Font sizes of width that a picture has at least."""
LARGE = 17.0
"""Font sizes of a picture under the mouse."""
AMBER = 0xFF4CB8F2
SHADE = 0xA0000000
EMPTY = 0x30808080


@dataclass(frozen=True)
class Hit:
    """What happened to a picture in this frame. menu: the other mouse button. asked: the mouse
    rests on it, so that more may be told."""

    clicked: bool = False
    menu: bool = False
    asked: bool = False
    starred: bool = False
    seen: bool = False


class Grid:
    """Places pictures from left to right. side: of a picture, in pixels."""

    def __init__(self) -> None:
        room = imgui.get_content_region_avail().x
        self._gap = widgets.em(0.5)
        least = widgets.em(LEAST)
        self.columns = max(int((room + self._gap) / (least + self._gap)), 1)
        self.side = max((room - (self.columns - 1) * self._gap) / self.columns, 8.0)
        self._at = 0

    def begin_row(self) -> None:
        """The next picture starts a row, e.g. below a heading."""
        self._at = 0

    def cell(
        self,
        id_: str,
        title: str,
        about: str,
        texture: int | None,
        *,
        active: bool = False,
        star: bool | None = None,
        badge: str = "",
        note: str | None = None,
    ) -> Hit:
        """One picture. about: its tooltip, drawn by the caller. star: None has no place for one.
        badge: a few letters in the corner. note: a second line below, None for no room for it."""
        if self._at % self.columns:
            imgui.same_line(0, self._gap)
        self._at += 1
        line = imgui.get_text_line_height()
        height = self.side + line * (1 if note is None else 2) + widgets.em(0.35)
        imgui.begin_group()
        if star is not None:
            imgui.set_next_item_allow_overlap()
        both = imgui.ButtonFlags_.mouse_button_left | imgui.ButtonFlags_.mouse_button_right
        clicked = imgui.invisible_button(f"###{id_}", ImVec2(self.side, height), both)
        widgets.tip(id_, about, show=False)
        seen, hovered = imgui.is_item_visible(), imgui.is_item_hovered()
        asked = imgui.is_item_hovered(imgui.HoveredFlags_.for_tooltip)
        menu = clicked and imgui.is_mouse_released(imgui.MouseButton_.right)
        corner = imgui.get_item_rect_min()
        _picture(corner, self.side, texture, active, hovered)
        _caption(corner, self.side, title, active or note is not None)
        if note:
            _caption(ImVec2(corner.x, corner.y + line), self.side, note, False)
        if badge:
            _badge(corner, badge)
        starred = star is not None and self._star(id_, corner, star, hovered)
        imgui.set_cursor_screen_pos(corner)  # back from the star
        imgui.dummy(ImVec2(self.side, height))
        imgui.end_group()
        return Hit(clicked and not menu, menu, asked, starred, seen)

    def _star(self, id_: str, corner: ImVec2, on: bool, near: bool) -> bool:
        """The star in the upper right corner; True when clicked."""
        size = widgets.em(1.7)
        imgui.set_cursor_screen_pos(ImVec2(corner.x + self.side - size, corner.y))
        pressed = imgui.invisible_button(f"###{id_}.star", ImVec2(size, size))
        widgets.tip(f"{id_}.star", "No longer a favourite" if on else "Make it a favourite")
        over = imgui.is_item_hovered()
        if on or near or over:
            draw = imgui.get_window_draw_list()
            middle = ImVec2(corner.x + self.side - size / 2, corner.y + size / 2)
            draw.add_circle_filled(middle, size * 0.43, SHADE)
            text = icons.ICON_FA_STAR
            extent = imgui.calc_text_size(text)
            at = ImVec2(middle.x - extent.x / 2, middle.y - extent.y / 2)
            draw.add_text(at, AMBER if on else 0xFFFFFFFF if over else 0x90FFFFFF, text)
        return bool(pressed)


def preview(texture: int | None, title: str, lines: Sequence[str], warning: str | None) -> None:
    """A tooltip with the picture large, its name and what it is."""
    if not imgui.begin_tooltip():
        return
    side = widgets.em(LARGE)
    corner = imgui.get_cursor_screen_pos()
    imgui.dummy(ImVec2(side, side))
    _picture(corner, side, texture, False, False)
    imgui.push_text_wrap_pos(imgui.get_cursor_pos_x() + side)
    imgui.text_unformatted(safe_text(title))
    for line in lines:
        widgets.dim(safe_text(line, 1000))
    if warning:
        imgui.push_style_color(imgui.Col_.text, widgets.warning_color())
        imgui.text_unformatted(safe_text(warning, 1000))
        imgui.pop_style_color()
    imgui.pop_text_wrap_pos()
    imgui.end_tooltip()


def pixels(side: float, least: int = 128) -> int:
    """Pixels to draw for a picture that is so large on the screen: one size or twice that."""
    scale = imgui.get_io().display_framebuffer_scale.x
    return least if side * scale <= 1.2 * least else 2 * least


def large_pixels() -> int:
    """Pixels to draw for the picture under the mouse."""
    return pixels(widgets.em(LARGE), 256)


def _picture(corner: ImVec2, side: float, texture: int | None, active: bool, hovered: bool) -> None:
    draw = imgui.get_window_draw_list()
    end = ImVec2(corner.x + side, corner.y + side)
    radius = imgui.get_style().frame_rounding
    if texture is None:
        draw.add_rect_filled(corner, end, EMPTY, radius)
    else:
        zero, one = ImVec2(0, 0), ImVec2(1, 1)
        image = imgui.ImTextureRef(texture)
        draw.add_image_rounded(image, corner, end, zero, one, 0xFFFFFFFF, radius)
    if active or hovered:
        role = imgui.Col_.check_mark if active else imgui.Col_.text_disabled
        thick = widgets.em(0.17 if active else 0.08)
        draw.add_rect(corner, end, imgui.get_color_u32(role), radius, thick)


def _caption(corner: ImVec2, side: float, title: str, active: bool) -> None:
    """The name below, cut where there is no more room."""
    role = imgui.Col_.text if active else imgui.Col_.text_disabled
    text = shortened(safe_text(title), side)
    at = ImVec2(corner.x + 1, corner.y + side + widgets.em(0.15))
    imgui.get_window_draw_list().add_text(at, imgui.get_color_u32(role), text)


def _badge(corner: ImVec2, text: str) -> None:
    draw = imgui.get_window_draw_list()
    extent, pad = imgui.calc_text_size(text), widgets.em(0.3)
    low = ImVec2(corner.x + pad, corner.y + pad)
    high = ImVec2(low.x + extent.x + 2 * pad, low.y + extent.y + 0.4 * pad)
    draw.add_rect_filled(low, high, SHADE, imgui.get_style().frame_rounding)
    draw.add_text(ImVec2(low.x + pad, low.y + 0.2 * pad), 0xFFFFFFFF, text)


def shortened(text: str, width: float) -> str:
    """The text, or as much of it as fits with an ellipsis."""
    if imgui.calc_text_size(text).x <= width:
        return text
    while text and imgui.calc_text_size(text + "…").x > width:
        text = text[:-1]
    return text.rstrip(" ,(") + "…"
