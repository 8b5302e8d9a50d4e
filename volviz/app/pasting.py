"""What was copied comes back: a scene as JSON, or the path of a file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from volviz.app.opening import Making, prepared
from volviz.errors import UsageError
from volviz.io.options import ReadOptions
from volviz.model import scenefile
from volviz.model.scene import SceneState, Source
from volviz.progress import Progress
from volviz.scene import Scene
from volviz.sources import is_sample, open_volume, source_of

if TYPE_CHECKING:
    from volviz.app import App

READING = 0.7
PLACE = "clipboard"


def paste(app: App, text: str) -> None:
    """Take over a scene in JSON (on the open volume if it is of that), or open what a path names.

    Raises UsageError for other text, InputError naming the place in the JSON.
    """
    text = text.strip()
    if text.startswith("{"):
        document = scenefile.decode(text.encode("utf-8", "replace"), PLACE)
        _take(app, document, scenefile.source_of(document))
        return
    name = text.strip("'\"")
    if not _is_name(name):
        raise UsageError("there is no scene to paste", fix="copy one as JSON first")
    app.open(name)


def _take(app: App, document: Any, source: Source | None) -> None:
    now = app.scene
    if now is not None and (source is None or _same(source, now.source)):
        scene = scenefile.to_scene(document, now.volume, type(now), PLACE)
        app.change(replace(scene, source=now.source), "Paste scene")
    elif source is None:
        raise UsageError("the copied scene names no volume", fix="open one first")
    else:
        app.load(source.path, _maker(app, document, source))


def _maker(app: App, document: Any, source: Source) -> Making:
    """What a worker runs to open the volume of a pasted scene."""

    def make(progress: Progress) -> SceneState:
        options = ReadOptions(**dict(source.choices), progress=progress.part(0.0, READING))
        volume = open_volume(source.path, options)
        scene = scenefile.to_scene(document, volume, Scene, PLACE)
        scene = replace(scene, source=source_of(volume))
        return prepared(scene, app.limits, progress.part(READING, 1.0))

    return make


def _same(one: Source, other: Source | None) -> bool:
    """True if two sources name one volume."""
    return other is not None and (one.path, one.choices) == (other.path, other.choices)


def _is_name(text: str) -> bool:
    try:
        return bool(text) and "\n" not in text and (is_sample(text) or _there(text))
    except (OSError, ValueError):  # too long for a path, or with a zero byte
        return False


def _there(text: str) -> bool:
    return Path(text).expanduser().exists()
