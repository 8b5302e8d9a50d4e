"""From a name to a scene, on a worker: a file, a folder, a sample or a scene file."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from volviz.io.options import ReadOptions
from volviz.model.scene import SceneState
from volviz.progress import Progress
from volviz.resolve import TextureLimits, resolve
from volviz.scene import Scene
from volviz.sources import is_sample, open_volume

SCENE_SUFFIX = ".json"
READING = 0.7

Making = Callable[[Progress], SceneState]


def maker(name: str, aspect: float, limits: Callable[[], TextureLimits], **choices: Any) -> Making:
    """What a worker runs to open `name`: reads it, suggests how to show it, prepares the frame.

    aspect: width / height of the view it is for. choices: fields of `ReadOptions`.
    """

    def make(progress: Progress) -> SceneState:
        options = ReadOptions(progress=progress.part(0.0, READING), **choices)
        if is_scene_file(name):
            scene = Scene.open(name, options=options)
        else:
            volume = open_volume(name, options)
            progress(READING, "looking at the values")
            scene = Scene.of(volume, aspect=aspect)
        return prepared(scene, limits(), progress.part(READING, 1.0))

    return make


def prepared(scene: SceneState, limits: TextureLimits, progress: Progress) -> SceneState:
    """The same scene, with everything known that its first frame needs."""
    progress(0.1, "preparing")
    resolve(scene, limits=limits, progress=progress)
    progress(1.0, "preparing")
    return scene


def is_scene_file(name: str) -> bool:
    """True for scene files; a .json may also be a header of some volume."""
    if is_sample(name) or not name.lower().endswith(SCENE_SUFFIX):
        return False
    if name.lower().endswith(".volviz.json"):
        return True
    try:
        with Path(name).open("rb") as file:
            return b'"volviz-scene"' in file.read(4096)
    except OSError:
        return False


def title_of(name: str) -> str:
    """A short name for labels and lists."""
    return name.removeprefix("sample:") if is_sample(name) else Path(name).name or name


def absolute(name: str) -> str:
    """The name as it is remembered."""
    return name if is_sample(name) else str(Path(name).expanduser().absolute())


def chosen(names: Sequence[str]) -> tuple[str, str | None]:
    """Which of several dropped names to open, and what to say about the others."""
    if len(names) == 1:
        return names[0], None
    folders = {str(Path(n).parent) for n in names}
    suffixes = {Path(n).suffix.lower() for n in names}
    if len(folders) == 1 and suffixes <= {".dcm", ".ima", ""} and len(names) > 2:
        return folders.pop(), f"{len(names)} slices: their folder is opened"
    told = f"{len(names)} files were given; {title_of(names[0])} is opened"
    return names[0], f"{told}, the others are in File > Open Recent"


def with_source(scene: SceneState, path: str) -> SceneState:
    """The scene with its volume's place made absolute, so that it survives a change of folder."""
    if scene.source is None or is_sample(scene.source.path):
        return scene
    return replace(scene, source=replace(scene.source, path=absolute(scene.source.path)))
