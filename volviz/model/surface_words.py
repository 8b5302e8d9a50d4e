"""A surface in one word, for command lines: `VALUE[,COLOUR[,OPACITY]][,KNOB=VALUE]…`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any
from urllib.parse import quote, unquote

from volviz.errors import UsageError, did_you_mean
from volviz.model.knobs import Knob, knobs_of
from volviz.model.refining import Refining
from volviz.model.surface import Surface
from volviz.model.surface_look import COLORS, SceneSurface, SurfaceLook

FIELD = "--isosurface"
FORM = "VALUE[,COLOUR[,OPACITY]][,KNOB=VALUE]…"
KEPT = "/:?&= \\~@+()"
"""Signs besides letters and digits that stand for themselves in a free text; others as %XX."""
_YES = {"true": True, "yes": True, "on": True, "false": False, "no": False, "off": False}


def knobs() -> dict[str, Knob]:
    """Everything that can be said of a surface besides its colour, by name."""
    return {k.name: k for owner in (Surface, SurfaceLook, Refining) for k in knobs_of(owner)}


def parse(text: str, number: int, color: Callable[[str], Sequence[float]]) -> SceneSurface:
    """The surface of a word. number: of the surface, for its default colour. color: reads one.

    Raises UsageError.
    """
    try:
        return _parsed(text, number, color)
    except UsageError as error:  # of a knob: which of the words it was, is what helps
        if error.field == FIELD:
            raise
        raise UsageError(f"'{text}': {error.what}", field=FIELD, fix=error.fix) from error


def _parsed(text: str, number: int, color: Callable[[str], Sequence[float]]) -> SceneSurface:
    first, *rest = (part.strip() for part in text.split(","))
    plain = [p for p in rest if "=" not in p]
    if len(plain) > 2:
        raise _no_surface(text)
    said: dict[str, Any] = {"color": COLORS[number % len(COLORS)]}
    if plain and plain[0]:
        said["color"] = _color(plain[0], color)
    if len(plain) == 2:
        said["opacity"] = _number(plain[1], text)
    known = knobs()
    for name, _, value in (p.partition("=") for p in rest if "=" in p):
        name = name.strip().replace("-", "_")
        if name not in known:
            raise UsageError(
                f"a surface has no '{name}'", field=FIELD, fix=did_you_mean(name, known)
            )
        said[name] = _value(known[name], value.strip(), text)
    return SceneSurface.at(_number(first, text), **said)


def spell(surface: SceneSurface, number: int) -> str:
    """The word that `parse` reads as this surface."""
    spec, look = surface.surface, surface.look
    words = [_spelled(spec.isovalue)]
    plain = look.color != COLORS[number % len(COLORS)]
    if plain or look.opacity != 1.0:
        words.append("/".join(map(_spelled, look.color)))
    if look.opacity != 1.0:
        words.append(_spelled(look.opacity))
    for owner in (spec, look, surface.refining):
        for knob in knobs_of(type(owner)):
            value = getattr(owner, knob.name)
            if knob.name not in ("isovalue", "opacity") and value != knob.default:
                free = knob.type is str and not knob.choices
                words.append(f"{knob.name}={quote(value, KEPT) if free else _spelled(value)}")
    return ",".join(words)


def _no_surface(text: str) -> UsageError:
    return UsageError(f"'{text}' is not {FORM}", field=FIELD, fix="e.g. 300 or 300,tan,0.3")


def _color(text: str, color: Callable[[str], Sequence[float]]) -> tuple[float, ...]:
    try:
        return tuple(color(text.replace("/", ","))[:3])
    except UsageError as error:
        raise UsageError(
            f"'{text}' is no colour", field=FIELD, fix="give a name, #rrggbb or red/green/blue"
        ) from error


def _number(text: str, whole: str) -> float:
    try:
        return float(text)
    except ValueError as error:
        raise _no_surface(whole) from error


def _value(knob: Knob, text: str, whole: str) -> Any:
    if knob.type is bool:
        return _YES.get(text.lower(), text)
    if knob.type is str and not knob.choices:
        return unquote(text)
    return text if knob.choices else _number(text, whole)


def _spelled(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return value if isinstance(value, str) else repr(float(value)).removesuffix(".0")
