"""A report of a mesh as people read it: lines of a name and what it is, with units."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from volviz.meshes.distance import TwoSided
    from volviz.meshes.measure import Component, MeshReport
    from volviz.model.volume import VolumeInfo

UNKNOWN = "units"
"""Of length, where the file does not say which one."""


def unit_of(info: VolumeInfo) -> str:
    """What the lengths of meshes of a volume are in: mm, or units that its file does not name."""
    return "mm" if info.length_unit else UNKNOWN


def part_columns(unit: str = "mm") -> tuple[str, ...]:
    """Titles of `part_row`."""
    return ("triangles", f"area {unit}²", f"volume {unit}³", "Euler", "loops", "genus")


def lines(report: MeshReport, unit: str = "mm") -> list[tuple[str, str]]:
    """(name, text) of everything but the components one by one. unit: of length (`unit_of`)."""
    rows = [
        ("triangles", str(report.triangles)),
        ("vertices", str(report.vertices)),
        ("area", f"{report.area:.6g} {unit}²"),
        ("enclosed volume", _volume(report.volume, unit)),
        ("components", str(report.components)),
        ("Euler characteristic", str(report.euler)),
        ("genus", "not defined (not a manifold)" if report.genus is None else str(report.genus)),
        ("boundary edges", f"{report.boundary_edges}, in {report.boundary_loops} loops"),
        (
            "non-manifold",
            f"{report.non_manifold_edges} edges, {report.non_manifold_vertices} vertices",
        ),
        ("inconsistent edges", str(report.inconsistent_edges)),
        ("duplicate faces", str(report.duplicate_faces)),
        ("degenerate faces", str(report.degenerate_faces)),
        ("from", _place(report.low, unit)),
        ("to", _place(report.high, unit)),
        ("space", report.space or "not known"),
    ]
    if report.skipped_cells:
        rows.insert(-3, ("cells without value", f"{report.skipped_cells}, left out"))
    if report.unused_vertices:
        rows.insert(2, ("unused vertices", str(report.unused_vertices)))
    return rows


def moved(distance: TwoSided, unit: str = "mm") -> list[tuple[str, str]]:
    """(name, text) of how far smoothing and decimation went."""
    return [
        ("moved, at most", f"{distance.hausdorff:.4g} {unit} (two-sided, sampled both ways)"),
        ("moved, RMS", f"{distance.rms:.4g} {unit}"),
    ]


def part_row(part: Component) -> tuple[str, ...]:
    """One component, in the order of `part_columns`."""
    volume = "open" if part.volume is None else f"{part.volume:.6g}"
    genus = "–" if part.genus is None else str(part.genus)
    numbers = (str(part.euler), str(part.boundary_loops), genus)
    return (str(part.triangles), f"{part.area:.6g}", volume, *numbers)


def table(report: MeshReport, unit: str = "mm", more: Sequence[tuple[str, str]] = ()) -> str:
    """All of it as tab-separated text, which spreadsheets take. more: other lines."""
    rows: list[tuple[str, ...]] = [*lines(report, unit), *more]
    if len(report.parts) > 1:
        rows += [(), part_columns(unit), *map(part_row, report.parts)]
    return "\n".join("\t".join(row) for row in rows) + "\n"


def _volume(volume: float | None, unit: str) -> str:
    return "not defined (not closed)" if volume is None else f"{volume:.6g} {unit}³"


def _place(corner: tuple[float, ...] | None, unit: str) -> str:
    return "" if corner is None else ", ".join(f"{v:.6g}" for v in corner) + f" {unit}"
