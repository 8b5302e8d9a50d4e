"""The plot of the transfer-function editor, its Hounsfield ruler and its colour bar.

Left drag moves points (of several selected, all), or selects in an empty place; shift adds to the
selection; Ctrl+drag shifts everything; right drag is window (sideways) and level (up); double
click adds; right click removes; the wheel zooms and the middle button pans the value axis.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from volviz.fields.statistics import Statistics
from volviz.model.transfer import TransferFunction
from volviz.ui import control_points as cp
from volviz.ui import painting, value_axis, widgets
from volviz.ui.im import ImVec2, imgui, implot
from volviz.ui.painting import Pane
from volviz.ui.transfer_state import NONE, Drag, EditorState, Kind
from volviz.ui.value_axis import Axis

REACH = 0.7
"""How far from a point the mouse still takes it, in font sizes."""
TICK = 3.0
"""Least distance of the values written along the axis, in font sizes."""
UNUSED = 4  # a mouse button that few mice have: implot's own frames and menus are not wanted
HELP = """Double click: a new point. Drag: move; Shift+click or a frame: several.
Delete or right click: remove.
Ctrl+drag: shift everything. Right drag: window (sideways) and level (up).
Wheel: zoom. Middle drag: pan."""
BAR_HELP = """Double click: a new colour, or on a point: pick its colour. Drag: move.
Delete or right click: remove. Ctrl+drag: shift everything."""


def plot(
    state: EditorState,
    transfer: TransferFunction,
    statistics: Statistics | None,
    *,
    unit: str,
    height: float,
) -> tuple[TransferFunction, Axis | None]:
    """Histogram, curve and opacity points; returns the edited transfer function and the axis,
    None where nothing of the plot is visible."""
    _map_mouse()
    flags = implot.Flags_
    off = flags.no_title | flags.no_legend | flags.no_menus | flags.no_box_select
    implot.push_style_var(implot.StyleVar_.plot_padding, ImVec2(widgets.em(0.3), widgets.em(0.4)))
    least = ImVec2(widgets.em(5), widgets.em(4))  # implot's own would be cut in narrow panels
    implot.push_style_var(implot.StyleVar_.plot_min_size, least)
    shown = implot.begin_plot("###opacity", ImVec2(-1, height), off | flags.no_mouse_text)
    axis = None
    if shown:
        _set_axes(state, transfer, statistics)
        pane = _pane()
        axis = state.axis = pane.axis
        hovered = implot.is_plot_hovered()
        implot.push_plot_clip_rect(widgets.em(0.6))
        _draw_plot(state, pane, transfer, statistics, hovered=hovered)
        _draw_unit(pane, unit)
        transfer = _plot_mouse(state, pane, transfer, hovered=hovered)
        implot.pop_plot_clip_rect()
        implot.end_plot()
        widgets.tip("transfer.plot", HELP, show=False)
    implot.pop_style_var(2)
    return transfer, axis


def color_bar(state: EditorState, transfer: TransferFunction, axis: Axis) -> TransferFunction:
    """The colours along the same axis, with their points."""
    size = widgets.em(1.5)
    imgui.set_cursor_screen_pos(ImVec2(axis.left, imgui.get_cursor_screen_pos().y))
    left_right = imgui.ButtonFlags_.mouse_button_left | imgui.ButtonFlags_.mouse_button_right
    imgui.invisible_button("###colors", ImVec2(axis.width, size), left_right)
    hovered = imgui.is_item_hovered()
    widgets.tip("transfer.colors", BAR_HELP, show=not imgui.is_item_active())
    pane = Pane(axis, imgui.get_item_rect_min().y, size)
    draw = imgui.get_window_draw_list()
    painting.color_bar(draw, pane, transfer)
    places = painting.color_marks(pane, transfer)
    over = _over(places, hovered)
    room = widgets.em(0.6)
    draw.push_clip_rect(
        ImVec2(axis.left - room, pane.top - room),
        ImVec2(axis.left + axis.width + room, pane.bottom + room),
        True,
    )
    fills = painting.packed(np.array(transfer.colors)[:, 1:])
    painting.points(draw, places, fills, state.colors, over)
    draw.pop_clip_rect()
    return _bar_mouse(state, pane, transfer, over, hovered=hovered)


def ruler(axis: Axis, offset: float) -> None:
    """What lies where on the Hounsfield scale. offset: what HU are raised by in the values."""
    size = widgets.em(1.6)
    imgui.set_cursor_screen_pos(ImVec2(axis.left, imgui.get_cursor_screen_pos().y))
    imgui.invisible_button("###ruler", ImVec2(axis.width, size))
    value = axis.value(imgui.get_mouse_pos().x)
    widgets.tip("transfer.ruler", painting.materials_at(value, offset, 4 * axis.per_pixel))
    painting.ruler(
        imgui.get_window_draw_list(), Pane(axis, imgui.get_item_rect_min().y, size), offset
    )


def _map_mouse() -> None:
    """The left button is ours; the plot pans with the middle one and never zooms by a frame."""
    keys = implot.get_input_map()
    middle = imgui.MouseButton_.middle.value
    keys.pan, keys.select_cancel = middle, imgui.MouseButton_.right.value
    keys.fit = keys.select = keys.menu = UNUSED
    keys.override_mod = imgui.Key.mod_super.value
    keys.select_mod = imgui.Key.mod_super.value


def _set_axes(
    state: EditorState, transfer: TransferFunction, statistics: Statistics | None
) -> None:
    bare = implot.AxisFlags_.no_menus | implot.AxisFlags_.no_side_switch
    bare |= implot.AxisFlags_.no_highlight
    x, y = implot.ImAxis_.x1.value, implot.ImAxis_.y1.value
    implot.setup_axis(x, None, bare)
    implot.setup_axis(y, None, bare | implot.AxisFlags_.lock)
    low, high = value_axis.whole_span(transfer, statistics)
    _set_ticks(state)
    if state.span is not None:
        implot.setup_axis_limits(x, *state.span, implot.Cond_.always.value)
        state.span = None
    implot.setup_axis_zoom_constraints(x, (high - low) * 1e-6, (high - low) * 4)
    implot.setup_axis_limits(y, 0.0, 1.0, implot.Cond_.always.value)
    shown = (0.0, 0.001, 0.01, 0.1, 1.0) if state.log_opacity else (0.0, 0.25, 0.5, 0.75, 1.0)
    heights = [float(h) for h in cp.height_of(shown, log=state.log_opacity)]
    implot.setup_axis_ticks(y, heights, [f"{a:g}" for a in shown])
    implot.setup_finish()


def _set_ticks(state: EditorState) -> None:
    """Round values along the axis as the frame before had it, farther apart than implot's."""
    if state.axis is None:
        return
    low, high = state.span or (state.axis.low, state.axis.high)
    values = value_axis.ticks(low, high, int(state.axis.width / widgets.em(TICK)))
    if values:
        implot.setup_axis_ticks(implot.ImAxis_.x1.value, values, [f"{v:.6g}" for v in values])


def _pane() -> Pane:
    place, size, limits = implot.get_plot_pos(), implot.get_plot_size(), implot.get_plot_limits()
    axis = Axis(place.x, max(size.x, 1.0), limits.x.min, limits.x.max)
    return Pane(axis, place.y, max(size.y, 1.0))


def _draw_plot(
    state: EditorState,
    pane: Pane,
    transfer: TransferFunction,
    statistics: Statistics | None,
    *,
    hovered: bool,
) -> None:
    draw = implot.get_plot_draw_list()
    painting.area(draw, pane, transfer, log=state.log_opacity)
    if statistics is not None and statistics.count:
        painting.histogram(draw, pane, statistics, log=state.log_counts)
    painting.curve(draw, pane, transfer, log=state.log_opacity)
    places = painting.opacity_marks(pane, transfer, log=state.log_opacity)
    values = [p[0] for p in transfer.opacities]
    over = None if state.drag else _over(places, hovered)
    painting.points(draw, places, painting.packed(transfer.color_at(values)), state.opacities, over)
    if state.drag is not None and state.drag.kind == "box":
        _draw_frame(draw, state.drag)
    if hovered or (state.drag is not None and state.drag.kind != "box"):
        _draw_text(draw, pane, _readout(state, pane.axis, transfer, statistics, over))


def _draw_unit(pane: Pane, unit: str) -> None:
    """The unit of the values, at the right end of their axis."""
    if unit:
        pad = widgets.em(0.35)
        _draw_text(implot.get_plot_draw_list(), pane, unit, pane.height - widgets.em() - 2 * pad)


def _draw_frame(draw: Any, drag: Drag) -> None:
    mouse = imgui.get_mouse_pos()
    a = ImVec2(min(drag.at[0], mouse.x), min(drag.at[1], mouse.y))
    b = ImVec2(max(drag.at[0], mouse.x), max(drag.at[1], mouse.y))
    draw.add_rect_filled(a, b, imgui.get_color_u32(imgui.Col_.check_mark, 0.15))
    draw.add_rect(a, b, imgui.get_color_u32(imgui.Col_.check_mark, 0.8))


def _readout(
    state: EditorState,
    axis: Axis,
    transfer: TransferFunction,
    statistics: Statistics | None,
    over: int | None,
) -> str:
    """Value, opacity and share of the voxels: of the point in hand, else under the mouse."""
    if state.drag is not None and len(state.opacities) == 1:
        over = min(state.opacities)
    if over is not None and over < len(transfer.opacities):
        value, opacity = transfer.opacities[over]
        return f"{value:.5g}   opacity {opacity:.3g}"
    value = axis.value(min(max(imgui.get_mouse_pos().x, axis.left), axis.left + axis.width))
    text = f"{value:.5g}"
    if statistics is not None and statistics.count:
        share = value_axis.share_between(statistics, value, np.inf)
        text += f"   {100 * share:.3g} % above"
    return text


def _draw_text(draw: Any, pane: Pane, text: str, lower: float = 0.0) -> None:
    """Text in the upper right corner (or `lower` pixels), on a ground that makes it readable."""
    size, pad = imgui.calc_text_size(text), widgets.em(0.35)
    right, top = pane.axis.left + pane.axis.width - pad, pane.top + pad + lower
    back = imgui.get_color_u32(imgui.Col_.popup_bg, 0.85)
    draw.add_rect_filled(
        ImVec2(right - size.x - 2 * pad, top), ImVec2(right, top + size.y + pad), back, pad
    )
    place = ImVec2(right - size.x - pad, top + pad / 2)
    draw.add_text(place, imgui.get_color_u32(imgui.Col_.text), text)


def _over(places: Any, hovered: bool) -> int | None:
    mouse = imgui.get_mouse_pos()
    reach = widgets.em(REACH)
    return cp.nearest(places[:, 0], places[:, 1], (mouse.x, mouse.y), reach) if hovered else None


def _plot_mouse(
    state: EditorState, pane: Pane, transfer: TransferFunction, *, hovered: bool
) -> TransferFunction:
    if state.drag is not None:
        return _dragging(state, pane, transfer)
    if not hovered:
        return transfer
    places = painting.opacity_marks(pane, transfer, log=state.log_opacity)
    over, io, mouse = _over(places, hovered), imgui.get_io(), imgui.get_mouse_pos()
    if imgui.is_mouse_double_clicked(0) and over is None and not io.key_ctrl:
        height = (pane.bottom - mouse.y) / pane.height
        opacity = cp.opacity_of(height, log=state.log_opacity)
        value = cp.neat(pane.axis.value(mouse.x), pane.axis.per_pixel)
        transfer, at = cp.add_opacity(transfer, value, opacity)
        state.opacities, state.colors = frozenset({at}), NONE
        _begin(state, "opacities", pane, transfer)
    elif imgui.is_mouse_clicked(1) and over is not None:
        state.opacities = frozenset({over})
        state.colors = NONE
        transfer = state.deleted(transfer)
    elif imgui.is_mouse_clicked(1):
        _begin(state, "window", pane, transfer)
    elif imgui.is_mouse_clicked(0) and over is not None:
        if state.select("opacities", over, more=io.key_shift):
            _begin(state, "opacities", pane, transfer, over)
    elif imgui.is_mouse_clicked(0):
        if not io.key_shift and not io.key_ctrl:
            state.opacities = state.colors = NONE
        _begin(state, "shift" if io.key_ctrl else "box", pane, transfer)
    return transfer


def _bar_mouse(
    state: EditorState,
    pane: Pane,
    transfer: TransferFunction,
    over: int | None,
    *,
    hovered: bool,
) -> TransferFunction:
    if state.drag is not None or not hovered:
        return transfer
    io, mouse = imgui.get_io(), imgui.get_mouse_pos()
    if imgui.is_mouse_double_clicked(0) and over is None:
        value = cp.neat(pane.axis.value(mouse.x), pane.axis.per_pixel)
        transfer, at = cp.add_color(transfer, value)
        state.opacities, state.colors, state.picking = NONE, frozenset({at}), True
    elif imgui.is_mouse_double_clicked(0):
        state.picking = True
    elif imgui.is_mouse_clicked(1) and over is not None:
        state.opacities, state.colors = NONE, frozenset({over})
        transfer = state.deleted(transfer)
    elif imgui.is_mouse_clicked(0) and io.key_ctrl:
        _begin(state, "shift", pane, transfer)
    elif imgui.is_mouse_clicked(0) and over is not None:
        if state.select("colors", over, more=io.key_shift):
            _begin(state, "colors", pane, transfer, over)
    elif imgui.is_mouse_clicked(0):
        state.opacities = state.colors = NONE
    return transfer


def _begin(
    state: EditorState,
    kind: Kind,
    pane: Pane,
    transfer: TransferFunction,
    pressed: int | None = None,
) -> None:
    mouse, button = imgui.get_mouse_pos(), 1 if kind == "window" else 0
    state.drag = Drag(
        kind, transfer, (mouse.x, mouse.y), button, pane.axis, pane.height,
        state.opacities, state.colors, pressed,
    )  # fmt: skip


def _dragging(state: EditorState, pane: Pane, transfer: TransferFunction) -> TransferFunction:
    drag, mouse = state.drag, imgui.get_mouse_pos()
    assert drag is not None
    at = (mouse.x, mouse.y)
    if imgui.is_mouse_down(drag.button):
        if drag.kind == "box":
            return transfer
        return drag.result(at, log=state.log_opacity, scale=imgui.get_font_size() / 16)
    state.drag = None
    if drag.kind == "box":
        _select_in(state, pane, transfer, drag, at)
    elif at == drag.at and drag.pressed is not None and not imgui.get_io().key_shift:
        alone = frozenset({drag.pressed})  # a click on one of several: that one alone
        state.opacities, state.colors = (alone, NONE) if drag.kind == "opacities" else (NONE, alone)
    return transfer


def _select_in(
    state: EditorState,
    pane: Pane,
    transfer: TransferFunction,
    drag: Drag,
    at: tuple[float, float],
) -> None:
    """Add the opacity points inside the frame to the selection."""
    places = painting.opacity_marks(pane, transfer, log=state.log_opacity)
    low, high = np.minimum(drag.at, at), np.maximum(drag.at, at)
    inside = np.all((places >= low) & (places <= high), axis=1)
    state.opacities |= frozenset(int(i) for i in np.flatnonzero(inside))
