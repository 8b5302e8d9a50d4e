"""A slider for an isovalue, over the histogram of the values."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from volviz.fields.statistics import Statistics
from volviz.ui import painting, tips, widgets
from volviz.ui.im import ImVec2, imgui
from volviz.ui.painting import Pane
from volviz.ui.value_axis import Axis, Span

HEIGHT = 2.4
"""Of the slider, in font sizes."""
TEXT = """The isovalue, over the histogram of the voxels.
Drag or click: this value. Wheel: finer steps, with Shift finer still."""


def span_of(statistics: Statistics, isovalues: Sequence[float]) -> Span:
    """The stretch of values that sliders cover: nearly all values, and all isovalues."""
    low = min([statistics.percentile(0.1), *isovalues])
    high = max([statistics.percentile(99.9), *isovalues])
    room = 0.05 * (high - low) or max(abs(low) * 0.1, 1.0)
    low = min(max(low - room, statistics.low), low)
    high = max(min(high + room, statistics.high), high)
    return (low, high) if high > low else (low - room, high + room)


def slider(
    id_: str,
    value: float,
    statistics: Statistics,
    span: Span,
    *,
    color: Sequence[float],
    others: Sequence[float] = (),
) -> float:
    """The value, changed or not. others: isovalues that are marked too."""
    width = max(imgui.get_content_region_avail().x, widgets.em(4))
    height = widgets.em(HEIGHT)
    imgui.invisible_button(f"###{id_}", ImVec2(width, height))
    corner, hovered = imgui.get_item_rect_min(), imgui.is_item_hovered()
    active = imgui.is_item_active()
    tips.tip(id_, TEXT, show=not active)
    inset = widgets.em(0.3)
    axis = Axis(corner.x + inset, max(width - 2 * inset, 1.0), *span)
    _paint(Pane(axis, corner.y, height), value, statistics, (color, others), lit=hovered or active)
    if active and (imgui.is_mouse_dragging(0, 0.0) or imgui.is_item_activated()):
        return _round(axis.value(imgui.get_mouse_pos().x), axis)
    io = imgui.get_io()
    if hovered and io.mouse_wheel:
        imgui.set_item_key_owner(imgui.Key.mouse_wheel_y)
        step = axis.per_pixel * (0.2 if io.key_shift else 1.0)
        return _round(value + io.mouse_wheel * step, axis, 0.1)
    return value


def _round(value: float, axis: Axis, part: float = 1.0) -> float:
    """A value that a person would write, as exact as a pixel (or a part of one) is."""
    value = min(max(value, axis.low), axis.high)
    unit = 10.0 ** math.floor(math.log10(max(axis.per_pixel * part, 1e-300)))
    return float(f"{round(value / unit) * unit:.7g}") if abs(value / unit) < 1e15 else value


def _paint(
    pane: Pane,
    value: float,
    statistics: Statistics,
    marks: tuple[Sequence[float], Sequence[float]],
    *,
    lit: bool,
) -> None:
    color, others = marks
    draw, axis = imgui.get_window_draw_list(), pane.axis
    pad = widgets.em(0.3)
    low = ImVec2(axis.left - pad, pane.top)
    high = ImVec2(axis.left + axis.width + pad, pane.bottom)
    face = imgui.Col_.frame_bg_hovered if lit else imgui.Col_.frame_bg
    rounding = imgui.get_style().frame_rounding
    draw.add_rect_filled(low, high, imgui.get_color_u32(face), rounding)
    draw.push_clip_rect(low, high, True)
    if statistics.count:
        painting.histogram(draw, pane, statistics, log=True)
    for x in axis.pixels(list(others)):
        faint = imgui.get_color_u32(imgui.Col_.text, 0.25)
        draw.add_line(ImVec2(float(x), pane.top), ImVec2(float(x), pane.bottom), faint, 1.0)
    x = round(float(axis.pixels(value)))
    paint = int(painting.packed(np.array([color]))[0])
    edge = imgui.get_color_u32(imgui.Col_.text)
    thick = max(widgets.em(0.12), 1.5)
    draw.add_line(ImVec2(x, pane.top), ImVec2(x, pane.bottom), edge, thick)
    grip, half = widgets.em(0.55), widgets.em(0.38)
    top = pane.top + 1.0
    corners: list[Any] = [
        ImVec2(x - half, top),
        ImVec2(x + half, top),
        ImVec2(x + half, top + grip),
        ImVec2(x, top + 1.6 * grip),
        ImVec2(x - half, top + grip),
    ]
    draw.add_convex_poly_filled(corners, paint)
    draw.add_polyline(corners, edge, 1.0, imgui.ImDrawFlags_.closed.value)
    draw.pop_clip_rect()
