"""How to make a picture again elsewhere: the command line and the Python code of a scene.

Both say where the volume is and only what differs from the scene that `Scene.of(volume)` suggests.
"""

from __future__ import annotations

import dataclasses
import os
import shlex
import subprocess
from dataclasses import dataclass
from typing import Any

from volviz.classify.presets import presets
from volviz.errors import UsageError
from volviz.image import check_size
from volviz.model.camera import Camera
from volviz.model.knobs import exacts_of, knobs_of
from volviz.model.scene import Background, SceneState, Source
from volviz.model.scenefile import transfer_text
from volviz.model.surface_look import SceneSurface, SurfaceLook
from volviz.model.surface_words import spell
from volviz.model.transfer import TransferFunction
from volviz.model.views import view_names, volume_camera
from volviz.scene import Scene
from volviz.sources import SAMPLE, is_sample, source_of

SAID = {"volume", "source", "transfer", "camera", "background", "surfaces", "bookmarks"}
"""Fields of a scene that have words of their own, or none because a picture does not show them; of
all others, the knobs are said."""
LONGEST = 120_000
"""Characters of one argument: a little below what Linux takes."""
WIDTH = 88


@dataclass(frozen=True)
class Recipe:
    """What to read, and what to change in the scene that is suggested for it.

    knobs: by name; camera: exact fields by name; None or empty: as suggested.
    """

    source: Source
    size: tuple[int, int]
    preset: str | None
    view: str | None
    knobs: dict[str, Any]
    transfer: TransferFunction | None
    camera: dict[str, Any]
    background: Background | None
    surfaces: tuple[SceneSurface, ...] = ()


def recipe_of(scene: SceneState, size: tuple[int, int]) -> Recipe:
    """What leads to this scene and a picture of it, width × height.

    Raises UsageError where no file has the volume, or where the scene has what only a scene file
    can say.
    """
    size = check_size(size)
    source = _source(scene)
    aspect = size[0] / size[1]
    for preset in _presets(scene):
        plain = Scene.of(scene.volume, preset=preset, aspect=aspect)
        knobs = _turned(scene, plain)
        start = Scene.of(scene.volume, preset=preset, aspect=aspect, **knobs)
        if start.transfer == scene.transfer:
            break
    transfer = None if start.transfer == scene.transfer else scene.transfer
    view, camera = _camera(scene, start, aspect)
    background = None if scene.background == start.background else scene.background
    return Recipe(source, size, preset, view, knobs, transfer, camera, background, scene.surfaces)


def arguments(scene: SceneState, size: tuple[int, int], output: str | None = None) -> list[str]:
    """What follows `volviz` on a command line that draws this scene. Raises UsageError."""
    recipe = recipe_of(scene, size)
    path = recipe.source.path
    flags: dict[str, Any] = {n: _listed(n, v) for n, v in recipe.source.choices}
    flags |= {"preset": recipe.preset, "view": recipe.view} | recipe.knobs
    flags |= {f"camera_{n}": _listed(n, v) for n, v in recipe.camera.items()}
    if recipe.transfer is not None:
        flags["transfer"] = transfer_text(recipe.transfer)
        if len(flags["transfer"]) > LONGEST:
            raise UsageError(
                "the transfer function has too many points for a command line",
                fix="save the scene and draw its file",
            )
    if recipe.background is not None:
        ends = dict.fromkeys((recipe.background.top, recipe.background.bottom))
        flags["background"] = "/".join(_listed("background", end) for end in ends)
    flags["isosurface"] = [spell(s, i) for i, s in enumerate(recipe.surfaces)]
    flags["size"] = f"{size[0]}x{size[1]}"
    words = [
        _flag(name, each)
        for name, value in flags.items()
        for each in (value if isinstance(value, list) else [value])
        if each is not None
    ]
    end = [] if output is None else ["-o", _plain(output)]
    return ["render", _plain(path), *words, *end]


def command(scene: SceneState, size: tuple[int, int], output: str | None = None) -> str:
    """The command line that draws this scene, quoted for this system's shell.

    output: the picture's file; by default the command's own choice. Raises UsageError.
    """
    words = ["volviz", *arguments(scene, size, output)]
    return subprocess.list2cmdline(words) if os.name == "nt" else shlex.join(words)


def python(scene: SceneState, size: tuple[int, int], output: str) -> str:
    """Python code that draws this scene to a file. Raises UsageError."""
    recipe = recipe_of(scene, size)
    width, height = recipe.size
    named = {"preset": recipe.preset, "view": recipe.view}
    start = {n: repr(v) for n, v in named.items() if v is not None}
    start |= {"aspect": f"{width} / {height}"}
    start |= {n: repr(v) for n, v in recipe.knobs.items()}
    lines = ["import volviz", "", f"volume = {_reading(recipe.source)}"]
    if recipe.camera or recipe.background is not None:
        lines.insert(0, "from dataclasses import replace\n")
    lines += [f"scene = {_call('volviz.Scene.of', 'volume', **start)}"]
    if recipe.transfer is not None:
        made = _call("volviz.TransferFunction", **_fields(recipe.transfer))
        lines += [f"transfer = {made}", "scene = scene.with_transfer(transfer)"]
    if recipe.camera:
        exact = {n: repr(v) for n, v in recipe.camera.items()}
        lines += [f"camera = {_call('replace', 'scene.camera', **exact)}"]
        lines += ["scene = scene.with_camera(camera)"]
    if recipe.background is not None:
        made = _call("volviz.Background", **_fields(recipe.background))
        lines += [f"background = {made}", "scene = replace(scene, background=background)"]
    if recipe.surfaces:
        made = _rows(tuple(_At(s) for s in recipe.surfaces))
        lines += [f"scene = scene.with_surfaces({made})"]
    lines += [f"image = volviz.render(scene, size=({width}, {height}))", f"image.save({output!r})"]
    return "\n".join(lines) + "\n"


class _At:
    """A surface that is written as the code that makes it."""

    def __init__(self, surface: SceneSurface) -> None:
        self.surface = surface

    def __repr__(self) -> str:
        spec, look = self.surface.surface, self.surface.look
        knobs = {"color": look.color} if look.color != SurfaceLook().color else {}
        for owner in (spec, look, self.surface.refining):
            for knob in knobs_of(type(owner)):
                value = getattr(owner, knob.name)
                if knob.name != "isovalue" and value != knob.default:
                    knobs[knob.name] = value
        said = "".join(f", {name}={value!r}" for name, value in knobs.items())
        return f"volviz.SceneSurface.at({spec.isovalue!r}{said})"


def _source(scene: SceneState) -> Source:
    source = scene.source or source_of(scene.volume)
    if source is None:
        raise UsageError(
            "the volume is an array in memory, which no command and no code can read",
            fix="save the array first (volviz.save_volume) and open its file",
        )
    return source


def _presets(scene: SceneState) -> tuple[str | None, ...]:
    """What may have given the transfer function; the last is where to start if none did."""
    name = scene.transfer.name
    return (None, name, None) if name in presets() else (None,)


def _turned(scene: SceneState, plain: SceneState) -> dict[str, Any]:
    """The knobs that differ, by name. Raises UsageError for what no knob can say."""
    knobs: dict[str, Any] = {}
    for field in dataclasses.fields(SceneState):
        now, then = getattr(scene, field.name), getattr(plain, field.name)
        if now == then or field.name in SAID - {"camera"}:
            continue
        names = [k.name for k in knobs_of(type(now))] if dataclasses.is_dataclass(now) else []
        found = {n: getattr(now, n) for n in names if getattr(now, n) != getattr(then, n, None)}
        if field.name not in SAID and (
            type(now) is not type(then) or dataclasses.replace(then, **found) != now
        ):
            raise UsageError(
                f"no flag says what the scene's {field.name.replace('_', ' ')} is",
                fix="save the scene and draw its file",
            )
        knobs |= found
    return knobs


def _camera(
    scene: SceneState, start: SceneState, aspect: float
) -> tuple[str | None, dict[str, Any]]:
    """The standard view, or the exact fields that differ from the view that is suggested."""
    camera = scene.camera
    if camera == start.camera:
        return None, {}
    lens: dict[str, Any] = {k.name: getattr(camera, k.name) for k in knobs_of(Camera)}
    for name in view_names(scene.volume):
        if camera == volume_camera(scene.volume, name, aspect=aspect, **lens):
            return name, {}
    fields = {k.name: getattr(camera, k.name) for k in exacts_of(Camera)}
    return None, {n: v for n, v in fields.items() if v != getattr(start.camera, n)}


def _listed(name: str, value: Any) -> Any:
    """Several numbers as one word: 20x25x30 for a shape, else 1,0.5,2."""
    if not isinstance(value, tuple | list):
        return value
    return ("x" if name == "shape" else ",").join(map(_number, value))


def _number(value: float) -> str:
    return repr(value).removesuffix(".0")


def _flag(name: str, value: Any) -> str:
    """One word, so that no value can be taken for another flag."""
    spelled = name.replace("_", "-")
    if isinstance(value, bool):
        return f"--{spelled}" if value else f"--no-{spelled}"
    return f"--{spelled}={value if isinstance(value, str) else _number(value)}"


def _plain(path: str) -> str:
    """A path that is no flag and that a shell can be told."""
    try:
        path.encode()
    except UnicodeEncodeError as error:
        raise UsageError(
            "the name of the file is not UTF-8 and cannot be copied", fix="rename it"
        ) from error
    return os.path.join(os.curdir, path) if path.startswith("-") else path


def _reading(source: Source) -> str:
    choices = {name: repr(value) for name, value in source.choices}
    if is_sample(source.path):
        return _call("volviz.sample", repr(source.path.removeprefix(SAMPLE)), **choices)
    return _call("volviz.load", repr(source.path), **choices)


def _fields(instance: Any) -> dict[str, str]:
    return {f.name: _rows(getattr(instance, f.name)) for f in dataclasses.fields(instance)}


def _rows(value: Any) -> str:
    """A value as code; a long tuple of tuples with a row to each line."""
    text = repr(value)
    if len(text) < WIDTH - 24 or not isinstance(value, tuple):
        return text
    return "(\n" + "".join(f"        {row!r},\n" for row in value) + "    )"


def _call(name: str, /, *first: str, **keywords: str) -> str:
    """A call as code, on one line if it fits."""
    words = [*first, *(f"{key}={value}" for key, value in keywords.items())]
    short = f"{name}({', '.join(words)})"
    if len(short) < WIDTH - 12 and "\n" not in short:
        return short
    return f"{name}(\n" + "".join(f"    {word},\n" for word in words) + ")"
