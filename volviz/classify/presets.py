"""Named transfer functions: found by name, fitted to a volume, taken from what is seen."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from os import PathLike, fspath
from pathlib import Path
from types import MappingProxyType
from typing import Any

from volviz.classify import own_presets
from volviz.classify.colormaps import hex_code
from volviz.classify.hounsfield import hounsfield_offset
from volviz.classify.labels import looks_like_labels
from volviz.classify.levels import Levels, extent, levels
from volviz.classify.preset_file import Group, Preset, load_preset, plain, shipped
from volviz.errors import UsageError, did_you_mean
from volviz.fields.statistics import Statistics
from volviz.model.knobs import knobs_of
from volviz.model.scene import Light, SceneState
from volviz.model.transfer import TransferFunction
from volviz.model.volume import Volume

MODALITIES: dict[str, Group] = {"CT": "CT", "MR": "MR", "US": "Ultrasound"}
"""DICOM's codes of what made a volume, and the groups of presets meant for it."""


def presets() -> MappingProxyType[str, Preset]:
    """All presets by name: those that volviz brings, in the order of their groups, then the
    user's own as they are in the configuration folder now. Broken ones are left out."""
    return MappingProxyType({**shipped(), **own_presets.own().presets})


def recent() -> MappingProxyType[str, Preset]:
    """`presets` as they were a second ago at most: for those who ask with every frame."""
    return MappingProxyType({**shipped(), **own_presets.recent().presets})


def preset(name: str | PathLike[str]) -> Preset:
    """The preset of that name, or in that `.json` file.

    Case, hyphens and underscores don't matter: "CT-Bone" and "ct_bone" are one. Raises
    UsageError for an unknown name, InputError for a file that is missing or wrong.
    """
    if not isinstance(name, str | PathLike):
        raise UsageError(f"{name!r} is no name of a preset", field="preset")
    text = fspath(name)
    known = {plain(n): p for n, p in presets().items()}
    if plain(text) in known:
        return known[plain(text)]
    if text.lower().endswith(".json") or "/" in text or "\\" in text:
        return load_preset(Path(text))
    broken = {plain(n): error for n, error in own_presets.own().broken.items()}
    if plain(text) in broken:
        raise broken[plain(text)]
    raise UsageError(f"unknown preset '{text}'", field="preset", fix=did_you_mean(text, presets()))


def captured(title: str, scene: SceneState, statistics: Statistics) -> Preset:
    """The look of a scene as a preset: `apply` brings it back on its volume and fits it to others.

    In Hounsfield units where the volume has them, else relative to its histogram; colours are
    rounded to 8 bits. statistics: of the scene's volume.
    """
    volume, transfer, light = scene.volume, scene.transfer, scene.light
    offset = hounsfield_offset(volume, statistics)
    if offset is not None:
        size, moved = 1.0, transfer.mapped(lambda value: _neat(value - offset))
    else:
        start, end = (levels(statistics).at(r) for r in (0.0, 1.0))
        size = extent(volume)
        moved = transfer.mapped(lambda value: _neat((value - start) / (end - start)))
    group = "CT" if offset is not None else MODALITIES.get(volume.info.modality or "", "Any")
    knobs = {k.name: getattr(light, k.name) for k in knobs_of(Light)}
    return Preset(
        name=own_presets.name_of(title),
        title=title.strip(),
        group=group,
        description=f"Saved from {volume.name}." if volume.name else "Saved in the window.",
        axis="relative" if offset is None else "hu",
        colors=tuple((value, hex_code(color)) for value, *color in moved.colors),
        opacities=moved.opacities,
        unit_distance=_neat(transfer.unit_distance / size),
        unit="size" if offset is None else "mm",
        mode=scene.raycast.mode,
        shading=scene.raycast.shading,
        light={k.name: knobs[k.name] for k in knobs_of(Light) if knobs[k.name] != k.default},
    )


def _neat(value: float) -> float:
    """Twelve digits: as exact as anybody can tell, and to be read in a file."""
    return float(f"{value:.12g}")


def apply(
    preset: Preset, volume: Volume, statistics: Statistics
) -> tuple[TransferFunction, dict[str, Any]]:
    """The preset fitted to a volume: a transfer function over its values, and knobs to turn.

    Hounsfield presets are moved by the offset of raw scanner numbers; on data that are not in
    Hounsfield units they are fitted by landmarks (background ≙ air, most frequent content ≙ soft
    tissue, brightest ≙ dense bone). `fit_warning` says so.
    """
    transfer = preset.transfer()
    if preset.axis == "relative":
        transfer = transfer.mapped(levels(statistics).at)
    else:
        offset = hounsfield_offset(volume, statistics)
        move = _by_landmarks(levels(statistics)) if offset is None else None
        transfer = transfer.mapped(move) if move else transfer.shifted(offset or 0.0)
    unit = preset.unit_distance * (extent(volume) if preset.unit == "size" else 1.0)
    labels = looks_like_labels(volume, statistics)
    return replace(transfer, unit_distance=unit), {
        **preset.knobs(),
        "interpolation": "nearest" if labels else "linear",
    }


def fit_warning(preset: Preset, volume: Volume, statistics: Statistics) -> str | None:
    """What to know when this preset meets this volume; None if they suit each other."""
    if preset.axis != "hu":
        return None
    offset = hounsfield_offset(volume, statistics)
    if offset is None:
        return (
            f"the values are not in Hounsfield units: preset '{preset.name}' is fitted to the "
            "histogram by guess"
        )
    if offset:
        return (
            f"the values look like Hounsfield units + {offset:g}: preset '{preset.name}' is moved "
            "by as much"
        )
    return None


def _by_landmarks(at: Levels) -> Callable[[float], float]:
    """Hounsfield units to values of unknown scale, rising and piecewise linear."""
    air, tissue, bone = -950.0, 40.0, 1500.0
    middle = min(max(at.tissue, at.background + 0.05 * (at.high - at.background)), at.at(0.8))

    def move(hu: float) -> float:
        if hu <= tissue:
            return middle + (hu - tissue) / (tissue - air) * (middle - at.background)
        return middle + (hu - tissue) / (bone - tissue) * (at.high - middle)

    return move
