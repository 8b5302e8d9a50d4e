"""Colours of a surface by a second field: values at its vertices, and a colour map over them."""

from __future__ import annotations

import threading
from collections import OrderedDict
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from volviz.classify.colormaps import ramp_points
from volviz.errors import Cancelled, UsageError, VolvizError
from volviz.fields.probe import gradient_magnitude_at, values_at
from volviz.model.mesh import Mesh
from volviz.model.surface_look import BY_TRANSFER, FIELDS, SurfaceLook
from volviz.model.transfer import TransferFunction
from volviz.model.volume import Volume
from volviz.progress import Progress, silent

if TYPE_CHECKING:
    from volviz.io.options import ReadOptions

MISSING = (0.55, 0.55, 0.55)
"""sRGB where the field has no value."""
KEPT = 2
"""Other volumes that are held in memory, the latest used."""
STEPS = 1024
"""Colours of a colour map."""

_others: OrderedDict[str, Volume] = OrderedDict()
_reading = threading.Lock()


@dataclass(frozen=True, eq=False)
class Sampled:
    """A field on a surface and on its coarse mesh. values, coarse: float32 per vertex, NaN for
    none. span: what the colours cover unless the look says it. error: why there are no values."""

    values: NDArray[np.float32]
    coarse: NDArray[np.float32]
    span: tuple[float, float]
    error: VolvizError | None = None


def field_values(
    volume: Volume, field: str, mesh: Mesh, progress: Progress | None = None
) -> NDArray[np.float32]:
    """float32[vertices]: a field of `surface_look.FIELDS`, or the values of another volume.

    field: else names a file, a folder or `sample:NAME`, whose grid may be any other: it is looked
    up at the vertices' places in the world. `?channel=1`, `?time=2` or `?series=NAME` after the
    name choose one of a file that has several. Raises VolvizError where that cannot be read, and
    Cancelled.
    """
    report = progress or silent()
    if field == "gradient-magnitude":
        return gradient_magnitude_at(volume, mesh.vertices, report)
    if field in FIELDS:
        return np.ascontiguousarray(mesh.vertices[:, "xyz".index(field)])
    other = _other(field, report.part(0, 0.6))
    return values_at(other, mesh.vertices, report.part(0.6, 1))


def span_of(values: NDArray[np.float32]) -> tuple[float, float]:
    """From the 2nd to the 98th percentile of the values there are; (0, 1) for none."""
    finite = values[np.isfinite(values)]
    if not finite.size:
        return 0.0, 1.0
    low, high = (float(v) for v in np.percentile(finite, (2, 98)))
    if not high > low:
        low, high = float(finite.min()), float(finite.max())
    return (low, high) if high > low else (low, low + max(abs(low) * 1e-6, 1e-6))


def sampled(
    volume: Volume, field: str, mesh: Mesh, coarse: Mesh, progress: Progress | None = None
) -> Sampled:
    """The field on both meshes; where it cannot be read, NaN and why. Raises Cancelled."""
    report = progress or silent()
    try:
        values = field_values(volume, field, mesh, report.part(0, 0.8))
        few = values
        if coarse is not mesh:
            few = field_values(volume, field, coarse, report.part(0.8, 1))
    except VolvizError as error:
        if isinstance(error, Cancelled):
            raise
        none, few = (np.full(len(m.vertices), np.nan, np.float32) for m in (mesh, coarse))
        return Sampled(none, few, (0.0, 1.0), error)
    return Sampled(values, few, span_of(values))


def painted(
    mesh: Mesh,
    values: NDArray[np.float32],
    look: SurfaceLook,
    span: tuple[float, float],
    transfer: TransferFunction,
) -> Mesh:
    """The mesh with these values and their colours. span: used where the look leaves it open."""
    low, high = (look.color_low, look.color_high) if look.color_low < look.color_high else span
    if look.colormap == BY_TRANSFER:
        low, high = transfer.domain
        table = transfer.color_at(np.linspace(low, high, STEPS))
    else:
        points = np.array(ramp_points(look.colormap, 0.0, 1.0))
        at = np.linspace(0, 1, STEPS)
        table = np.stack([np.interp(at, points[:, 0], points[:, k]) for k in (1, 2, 3)], axis=1)
    codes = np.empty((STEPS + 1, 4), dtype=np.uint8)
    codes[:-1, :3] = np.rint(255 * np.clip(table, 0, 1))
    codes[-1, :3] = np.rint(255 * np.array(MISSING))
    codes[:, 3] = 255
    place = (values.astype(np.float64) - low) * ((STEPS - 1) / max(high - low, 1e-300))
    known = np.isfinite(values)
    row = np.where(known, np.clip(np.rint(np.where(known, place, 0)), 0, STEPS - 1), STEPS)
    return replace(mesh, values=values, colors=codes[row.astype(np.int64)])


def _other(name: str, progress: Progress) -> Volume:
    """Another volume, read once while it is one of the latest."""
    from volviz.sources import open_volume

    with _reading:
        if name in _others:
            _others.move_to_end(name)
            return _others[name]
        progress(None, f"reading {name}")
        path, options = _chosen(name, progress)
        found = open_volume(path, options)
        _others[name] = found
        while len(_others) > KEPT:
            _others.popitem(last=False)
        return found


def _chosen(name: str, progress: Progress) -> tuple[str, ReadOptions | None]:
    """The file, and which of its parts: `NAME?channel=1&time=2`."""
    from volviz.io.options import ReadOptions

    path, mark, choices = name.rpartition("?")
    if not mark or "=" not in choices:
        return name, None if name.startswith("sample:") else ReadOptions(progress=progress)
    known = {"channel": int, "time": int, "series": str}
    given: dict[str, int | str] = {}
    for part in choices.split("&"):
        key, _, value = part.partition("=")
        try:
            given[key] = known[key](value)
        except (KeyError, ValueError) as error:
            fix = "give ?channel=N, ?time=N or ?series=NAME after the file"
            raise UsageError(f"'{part}' does not choose a part", file=path, fix=fix) from error
    return path, ReadOptions(progress=progress, **given)  # type: ignore[arg-type]
