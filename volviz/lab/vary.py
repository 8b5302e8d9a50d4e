"""Variants of one scene: any knob over several values, several knobs crossed.

What can be varied is read from the scene: every knob of every dataclass in its fields, in tuples
among them and in fields of those, under the name of the class or of the field it is in
(`raycast.step`, `light.ambient`, `surface.method`). All that is of a surface is also found as
`surface.…` (`surface.smooth`, `surface.opacity`).
So a new knob, and a new part of the scene, join without code here. `MORE` has what people want to
vary besides knobs.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass, replace
from typing import Any, TypeVar

from volviz.classify import presets
from volviz.errors import LimitError, UsageError, VolvizError, did_you_mean
from volviz.model.knobs import AS_SCENE, Knob, knobs_of
from volviz.model.scene import Background, Light, SceneState
from volviz.model.surface_look import SceneSurface
from volviz.model.views import volume_camera
from volviz.resolve import known_statistics

MOST = 64
"""Variants of one comparison."""
ALL = "all"
"""Stands for every choice of a knob that has choices."""
SWITCH = {"true": True, "on": True, "yes": True, "false": False, "off": False, "no": False}

S = TypeVar("S", bound=SceneState)


@dataclass(frozen=True)
class Place:
    """Where a knob is: the field of the scene, and its name there."""

    field: str
    part: str
    knob: Knob

    @property
    def name(self) -> str:
        """As it is written: `raycast.step`."""
        return f"{self.part}.{_spelled(self.knob.name)}"


@dataclass(frozen=True)
class More:
    """What can be varied besides knobs. read: the value of a word, UsageError for a wrong one.
    turn: scene, value and aspect of the picture to a scene."""

    help: str
    read: Callable[[str], Any]
    turn: Callable[[Any, Any, float], Any]


@dataclass(frozen=True)
class Axis:
    """One thing that varies. name: `raycast.step`, `preset`; short: without what is clear."""

    name: str
    short: str
    values: tuple[Any, ...]

    @property
    def texts(self) -> tuple[str, ...]:
        """The values as people read them."""
        return tuple(map(value_text, self.values))


@dataclass(frozen=True)
class Variant:
    """One scene of a comparison. changed: values by full name, in the order of the axes."""

    label: str
    scene: SceneState
    changed: Mapping[str, Any] = field(default_factory=dict)


def places(scene: SceneState) -> dict[str, Place]:
    """All knobs of a scene by their full names, in its order."""
    found = {}
    for spec in fields(scene):
        for name, part in _parts(getattr(scene, spec.name)):
            for knob in knobs_of(type(part)):
                place = Place(spec.name, name, knob)
                found[place.name] = place
    return found


def axis(text: str, scene: SceneState) -> Axis:
    """An axis from `KNOB=V1,V2,…`; `KNOB=all` has all its choices. Raises UsageError."""
    name, equals, values = text.partition("=")
    words = [word.strip() for word in values.split(",")]
    if not equals or not name.strip() or not all(words):
        raise UsageError(
            f"'{text}' does not say what to vary",
            field="--vary",
            fix="give KNOB=VALUE,VALUE,…, e.g. step=0.25,0.5,1",
        )
    return axis_of(name, words, scene)


def axis_of(name: str, values: Iterable[Any], scene: SceneState) -> Axis:
    """An axis from a name (`step`, `raycast.step`, `preset`) and values or their words.

    Raises UsageError for what is not known (with the nearest name) or not within the range.
    """
    full, short = _found(str(name).strip(), scene)
    alone = isinstance(values, str) or not isinstance(values, Iterable)
    given: list[Any] = [values] if alone else list(values)
    place = places(scene).get(full)
    if place is not None and given == [ALL] and place.knob.choices:
        given = list(place.knob.choices)
    taken = []
    for value in given:
        try:
            read = MORE[full].read(str(value)) if place is None else _read(place.knob, value)
            there = turned(scene, {full: read})
            taken.append(read if place is None else value_of(there, place))
        except UsageError as error:
            raise UsageError(error.what, field=f"--vary {short}", fix=error.fix) from error
    if not taken:
        raise UsageError("no values to vary over", field=f"--vary {short}", fix="give one or more")
    return Axis(full, short, tuple(taken))


def variants(scene: SceneState, axes: Sequence[Axis], *, aspect: float = 1.0) -> list[Variant]:
    """Every combination of the axes' values; the last axis changes first.

    aspect: width / height of the picture. Raises UsageError for none, LimitError for more than
    `MOST`.
    """
    names = [a.name for a in axes]
    if not axes:
        raise UsageError("nothing varies", field="--vary", fix="e.g. --vary step=0.25,0.5,1")
    twice = next((n for n in names if names.count(n) > 1), None)
    if twice is not None:
        raise UsageError(f"{twice} is varied twice", field="--vary", fix="give all values at once")
    count = math.prod(len(a.values) for a in axes)
    if count > MOST:
        sizes = " × ".join(str(len(a.values)) for a in axes)
        product = f"{sizes} = {count}" if len(axes) > 1 else str(count)
        raise LimitError(
            f"{product} variants are more than {MOST}", field="--vary", fix="give fewer values"
        )
    combined: list[tuple[list[str], dict[str, Any]]] = [([], {})]
    for one in axes:
        combined = [
            ([*labels, f"{one.short} {text}"], {**changed, one.name: value})
            for labels, changed in combined
            for value, text in zip(one.values, one.texts, strict=True)
        ]
    return [
        Variant(" · ".join(labels), turned(scene, changed, aspect=aspect), changed)
        for labels, changed in combined
    ]


def turned(scene: S, changed: Mapping[str, Any], *, aspect: float = 1.0) -> S:
    """The scene with these values, by full name. What is no knob comes first: a preset brings
    knobs of its own, which then may be turned. Raises UsageError."""
    known = places(scene)
    for name in (n for n in changed if n not in known):
        scene = MORE[name].turn(scene, changed[name], aspect)
    for name in (n for n in changed if n in known):
        scene = _with(scene, known[name], changed[name])
    return scene


def fine(scene: S, variant: SceneState, all_of_them: Sequence[SceneState]) -> S:
    """What a variant approximates: the same, with every knob that only decides how exactly it is
    computed at its fine value, or beyond the finest of all variants. scene: before it was varied.

    Variants that differ in nothing else so share one reference.
    """
    result: Any = variant
    base, known = places(scene), places(variant)
    for name, place in known.items():
        if place.knob.fine is AS_SCENE:
            if name in base:
                result = _with(result, place, value_of(scene, base[name]))
        elif place.knob.fine is not None:
            values = [value_of(v, place) for v in all_of_them]
            result = _with(result, place, _finest(place.knob, values))
    return result


def value_text(value: Any) -> str:
    """A value as people read and type it."""
    if isinstance(value, bool):
        return "on" if value else "off"
    return f"{value:.6g}" if isinstance(value, float) else str(value)


# --- knobs ---------------------------------------------------------------------------------------


def _spelled(name: str) -> str:
    return name.replace("_", "-")


def _parts(value: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    """The dataclasses with knobs in a value and what they are called, in order."""
    for one in value if isinstance(value, tuple) else (value,):
        if not is_dataclass(one):
            continue
        if knobs_of(type(one)):
            yield name or type(one).__name__.lower(), one
        else:
            for spec in fields(one):
                yield from _parts(getattr(one, spec.name), spec.name)


def _found(name: str, scene: SceneState) -> tuple[str, str]:
    """Full and short name of what is meant."""
    known = places(scene)
    if name in MORE:
        return name, name
    shorts: dict[str, list[str]] = {more: [more] for more in MORE}
    for full, place in known.items():
        shorts.setdefault(_spelled(place.knob.name), []).append(full)
    plain = _spelled(name).lower()
    if plain in known:
        short = plain.partition(".")[2]
        return plain, short if len(shorts[short]) == 1 else plain
    if plain.startswith("surface."):  # of how it looks, of what is done to it
        rest = plain.removeprefix("surface.")
        fulls = shorts.get(rest, [])
        for full in (f for f in fulls if f in known and known[f].field == "surfaces"):
            return full, rest if len(fulls) == 1 else full
    if plain not in shorts:
        if not scene.surfaces and plain.removeprefix("surface.") in _of_surfaces():
            raise UsageError(
                f"there is no surface whose '{name}' could vary",
                field="--vary",
                fix="give --isovalue VALUE, or a scene with surfaces",
            )
        nearest = did_you_mean(plain, known if "." in plain else shorts)
        raise UsageError(f"nothing is called '{name}'", field="--vary", fix=nearest)
    if len(shorts[plain]) > 1:
        several = " or ".join(shorts[plain])
        raise UsageError(f"'{name}' is not one thing", field="--vary", fix=f"say {several}")
    return shorts[plain][0], plain


def _of_surfaces() -> set[str]:
    """Short names of what can be varied of a surface."""
    parts = (part for _, part in _parts(SceneSurface()))
    return {_spelled(knob.name) for part in parts for knob in knobs_of(type(part))}


def _read(knob: Knob, value: Any) -> Any:
    """A knob's value of a word; one that does not fit is for the knob to refuse."""
    if not isinstance(value, str):
        return value
    if knob.type is bool:
        if value.lower() not in SWITCH:
            raise UsageError(f"'{value}' is neither on nor off", fix="give on or off")
        return SWITCH[value.lower()]
    try:
        return knob.type(value)
    except ValueError:
        return value


def _with(scene: S, place: Place, value: Any) -> S:
    """The scene with a knob turned, in each part of a tuple."""

    def turn(part: Any) -> Any:
        if isinstance(part, tuple):
            return tuple(map(turn, part))
        if not is_dataclass(part) or isinstance(part, type):
            return part
        known = knobs_of(type(part))
        if known:
            return replace(part, **{place.knob.name: value}) if place.knob in known else part
        inner = {f.name: getattr(part, f.name) for f in fields(part) if f.init}
        new = {n: turn(v) for n, v in inner.items()}
        return replace(part, **new) if any(new[n] is not inner[n] for n in new) else part

    changes: dict[str, Any] = {place.field: turn(getattr(scene, place.field))}
    return replace(scene, **changes)


def value_of(scene: SceneState, place: Place) -> Any:
    """The value of a knob; of the first part that has it."""
    parts = [part for name, part in _parts(getattr(scene, place.field)) if name == place.part]
    return getattr(parts[0], place.knob.name)


def _finest(knob: Knob, values: Sequence[Any]) -> Any:
    """The fine value; twice as fine as the finest of these where that is finer still."""
    if knob.type not in (int, float) or knob.fine == knob.default:
        return knob.fine
    if knob.fine < knob.default:
        value = min(knob.fine, min(values) / 2)
        return knob.type(value if knob.low is None else max(value, knob.low))
    value = max(knob.fine, 2 * max(values))
    return knob.type(value if knob.high is None else min(value, knob.high))


# --- what is no knob -----------------------------------------------------------------------------


def _preset_name(word: str) -> str:
    return presets.preset(word).name


def _preset(scene: S, name: str, aspect: float) -> S:
    """As the window puts a preset on: the light starts anew, what it does not decide stays."""
    chosen = presets.preset(name)
    transfer, knobs = presets.apply(chosen, scene.volume, known_statistics(scene.volume))
    return replace(scene, transfer=transfer, light=Light()).with_knobs(**knobs)


def _view(scene: S, name: str, aspect: float) -> S:
    lens = {k.name: getattr(scene.camera, k.name) for k in knobs_of(type(scene.camera))}
    return scene.with_camera(volume_camera(scene.volume, name, aspect=aspect, **lens))


def _color(word: str) -> str:
    from PIL import ImageColor

    if word.lower() != "transparent":
        try:
            ImageColor.getrgb(word)
        except ValueError:
            raise UsageError(
                f"'{word}' is no colour", fix="give a name, #rrggbb or transparent"
            ) from None
    return word


def _background(scene: S, name: str, aspect: float) -> S:
    from PIL import ImageColor

    clear = name.lower() == "transparent"
    color = (0, 0, 0, 0) if clear else ImageColor.getrgb(_color(name))
    return replace(scene, background=Background.plain([c / 255 for c in color]))


def _positive(word: str) -> float:
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if not 0 < value < math.inf:
        raise UsageError(f"'{word}' is not a number above 0", fix="give a number above 0")
    return value


def _faded(scene: S, factor: float, aspect: float) -> S:
    return scene.with_transfer(scene.transfer.faded(_positive(str(factor))))


def _unit_distance(scene: S, distance: float, aspect: float) -> S:
    return scene.with_transfer(replace(scene.transfer, unit_distance=_positive(str(distance))))


MORE: dict[str, More] = {
    "preset": More("transfer function by name (see 'volviz presets')", _preset_name, _preset),
    "view": More("standard view: anterior, left, superior, …; front, top, …", str, _view),
    "background": More("a colour's name, #rrggbb, or transparent", _color, _background),
    "opacity": More("multiplies every opacity", _positive, _faded),
    "unit-distance": More("mm over which the opacity accumulates", _positive, _unit_distance),
}


def idle_warning(axis: Axis, scenes: Sequence[SceneState]) -> str | None:
    """What to know of a knob that does nothing in any of these scenes; None if it does."""
    needed: Mapping[str, tuple[str, ...]] = {}
    for scene in scenes:
        place = places(scene).get(axis.name)
        if place is None:
            return None
        whole = getattr(scene, place.field)
        for one in whole if isinstance(whole, tuple) else (whole,):
            parts = [part for _, part in _parts(one)]
            values = {k.name: getattr(p, k.name) for p in parts for k in knobs_of(type(p))}
            if place.knob.used(values):
                return None
            needed = place.knob.used_with
    told = ", ".join(f"{name} {' or '.join(those)}" for name, those in needed.items())
    return f"{axis.name} does nothing here: it is for {told}"


def preset_warning(scene: SceneState, changed: Mapping[str, Any]) -> str | None:
    """What to know about how a varied preset suits the volume."""
    if "preset" not in changed:
        return None
    try:
        chosen = presets.preset(changed["preset"])
    except VolvizError:
        return None
    return presets.fit_warning(chosen, scene.volume, known_statistics(scene.volume))
