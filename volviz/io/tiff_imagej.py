"""Voxel size, unit and display range as ImageJ, SCIFIO and Zeiss LSM write them."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from volviz.errors import InputError, safe_text
from volviz.io.geometry import length_unit, mm_per
from volviz.io.tiff_plane import Layout


def imagej_layout(layout: Layout, meta: Mapping[str, Any], path: Path) -> Layout:
    """Voxel size, unit and display range as ImageJ writes them."""
    declared = math.prod(int(_number(meta.get(k)) or 1) for k in ("slices", "frames", "channels"))
    there = layout.times * layout.channels * layout.depth * int(layout.key.samplesperpixel)
    if declared > there:
        raise InputError(
            f"ImageJ describes {declared} planes, the file has {there}",
            file=path,
            field="ImageDescription",
            fix="the file is cut off: copy it again",
        )
    unit = length_unit(_unescaped(str(meta.get("unit", ""))))
    scale = mm_per(unit) if unit else 1.0
    x, y = (_per_pixel(layout.key, tag) for tag in ("XResolution", "YResolution"))
    z = _positive(meta.get("spacing"))
    scales, axes = str(meta.get("scales", "")).split(","), str(meta.get("axes", "")).split(",")
    named = dict(zip(axes, scales, strict=False))
    if {"X", "Y", "Z"} <= named.keys():
        x, y, z = (_positive(named[axis]) for axis in "XYZ")
    low, high = (_number(meta.get(k)) for k in ("min", "max"))
    window = None
    if low is not None and high is not None and high > low:
        window = ((low + high) / 2, high - low)
    c0, c1 = _number(meta.get("c0")), _number(meta.get("c1"))
    signed = _number(meta.get("cf")) == 0 and (c0, c1) == (-32768, 1) and layout.key.dtype == "u2"
    notes = list(layout.warnings)
    if _number(meta.get("cf")) is not None and not signed:
        notes.append("the calibration of values (ImageJ) is not applied: stored values are shown")
    steps = tuple(None if s is None else s * scale for s in (x, y, z))
    return replace(
        layout,
        kind="ImageJ",
        steps=(steps[0], steps[1], steps[2]),
        unit=unit,
        window=window,
        signed16=signed,
        warnings=tuple(notes),
        fields={str(k): safe_text(v) for k, v in meta.items() if k not in ("LUTs", "IJMetadata")},
    )


def lsm_layout(layout: Layout, meta: Mapping[str, Any]) -> Layout:
    """Voxel size of a Zeiss LSM file, stored in metres."""
    steps = tuple(_positive(meta.get(f"VoxelSize{axis}")) for axis in "XYZ")
    x, y, z = (None if s is None else s * 1000 for s in steps)
    return replace(layout, kind="LSM", steps=(x, y, z), unit="µm")


def _unescaped(text: str) -> str:
    return re.sub(r"\\u([0-9a-fA-F]{4})", lambda m: chr(int(m.group(1), 16)), text)


def _per_pixel(page: Any, tag: str) -> float | None:
    """Units per pixel from a resolution in pixels per unit."""
    value = page.tags.valueof(tag)
    try:
        above, below = float(value[0]), float(value[1])
    except (TypeError, ValueError, IndexError, OverflowError):
        return None
    return _positive(below / above) if above > 0 else None


def _number(value: object) -> float | None:
    try:
        number = float(str(value))
    except ValueError:
        return None
    return number if math.isfinite(number) else None


def _positive(value: object) -> float | None:
    """The absolute value (ImageJ writes negative spacing for reversed stacks), None for 0."""
    number = _number(value)
    return abs(number) or None if number is not None else None
