"""Colours of the vertices that `volviz surface` writes: by a second field and a colour map."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from volviz.classify.suggest import suggest
from volviz.cli.flags import flag, numbers
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
]


@dataclass(frozen=True)
class Paint:
    """What was asked for."""

    look: SurfaceLook


def asked(given: dict[str, Any], output: str | None) -> Paint | None:
    """The flags of `FLAGS`, taken out of what was given; None for no colours.

    Raises UsageError for a range or a map without a field, and for a file without colours.
    """
    field, colors, span = (given.pop(n, None) for n in ("color_by", "colormap", "color_range"))
    if field is None:
        if colors is not None or span is not None:
            name = "--colormap" if colors is not None else "--color-range"
            raise UsageError("there is no field to colour by", field=name, fix="give --color-by")
        return None
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
    return Paint(SurfaceLook(**knobs))


def painted(made: Made, volume: Volume, paint: Paint | None, progress: Progress) -> Made:
    """The same with colours and values at the vertices of its mesh. Raises VolvizError."""
    if paint is None or made.mesh.empty:
        return made
    values = field_values(volume, paint.look.color_field, made.mesh, progress)
    transfer = _transfer(volume) if paint.look.colormap == BY_TRANSFER else _NONE
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


def _transfer(volume: Volume) -> TransferFunction:
    """The one that a scene of this volume begins with."""
    return suggest(volume, known_statistics(volume)).transfer


_NONE = TransferFunction(((0.0, 0.0, 0.0, 0.0),), ((0.0, 0.0),))
