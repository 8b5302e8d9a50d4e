"""What is known of a volume as text for people: one list, for `volviz info` and the Data panel."""

from __future__ import annotations

from volviz.fields.statistics import Statistics
from volviz.model.lengths import spoken
from volviz.model.volume import VolumeInfo


def header_facts(info: VolumeInfo) -> dict[str, str]:
    """Text by name of the fact, in the order of the Data panel; "" where the file says nothing.

    Lengths are mm, or in the file's own unit where that is a small one; values carry the volume's
    unit. All of it is known without the voxels.
    """
    length, mm = spoken(info.length_unit)
    steps = [s / mm for s in info.spacing]
    extent = (s * n for s, n in zip(steps, info.dims, strict=True))
    return {
        "name": info.name,
        "format": f"{info.format}, {info.encoding}",
        "modality": info.modality or "",
        "kind": "labels" if info.kind == "labels" else "",
        "grid": "uniform, oblique" if info.oblique else "uniform",
        "samples": " × ".join(map(str, info.dims)),
        "type": f"{info.dtype}{unit_of(info)}",
        "spacing": " × ".join(f"{s:.6g}" for s in steps) + f" {length}",
        "size": " × ".join(f"{s:.5g}" for s in extent) + f" {length}",
        "orientation": info.orientation or "unknown",
        "origin": ", ".join(f"{v / mm:.6g}" for v in info.origin),
    }


def unit_of(info: VolumeInfo) -> str:
    """The unit of the values with a space before it, "" if not known."""
    return f" {info.value_unit}" if info.value_unit else ""


def range_text(statistics: Statistics, info: VolumeInfo) -> str:
    """From the lowest to the highest finite value, with unit."""
    if statistics.count == 0:
        return "none that is finite"
    return f"{statistics.low:.6g} … {statistics.high:.6g}{unit_of(info)}"


def odd_counts(statistics: Statistics) -> dict[str, int]:
    """How many voxels hold no value, by why; those of which there are none are left out."""
    counts = {
        "NaN": statistics.nan_count,
        "infinite": statistics.inf_count,
        "padding": statistics.padding_count,
    }
    return {name: n for name, n in counts.items() if n}
