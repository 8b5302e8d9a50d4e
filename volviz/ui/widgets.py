"""Widgets as panels use them: each has an id of its own and a tooltip, and returns its value.

Panels call these and never imgui's own, so that no tooltip is forgotten. `watch` lists the
widgets of a frame for tests.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

import numpy as np

from volviz.errors import safe_text
from volviz.ui import theme
from volviz.ui.im import ImVec2, ImVec4, imgui
from volviz.ui.tips import Watch, tip, watch

__all__ = ["Watch", "tip", "watch"]  # of `tips`, for those who use widgets

FILL = -1e-5


def em(count: float = 1.0) -> float:
    """So many font sizes in pixels."""
    return float(count * imgui.get_font_size())


def dim(text: str) -> None:
    """Text in the quieter colour."""
    imgui.push_style_color(imgui.Col_.text, imgui.get_style_color_vec4(imgui.Col_.text_disabled))
    imgui.text_unformatted(text)
    imgui.pop_style_color()


def quiet(text: str) -> None:
    """Text in the quieter colour, over as many lines as it needs."""
    wrapped(text, imgui.get_style_color_vec4(imgui.Col_.text_disabled))


def wrapped(text: str, color: ImVec4 | None = None) -> None:
    """Text over as many lines as it needs, unformatted."""
    if color is not None:
        imgui.push_style_color(imgui.Col_.text, color)
    imgui.push_text_wrap_pos(0.0)
    imgui.text_unformatted(text)
    imgui.pop_text_wrap_pos()
    if color is not None:
        imgui.pop_style_color()


def warning_color() -> ImVec4:
    """Amber that can be read on the window's background."""
    return theme.level("warning")


def error_color() -> ImVec4:
    """Red that can be read on the window's background."""
    return theme.level("error")


def button(id_: str, label: str, text: str, *, width: float = 0.0, enabled: bool = True) -> bool:
    """A button; True when clicked."""
    imgui.begin_disabled(not enabled)
    pressed = imgui.button(f"{label}###{id_}", ImVec2(width, 0.0))
    imgui.end_disabled()
    tip(id_, text)
    return bool(pressed and enabled)


def toggle(id_: str, label: str, text: str, value: bool) -> bool:
    """A check box."""
    _, value = imgui.checkbox(f"{label}###{id_}", value)
    tip(id_, text)
    return bool(value)


def row(id_: str, label: str, text: str, selected: bool, *, span: bool = False) -> bool:
    """A line to pick in a list; True when clicked. span: across all columns of a table."""
    flags = imgui.SelectableFlags_.span_all_columns if span else 0
    pressed, _ = imgui.selectable(f"{safe_text(label, 2000)}###{id_}", selected, flags)
    tip(id_, text)
    return pressed


def choice(
    id_: str,
    text: str,
    value: str,
    options: Sequence[tuple[str, str, str, str]],
    *,
    shown: str | None = None,
    swatch: Callable[[str], Sequence[int]] | None = None,
) -> str:
    """One of several names. options: (group, name, label, tooltip); groups get a heading each.

    shown: what is written in the closed field. swatch: packed colours to paint beside a name.
    """
    alone = len(options) < 2
    if alone:
        imgui.begin_disabled()
    large = imgui.ComboFlags_.height_large
    opened = imgui.begin_combo(f"###{id_}", value if shown is None else shown, large)
    if alone:  # a disabled one never opens: what it begins would have to end within
        imgui.end_disabled()
    tip(id_, text)
    if opened:
        heading = ""
        for group, name, label, about in options:
            if group != heading:
                heading = group
                imgui.separator_text(group)
            if row(f"{id_}.{name}", label, about, name == value):
                value = name
            if swatch is not None:
                _paint_swatch(swatch(name))
            if name == value and imgui.is_window_appearing():
                imgui.set_scroll_here_y()
        imgui.end_combo()
    return value


def _paint_swatch(colors: Sequence[int]) -> None:
    """Colours from left to right, at the right end of the item just drawn."""
    low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
    width, inset = em(7), (high.y - low.y) * 0.15
    left, draw = high.x - width - inset, imgui.get_window_draw_list()
    step = width / (len(colors) - 1)
    for i, (a, b) in enumerate(itertools.pairwise(colors)):
        corner = ImVec2(left + i * step, low.y + inset)
        end = ImVec2(left + (i + 1) * step, high.y - inset)
        draw.add_rect_filled_multi_color(corner, end, a, b, b, a)


def drag(
    id_: str,
    text: str,
    value: float,
    *,
    speed: float,
    low: float | None = None,
    high: float | None = None,
    form: str = "%.4g",
    log: bool = False,
) -> float:
    """A number to drag, or to type after a double click; kept within low..high."""
    flags = imgui.SliderFlags_.no_round_to_format
    if low is not None or high is not None:
        flags |= imgui.SliderFlags_.always_clamp
    if log:
        flags |= imgui.SliderFlags_.logarithmic
    least, most = -3.4e38 if low is None else low, 3.4e38 if high is None else high
    if low is None and high is None:
        least = most = 0.0
    changed, new = imgui.drag_float(f"###{id_}", value, speed, least, most, form, flags)
    tip(id_, text)
    if not changed or not math.isfinite(new):
        return value
    new = rounded(new)
    return min(max(new, least), most) if least < most else new


def drag_whole(
    id_: str, text: str, value: int, *, speed: float, low: int | None, high: int | None
) -> int:
    """A whole number to drag, or to type after a double click."""
    least = -(2**31) if low is None else low
    most = 2**31 - 1 if high is None else high
    flags = imgui.SliderFlags_.always_clamp
    _, value = imgui.drag_int(f"###{id_}", value, speed, least, most, "%d", flags)
    tip(id_, text)
    return min(max(int(value), least), most)


def slide_whole(id_: str, text: str, value: int, *, low: int, high: int, form: str) -> int:
    """A whole number between two ends, to slide, or to type after Ctrl+click."""
    flags = imgui.SliderFlags_.always_clamp
    _, value = imgui.slider_int(f"###{id_}", value, low, high, form, flags)
    tip(id_, text, show=not imgui.is_item_active())
    return min(max(int(value), low), high)


def vector(
    id_: str, text: str, value: tuple[float, float, float], *, speed: float
) -> tuple[float, float, float]:
    """Three numbers to drag or type; those left alone stay as exact as they were."""
    flags = imgui.SliderFlags_.no_round_to_format
    changed, new = imgui.drag_float3(f"###{id_}", list(value), speed, 0.0, 0.0, "%.4g", flags)
    tip(id_, text)
    if not changed:
        return value
    single = [float(np.float32(v)) for v in value]
    x, y, z = (
        v if n == s or not math.isfinite(n) else rounded(n)
        for v, n, s in zip(value, new, single, strict=True)
    )
    return x, y, z


def number(id_: str, text: str, value: float, *, form: str = "%.7g") -> float:
    """A number to type, exactly."""
    changed, new = imgui.input_double(f"###{id_}", value, 0.0, 0.0, form)
    tip(id_, text)
    return float(new) if changed and math.isfinite(new) else value


def search(id_: str, hint: str, text: str, value: str) -> str:
    """A line to type in."""
    _, value = imgui.input_text_with_hint(f"###{id_}", hint, value)
    tip(id_, text)
    return str(value)


def color(id_: str, text: str, value: Sequence[float], *, bare: bool = False) -> tuple[float, ...]:
    """An sRGB colour with or without opacity: a field that opens a picker. bare: without text."""
    flags = imgui.ColorEditFlags_.float | imgui.ColorEditFlags_.no_tooltip
    if bare:
        flags |= imgui.ColorEditFlags_.no_inputs
    if len(value) == 4:
        flags |= imgui.ColorEditFlags_.alpha_preview_half | imgui.ColorEditFlags_.alpha_bar
        flags |= imgui.ColorEditFlags_.display_rgb
        changed, new = imgui.color_edit4(f"###{id_}", list(value), flags)
    else:
        flags |= imgui.ColorEditFlags_.display_hex
        changed, new = imgui.color_edit3(f"###{id_}", list(value), flags)
    tip(id_, text)
    if not changed:
        return tuple(value)
    return tuple(min(max(round(float(c), 6), 0.0), 1.0) for c in new)


def _bare_button(id_: str, text: str) -> tuple[bool, ImVec2, float, int]:
    """A square button without a face: pressed, its corner, its side, and what to paint it with."""
    size = imgui.get_frame_height()
    pressed = bool(imgui.invisible_button(f"###{id_}", ImVec2(size, size)))
    tip(id_, text)
    hot = imgui.Col_.text if imgui.is_item_hovered() else imgui.Col_.text_disabled
    return pressed, imgui.get_item_rect_min(), size, imgui.get_color_u32(hot)


def reset_button(id_: str, text: str) -> bool:
    """A small arrow that runs back; drawn, so that it needs no font."""
    pressed, low, size, paint = _bare_button(id_, text)
    draw = imgui.get_window_draw_list()
    middle, radius = ImVec2(low.x + size / 2, low.y + size / 2), size * 0.22
    draw.path_arc_to(middle, radius, -2.4, 2.4, 20)
    draw.path_stroke(paint, max(size * 0.06, 1.0))
    x, y = middle.x + radius * math.cos(-2.4), middle.y + radius * math.sin(-2.4)
    reach = size * 0.16
    draw.add_triangle_filled(
        ImVec2(x - reach * 0.9, y - reach * 0.3),
        ImVec2(x + reach * 0.9, y - reach * 0.9),
        ImVec2(x + reach * 0.5, y + reach * 0.9),
        paint,
    )
    return pressed


def delete_button(id_: str, text: str) -> bool:
    """A small cross; drawn, so that it needs no font."""
    pressed, low, size, paint = _bare_button(id_, text)
    draw = imgui.get_window_draw_list()
    a, b = size * 0.34, size * 0.66
    thick = max(size * 0.06, 1.0)
    draw.add_line(ImVec2(low.x + a, low.y + a), ImVec2(low.x + b, low.y + b), paint, thick)
    draw.add_line(ImVec2(low.x + a, low.y + b), ImVec2(low.x + b, low.y + a), paint, thick)
    return pressed


def hint(id_: str, text: str) -> None:
    """A question mark that explains."""
    imgui.align_text_to_frame_padding()
    dim("(?)")
    tip(id_, text)


def faint(text: str) -> None:
    """Quiet text on the line of a widget."""
    imgui.align_text_to_frame_padding()
    dim(text)


def picker(id_: str, text: str, value: Sequence[float]) -> tuple[float, ...]:
    """A large colour picker."""
    flags = imgui.ColorEditFlags_.no_side_preview | imgui.ColorEditFlags_.picker_hue_wheel
    imgui.set_next_item_width(em(14))
    changed, new = imgui.color_picker3(f"###{id_}", list(value), flags)
    tip(id_, text, show=False)
    return tuple(min(max(round(float(c), 6), 0.0), 1.0) for c in new) if changed else tuple(value)


@contextmanager
def form(id_: str, labels: Sequence[str] = ()) -> Iterator[bool]:
    """Rows of label, widget and a place for a reset button; False while nothing can be seen.

    labels: those that will come, so that their column is wide enough from the first frame on.
    Where the panel is too narrow, labels stand above their widgets.
    """
    wide = max((imgui.calc_text_size(t).x for t in labels), default=em(6))
    columns = 3 if imgui.get_content_region_avail().x > wide + em(9) else 2
    shown = imgui.begin_table(f"{id_}###{id_}{columns}", columns, imgui.TableFlags_.none)
    if shown:
        if columns == 3:
            imgui.table_setup_column("label", imgui.TableColumnFlags_.width_fixed, wide)
        imgui.table_setup_column("widget", imgui.TableColumnFlags_.width_stretch)
        fixed = imgui.TableColumnFlags_.width_fixed
        imgui.table_setup_column("reset", fixed, imgui.get_frame_height())
    try:
        yield bool(shown)
    finally:
        if shown:
            imgui.end_table()


@contextmanager
def facts(id_: str, labels: Sequence[str]) -> Iterator[bool]:
    """Rows of `fact`; False while nothing can be seen. Where it is narrow, names stand above."""
    wide = max((imgui.calc_text_size(t).x for t in labels), default=em(6))
    columns = 2 if imgui.get_content_region_avail().x > wide + em(7) else 1
    shown = imgui.begin_table(f"{id_}###{id_}{columns}", columns, imgui.TableFlags_.none)
    if shown and columns == 2:
        imgui.table_setup_column("name", imgui.TableColumnFlags_.width_fixed, wide)
        imgui.table_setup_column("text", imgui.TableColumnFlags_.width_stretch)
    try:
        yield bool(shown)
    finally:
        if shown:
            imgui.end_table()


def label(text: str) -> None:
    """Begins a row of a form; the next widget fills its middle."""
    imgui.table_next_row()
    imgui.table_next_column()
    if imgui.table_get_column_count() == 3:
        imgui.align_text_to_frame_padding()
        imgui.text_unformatted(text)
        imgui.table_next_column()
    else:
        imgui.text_unformatted(text)
    imgui.set_next_item_width(FILL)


def fact(name: str, text: str) -> None:
    """A row of facts, closer to its neighbours than widgets are."""
    imgui.table_next_row()
    imgui.table_next_column()
    above = imgui.table_get_column_count() == 1
    spacing = imgui.get_style().item_spacing
    imgui.push_style_var(imgui.StyleVar_.item_spacing, ImVec2(spacing.x, em(0.1)))
    dim(name)
    if not above:
        imgui.table_next_column()
    wrapped(folded(text, imgui.get_content_region_avail().x))
    if above:
        imgui.dummy(ImVec2(0, em(0.2)))
    imgui.pop_style_var()


def folded(path: str, width: float) -> str:
    """A path over several lines, broken after its slashes; other text as it is. width: pixels."""
    if " " in path or imgui.calc_text_size(path).x <= width:
        return path
    lines = [""]
    for part in re.split(r"(?<=[/\\])", path):
        if lines[-1] and imgui.calc_text_size(lines[-1] + part).x > width:
            lines.append("")
        lines[-1] += part
    return "\n".join(lines)


def caution(text: str) -> None:
    """A row of a form that warns, below the widget it is about."""
    imgui.table_next_row()
    imgui.table_set_column_index(imgui.table_get_column_count() - 2)
    wrapped(text, warning_color())


def beside(text: str, *, box: bool = False) -> None:
    """Stay on the line if a button (box: a check box) with this text fits, else begin another."""
    style = imgui.get_style()
    width = imgui.calc_text_size(text).x + 2 * style.frame_padding.x
    width += imgui.get_frame_height() if box else 0
    right = imgui.get_window_pos().x + imgui.get_window_width() - style.window_padding.x
    if imgui.get_scroll_max_y() > 0:
        right -= style.scrollbar_size
    if imgui.get_item_rect_max().x + style.item_spacing.x + width < right:
        imgui.same_line()


def rounded(value: float) -> float:
    """A number that went through 32 bits, as a person would write it."""
    return float(f"{value:.6g}")
