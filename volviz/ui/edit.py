"""Widgets derived from what knobs say of themselves, and names for what was changed.

A new knob gets its row, range, unit, tooltip and reset button without code here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from typing import Any, TypeVar

from volviz.errors import VolvizError
from volviz.model.knobs import Knob, knobs_of
from volviz.model.scene import SceneState
from volviz.model.surface_look import SceneSurface
from volviz.model.transfer import TransferFunction
from volviz.ui import widgets
from volviz.ui.im import imgui

T = TypeVar("T")
TITLES = {
    "fov": "Field of view",
    "coloring": "Colouring",
    "color_field": "Field",
    "colormap": "Colour map",
    "color_low": "First colour at",
    "color_high": "Last colour at",
}
CHOICES = {
    "dvr": "Volume (DVR)",
    "mip": "Maximum (MIP)",
    "phong": "Phong",
    "color": "Own colour",
    "transfer": "Transfer function",
    "field": "By a second field",
    "blinn-phong": "Blinn–Phong",
}
"""How names are written where people read them; others begin with a capital."""
WIDE = 100
"""A range of so many times its lower end is dragged logarithmically."""
LENGTHS = 10
"""Spacings that 500 pixels drag a length."""


def knob_rows(
    owner: T,
    scope: str,
    names: Sequence[str] | None = None,
    *,
    beside: Sequence[str] = (),
    given: Mapping[str, Any] | None = None,
    spacing: float = 0.0,
) -> T:
    """A form with a row for each knob of a dataclass that does something; returns the changed
    owner, or the same.

    scope: begins the ids of the widgets ("scope.knob"). names: only these knobs. beside: labels of
    other forms, above or below, with which the widgets shall stand in line. given: values of knobs
    that are another dataclass's, on which it may depend whether one does something. spacing: mm
    between samples, by which lengths without an upper end are dragged.
    """
    every = knobs_of(type(owner))
    values = {k.name: getattr(owner, k.name) for k in every} | dict(given or {})
    known = [k for k in every if (names is None or k.name in names) and k.used(values)]
    with widgets.form(scope, [*map(title, known), *beside]) as shown:
        if shown:
            for spec in known:
                owner = _knob_row(owner, scope, spec, spacing)
    return owner


def title(spec: Knob) -> str:
    """The name of a knob as people read it."""
    return TITLES.get(spec.name, spec.name.replace("_", " ").capitalize())


def choice_title(name: str) -> str:
    """The name of one of a knob's choices as people read it."""
    return CHOICES.get(name, name.replace("-", " ").capitalize())


def about(spec: Knob) -> str:
    """Help, unit, range and default of a knob."""
    unit = f" {spec.unit}" if spec.unit and spec.unit != "°" else spec.unit
    lines = [spec.help[:1].upper() + spec.help[1:] + "."]
    if spec.choices:
        lines.append("One of " + ", ".join(spec.choices) + ".")
    elif spec.low is not None and spec.high is not None:
        lines.append(f"{spec.low:g} to {spec.high:g}{unit}.")
    elif unit:
        lines.append(f"In{unit}.")
    default = spec.default if isinstance(spec.default, str | bool) else f"{spec.default:.6g}"
    lines.append(f"Default: {default}{'' if spec.choices else unit}.")
    if spec.type in (float, int):
        lines.append("Drag to change; double click or Ctrl+click to type.")
    return "\n".join(lines)


def knob_widget(id_: str, spec: Knob, value: Any, spacing: float = 0.0) -> Any:
    """The widget for one knob, by its type; returns the value, changed or not. spacing: as in
    `knob_rows`."""
    text = about(spec)
    if spec.choices:
        options = [("", c, choice_title(c), f"{c}: {spec.help}") for c in spec.choices]
        return widgets.choice(id_, text, value, options, shown=choice_title(value))
    if spec.type is bool:
        return widgets.toggle(id_, "", text, value)
    if spec.type is int:
        least = None if spec.low is None else int(spec.low)
        most = None if spec.high is None else int(spec.high)
        speed = 0.1 if most is not None else max(0.5, value / 50)
        return widgets.drag_whole(id_, text, value, speed=speed, low=least, high=most)
    if spec.type is float:
        low, high = spec.low, spec.high
        log = low is not None and high is not None and low > 0 and high / low >= WIDE
        span = high - low if low is not None and high is not None else 100.0
        if spacing and high is None and spec.unit in ("mm", "mm²"):
            span = LENGTHS * spacing ** (2 if spec.unit == "mm²" else 1)
        return widgets.drag(
            id_, text, value, speed=span / 500, low=low, high=high, log=log, form=_format(spec)
        )
    return widgets.search(id_, spec.name, text, str(value))


def _knob_row(owner: T, scope: str, spec: Knob, spacing: float) -> T:
    value = getattr(owner, spec.name)
    widgets.label(title(spec))
    new = knob_widget(f"{scope}.{spec.name}", spec, value, spacing)
    imgui.table_next_column()
    if value != spec.default and widgets.reset_button(
        f"{scope}.{spec.name}.reset", f"Back to {_text(spec.default)}"
    ):
        new = spec.default
    return owner if new == value else changed(owner, **{spec.name: new})


def changed(owner: T, **values: Any) -> T:
    """`dataclasses.replace`, or the same object where the values are refused or equal."""
    try:
        new = replace(owner, **values)  # type: ignore[type-var]
    except VolvizError:
        return owner
    return owner if new == owner else new


def difference(before: SceneState, after: SceneState) -> str:
    """What a change was, for the list of steps: "opacity", "camera", "step", …; "" for none."""
    if before.volume is not after.volume:
        return f"open {after.volume.name or 'volume'}"
    if before.transfer != after.transfer:
        return _transfer_difference(before.transfer, after.transfer)
    if before.surfaces != after.surfaces:
        return _surface_difference(before.surfaces, after.surfaces)
    names = [
        part for part in ("camera", "background") if getattr(before, part) != getattr(after, part)
    ]
    for part in ("raycast", "light", "lens"):
        old, new = getattr(before, part), getattr(after, part)
        names += [
            f.name.replace("_", " ")
            for f in fields(old)
            if getattr(old, f.name) != getattr(new, f.name)
        ]
    return names[0] if len(names) == 1 else "settings" if names else ""


def _surface_difference(before: tuple[SceneSurface, ...], after: tuple[SceneSurface, ...]) -> str:
    if len(before) != len(after):
        return "add surface" if len(after) > len(before) else "remove surface"
    for number, (old, new) in enumerate(zip(before, after, strict=True), 1):
        for part in ("surface", "look", "refining"):
            was, now = getattr(old, part), getattr(new, part)
            for f in fields(was):
                if getattr(was, f.name) != getattr(now, f.name):
                    which = f" of surface {number}" if len(after) > 1 else ""
                    what = TITLES.get(f.name, f.name.replace("_", " "))
                    return f"{what[:1].lower()}{what[1:]}{which}"
    return "surfaces"


def _transfer_difference(before: TransferFunction, after: TransferFunction) -> str:
    if before.name != after.name:
        return f"preset {after.name}" if after.name != "suggested" else "suggestion"
    parts = [
        text
        for name, text in (
            ("colors", "colours"),
            ("opacities", "opacity"),
            ("unit_distance", "opacity distance"),
        )
        if getattr(before, name) != getattr(after, name)
    ]
    return parts[0] if len(parts) == 1 else "transfer function"


def _format(spec: Knob) -> str:
    if spec.unit == "°":
        return "%.1f°"
    return "%.3g × voxel" if "voxel" in spec.unit else "%.4g"


def _text(value: Any) -> str:
    return str(value) if isinstance(value, str | bool) else f"{value:.6g}"
