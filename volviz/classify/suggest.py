"""A good first picture for any volume: transfer function, mode and shading, with the reason why.

What the file says (kind, modality, unit) comes first; the histogram decides the rest.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from volviz.classify import presets
from volviz.classify.colormaps import RAMPS, rgb
from volviz.classify.hounsfield import hounsfield_offset
from volviz.classify.inverted import bright_ground, mirrored, turned
from volviz.classify.labels import label_transfer, looks_like_labels
from volviz.classify.levels import HUGE, TINY, Levels, extent, levels
from volviz.classify.preset_file import Preset
from volviz.classify.texture import coverage_level, roughness
from volviz.fields.statistics import Statistics
from volviz.model.transfer import OpacityPoint, TransferFunction
from volviz.model.volume import Volume

SMOOTH = 0.2  # roughness of computed fields
BODY_AREA = 33_000.0
"""mm² of tissue in a slice: a head has 18 to 27 thousand, with its holder; a trunk 40 and more."""
LIGHTEST = -300.0
"""HU of what counts as tissue there."""
FEW = 96
"""Samples along an axis that are enough to tell."""
TWO_PARTS = 0.77  # bimodality: one bump has 0.64, an even spread 0.75
SOFT = {"ambient": 0.2, "diffuse": 0.82, "specular": 0.12, "exponent": 16.0}
CLEAR = {"ambient": 0.15, "diffuse": 0.88, "specular": 0.16, "exponent": 20.0}


@dataclass(frozen=True)
class Suggestion:
    """How to show a volume. why: one sentence. modality: "labels", DICOM's code, or a guess."""

    transfer: TransferFunction
    why: str
    modality: str
    mode: str = "dvr"
    shading: str = "blinn-phong"
    interpolation: str = "linear"
    light: Mapping[str, float] = field(default_factory=dict)

    def knobs(self) -> dict[str, Any]:
        """Knobs of ray and light by name."""
        return {
            "mode": self.mode,
            "shading": self.shading,
            "interpolation": self.interpolation,
            **self.light,
        }


def suggest(volume: Volume, statistics: Statistics) -> Suggestion:
    """The suggestion for a volume; valid for constant, empty and all-NaN volumes too."""
    if looks_like_labels(volume, statistics):
        transfer = label_transfer(volume, statistics)
        why = "values are names of things: a colour each, no interpolation between them"
        return Suggestion(transfer, why, "labels", interpolation="nearest", light=SOFT)
    at = levels(statistics)
    if statistics.constant or statistics.high / 2 - statistics.low / 2 < TINY:
        return _constant(volume, statistics, at)
    modality = volume.info.modality or ""
    if min(volume.dims) == 1:
        return _picture(volume, statistics, modality or _guess(volume))
    offset = hounsfield_offset(volume, statistics)
    if offset is not None:
        return _tomogram(volume, statistics, offset)
    if modality == "US":
        return _from_preset("us-fetal", volume, statistics, "ultrasound", "US")
    ground = None if volume.info.format == "mrc" else bright_ground(volume, statistics)
    if ground is not None:
        return _dark(volume, statistics, ground, modality or _guess(volume))
    if volume.info.format != "mrc" and _symmetric(statistics):
        return _signed(volume, statistics, modality or _guess(volume))
    if volume.info.format == "mrc" or _about_zero(statistics):
        return _density(volume, statistics, at)
    if modality in ("PT", "NM"):
        return _sparse(volume, at, modality)
    smooth = roughness(volume, at.background) < SMOOTH
    if at.empty > 0 and (at.share < 0.1 or smooth):
        return _sparse(volume, at, modality or _guess(volume))
    if at.empty > 0 or smooth or at.bimodality > TWO_PARTS:
        return _body(volume, at, modality or _guess(volume))
    return _block(volume, statistics, modality or _guess(volume))


def suits(preset: Preset, offset: float | None, modality: str) -> bool:
    """True if a preset was made for such data; others are fitted by guess.

    offset: what Hounsfield units are raised by in it, None if it has none. modality: as suggested.
    """
    if preset.axis == "hu":
        return offset is not None
    if preset.group == "Micro-CT":
        return modality == "CT" and offset is None
    return preset.group in ("Any", presets.MODALITIES.get(modality, "Any"))


def mip_transfer(volume: Volume, statistics: Statistics) -> TransferFunction:
    """A gray ramp for the maximum along a ray: CT windowed in HU, else from the background up."""
    ct = hounsfield_offset(volume, statistics) is not None
    transfer, _ = presets.apply(presets.preset("ct-mip" if ct else "mr-mip"), volume, statistics)
    return transfer


def _about_zero(statistics: Statistics) -> bool:
    """True if values lie on both sides of zero, more than noise would."""
    low, high = statistics.percentile(1), statistics.percentile(99)
    return low < 0 < high and -low > 0.1 * (high - low)


def _symmetric(statistics: Statistics) -> bool:
    """True if there is as much below zero as above, in the bulk and far out: waves, differences."""
    for part in (0.05, 1.0, 10.0):
        below, above = -statistics.percentile(part), statistics.percentile(100 - part)
        if not 0 < below < 1.5 * above < 2.25 * below:
            return False
    return True


def _guess(volume: Volume) -> str:
    """What made it, as far as the file's form tells."""
    if volume.info.space is not None:
        return "MR"
    if volume.info.format in ("tiff", "images"):
        return "microscopy"
    return "simulation" if volume.data.dtype.kind == "f" else "unknown"


def _from_preset(
    name: str, volume: Volume, statistics: Statistics, why: str, modality: str
) -> Suggestion:
    chosen = presets.preset(name)
    transfer, _ = presets.apply(chosen, volume, statistics)
    reason = f"{why}: preset '{name}'"
    return Suggestion(transfer, reason, modality, chosen.mode, chosen.shading, light=chosen.light)


def _tomogram(volume: Volume, statistics: Statistics, offset: float) -> Suggestion:
    unit = "Hounsfield units" + (f" + {offset:g}" if offset else "")
    if (area := _tissue_area(volume, offset)) > BODY_AREA:
        why = f"CT in {unit}, {area / 100:.0f} cm² across"
        return _from_preset("ct-body", volume, statistics, why, "CT")
    return _from_preset("ct-head", volume, statistics, f"CT in {unit}", "CT")


def _tissue_area(volume: Volume, offset: float) -> float:
    """mm² of what is denser than air and lung, in an axial slice larger than nine of ten; 0 where
    nobody says which way is up."""
    if volume.info.space is None:
        return 0.0
    columns = volume.affine[:3, :3]
    up = int(np.argmax(np.abs(columns[2]) / np.linalg.norm(columns, axis=0)))
    strides = [max(n // FEW, 1) for n in volume.dims]
    sx, sy, sz = strides
    tissue = volume.data[::sz, ::sy, ::sx] > offset + LIGHTEST
    across = [i for i in range(3) if i != up]
    one, other = (columns[:, i] * strides[i] for i in across)
    cell = np.linalg.norm(np.cross(one, other))
    counts = tissue.sum(axis=tuple(2 - i for i in across))
    return float(np.percentile(counts, 90) * cell)


def _constant(volume: Volume, statistics: Statistics, at: Levels) -> Suggestion:
    """A faint gray block, so that there is something to see; nothing where nothing counts."""
    size = max(extent(volume), 1e-30)
    transfer = _ramp("gray", (at.low, at.high), ((at.low, 0.5), (at.high, 0.5)), size / 2)
    what = f"every voxel is {statistics.low:g}" if statistics.count else "no voxel holds a number"
    return Suggestion(transfer, what, "unknown", shading="none")


def _density(volume: Volume, statistics: Statistics, at: Levels) -> Suggestion:
    """Maps about zero (cryo-EM, crystallography, wavelets): what rises above the mean by sigmas."""
    mean, sigma, high = statistics.mean, statistics.std, statistics.percentile(99.95)
    if statistics.fine is not None:  # outliers: a normal curve has 68 % within a sigma
        lower, mean, upper = (statistics.percentile(p) for p in (15.87, 50, 84.13))
        sigma = (upper - lower) / 2
    edge = mean + 2 * sigma
    if high <= edge:  # a broad histogram: its upper third
        edge = statistics.percentile(70)
    top = max(high, edge + 1e-3 * max(sigma, abs(edge), 1e-30))
    soft = min(0.5 * sigma, 0.5 * (top - edge))
    points = ((edge - soft, 0.0), (edge, 0.3), (edge + soft, 0.75), (top, 0.9))
    transfer = _ramp("ice", (edge - soft, top), points, 0.01 * extent(volume))
    why = f"values about {mean:.3g}: density above mean + 2 sigma ({edge:.3g})"
    return Suggestion(transfer, why, "density map", light=CLEAR)


def _signed(volume: Volume, statistics: Statistics, modality: str) -> Suggestion:
    """Seismic amplitudes, velocities, differences: both signs alike, in two colours."""
    far = max(-statistics.percentile(0.5), statistics.percentile(99.5))
    usual = (statistics.percentile(90) - statistics.percentile(10)) / 2
    edge = min(max(0.25 * far, usual), 0.6 * far)
    rise = ((edge, 0.0), ((edge + far) / 2, 0.35), (far, 0.8))
    points = (*((-value, opacity) for value, opacity in reversed(rise)), *rise)
    transfer = _ramp("coolwarm", (-far, far), points, 0.008 * extent(volume))
    why = f"as much below zero as above: what is farther than {edge:.4g} from it, by its sign"
    return Suggestion(transfer, why, modality, light=SOFT)


def _sparse(volume: Volume, at: Levels, modality: str) -> Suggestion:
    """Little signal in much darkness (fluorescence, plumes, vessels): it glows as it grows.

    Where what stands out would cover the whole picture, only the brighter part of it does.
    """
    low, edge, high = at.background, at.threshold, at.high
    cover = coverage_level(volume, 0.6)
    if cover > edge:
        edge = min(cover, low + 0.9 * (high - low))
        low = max(low, edge - 0.2 * (high - edge))
    smooth = roughness(volume, at.background) < SMOOTH
    faint, strong = (0.06, 0.35) if smooth else (0.16, 0.5)  # smooth shells have depth
    points = (
        (low, 0.0),
        (low + 0.3 * (edge - low), faint / 8),
        (edge, faint),
        ((edge + high) / 2, strong),
        (high, 0.8),
    )
    transfer = _ramp("ember", (low, high), points, (0.025 if smooth else 0.01) * extent(volume))
    why = f"little of the volume stands out (above {edge:.4g}): it glows by strength"
    return Suggestion(transfer, why, modality, light=SOFT)


def _body(volume: Volume, at: Levels, modality: str) -> Suggestion:
    """Something solid in an empty surround: its surface, softly, and the denser inside."""
    low, edge, high = at.background, at.threshold, at.high
    tissue = min(max(at.tissue, edge + 0.05 * (high - edge)), edge + 0.8 * (high - edge))
    start = low + 0.35 * (edge - low)
    points = ((start, 0.0), (edge, 0.15), (tissue, 0.65), (high, 0.92))
    colors = "tissue" if modality == "MR" else "clay"
    transfer = _ramp(colors, (start, high), points, 0.008 * extent(volume))
    why = f"contents ({at.share:.0%} of the voxels) divide from the surround at {edge:.4g} (Otsu)"
    return Suggestion(transfer, why, modality, light=CLEAR)


def _dark(volume: Volume, statistics: Statistics, ground: float, modality: str) -> Suggestion:
    """Something dark in bright surroundings: the same, from the other end of the values."""
    at = levels(mirrored(statistics))
    low = min(max(statistics.low + statistics.high - ground, at.background), at.high)
    edge = min(max(at.threshold, low + 0.05 * (at.high - low)), at.high)
    at = replace(at, background=low, threshold=edge)
    found = _body(volume, at, modality)
    edge = statistics.low + statistics.high - at.threshold
    why = f"bright round about: what is below {edge:.4g} ({at.share:.0%} of the voxels) is shown"
    return replace(found, transfer=turned(found.transfer, statistics), why=why)


def _block(volume: Volume, statistics: Statistics, modality: str) -> Suggestion:
    """No empty surround (EM, cut-outs): an opaque block with its values on the faces."""
    transfer = _opaque(volume, statistics)
    why = "no empty surround: an opaque block in gray"
    return Suggestion(transfer, why, modality, shading="none")


def _picture(volume: Volume, statistics: Statistics, modality: str) -> Suggestion:
    """One slice: as picture viewers show it."""
    transfer = _opaque(volume, statistics)
    return Suggestion(transfer, "a single slice: a picture in gray", modality, shading="none")


def _opaque(volume: Volume, statistics: Statistics) -> TransferFunction:
    """Gray over the file's window, or soft tissue in CT, or all but the outermost percents."""
    low, high = statistics.percentile(0.5), statistics.percentile(99.5)
    if volume.info.window is not None:
        center, width = volume.info.window
        if width > 0 and statistics.low < center < statistics.high:
            low, high = center - width / 2, center + width / 2
    elif (offset := hounsfield_offset(volume, statistics)) is not None:
        low, high = offset - 160, offset + 240  # soft tissue
    if not low < high:
        low, high = statistics.low, statistics.high
    return _ramp("gray", (low, high), ((low, 0.95), (high, 0.95)), 0.004 * extent(volume))


def _ramp(
    name: str, ends: tuple[float, float], opacities: Sequence[OpacityPoint], unit: float
) -> TransferFunction:
    """A named ramp over `ends`; points that rounding brought out of order are put in order."""
    low, high = max(ends[0], -HUGE), min(ends[1], HUGE)
    codes = RAMPS[name]
    step = (high - low) / (len(codes) - 1)
    colors = tuple((low + i * step, *rgb(code)) for i, code in enumerate(codes))
    highest = -HUGE
    rising = []
    for value, opacity in opacities:
        highest = min(max(highest, value), HUGE)
        rising.append((highest, opacity))
    unit = unit if math.isfinite(unit) and unit > 0 else 1.0
    return TransferFunction(colors, tuple(rising), unit, "suggested")
