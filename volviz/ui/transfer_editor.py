"""The transfer-function editor: presets, histogram, opacity and colour points, exact numbers."""

from __future__ import annotations

import numpy as np

from volviz.classify.colormaps import RAMPS, rgb
from volviz.classify.presets import recent
from volviz.fields.statistics import Statistics
from volviz.model.scene import SceneState
from volviz.model.transfer import TransferFunction
from volviz.model.volume import VolumeInfo
from volviz.ui import control_points as cp
from volviz.ui import (
    edit,
    lengths,
    looks,
    painting,
    transfer_keys,
    transfer_plot,
    value_axis,
    widgets,
)
from volviz.ui.facts import Facts
from volviz.ui.im import imgui
from volviz.ui.transfer_state import EditorState

PERCENTILES = ((0.0, 100.0), (0.5, 99.5), (2.0, 98.0), (5.0, 95.0))
LABELS = ("Opacity per", "Opacity at")


def panel(scene: SceneState, facts: Facts) -> SceneState:
    """Edits the transfer function; presets also turn the knobs that belong to them."""
    state = facts.local.of(EditorState)
    statistics = facts.statistics
    state.look_at(scene.volume, scene.transfer, statistics)
    with widgets.form("transfer.looks", LABELS) as shown:
        if shown:
            scene = _preset_row(scene, state, statistics)
            scene = scene_with(scene, _color_map_row(scene.transfer))
    _tools(state, scene.transfer, statistics)
    scene = scene_with(scene, _plots(scene, state, statistics))
    before = scene.transfer
    scene = scene_with(scene, _range_tools(before, statistics, state))
    if scene.transfer is not before:
        state.span = value_axis.fitted_span(scene.transfer, statistics)
    with widgets.form("transfer.numbers", LABELS) as shown:
        if shown:
            scene = scene_with(scene, _numbers(scene.transfer, state, scene.volume.info))
    state.left = scene.transfer
    return scene


def scene_with(scene: SceneState, transfer: TransferFunction) -> SceneState:
    """The scene with this transfer function; the same scene if it has it."""
    return scene if transfer == scene.transfer else scene.with_transfer(transfer)


def _preset_row(scene: SceneState, state: EditorState, statistics: Statistics | None) -> SceneState:
    name = scene.transfer.name
    look = looks.named_look(name, scene.volume, statistics) if statistics else None
    edited = look is not None and look.transfer != scene.transfer
    known = recent()
    title = known[name].title if name in known else name.capitalize()
    widgets.label("Preset")
    picked = widgets.choice(
        "transfer.preset",
        "A ready-made transfer function, with the light that suits it.",
        "" if edited else name,
        _preset_options(scene, statistics) if statistics else (),
        shown=(title or "Your own") + (", edited" if edited else ""),
    )
    imgui.table_next_column()
    if (
        look is not None
        and edited
        and widgets.reset_button("transfer.preset.reset", f"Undo all edits: back to {title}")
    ):
        picked = name
    elif picked == ("" if edited else name):
        _fit_note(look)
        return scene
    assert statistics is not None
    chosen = looks.named_look(picked, scene.volume, statistics)
    assert chosen is not None
    state.span = value_axis.fitted_span(chosen.transfer, statistics)
    state.opacities = state.colors = frozenset()
    return looks.dressed(scene, chosen)


def _fit_note(look: looks.Look | None) -> None:
    if look is not None and look.warning is not None:
        widgets.caution(look.warning)


def _preset_options(scene: SceneState, statistics: Statistics) -> list[tuple[str, str, str, str]]:
    found = looks.catalogue(scene.volume, statistics)
    return [(c.section, c.name, c.title, c.about) for c in found]


def _color_map_row(transfer: TransferFunction) -> TransferFunction:
    now = looks.color_map_of(transfer) or ""
    widgets.label("Colours")
    options = [("", n, n, f"The colours of {n}, spread over the same values.") for n in RAMPS]
    picked = widgets.choice(
        "transfer.colormap",
        "Colours by their known names; the opacity stays.",
        now,
        options,
        shown=now or "own colours",
        swatch=_swatch,
    )
    return looks.with_color_map(transfer, picked) if picked != now else transfer


def _swatch(name: str) -> list[int]:
    """Packed colours of a map."""
    return [int(c) for c in painting.packed(np.array([rgb(code) for code in RAMPS[name]]))]


def _tools(state: EditorState, transfer: TransferFunction, statistics: Statistics | None) -> None:
    """How the plot is shown; changes nothing of the scene."""
    if widgets.button("transfer.fit", "Fit", "Show all points and nearly all values."):
        state.span = value_axis.fitted_span(transfer, statistics)
    widgets.beside("All")
    if widgets.button("transfer.all", "All", "Show all values, outliers too."):
        state.span = value_axis.whole_span(transfer, statistics)
    widgets.beside("Log counts", box=True)
    state.log_counts = widgets.toggle(
        "transfer.logcounts",
        "Log counts",
        "The histogram's height is the logarithm of the number of voxels.",
        state.log_counts,
    )
    widgets.beside("Log opacity", box=True)
    state.log_opacity = widgets.toggle(
        "transfer.logopacity",
        "Log opacity",
        "The opacity axis is logarithmic from 0.0001 to 1, so that 0.001 can be set by hand. "
        "The bottom is 0.",
        state.log_opacity,
    )
    widgets.beside("(?)")
    widgets.hint("transfer.help", transfer_plot.HELP + "\n\nColour bar\n" + transfer_plot.BAR_HELP)


def _plots(
    scene: SceneState, state: EditorState, statistics: Statistics | None
) -> TransferFunction:
    transfer, info = scene.transfer, scene.volume.info
    offset = looks.hounsfield(scene.volume, statistics) if statistics is not None else None
    unit = info.value_unit or ("HU" if offset == 0 else "")
    below = widgets.em(9.2 if offset is None else 11)  # colours, numbers, ruler
    room = imgui.get_content_region_avail().y - below
    height = min(max(room, widgets.em(7)), widgets.em(20))
    focused = imgui.is_window_focused(imgui.FocusedFlags_.root_and_child_windows)
    transfer, axis = transfer_plot.plot(state, transfer, statistics, unit=unit, height=height)
    if axis is None:
        state.drag = None
        return transfer
    if offset is not None:
        transfer_plot.ruler(axis, offset)
    transfer = transfer_plot.color_bar(state, transfer, axis)
    if focused and not imgui.get_io().want_text_input:
        transfer = transfer_keys.pressed(state, transfer, axis)
    imgui.dummy((0, widgets.em(0.2)))
    return transfer


def _range_tools(
    transfer: TransferFunction, statistics: Statistics | None, state: EditorState
) -> TransferFunction:
    """Range of values, and turning the colours round."""
    if widgets.button(
        "transfer.range", "Range", "Stretch everything over other values: percentiles or numbers."
    ):
        imgui.open_popup("###transfer.ranges")
        state.typed = None
    widgets.beside("Reverse colours")
    if widgets.button("transfer.reverse", "Reverse colours", "The colours in opposite order."):
        transfer = cp.reversed_colors(transfer)
    low, high = transfer.domain
    ends = f"{low:.5g} … {high:.5g}"
    widgets.beside(ends)
    widgets.faint(ends)
    if imgui.begin_popup("###transfer.ranges"):
        transfer = _range_popup(transfer, statistics, state)
        imgui.end_popup()
    return transfer


def _range_popup(
    transfer: TransferFunction, statistics: Statistics | None, state: EditorState
) -> TransferFunction:
    low, high = state.typed or transfer.domain
    with widgets.form("transfer.domain", ("Highest",)) as shown:
        if shown:
            widgets.label("Lowest")
            new_low = widgets.number("transfer.low", "Value of the lowest point.", low)
            widgets.label("Highest")
            new_high = widgets.number("transfer.high", "Value of the highest point.", high)
            new_low, new_high = _window_rows(new_low, new_high)
            if (new_low, new_high) != (low, high):
                fits = new_low < new_high
                state.typed = None if fits else (new_low, new_high)
                transfer = cp.stretched(transfer, new_low, new_high) if fits else transfer
    if state.typed is not None:  # who moves both ends types one after the other
        widgets.wrapped("The lowest must be below the highest.", widgets.warning_color())
    for least, most in PERCENTILES if statistics is not None and statistics.count else ():
        label = "All values" if most == 100 else f"{least:g} to {most:g} %"
        text = "Stretch over these percentiles of the values."
        if widgets.button(f"transfer.percent{most:g}", label, text, width=widgets.em(12)):
            assert statistics is not None
            transfer = looks.with_percentiles(transfer, statistics, least, most)
            imgui.close_current_popup()
    return transfer


def _window_rows(low: float, high: float) -> tuple[float, float]:
    """The same range as radiologists say it."""
    width, level = high - low, low / 2 + high / 2
    widgets.label("Width")
    new_width = widgets.number("transfer.width", "From the lowest to the highest value.", width)
    widgets.label("Level")
    new_level = widgets.number("transfer.level", "The value in the middle.", level)
    if (new_width, new_level) == (width, level):
        return low, high
    return new_level - new_width / 2, new_level + new_width / 2


def _numbers(transfer: TransferFunction, state: EditorState, info: VolumeInfo) -> TransferFunction:
    """Exact numbers of what is selected, and the length the opacity is meant for."""
    if not state.opacities and not state.colors:
        widgets.label("Selected")
        widgets.faint("Nothing: click a point")
    if state.opacities:
        transfer = _opacity_row(transfer, state)
    if state.colors:
        transfer = _color_row(transfer, state)
    widgets.label("Opacity per")
    unit = widgets.drag(
        "transfer.unit",
        f"The opacity is what gathers over this length{lengths.word(info)}: shorter is denser.\n"
        "Drag to change; double click or Ctrl+click to type.",
        transfer.unit_distance,
        speed=0.01,
        low=1e-6,
        high=1e6,
        form=lengths.form(info, "%.4g"),
        log=True,
    )
    if unit == transfer.unit_distance:
        return transfer
    return edit.changed(transfer, unit_distance=unit)


def _opacity_row(transfer: TransferFunction, state: EditorState) -> TransferFunction:
    points, chosen = transfer.opacities, state.opacities
    widgets.label("Opacity at")
    at = min(chosen)
    value, opacity = points[at]
    new = _value_field("transfer.opacity.value", value, len(chosen))
    alpha = widgets.number("transfer.opacity.opacity", "Opacity, 0 to 1, of all selected.", opacity)
    if new != value:
        points, state.opacities = _placed(points, chosen, at, new)
    if alpha != opacity:
        alpha = min(max(alpha, 0.0), 1.0)
        points = tuple(
            (v, alpha) if i in state.opacities else (v, a) for i, (v, a) in enumerate(points)
        )
    imgui.table_next_column()
    if widgets.delete_button("transfer.opacity.delete", "Remove the selected points (Delete)."):
        state.colors = frozenset()
        return state.deleted(transfer)
    return cp.with_opacities(transfer, points)


def _color_row(transfer: TransferFunction, state: EditorState) -> TransferFunction:
    points, chosen = transfer.colors, state.colors
    widgets.label("Colour at")
    at = min(chosen)
    value, color = points[at][0], points[at][1:]
    new = _value_field("transfer.color.value", value, len(chosen))
    picked = widgets.color("transfer.color.color", "Colour of all selected; click to pick.", color)
    picked = _picker(state, picked)
    if new != value:
        points, state.colors = _placed(points, chosen, at, new)
    if picked != color:
        points = cp.painted(points, state.colors, picked)
    imgui.table_next_column()
    if widgets.delete_button("transfer.color.delete", "Remove the selected colours (Delete)."):
        state.opacities = frozenset()
        return state.deleted(transfer)
    return cp.with_colors(transfer, points)


def _value_field(id_: str, value: float, count: int) -> float:
    """The value of what is selected, how many there are, and room for what stands beside."""
    half = (imgui.get_content_region_avail().x - imgui.get_style().item_spacing.x) / 2
    text = "Value of the selected point; Enter takes it."
    form = "%.7g"
    if count > 1:
        text = f"Value of the first of {count} selected points; the others keep their distance."
        form = f"%.7g  (+{count - 1})"
    imgui.set_next_item_width(half)
    value = widgets.number(id_, text, value, form=form)
    imgui.same_line()
    imgui.set_next_item_width(half)
    return value


def _picker(state: EditorState, color: tuple[float, ...]) -> tuple[float, ...]:
    """The picker that a double click on the bar opens."""
    if state.picking:
        imgui.open_popup("###transfer.picker")
        state.picking = False
    if imgui.begin_popup("###transfer.picker"):
        color = widgets.picker("transfer.picker.color", "Hue, saturation, brightness.", color)
        imgui.end_popup()
    return color


def _placed(
    points: cp.Points, chosen: cp.Indices, at: int, value: float
) -> tuple[cp.Points, cp.Indices]:
    """A typed value: one point goes there, past others if need be; several move together."""
    if len(chosen) == 1:
        points, index = cp.put(points, at, (value, *points[at][1:]))
        return points, frozenset({index})
    return cp.moved(points, chosen, value - points[at][0]), chosen
