"""Ready-made looks for a scene: presets, the suggestion, colour maps, ranges. Scene in, scene out.

What is fitted to a volume is remembered with it, so that a panel may ask every frame.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from volviz.classify import presets
from volviz.classify.colormaps import RAMPS, ramp_points
from volviz.classify.hounsfield import hounsfield_offset
from volviz.classify.suggest import suggest
from volviz.fields.statistics import Statistics
from volviz.model.scene import Light, SceneState
from volviz.model.transfer import TransferFunction
from volviz.model.volume import Volume
from volviz.resolve import MEMO
from volviz.ui import control_points

SUGGESTED = "suggested"


@dataclass(frozen=True)
class Look:
    """A transfer function with the knobs that go with it. warning: how well it suits, if badly."""

    transfer: TransferFunction
    knobs: dict[str, Any]
    warning: str | None = None


def preset_look(name: str, volume: Volume, statistics: Statistics) -> Look:
    """A preset fitted to a volume."""

    def fit() -> Look:
        chosen = presets.preset(name)
        transfer, knobs = presets.apply(chosen, volume, statistics)
        return Look(transfer, knobs, presets.fit_warning(chosen, volume, statistics))

    return MEMO.get(volume, ("look", name), fit)


def suggested_look(volume: Volume, statistics: Statistics) -> Look:
    """What volviz suggests for a volume."""

    found = MEMO.get(volume, "suggestion", lambda: suggest(volume, statistics))
    return Look(found.transfer, found.knobs())


def named_look(name: str, volume: Volume, statistics: Statistics) -> Look | None:
    """The look a transfer function says it came from; None if that is not known here."""
    if name in presets.presets():
        return preset_look(name, volume, statistics)
    suggested = suggested_look(volume, statistics)
    return suggested if name in (SUGGESTED, suggested.transfer.name) else None


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
