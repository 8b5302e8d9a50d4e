"""`volviz surface`: an isosurface of a file, refined, measured, and written as a mesh."""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Annotated, Any

import typer

from volviz.cli import show, surface_paint
from volviz.cli.flags import (
    READ_FLAGS,
    is_scene,
    knob_flags,
    picture_size,
    read_options,
    several,
    with_flags,
)
from volviz.errors import UsageError
from volviz.files import check_writable, same_file
from volviz.image import check_size
from volviz.io.mesh_files import check_mesh_path, save_mesh
from volviz.model.knobs import knobs_of
from volviz.model.lens import Viewing, seen
from volviz.model.mesh import Mesh
from volviz.model.refining import Refining
from volviz.model.surface import Surface
from volviz.model.views import volume_camera
from volviz.model.volume import Volume
from volviz.progress import Progress
from volviz.resolve import known_statistics
from volviz.scene import volume_of_scene
from volviz.sources import open_volume

if TYPE_CHECKING:  # these load the compiler, which help does not wait for
    from volviz.meshes.distance import TwoSided
    from volviz.meshes.measure import MeshReport

surface = typer.Typer(add_completion=False)
FLAGS = [
    *several("isovalue", knob_flags({Surface: "Surface", Refining: "After extraction"})),
    *surface_paint.FLAGS,
    *READ_FLAGS,
]
LISTED = 10
FLAT = 0.01
"""Share of triangles without area from which on it is said why."""


@dataclass(frozen=True)
class Made:
    """What came out. extracted: triangles before any further step. values: the range of the
    volume, None if it has no finite value. dims: its samples along x, y, z. distance: to the
    surface before it was smoothed and decimated; report: None if not asked for. level_error: mm
    that a level may be off the finest. ambiguous: cells where rules may differ, None if not asked
    for or if the method has no such rule. color: by what its vertices are coloured. merged: what
    merging coplanar triangles saved, None if not asked for or if the method merges none."""

    mesh: Mesh
    extracted: int
    values: tuple[float, float] | None
    dims: tuple[int, int, int]
    report: MeshReport | None
    distance: TwoSided | None
    level_error: float | None = None
    ambiguous: dict[str, Any] | None = None
    color: dict[str, Any] | None = None
    merged: dict[str, Any] | None = None


@surface.command()
@with_flags(FLAGS)
def _surface(
    *,
    file: Annotated[str, typer.Argument(metavar="FILE", help="file, folder, sample:NAME or scene")],
    given: dict[str, Any],
    output: Annotated[
        str | None, typer.Option("--output", "-o", help="mesh to write: .stl, .ply, .obj or .glb")
    ] = None,
    picture: Annotated[
        str, typer.Option(help="WIDTHxHEIGHT of the picture that sizes in pixels are of")
    ] = "800x600",
    report: Annotated[
        bool, typer.Option("--report", help="print what it measures (done anyway without -o)")
    ] = False,
    force: Annotated[
        bool, typer.Option("--force", "-f", help="replace a file that exists")
    ] = False,
    json: Annotated[bool, typer.Option("--json", help="print the report as JSON")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="say only what went wrong")] = False,
) -> None:
    started = time.perf_counter()
    _check_output(output, file, force)
    wanted, steps = _wanted(given)
    size = check_size(picture_size(picture, "--picture"), "--picture")
    with show.progress_bar("reading", quiet=quiet) as progress:
        paint = surface_paint.asked(given, output)
        options = read_options(given, progress.part(0.0, 0.2))
        scene = file if is_scene(file) else None
        if scene is not None:
            file, options = volume_of_scene(file, options)
        volume = open_volume(file, options)
        if wanted is None:
            raise _without_isovalue(volume)
        told = report or json or output is None
        made = _make(volume, wanted, steps, size, measured=told, progress=progress.part(0.2, 0.8))
        made = surface_paint.painted(made, volume, paint, scene, progress.part(0.8, 0.9))
        if output is not None:
            if made.mesh.empty:
                raise UsageError(f"{_why_empty(made, wanted)}, nothing is written", file=output)
            part, unit = progress.part(0.9, 1.0), "mm" if volume.info.length_unit else None
            save_mesh(made.mesh, output, overwrite=force, unit=unit, progress=part)
    seconds = time.perf_counter() - started
    if json:
        show.print_json(
            {"file": file, **_facts(wanted, steps, made), **_done(output, seconds, volume)}
        )
    elif told:
        _print(made, volume)
    if not quiet:
        _warn_of_idle(wanted, given)
        _tell(wanted, made, output, seconds, volume)


def _check_output(output: str | None, file: str, force: bool) -> None:
    if output is None:
        return
    check_mesh_path(output)
    check_writable(output, overwrite=force)
    if same_file(output, file):
        raise UsageError("this is the file that is read", file=output, fix="give another name")


def _wanted(given: dict[str, Any]) -> tuple[Surface | None, Refining]:
    """The knobs that were given, checked before anything is read; no surface without isovalue."""
    values = given.get("isovalue", [])
    if len(values) > 1:
        raise UsageError(
            f"{len(values)} isovalues were given, a mesh has one",
            field="--isovalue",
            fix="run it once for each; 'volviz render --isosurface' draws several",
        )
    if values:
        given = {**given, "isovalue": values[0]}
    own, more = ({k.name for k in knobs_of(kind)} for kind in (Surface, Refining))
    made = Surface(**{k: v for k, v in given.items() if k in own})
    steps = Refining(**{k: v for k, v in given.items() if k in more})
    return (made if "isovalue" in given else None), steps


def _without_isovalue(volume: Volume) -> UsageError:
    values = _values(volume)
    span = "the volume has no finite value" if values is None else _span(values)
    return UsageError("no isovalue was given", field="--isovalue", fix=f"give one; {span}")


def _make(
    volume: Volume,
    wanted: Surface,
    steps: Refining,
    size: tuple[int, int],
    *,
    measured: bool,
    progress: Progress,
) -> Made:
    from volviz.isosurface import extract  # brings the compiler with it
    from volviz.meshes.distance import two_sided
    from volviz.meshes.measure import measure
    from volviz.meshes.refine import refine

    camera = volume_camera(volume, aspect=size[0] / size[1])
    extracted = extract(volume, seen(wanted, Viewing(camera, size)), progress.part(0.0, 0.4))
    chosen = refine(extracted, steps.choosing, progress.part(0.4, 0.5))
    mesh = refine(chosen, steps.shaping, progress.part(0.5, 0.8))
    report, distance = None, None
    if measured:
        report = measure(mesh, progress.part(0.8, 0.9))
        if steps.moves and len(mesh.faces):
            distance = two_sided(mesh, chosen, progress=progress.part(0.9, 0.95))
    error, ambiguous = None, None
    if measured and len(extracted.faces) and (wanted.level or wanted.level_pixels):
        error = _level_error(volume, wanted, extracted, progress.part(0.9, 0.95))
    if measured and not (wanted.level or wanted.level_pixels):
        ambiguous = _ambiguous(volume, wanted, progress.part(0.95, 1.0))
    return Made(
        mesh,
        len(extracted.faces),
        _values(volume),
        volume.dims,
        report,
        distance,
        error,
        ambiguous,
        merged=_merged(volume, wanted) if measured and len(extracted.faces) else None,
    )


def _level_error(volume: Volume, wanted: Surface, mesh: Mesh, progress: Progress) -> float | None:
    """How far a level may be from the finest, mm; None if it is coarser than are measured."""
    from volviz.isosurface.hierarchy import hierarchy

    levels = hierarchy(volume, wanted, progress=progress)
    if wanted.level_pixels:
        return next((le.error for le in levels if le.mesh is mesh), None)
    return levels[wanted.level].error if wanted.level < len(levels) else None


def _ambiguous(volume: Volume, wanted: Surface, progress: Progress) -> dict[str, Any] | None:
    from volviz.isosurface.ambiguous import ambiguous_cells
    from volviz.isosurface.extractors import EXTRACTORS

    if "ambiguity" not in EXTRACTORS[wanted.method].knobs:
        return None
    return ambiguous_cells(volume, wanted.isovalue, progress).as_dict()


def _merged(volume: Volume, wanted: Surface) -> dict[str, Any] | None:
    """Made once more for its figures: that takes less than measuring it."""
    if wanted.method != "discretized-marching-cubes" or wanted.level_pixels:
        return None
    from volviz.fields.pyramid import level_of
    from volviz.isosurface.extractors.discretized_marching_cubes import extract_with_saving

    saving = extract_with_saving(level_of(volume, wanted.level), wanted.isovalue)[1]
    return {**asdict(saving), "share": saving.share}


def _values(volume: Volume) -> tuple[float, float] | None:
    known = known_statistics(volume)
    return (known.low, known.high) if known.count else None


def _span(values: tuple[float, float]) -> str:
    if values[0] == values[1]:
        return f"every value is {values[0]:.6g}"
    return f"the values go from {values[0]:.6g} to {values[1]:.6g}"


def _why_empty(made: Made, wanted: Surface) -> str:
    """One clause on a mesh without anything."""
    if made.extracted:
        return f"none of the {made.extracted} triangles is in a part that large"
    if made.values is None:
        return "the volume has no finite value"
    if min(made.dims) < 2:
        samples = " × ".join(map(str, made.dims))
        return f"a surface needs two samples along every axis, there are {samples}"
    skipped = f", {_skipped(made.mesh)}" if made.mesh.skipped else ""
    why = _span(made.values)
    if made.values[0] < made.values[1] and wanted.isovalue <= made.values[0]:
        why = f"every sample is at least that, so inside; {why}"
    return f"there is no surface at {wanted.isovalue:g}: {why}{skipped}"


def _skipped(mesh: Mesh) -> str:
    return f"{mesh.skipped} cells have a sample without a value and were left out"


def _warn_of_idle(wanted: Surface, given: dict[str, Any]) -> None:
    """Flags that do nothing with the method."""
    for spec in knobs_of(Surface):
        if spec.name in given and not spec.used(vars(wanted)):
            those = ", ".join(spec.used_with["method"])
            show.note(f"warning: {spec.flag} does nothing with {wanted.method}, it is for {those}")


def _tell(wanted: Surface, made: Made, output: str | None, seconds: float, volume: Volume) -> None:
    show.warnings(volume.info.warnings)
    mesh = made.mesh
    if mesh.empty:
        show.note(_why_empty(made, wanted))
        return
    if mesh.skipped:
        show.note(f"warning: {_skipped(mesh)}")
    fewer = f" of {made.extracted}" if made.extracted != len(mesh.faces) else ""
    flat = 0 if made.report is None else made.report.degenerate_faces
    if flat > FLAT * len(mesh.faces):
        show.note(
            f"{flat} of {len(mesh.faces)} triangles have no area, since samples are equal to the "
            "isovalue: --weld 1e-6 takes them away; for labels give half a step less"
        )
    where = "" if output is None else f"{output}: "
    space = mesh.space or "the file's own axes"
    count = f"{len(mesh.faces)}{fewer} triangles"
    if not len(mesh.faces):
        count = f"{len(mesh.vertices)} points without triangles, as {wanted.method} makes them"
    unit = "mm" if volume.info.length_unit else "unit of length unknown"
    show.note(f"{where}{count}, {unit}, {space}, {seconds:.1f} s")


def _facts(wanted: Surface, steps: Refining, made: Made) -> dict[str, Any]:
    return {
        "surface": asdict(wanted),
        "steps": asdict(steps),
        "values": None if made.values is None else list(made.values),
        "extracted_triangles": made.extracted,
        "mesh": None if made.report is None else made.report.as_dict(),
        "level_error_mm": made.level_error,
        "distance_mm": None if made.distance is None else made.distance.as_dict(),
        "ambiguous_cells": made.ambiguous,
        "color": made.color,
        "merged": made.merged,
    }


def _done(output: str | None, seconds: float, volume: Volume) -> dict[str, Any]:
    return {
        "output": output,
        "seconds": round(seconds, 3),
        "length_unit": volume.info.length_unit,
        "warnings": list(volume.info.warnings),
    }


def _print(made: Made, volume: Volume) -> None:
    if made.report is None or not made.report.triangles:
        return
    from volviz.meshes import report_text

    unit = report_text.unit_of(volume.info)
    show.table("", ("", ""), _lines(made, unit))
    parts = made.report.parts
    if len(parts) > 1:
        shown = min(len(parts), LISTED)
        title = f"\ncomponents, the {shown} largest" if made.report.components > shown else ""
        rows = [report_text.part_row(p) for p in parts[:LISTED]]
        show.table(title, report_text.part_columns(unit), rows)


def _lines(made: Made, unit: str) -> list[tuple[str, str]]:
    from volviz.meshes import report_text

    assert made.report is not None
    lines, distance = report_text.lines(made.report, unit), made.distance
    if made.level_error is not None:
        lines.append(("from the finest level", f"at most {made.level_error:.4g} {unit}"))
    if made.ambiguous is not None:
        cells = made.ambiguous
        rules = cells["differ_from_trilinear"]
        told = ", ".join(f"{rule} in {count}" for rule, count in rules.items())
        lines.append(("ambiguous cells", f"{cells['cells']}; other than trilinear: {told}"))
    if made.merged is not None:
        saved = made.merged
        told = f"{saved['before']} to {saved['after']}, {100 * saved['share']:.1f} % saved"
        lines.append(("coplanar triangles merged", f"{told}, {saved['polygons']} polygons"))
    if made.color is not None:
        color = made.color
        told = f"{color['field']}, {color['low']:.6g} to {color['high']:.6g}"
        lines.append(("coloured by", told))
    if distance is not None:
        lines += report_text.moved(distance, unit)
    return lines
