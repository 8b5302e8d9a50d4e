"""Preset files: their schema, reading and writing them, and those that volviz brings.

Values stand on one of two axes: "hu" is Hounsfield units, "relative" runs from 0 (where the
volume's background ends) to 1 (where its brightest half percent begins).
"""

from __future__ import annotations

import json
import re
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, Literal, get_args

import msgspec
from msgspec import Meta

from volviz.classify.colormaps import rgb
from volviz.errors import InputError, UsageError, did_you_mean
from volviz.model.scene import Light, Raycast
from volviz.model.transfer import TransferFunction
from volviz.resources import asset_dir

Group = Literal["CT", "MR", "Micro-CT", "Ultrasound", "Any"]
GROUPS: tuple[Group, ...] = get_args(Group)
MAX_BYTES = 1 << 20

Fraction = Annotated[float, Meta(ge=0, le=1)]


class Preset(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A preset file.

    colors: (value on the axis, "#rrggbb"). opacities: (value, opacity over the unit distance).
    unit_distance: in mm, or, with unit "size", as a part of the volume's size. mode, shading:
    as the knobs of `Raycast`. light: knobs of `Light` that differ from their defaults.
    """

    name: Annotated[str, Meta(min_length=1, max_length=200)]
    title: str
    group: Group
    description: str
    axis: Literal["hu", "relative"]
    colors: Annotated[tuple[tuple[float, str], ...], Meta(min_length=1, max_length=4096)]
    opacities: Annotated[tuple[tuple[float, Fraction], ...], Meta(min_length=1, max_length=4096)]
    unit_distance: Annotated[float, Meta(gt=0)] = 1.0
    unit: Literal["mm", "size"] = "mm"
    mode: str = "dvr"
    shading: str = "blinn-phong"
    light: dict[str, float] = {}

    def transfer(self) -> TransferFunction:
        """The transfer function over the preset's own axis."""
        colors = tuple((value, *rgb(code)) for value, code in self.colors)
        return TransferFunction(colors, self.opacities, self.unit_distance, self.name)

    def knobs(self) -> dict[str, Any]:
        """The knobs of ray and light that the preset turns."""
        return {"mode": self.mode, "shading": self.shading, **self.light}


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
    return decoded(content, path)


def decoded(content: bytes, path: Path) -> Preset:
    """The checked preset of a file's bytes. Raises InputError that names file and field."""
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


def encoded(preset: Preset) -> bytes:
    """The text of a preset's file, as those that volviz brings are written: a point a line."""
    default = {f.name: f.default for f in msgspec.structs.fields(Preset) if not f.required}
    default["light"] = {}
    lines = []
    for name, value in msgspec.to_builtins(preset).items():
        if name in default and value == default[name]:
            continue
        if name in ("colors", "opacities"):
            points = ",\n    ".join(json.dumps(p, ensure_ascii=False) for p in value)
            text = f"[\n    {points}\n  ]"
        else:
            text = json.dumps(value, ensure_ascii=False)
        lines.append(f'  "{name}": {text}')
    return ("{\n" + ",\n".join(lines) + "\n}\n").encode()


@cache
def shipped() -> MappingProxyType[str, Preset]:
    """The presets that volviz brings, by name, in the order of their groups."""
    found = [load_preset(path) for path in sorted((asset_dir() / "presets").glob("*.json"))]
    found.sort(key=lambda p: (GROUPS.index(p.group), natural(p.name)))
    return MappingProxyType({p.name: p for p in found})


def plain(name: str) -> str:
    """What is compared of a name: "CT-Bone" and "ct_bone" are one."""
    return re.sub(r"[^\w.]|_", "", name.casefold().replace("µ", "u").replace("μ", "u"))


def natural(name: str) -> list[tuple[str, int]]:
    """A key that sorts names with numbers as people do."""
    return [_parted(part) for part in name.split("-")]


def _parted(text: str) -> tuple[str, int]:
    letters = text.rstrip("0123456789")
    return letters, int(text[len(letters) :] or 0)
