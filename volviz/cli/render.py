"""`volviz render`: a picture from a file, a folder, a sample or a scene."""

from __future__ import annotations

import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from volviz.cli import show
from volviz.cli.flags import (
    READ_FLAGS,
    SCENE_SUFFIX,
    camera_flags,
    color,
    exact_camera,
    flag,
    is_scene,
    knob_flags,
    numbers,
    picture_size,
    read_options,
    transfer_of,
    with_flags,
)
from volviz.errors import UsageError, VolvizError
from volviz.files import check_writable, same_file, write_atomically
from volviz.image import Image, check_size, image_format
from volviz.model.camera import Camera
from volviz.model.knobs import knobs_of
from volviz.model.scene import Background, box_corners
from volviz.model.surface_words import FIELD, parse
from volviz.model.views import volume_camera
from volviz.scene import Scene
from volviz.scene import render as draw
from volviz.sources import open_volume

render = typer.Typer(add_completion=False)

LOOK = "Look"
VIEW = "Camera"
SCENE_FLAGS = [
    flag("preset", str, "transfer function by name (see 'volviz presets') or file", LOOK),
    flag("transfer", str, "transfer function as JSON text, or a file with it (.json)", LOOK),
    flag(
        "background",
        str,
        "r,g,b[,a] from 0 to 1, #rrggbb, a name, or transparent; TOP/BOTTOM for two",
        LOOK,
    ),
    flag("opacity", float, "multiplies every opacity", LOOK),
    flag("unit_distance", float, "mm over which the opacity accumulates", LOOK),
    flag("window", str, "LOW,HIGH: stretch the transfer function over these values", LOOK),
    flag("shift", float, "move the transfer function along the values", LOOK),
    flag(
        "isosurface",
        list[str],
        "surface in the volume: VALUE[,COLOUR[,OPACITY]][,KNOB=VALUE]…, e.g. 300,#eee0c2 or "
        "-300,tan,0.3,shading=flat,smooth=20,keep_largest=yes; give it once for each surface",
        LOOK,
    ),
    flag("view", str, "standard view: anterior, left, superior, …; front, top, …", VIEW),
    flag("azimuth", float, "turn the camera to its right, degrees", VIEW),
    flag("elevation", float, "raise the camera, degrees", VIEW),
    flag("roll", float, "turn the picture, degrees", VIEW),
    flag("zoom", float, "2 shows everything twice as large", VIEW),
    *camera_flags(),
]
FLAGS = [*SCENE_FLAGS, *knob_flags(), *READ_FLAGS]
TURNS = ("view", "azimuth", "elevation", "roll", "zoom")


@render.command()
@with_flags(FLAGS)
def _render(
    *,
    file: Annotated[
        str, typer.Argument(metavar="FILE", help="file, folder, sample:NAME or .volviz.json")
    ],
    given: dict[str, Any],
    output: Annotated[
        str | None, typer.Option("--output", "-o", help="picture to write; - is standard output")
    ] = None,
    size: Annotated[str, typer.Option(help="WIDTHxHEIGHT in pixels")] = "800x600",
    save_scene: Annotated[
        str | None, typer.Option(help="also write the scene here (.volviz.json); - as above")
    ] = None,
    backend: Annotated[
        str | None, typer.Option(help="OpenGL to use: auto, egl, egl:1, … (see 'volviz doctor')")
    ] = None,
    force: Annotated[bool, typer.Option("--force", "-f", help="replace files that exist")] = False,
    json: Annotated[bool, typer.Option("--json", help="print what was done as JSON")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="say only what went wrong")] = False,
) -> None:
    started = time.perf_counter()
    pixels = check_size(picture_size(size))
    target = _target(output, file, pixels)
    _check_outputs(file, target, save_scene, force=force, json=json)
    with show.progress_bar("reading", quiet=quiet) as progress:
        options_given = dict(given)
        options = read_options(options_given, progress.part(0.0, 0.3))
        scene = scene_from(file, options, options_given, pixels[0] / pixels[1])
        image = draw(scene, pixels, backend=backend, progress=progress.part(0.3, 1.0))
    _write(image, target, force)
    if save_scene == "-":
        _to_standard_output(scene.encoded(save_scene))
    elif save_scene is not None:
        scene.save(save_scene, overwrite=force)
    _tell(scene, image, target, time.perf_counter() - started, json=json, quiet=quiet)


def scene_from(file: str, options: Any, given: dict[str, Any], aspect: float) -> Scene:
    """The scene of a file with the flags that were given; a suggested one if it holds a volume."""
    look = {k: given.pop(k) for k in [f.name for f in SCENE_FLAGS] if k in given}
    if is_scene(file):
        scene = Scene.open(file, options=options)
        if "preset" in look:
            dressed = Scene.of(scene.volume, preset=look["preset"])
            scene = replace(
                scene, transfer=dressed.transfer, raycast=dressed.raycast, light=dressed.light
            )
        if any(k in look for k in TURNS):
            lens = {k.name: getattr(scene.camera, k.name) for k in knobs_of(Camera)}
            scene = scene.with_camera(_camera(scene, look, aspect, **lens))
        scene = scene.with_knobs(**given)
    else:
        volume = open_volume(file, options)
        scene = Scene.of(volume, preset=look.get("preset"), **given)
        lens = {k: v for k, v in given.items() if k in {n.name for n in knobs_of(Camera)}}
        scene = scene.with_camera(_camera(scene, look, aspect, **lens))
    if given.get("lens") and not any(scene.lens.focus):
        x, y, z = (float(v) for v in box_corners(scene.volume).mean(axis=0))
        scene = scene.with_knobs(lens_x=x, lens_y=y, lens_z=z)
    exactly = exact_camera(look)
    if exactly:
        scene = scene.with_camera(replace(scene.camera, **exactly))
    return _dressed(scene, look)


def _camera(scene: Scene, look: dict[str, Any], aspect: float, **lens: Any) -> Camera:
    turns = {k: look[k] for k in TURNS if k in look}
    if turns.get("zoom", 1.0) <= 0:
        raise UsageError(f"{turns['zoom']} is no zoom", field="--zoom", fix="give a number > 0")
    return volume_camera(scene.volume, aspect=aspect, **turns, **lens)


def _dressed(scene: Scene, look: dict[str, Any]) -> Scene:
    transfer = transfer_of(look["transfer"]) if "transfer" in look else scene.transfer
    if "window" in look:
        low, high = numbers(look["window"], (2,), "--window", "LOW,HIGH")
        if not high > low:
            raise UsageError("LOW must be below HIGH", field="--window")
        transfer = transfer.stretched(low, high)
    if "shift" in look:
        transfer = transfer.shifted(look["shift"])
    if "opacity" in look:
        if not look["opacity"] >= 0:
            raise UsageError(f"{look['opacity']} is no factor", field="--opacity")
        transfer = transfer.faded(look["opacity"])
    if "unit_distance" in look:
        transfer = replace(transfer, unit_distance=look["unit_distance"])
    scene = scene.with_transfer(transfer)
    if look.get("isosurface"):
        scene = scene.with_surfaces(
            [parse(w, i, surface_color) for i, w in enumerate(look["isosurface"])]
        )
    if "background" in look:
        scene = replace(scene, background=_background(look["background"]))
    return scene


def surface_color(text: str) -> tuple[float, ...]:
    """A colour as `--background` takes it."""
    return color(text, FIELD)


def _background(text: str) -> Background:
    top, _, bottom = text.partition("/")
    if not bottom:
        return Background.plain(color(text, "--background"))
    ends = (Background.plain(color(end, "--background")).top for end in (top, bottom))
    return Background(*ends)


def _target(output: str | None, file: str, size: tuple[int, int]) -> str:
    if output is not None:
        if output != "-":
            image_format(output, size)
        return output
    stem = Path(file.removeprefix("sample:")).name.split(".")[0] or "volviz"
    return f"{stem}.png"


def _check_outputs(
    file: str, target: str, save_scene: str | None, *, force: bool, json: bool
) -> None:
    if [target, save_scene, "-" if json else None].count("-") > 1:
        raise UsageError("two things cannot both go to standard output", field="-o")
    if save_scene is not None and same_file(target, save_scene):
        raise UsageError("the picture and the scene are one file", file=target, field="-o")
    if save_scene not in (None, "-") and not save_scene.lower().endswith(SCENE_SUFFIX):
        raise UsageError(
            "the name of a scene ends in .json", file=save_scene, fix="use .volviz.json"
        )
    for written in filter(None, {target, save_scene} - {"-"}):
        check_writable(written, overwrite=force)
        if same_file(written, file) and not (written == save_scene and is_scene(file)):
            raise UsageError("this is the file that is read", file=written, fix="give another name")


def _write(image: Image, target: str, force: bool) -> None:
    if target == "-":
        _to_standard_output(image.encoded())
    else:
        write_atomically(target, image.encoded(image_format(target)), overwrite=force)


def _to_standard_output(content: bytes) -> None:
    sys.stdout.buffer.write(content)
    sys.stdout.buffer.flush()


def _tell(
    scene: Scene, image: Image, target: str, seconds: float, *, json: bool, quiet: bool
) -> None:
    if not quiet:
        show.warnings([*scene.volume.info.warnings, *image.notes])
        width, height = image.size
        look = scene.transfer.name or "own transfer function"
        shown = "standard output" if target == "-" else target
        show.note(f"{shown}: {width}×{height}, {look}, {image.renderer}, {seconds:.1f} s")
    if json:
        show.print_json(
            {
                "output": target,
                "size": list(image.size),
                "transfer": scene.transfer.name,
                "mode": scene.raycast.mode,
                "renderer": image.renderer,
                "seconds": round(seconds, 3),
                "notes": list(image.notes),
                "warnings": list(scene.volume.info.warnings),
            }
        )


__all__ = ["VolvizError", "render", "scene_from"]
