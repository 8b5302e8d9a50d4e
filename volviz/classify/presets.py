"""Named transfer functions: one JSON file each, checked on loading, fitted to a volume.

Values stand on one of two axes: "hu" is Hounsfield units, "relative" runs from 0 (where the
volume's background ends) to 1 (where its brightest half percent begins).
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from os import PathLike, fspath
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta

from volviz.classify.colormaps import rgb
from volviz.classify.hounsfield import hounsfield_offset
from volviz.classify.labels import looks_like_labels
from volviz.classify.levels import Levels, extent, levels
from volviz.errors import InputError, UsageError, did_you_mean
from volviz.fields.statistics import Statistics
from volviz.model.scene import Light, Raycast
from volviz.model.transfer import TransferFunction
from volviz.model.volume import Volume
from volviz.resources import asset_dir

GROUPS = ("CT", "MR", "Micro-CT", "Ultrasound", "Any")
MAX_BYTES = 1 << 20

Fraction = Annotated[float, Meta(ge=0, le=1)]
Knob = float | int | str


class Preset(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A preset file.

    colors: (value on the axis, "#rrggbb"). opacities: (value, opacity over the unit distance).
    unit_distance: in mm, or, with unit "size", as a part of the volume's size. mode, shading:
    as the knobs of `Raycast`. light: knobs of `Light` that differ from their defaults.
    """

    name: str
    title: str
    group: Literal["CT", "MR", "Micro-CT", "Ultrasound", "Any"]
    description: str
    axis: Literal["hu", "relative"]
    colors: Annotated[tuple[tuple[float, str], ...], Meta(min_length=1, max_length=4096)]
    opacities: Annotated[tuple[tuple[float, Fraction], ...], Meta(min_length=1, max_length=4096)]
    unit_distance: Annotated[float, Meta(gt=0)] = 1.0
    unit: Literal["mm", "size"] = "mm"
    mode: Literal["dvr", "mip"] = "dvr"
    shading: Literal["none", "phong", "blinn-phong"] = "blinn-phong"
    light: dict[str, float] = {}

    def transfer(self) -> TransferFunction:
        """The transfer function over the preset's own axis."""
        colors = tuple((value, *rgb(code)) for value, code in self.colors)
        return TransferFunction(colors, self.opacities, self.unit_distance, self.name)

    def knobs(self) -> dict[str, Any]:
        """The knobs of ray and light that the preset turns."""
        return {"mode": self.mode, "shading": self.shading, **self.light}


def presets() -> MappingProxyType[str, Preset]:
    """All presets that volviz brings, by name, in the order of their groups."""
    return MappingProxyType(_all())


def preset(name: str | PathLike[str]) -> Preset:
    """The preset of that name, or in that `.json` file.

    Case, hyphens and underscores don't matter: "CT-Bone" and "ct_bone" are one. Raises
    UsageError for an unknown name, InputError for a file that is missing or wrong.
    """
    if not isinstance(name, str | PathLike):
        raise UsageError(f"{name!r} is no name of a preset", field="preset")
    text = fspath(name)
    known = {_plain(n): p for n, p in presets().items()}
    if _plain(text) in known:
        return known[_plain(text)]
    if text.lower().endswith(".json") or "/" in text or "\\" in text:
        return load_preset(Path(text))
    raise UsageError(f"unknown preset '{text}'", field="preset", fix=did_you_mean(text, presets()))


def load_preset(path: Path) -> Preset:
    """Read and check a preset file. Raises InputError that names the field."""
    try:
        if path.exists() and not path.is_file():  # a pipe or a device would never end
            raise InputError("not a regular file", file=path)
        with path.open("rb") as file:
            content = file.read(MAX_BYTES + 1)
        if len(content) > MAX_BYTES:
            raise InputError("too large for a preset (1 MiB at most)", file=path)
    except OSError as error:
        raise InputError(error.strerror or str(error), file=path) from error
    try:
        found = msgspec.json.decode(content, type=Preset)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        what, _, where = str(error).partition(" - at ")
        raise InputError(what, file=path, field=where.strip("`") or None) from error
    try:
        found.transfer()
        knobs = {n: v for n, v in found.light.items() if n in Light.__dataclass_fields__}
        if len(knobs) < len(found.light):
            unknown = next(n for n in found.light if n not in knobs)
            raise UsageError(
                f"unknown knob '{unknown}'",
                field="light",
                fix=did_you_mean(unknown, Light.__dataclass_fields__),
            )
        Light(**knobs)
        Raycast(mode=found.mode, shading=found.shading)
    except UsageError as error:
        where = error.field or "colors"
        raise InputError(error.what, file=path, field=where, fix=error.fix) from error
    return found


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


@cache
def _all() -> dict[str, Preset]:
    found = [load_preset(path) for path in sorted((asset_dir() / "presets").glob("*.json"))]
    found.sort(key=lambda p: (GROUPS.index(p.group), [_natural(t) for t in p.name.split("-")]))
    return {p.name: p for p in found}


def _natural(text: str) -> tuple[str, int]:
    letters = text.rstrip("0123456789")
    return letters, int(text[len(letters) :] or 0)


def _plain(name: str) -> str:
    return re.sub(r"[^a-z0-9.]", "", name.lower().replace("µ", "u").replace("μ", "u"))
