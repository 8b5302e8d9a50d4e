"""`volviz compare`: one scene over several values of its knobs, as pictures and as numbers."""

from __future__ import annotations

import sys
from typing import Annotated, Any

import typer

from volviz.cli import show
from volviz.cli.flags import picture_size, read_options, with_flags
from volviz.cli.render import FLAGS, scene_from
from volviz.errors import UsageError
from volviz.files import check_writable, same_file, write_atomically
from volviz.image import check_size, image_format
from volviz.lab import vary
from volviz.lab.compare import Comparison, measure_axes
from volviz.lab.measure import check_reference
from volviz.model.surface_look import SceneSurface

compare = typer.Typer(add_completion=False)


@compare.command()
@with_flags(FLAGS)
def _compare(
    *,
    file: Annotated[
        str, typer.Argument(metavar="FILE", help="file, folder, sample:NAME or .volviz.json")
    ],
    given: dict[str, Any],
    vary_over: Annotated[
        list[str] | None,
        typer.Option(
            "--vary",
            metavar="KNOB=V1,V2,…",
            help="what differs: any knob (step=0.25,0.5,1 or raycast.step=…; shading=all), or "
            f"{', '.join(vary.MORE)}; several are combined",
        ),
    ] = None,
    isovalue: Annotated[
        float | None,
        typer.Option(help="of the surface here, alone: what --vary surface.method=… is about"),
    ] = None,
    output: Annotated[
        str | None,
        typer.Option("--output", "-o", help="contact sheet to write; - is standard output"),
    ] = None,
    size: Annotated[str, typer.Option(help="WIDTHxHEIGHT of each picture, in pixels")] = "400x400",
    reference: Annotated[
        str,
        typer.Option(help="fine: RMSE against the same, finely sampled; none: quicker, no errors"),
    ] = "fine",
    repeat: Annotated[
        int, typer.Option(help="timed draws of each variant; 0 measures no time")
    ] = 3,
    difference: Annotated[
        bool, typer.Option("--difference", help="on the sheet, also what differs, amplified")
    ] = False,
    backend: Annotated[
        str | None, typer.Option(help="OpenGL to use: auto, egl, egl:1, … (see 'volviz doctor')")
    ] = None,
    force: Annotated[
        bool, typer.Option("--force", "-f", help="replace a file that exists")
    ] = False,
    json: Annotated[bool, typer.Option("--json", help="print the numbers as JSON")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="say only what went wrong")] = False,
) -> None:
    pixels = check_size(picture_size(size))
    _check(file, output, vary_over, reference, difference=difference, force=force, json=json)
    with show.progress_bar("reading", quiet=quiet) as progress:
        options = read_options(given, progress.part(0.0, 0.1))
        scene = scene_from(file, options, given, pixels[0] / pixels[1])
        if isovalue is not None:
            scene = scene.with_surfaces([SceneSurface.at(isovalue)]).with_knobs(show_volume=False)
        found = measure_axes(
            scene,
            [vary.axis(text, scene) for text in vary_over or ()],
            size=pixels,
            reference=reference,
            repeat=repeat,
            backend=backend,
            progress=progress.part(0.1, 1.0),
        )
    if output is not None:
        _write(found, output, difference=difference, force=force)
    _tell(found, output, json=json, quiet=quiet)


def _check(
    file: str,
    output: str | None,
    vary_over: list[str] | None,
    reference: str,
    *,
    difference: bool,
    force: bool,
    json: bool,
) -> None:
    """What is wrong is said before anything is read."""
    if not vary_over:
        raise UsageError("nothing varies", field="--vary", fix="e.g. --vary step=0.25,0.5,1")
    check_reference(reference)
    if difference and (output is None or reference == "none"):
        missing = "a sheet to draw it on (-o)" if output is None else "a reference"
        raise UsageError(f"a difference needs {missing}", field="--difference")
    if output == "-":
        if json:
            raise UsageError("two things cannot both go to standard output", field="-o")
    elif output is not None:
        image_format(output)
        check_writable(output, overwrite=force)
        if same_file(output, file):
            fix = "give another name"
            raise UsageError("this is the file that is read", file=output, fix=fix)


def _write(found: Comparison, output: str, *, difference: bool, force: bool) -> None:
    sheet = found.sheet(difference=difference)
    if output == "-":
        sys.stdout.buffer.write(sheet.encoded())
        sys.stdout.buffer.flush()
    else:
        content = sheet.encoded(image_format(output, sheet.size))
        write_atomically(output, content, overwrite=force)


def _tell(found: Comparison, output: str | None, *, json: bool, quiet: bool) -> None:
    if not quiet:
        show.warnings([*found.scene.volume.info.warnings, *found.notes])
        counts = " × ".join(f"{len(a.values)} {a.short}" for a in found.axes)
        where = "" if output in (None, "-") else f"{output}: "
        number = len(found.variants)
        noun = "variant" if number == 1 else "variants"
        show.note(f"{where}{number} {noun} ({counts}), {found.setting}")
        if found.against:
            show.note(found.against)
    if json:
        show.print_json({"output": output, **found.document()})
    elif output != "-" and not (quiet and output):
        show.table("", *found.table(), names=len(found.axes))
