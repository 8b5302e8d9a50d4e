"""Rows of a surface's look for its second field: which one, its colour map and range."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING

from volviz.app.opening import typed
from volviz.model.knobs import knobs_of
from volviz.model.surface_look import BY_TRANSFER, FIELDS, SurfaceLook
from volviz.sources import is_sample
from volviz.ui import edit, widgets
from volviz.ui.facts import Facts
from volviz.ui.im import icons, imgui

if TYPE_CHECKING:
    from volviz.resolve_surfaces import Extracted

KNOBS = ("color_field", "colormap", "color_low", "color_high")
OTHER = "other"
NAMES = {
    "gradient-magnitude": "Gradient magnitude",
    "x": "x",
    "y": "y",
    "z": "z",
    OTHER: "Another volume …",
}


@dataclass
class State:
    """text: the name of another volume, as it is typed; of: the surface it is typed for."""

    text: str = ""
    of: str = ""


def rows(look: SurfaceLook, id_: str, facts: Facts, found: Extracted | None) -> SurfaceLook:
    """The look as it is to be. found: the surface that is drawn."""
    if look.coloring != "field":
        return look
    state = facts.local.of(State)
    spec = {k.name: k for k in knobs_of(SurfaceLook) if k.name in KNOBS}
    labels = [edit.title(k) for k in spec.values()]
    shown = OTHER if look.color_field not in FIELDS or state.of == id_ else look.color_field
    with widgets.form(f"{id_}.field", labels) as visible:
        if not visible:
            return look
        widgets.label(edit.title(spec["color_field"]))
        options = [("", name, title, _about(name)) for name, title in NAMES.items()]
        text = edit.about(spec["color_field"])
        name = widgets.choice(f"{id_}.color_field", text, shown, options, shown=NAMES[shown])
    if name != shown:
        state.of = id_ if name == OTHER else ""
        state.text = "" if look.color_field in FIELDS else look.color_field
    if name == OTHER:
        look = _file(look, id_, state)
    elif name != look.color_field:
        look = edit.changed(look, color_field=name)
    wanted = ["colormap"] if look.colormap == BY_TRANSFER else list(KNOBS[1:])
    look = edit.knob_rows(look, f"{id_}.map", wanted, beside=labels)
    _told(look, found)
    return look


def _about(name: str) -> str:
    return {
        "gradient-magnitude": "How steep the values are where the surface is, by length.",
        OTHER: "A file, another channel of this one, or sample:NAME, looked up in the world.",
    }.get(name, "The place in the world.")


def _file(look: SurfaceLook, id_: str, state: State) -> SurfaceLook:
    """The name of another volume, and a button that takes it."""
    if state.of != id_:
        state.of, state.text = id_, look.color_field
    label = f"{icons.ICON_FA_CHECK}  Use"
    side = imgui.calc_text_size(label).x + 3 * imgui.get_style().frame_padding.x
    room = imgui.get_content_region_avail().x - side - imgui.get_style().item_spacing.x
    imgui.set_next_item_width(max(room, widgets.em(4)))
    text = "A file or folder, FILE?channel=1 for one of its channels, or sample:NAME."
    state.text = widgets.search(f"{id_}.file", "File with a volume", text, state.text)
    name = state.text.strip()
    path = name if is_sample(name) else str(typed(name.partition("?")[0])) if name else ""
    there = bool(name) and (is_sample(name) or os.path.exists(path))
    if room > widgets.em(4):
        imgui.same_line()
    whole = name if is_sample(name) else os.path.abspath(path) + "".join(name.partition("?")[1:])
    fresh = there and whole != look.color_field
    if widgets.button(f"{id_}.use", label, "Colour the surface by this volume.", enabled=fresh):
        return edit.changed(look, color_field=whole)
    if name and not there:
        widgets.wrapped("There is no such file.", widgets.warning_color())
    return look


def _told(look: SurfaceLook, found: Extracted | None) -> None:
    """What the colours cover, or why there are none."""
    more = None if found is None else found.fields.get(look.color_field)
    if more is None:
        widgets.dim("sampling the field …")
    elif more.error is not None:
        widgets.wrapped(str(more.error), widgets.warning_color())
    elif look.colormap != BY_TRANSFER:
        own = look.color_low < look.color_high
        if look.color_low > look.color_high:
            text = "The first colour's value is not below the last one's: it is not used."
            widgets.wrapped(text, widgets.warning_color())
        low, high = (look.color_low, look.color_high) if own else more.span
        widgets.dim(f"{low:.4g} to {high:.4g}{'' if own else ', 2nd to 98th percentile'}")
