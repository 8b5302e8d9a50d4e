"""Ready-made looks for a scene: presets, the suggestion, colour maps, ranges. Scene in, scene out.

What is fitted to a volume is remembered with it, so that a panel may ask every frame.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import Any

from volviz.classify import own_presets, presets
from volviz.classify.colormaps import RAMPS, ramp_points
from volviz.classify.hounsfield import hounsfield_offset
from volviz.classify.preset_file import GROUPS, Preset
from volviz.classify.suggest import Suggestion, suggest, suits
from volviz.fields.statistics import Statistics
from volviz.model.scene import Light, SceneState
from volviz.model.transfer import TransferFunction
from volviz.model.volume import Volume
from volviz.resolve import MEMO
from volviz.ui import control_points

SUGGESTED = "suggested"
SECTIONS = ("Suggested", "Favourites", "Your own")
GENERAL, OTHERS = "For any data", "Made for other data"


@dataclass(frozen=True)
class Look:
    """A transfer function with the knobs that go with it. warning: how well it suits, if badly."""

    transfer: TransferFunction
    knobs: dict[str, Any]
    warning: str | None = None


@dataclass(frozen=True)
class Choice:
    """A look to choose. section: the heading it stands under. about: what it shows. preset: None
    for what is suggested without one. suits: made for such data. own: the user's own file."""

    section: str
    name: str
    title: str
    about: str
    preset: Preset | None = None
    suits: bool = True
    own: bool = False


def catalogue(
    volume: Volume, statistics: Statistics, favourites: Collection[str] = ()
) -> list[Choice]:
    """All looks for a volume, each once: suggested, favourites, the user's own, those made for
    such data, those for any, and last those that are fitted by guess."""
    found = _suggestion(volume, statistics)
    named = presets.recent()
    mine = own_presets.recent().presets
    offset = hounsfield(volume, statistics)
    suggested = found.transfer.name if found.transfer.name in named else SUGGESTED
    first = Choice(SECTIONS[0], SUGGESTED, "Suggested", _sentence(found.why))
    listed: list[Choice] = []
    for name, preset in named.items():
        fits = suits(preset, offset, found.modality)
        own, about = name in mine, preset.description
        if name == suggested:
            about = f"{about} Suggested: {found.why}."
        section = (
            SECTIONS[0] if name == suggested
            else SECTIONS[1] if name in favourites
            else SECTIONS[2] if own
            else OTHERS if not fits
            else GENERAL if preset.group == "Any"
            else preset.group
        )  # fmt: skip
        listed.append(Choice(section, name, preset.title, about, preset, fits, own))
    order = [*SECTIONS, *(g for g in GROUPS if g != "Any"), GENERAL, OTHERS]
    listed = listed if suggested in named else [first, *listed]
    return sorted(listed, key=lambda c: order.index(c.section))


def preset_look(name: str, volume: Volume, statistics: Statistics) -> Look:
    """A preset fitted to a volume. Raises UsageError for an unknown name."""
    chosen = presets.recent().get(name) or presets.preset(name)

    def fit() -> Look:
        transfer, knobs = presets.apply(chosen, volume, statistics)
        return Look(transfer, knobs, presets.fit_warning(chosen, volume, statistics))

    return MEMO.latest(volume, f"look {name}", chosen, fit)  # a user's file may change


def suggested_look(volume: Volume, statistics: Statistics) -> Look:
    """What volviz suggests for a volume."""
    found = _suggestion(volume, statistics)
    return Look(found.transfer, found.knobs())


def _suggestion(volume: Volume, statistics: Statistics) -> Suggestion:
    return MEMO.get(volume, "suggestion", lambda: suggest(volume, statistics))


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:] + "."


def named_look(name: str, volume: Volume, statistics: Statistics) -> Look | None:
    """The look a transfer function says it came from; None if that is not known here."""
    if name in presets.recent():
        return preset_look(name, volume, statistics)
    suggested = suggested_look(volume, statistics)
    return suggested if name in (SUGGESTED, suggested.transfer.name) else None


def worn(scene: SceneState, choice: str, statistics: Statistics) -> bool:
    """True if the scene looks as this choice makes it, with nothing changed since."""
    name = scene.transfer.name
    if choice != name and (choice != SUGGESTED or name in presets.recent()):
        return False
    look = named_look(choice, scene.volume, statistics)
    return look is not None and look.transfer == scene.transfer and dressed(scene, look) == scene


def dressed(scene: SceneState, look: Look) -> SceneState:
    """The scene in another look, as `Scene.of(preset=…)` makes it: the light starts anew, what
    the look doesn't decide (camera, step, samples, …) stays."""
    return replace(scene, transfer=look.transfer, light=Light()).with_knobs(**look.knobs)


def with_color_map(transfer: TransferFunction, name: str) -> TransferFunction:
    """The colours of a named map, spread over the values that had colours before."""
    low, high = transfer.colors[0][0], transfer.colors[-1][0]
    if not low < high:
        low, high = transfer.domain
    return replace(transfer, colors=ramp_points(name, low, high))


def color_map_of(transfer: TransferFunction) -> str | None:
    """Name of the colour map whose colours these are, in its order; None if of no map."""
    for name in RAMPS:
        if len(RAMPS[name]) == len(transfer.colors):
            points = ramp_points(name, transfer.colors[0][0], transfer.colors[-1][0])
            if [p[1:] for p in points] == [p[1:] for p in transfer.colors]:
                return name
    return None


def with_percentiles(
    transfer: TransferFunction, statistics: Statistics, low: float, high: float
) -> TransferFunction:
    """The transfer function stretched between two percentiles of the values."""
    ends = statistics.percentile(low), statistics.percentile(high)
    return control_points.stretched(transfer, *ends)


def hounsfield(volume: Volume, statistics: Statistics) -> float | None:
    """What Hounsfield units are raised by in this volume's values; None if it is no CT."""
    return MEMO.get(volume, "hounsfield", lambda: hounsfield_offset(volume, statistics))
