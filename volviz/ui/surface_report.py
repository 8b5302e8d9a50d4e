"""What a surface measures, in the Surfaces panel: the report of `volviz surface --report`."""

from __future__ import annotations

import json
import weakref
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from volviz.app.answers import Answers
from volviz.meshes import report_text
from volviz.model.volume import Volume, VolumeInfo
from volviz.progress import Progress
from volviz.resolve_surfaces import Extracted
from volviz.ui import clipboard, folds, widgets
from volviz.ui.im import icons, imgui

if TYPE_CHECKING:
    from volviz.meshes.distance import TwoSided
    from volviz.meshes.measure import MeshReport

LISTED = 8
"""Components that are shown; copies have all that the report lists."""


@dataclass(frozen=True)
class Measured:
    """What is told of a surface. extracted: triangles before anything was done to it, None if
    nothing was. moved: how far it is from there, None if nothing moved it."""

    report: MeshReport
    extracted: int | None = None
    moved: TwoSided | None = None

    def as_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON, under the names of `volviz surface --json`."""
        more: dict[str, Any] = {}
        if self.extracted is not None:
            more["extracted_triangles"] = self.extracted
        if self.moved is not None:
            more["distance_mm"] = self.moved.as_dict()
        return {**self.report.as_dict(), **more}

    def lines(self, unit: str) -> list[tuple[str, str]]:
        """What is told besides the report."""
        count = [] if self.extracted is None else [("extracted", f"{self.extracted} triangles")]
        return count + ([] if self.moved is None else report_text.moved(self.moved, unit))


def measured(found: Extracted, progress: Progress) -> Measured:
    """Of the mesh that is drawn. Raises Cancelled."""
    from volviz.meshes.distance import two_sided  # bring the compiler with them
    from volviz.meshes.measure import measure
    from volviz.meshes.refine import refine

    report, before = measure(found.mesh, progress.part(0, 0.4)), found.before
    if before is None:
        return Measured(report)
    moved = None
    if found.refining.moves:
        there = refine(before.as_extracted, found.refining.choosing, progress.part(0.4, 0.5))
        moved = two_sided(found.mesh, there, progress=progress.part(0.5, 1))
    return Measured(report, len(before.mesh.faces), moved)


def section(id_: str, volume: Volume, found: Extracted | None, answers: Answers) -> None:
    """The fold-out of one surface. found: the one that is drawn; None until there is one."""
    about = "Counts, area, enclosed volume, topology and bounding box of this surface."
    if not folds.fold(f"{id_}.report", "Report", about):
        return
    if found is None or not len(found.mesh.faces):
        widgets.dim("No triangles to measure.")
        return
    name = f"{id_}.report"

    def work(progress: Progress) -> Measured:
        return measured(found, progress)

    question = weakref.ref(found.mesh)
    answer = answers.ask(name, volume, question, work, title="Measuring the surface")
    if not answer.fresh:
        folds.waiting(answers, name, answer)
    if answer.value is not None:
        imgui.begin_disabled(not answer.fresh)  # of the mesh before, until the new one is measured
        _shown(name, volume.info, answer.value)
        imgui.end_disabled()


def _shown(id_: str, info: VolumeInfo, found: Measured) -> None:
    unit, report = report_text.unit_of(info), found.report
    more = found.lines(unit)
    lines = [*report_text.lines(report, unit), *more]
    rows = [(name[:1].upper() + name[1:], text) for name, text in lines]
    with widgets.facts(f"{id_}.facts", [name for name, _ in rows]) as shown:
        if shown:
            for name, text in rows:
                widgets.fact(name, text)
    if len(report.parts) > 1:
        _components(id_, unit, report)
    text = "Copy the report as JSON, as volviz surface --json prints it."
    if widgets.button(f"{id_}.json", f"{icons.ICON_FA_COPY}  JSON", text):
        clipboard.put_text(json.dumps(found.as_dict(), indent=2, ensure_ascii=False))
    widgets.beside(f"{icons.ICON_FA_COPY}  Table")
    text = "Copy the report with its components as a table, which spreadsheets take."
    if widgets.button(f"{id_}.table", f"{icons.ICON_FA_COPY}  Table", text):
        clipboard.put_text(report_text.table(report, unit, more))


def _components(id_: str, unit: str, report: MeshReport) -> None:
    count = min(len(report.parts), LISTED)
    widgets.dim(f"Components, the {count} largest" if report.components > count else "Components")
    columns = report_text.part_columns(unit)
    flags = imgui.TableFlags_.sizing_stretch_prop | imgui.TableFlags_.row_bg
    if not imgui.begin_table(f"###{id_}.parts", len(columns), flags.value):
        return
    for column in columns:
        imgui.table_setup_column(column)
    imgui.table_headers_row()
    for part in report.parts[:count]:
        imgui.table_next_row()
        for text in report_text.part_row(part):
            imgui.table_next_column()
            imgui.text_unformatted(text)
    imgui.end_table()
