"""`volviz surface`: an isosurface of a file, refined, measured, and written as a mesh."""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Annotated, Any

import typer

import volviz
from volviz.cli import show
from volviz.cli.flags import READ_FLAGS, is_scene, knob_flags, read_options, with_flags
from volviz.errors import UsageError
from volviz.files import check_writable, same_file
from volviz.io.mesh_files import check_mesh_path, save_mesh
from volviz.model.knobs import knobs_of
from volviz.model.mesh import Mesh
from volviz.model.refining import Refining
from volviz.model.surface import Surface
from volviz.model.volume import Volume
from volviz.progress import Progress
from volviz.resolve import known_statistics
from volviz.scene import volume_of_scene
from volviz.sources import open_volume

if TYPE_CHECKING:  # these load the compiler, which help does not wait for
    from volviz.meshes.distance import TwoSided
    from volviz.meshes.measure import Component, MeshReport

surface = typer.Typer(add_completion=False)
FLAGS = [*knob_flags({Surface: "Surface", Refining: "After extraction"}), *READ_FLAGS]
LISTED = 10


@dataclass(frozen=True)
class Made:
    """What came out. extracted: triangles before any further step. values: the range of the
    volume, None if it has no finite value. dims: its samples along x, y, z. distance: to the
    surface before it was smoothed and decimated; report: None if not asked for."""

    mesh: Mesh
    extracted: int
    values: tuple[float, float] | None
    dims: tuple[int, int, int]
    report: MeshReport | None
    distance: TwoSided | None


@surface.command()
@with_flags(FLAGS)
def _surface(
    *,
    file: Annotated[str, typer.Argument(metavar="FILE", help="file, folder, sample:NAME or scene")],
    given: dict[str, Any],
    output: Annotated[
        str | None, typer.Option("--output", "-o", help="mesh to write: .stl, .ply, .obj or .glb")
    ] = None,
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
    with show.progress_bar("reading", quiet=quiet) as progress:
        options = read_options(given, progress.part(0.0, 0.2))
        if is_scene(file):
            file, options = volume_of_scene(file, options)
        volume = open_volume(file, options)
        if wanted is None:
            raise _without_isovalue(volume)
        told = report or json or output is None
        made = _make(volume, wanted, steps, measured=told, progress=progress.part(0.2, 0.9))
        if output is not None:
            if made.mesh.empty:
                raise UsageError(f"{_why_empty(made, wanted)}, nothing is written", file=output)
            save_mesh(made.mesh, output, overwrite=force, progress=progress.part(0.9, 1.0))
    seconds = time.perf_counter() - started
    if json:
        show.print_json(
            {"file": file, **_facts(wanted, steps, made), **_done(output, seconds, volume)}
        )
    elif told:
        _print(made)
    if not quiet:
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
    own, more = ({k.name for k in knobs_of(kind)} for kind in (Surface, Refining))
    made = Surface(**{k: v for k, v in given.items() if k in own})
    steps = Refining(**{k: v for k, v in given.items() if k in more})
    return (made if "isovalue" in given else None), steps


def _without_isovalue(volume: Volume) -> UsageError:
    values = _values(volume)
    span = "the volume has no finite value" if values is None else _span(values)
    return UsageError("no isovalue was given", field="--isovalue", fix=f"give one; {span}")


def _make(
    volume: Volume, wanted: Surface, steps: Refining, *, measured: bool, progress: Progress
) -> Made:
    from volviz.meshes.distance import two_sided
    from volviz.meshes.measure import measure
    from volviz.meshes.refine import refine

    extracted = volviz.extract_surface(volume, **asdict(wanted), progress=progress.part(0.0, 0.4))
    chosen = refine(extracted, steps.choosing, progress.part(0.4, 0.5))
    mesh = refine(chosen, steps.shaping, progress.part(0.5, 0.8))
    report, distance = None, None
    if measured:
        progress(0.8, "measuring")
        report = measure(mesh)
        if steps.moves and len(mesh.faces):
            distance = two_sided(mesh, chosen, progress=progress.part(0.8, 1.0))
    values = _values(volume)
    return Made(mesh, len(extracted.faces), values, volume.dims, report, distance)


def _values(volume: Volume) -> tuple[float, float] | None:
    known = known_statistics(volume)
    return (known.low, known.high) if known.count else None


def _span(values: tuple[float, float]) -> str:
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
    return f"there is no surface at {wanted.isovalue:g}: {_span(made.values)}{skipped}"


def _skipped(mesh: Mesh) -> str:
    return f"{mesh.skipped} cells have a sample without a value and were left out"


def _tell(wanted: Surface, made: Made, output: str | None, seconds: float, volume: Volume) -> None:
    show.warnings(volume.info.warnings)
    mesh = made.mesh
    if mesh.empty:
        show.note(_why_empty(made, wanted))
        return
    if mesh.skipped:
        show.note(f"warning: {_skipped(mesh)}")
    fewer = f" of {made.extracted}" if made.extracted != len(mesh.faces) else ""
    where = "" if output is None else f"{output}: "
    space = mesh.space or "the file's own axes"
    count = f"{len(mesh.faces)}{fewer} triangles"
    if not len(mesh.faces):
        count = f"{len(mesh.vertices)} points without triangles, as {wanted.method} makes them"
    show.note(f"{where}{count}, mm, {space}, {seconds:.1f} s")


def _facts(wanted: Surface, steps: Refining, made: Made) -> dict[str, Any]:
    return {
        "surface": asdict(wanted),
        "steps": asdict(steps),
        "values": None if made.values is None else list(made.values),
        "extracted_triangles": made.extracted,
        "mesh": None if made.report is None else made.report.as_dict(),
        "distance_mm": None if made.distance is None else made.distance.as_dict(),
    }


def _done(output: str | None, seconds: float, volume: Volume) -> dict[str, Any]:
    return {
        "output": output,
        "seconds": round(seconds, 3),
        "warnings": list(volume.info.warnings),
    }


def _print(made: Made) -> None:
    if made.report is None or not made.report.triangles:
        return
    show.table("", ("", ""), _lines(made.report, made.distance))
    parts = made.report.parts
    if len(parts) > 1:
        shown = min(len(parts), LISTED)
        title = f"\ncomponents, the {shown} largest" if made.report.components > shown else ""
        columns = ("triangles", "area mm²", "volume mm³", "Euler", "loops", "genus")
        show.table(title, columns, [_part(p) for p in parts[:LISTED]])


def _lines(report: MeshReport, distance: TwoSided | None) -> list[tuple[str, str]]:
    lines = [
        ("triangles", str(report.triangles)),
        ("vertices", str(report.vertices)),
        ("area", f"{report.area:.6g} mm²"),
        ("enclosed volume", _volume(report.volume)),
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
        ("from", _place(report.low)),
        ("to", _place(report.high)),
        ("space", report.space or "not known"),
    ]
    if report.skipped_cells:
        lines.insert(-3, ("cells without value", f"{report.skipped_cells}, left out"))
    if report.unused_vertices:
        lines.insert(2, ("unused vertices", str(report.unused_vertices)))
    if distance is not None:
        lines += [
            ("moved, at most", f"{distance.hausdorff:.4g} mm (two-sided, sampled both ways)"),
            ("moved, RMS", f"{distance.rms:.4g} mm"),
        ]
    return lines


def _volume(volume: float | None) -> str:
    return "not defined (not closed)" if volume is None else f"{volume:.6g} mm³"


def _place(corner: tuple[float, ...] | None) -> str:
    return "" if corner is None else ", ".join(f"{v:.6g}" for v in corner) + " mm"


def _part(part: Component) -> tuple[str, ...]:
    volume = "open" if part.volume is None else f"{part.volume:.6g}"
    genus = "–" if part.genus is None else str(part.genus)
    numbers = (str(part.euler), str(part.boundary_loops), genus)
    return (str(part.triangles), f"{part.area:.6g}", volume, *numbers)
