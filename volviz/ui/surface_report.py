"""What a surface measures, in the Surfaces panel: the report of `volviz surface --report`."""

from __future__ import annotations

import json
import weakref
from typing import TYPE_CHECKING

from volviz.app.answers import Answers
from volviz.meshes import report_text
from volviz.model.mesh import Mesh
from volviz.model.volume import Volume, VolumeInfo
from volviz.progress import Progress
from volviz.ui import clipboard, folds, widgets
from volviz.ui.im import icons, imgui

if TYPE_CHECKING:
    from volviz.meshes.measure import MeshReport

LISTED = 8
"""Components that are shown; copies have all that the report lists."""


def section(id_: str, volume: Volume, mesh: Mesh | None, answers: Answers) -> None:
    """The fold-out of one surface. mesh: the one that is drawn; None until there is one."""
    about = "Counts, area, enclosed volume, topology and bounding box of this surface."
    if not folds.fold(f"{id_}.report", "Report", about):
        return
    if mesh is None or not len(mesh.faces):
        widgets.dim("No triangles to measure.")
        return
    name = f"{id_}.report"

    def work(progress: Progress) -> MeshReport:
        from volviz.meshes.measure import measure  # brings the compiler with it

        return measure(mesh, progress)

    question = weakref.ref(mesh)
    answer = answers.ask(name, volume, question, work, title="Measuring the surface")
    if not answer.fresh:
        folds.waiting(answers, name, answer)
    if answer.value is not None:
        imgui.begin_disabled(not answer.fresh)  # of the mesh before, until the new one is measured
        _shown(name, volume.info, answer.value)
        imgui.end_disabled()


def _shown(id_: str, info: VolumeInfo, report: MeshReport) -> None:
    unit = report_text.unit_of(info)
    rows = [(name[:1].upper() + name[1:], text) for name, text in report_text.lines(report, unit)]
    with widgets.facts(f"{id_}.facts", [name for name, _ in rows]) as shown:
        if shown:
            for name, text in rows:
                widgets.fact(name, text)
    if len(report.parts) > 1:
        _components(id_, unit, report)
    text = "Copy the report as JSON, as volviz surface --json prints it."
    if widgets.button(f"{id_}.json", f"{icons.ICON_FA_COPY}  JSON", text):
        clipboard.put_text(json.dumps(report.as_dict(), indent=2, ensure_ascii=False))
    widgets.beside(f"{icons.ICON_FA_COPY}  Table")
    text = "Copy the report with its components as a table, which spreadsheets take."
    if widgets.button(f"{id_}.table", f"{icons.ICON_FA_COPY}  Table", text):
        clipboard.put_text(report_text.table(report, unit))


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
