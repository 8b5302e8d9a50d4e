"""Colours of the vertices that `volviz surface` writes: by a second field and a colour map."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from volviz.classify import presets
from volviz.classify.presets import Preset
from volviz.classify.suggest import suggest
from volviz.cli.flags import flag, numbers, transfer_of
from volviz.errors import UsageError
from volviz.model.surface_look import BY_TRANSFER, COLORMAPS, FIELDS, SurfaceLook
from volviz.model.transfer import TransferFunction
from volviz.model.volume import Volume
from volviz.progress import Progress
from volviz.resolve import known_statistics
from volviz.surface_colors import field_values, span_of
from volviz.surface_colors import painted as paint_mesh

if TYPE_CHECKING:
    from volviz.cli.surface import Made

COLORED = (".ply", ".obj", ".glb")
_PANEL = "Colours"
FLAGS = [
    flag(
        "color_by",
        str,
        f"colour the vertices by a field: {', '.join(FIELDS)}, or a file with another volume "
        "(FILE?channel=1 for one of its channels)",
        _PANEL,
    ),
    flag("colormap", str, f"colours of that field: {', '.join(COLORMAPS)}", _PANEL),
    flag("color_range", str, "LOW,HIGH of the colours; by default nearly all values", _PANEL),
    flag(
        "preset",
        str,
        "transfer function of the colours, by name (see 'volviz presets') or file; without one a "
        "scene's own, or the one that suits the file",
        _PANEL,
    ),
    flag("transfer", str, "that transfer function as JSON text, or a file with it (.json)", _PANEL),
]


@dataclass(frozen=True)
class Paint:
    """What was asked for. preset, transfer: None for what the volume or its scene begins with."""

    look: SurfaceLook
    preset: Preset | None = None
    transfer: TransferFunction | None = None


def asked(given: dict[str, Any], output: str | None) -> Paint | None:
    """The flags of `FLAGS`, taken out of what was given; None for no colours.

    Raises UsageError for a range or a map without a field, and for a file without colours.
    """
    asked_for = {f.name: given.pop(f.name) for f in FLAGS if f.name in given}
    if "color_by" not in asked_for:
        if asked_for:
            name = f"--{next(iter(asked_for)).replace('_', '-')}"
            raise UsageError("there is no field to colour by", field=name, fix="give --color-by")
        return None
    names = ("color_by", "colormap", "color_range")
    field, colors, span = (asked_for.get(name) for name in names)
    preset, transfer = _transfer_asked(asked_for)
    if preset is not None or transfer is not None:
        colors = colors or BY_TRANSFER
    suffix = Path(output or "x.ply").suffix.lower()
    if suffix not in COLORED:
        raise UsageError(
            f"a {suffix} file has no colours", file=output, fix=f"write {', '.join(COLORED)}"
        )
    knobs: dict[str, Any] = {"coloring": "field", "color_field": field}
    if colors is not None:
        knobs["colormap"] = colors
    if span is not None:
        low, high = numbers(span, (2,), "--color-range", "LOW,HIGH")
        if not low < high:
            raise UsageError(f"{low:g} is not below {high:g}", field="--color-range")
        knobs |= {"color_low": low, "color_high": high}
    look = SurfaceLook(**knobs)
    if look.colormap == BY_TRANSFER and span is not None:
        raise UsageError("a transfer function has its own range", field="--color-range")
    if look.colormap != BY_TRANSFER and (preset is not None or transfer is not None):
        raise UsageError(
            f"the colours are those of {look.colormap}",
            field="--preset" if preset is not None else "--transfer",
            fix=f"give --colormap {BY_TRANSFER}",
        )
    return Paint(look, preset, transfer)


def _transfer_asked(given: dict[str, Any]) -> tuple[Preset | None, TransferFunction | None]:
    """Read before the volume is, so that a wrong name is told at once."""
    if "preset" in given and "transfer" in given:
        raise UsageError("--preset says it too", field="--transfer", fix="give one of the two")
    preset = presets.preset(given["preset"]) if "preset" in given else None
    return preset, transfer_of(given["transfer"]) if "transfer" in given else None


def painted(
    made: Made, volume: Volume, paint: Paint | None, scene: str | None, progress: Progress
) -> Made:
    """The same with colours and values at the vertices of its mesh.

    scene: the file that the volume was named by, if that was a scene. Raises VolvizError.
    """
    if paint is None or made.mesh.empty:
        return made
    values = field_values(volume, paint.look.color_field, made.mesh, progress)
    transfer = _transfer(volume, paint, scene) if paint.look.colormap == BY_TRANSFER else _NONE
    look, span = paint.look, span_of(values)
    if look.colormap == BY_TRANSFER:
        span = transfer.domain
    elif look.color_low < look.color_high:
        span = (look.color_low, look.color_high)
    mesh = paint_mesh(made.mesh, values, look, span, transfer)
    told = {
        "field": look.color_field,
        "colormap": look.colormap,
        "low": span[0],
        "high": span[1],
        "vertices_without_value": int(np.isnan(values).sum()),
    }
    return replace(made, mesh=mesh, color=told)


def _transfer(volume: Volume, paint: Paint, scene: str | None) -> TransferFunction:
    """The one that was asked for, the scene's, or the one a scene of this volume begins with."""
    if paint.transfer is not None:
        return paint.transfer
    if paint.preset is not None:
        return presets.apply(paint.preset, volume, known_statistics(volume))[0]
    if scene is not None:
        return transfer_of(scene)
    return suggest(volume, known_statistics(volume)).transfer


_NONE = TransferFunction(((0.0, 0.0, 0.0, 0.0),), ((0.0, 0.0),))
