"""From a name to a scene, on a worker: a file, a folder, a sample or a scene file."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

from volviz.errors import UsageError, VolvizError, safe_text
from volviz.io import identify, probe, sniff
from volviz.io.options import ReadOptions
from volviz.io.parts import Choices, Part, parts
from volviz.model.scene import SceneState
from volviz.progress import Progress
from volviz.resolve import TextureLimits, resolve
from volviz.scene import Scene
from volviz.sources import is_sample, open_volume

SCENE_SUFFIX = ".json"
READING = 0.7
LONGEST_TITLE = 60
MOST = 12
"""Of several names that are given at once so many are kept as recent ones."""


@dataclass(frozen=True, eq=False)
class Offer:
    """A question: which of these? present: what is open of them, None if nothing is. again: what
    opens the answer, by its choices, where more than the name was said about how."""

    name: str
    parts: tuple[Part, ...]
    present: Choices | None = None
    again: Again | None = None


def offer_of(name: str, progress: Progress) -> Offer:
    """Lists what can be opened from a name; for a worker. Raises VolvizError."""
    return Offer(name, parts(name, ReadOptions(progress=progress)))


Making = Callable[[Progress], SceneState | Offer]
Again = Callable[[dict[str, Any]], Making]


def maker(
    name: str, aspect: Callable[[], float], limits: Callable[[], TextureLimits], **choices: Any
) -> Making:
    """What a worker runs to open `name`: reads it, suggests how to show it, prepares the frame.

    Where it holds several series and none was chosen, the worker lists them instead.

    aspect: width / height of the view it is for. choices: fields of `ReadOptions`.
    """

    def make(progress: Progress) -> SceneState | Offer:
        options = ReadOptions(progress=progress.part(0.0, READING), **choices)
        if is_scene_file(name):
            scene = Scene.open(name, options=options)
        else:
            try:
                volume = open_volume(name, options)
            except UsageError as error:
                if error.field != "series" or options.series is not None:
                    raise
                return offer_of(name, progress)
            progress(READING, "looking at the values")
            scene = Scene.of(volume, aspect=aspect())
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
    except (OSError, ValueError):  # a name may hold a zero byte
        return False


def title_of(name: str) -> str:
    """A short name for labels and lists, fit for the screen whatever the file is called."""
    title = name.removeprefix("sample:") if is_sample(name) else Path(name).name or name
    return shortened(title)


def shortened(text: str, longest: int = LONGEST_TITLE) -> str:
    """The text without control characters, its middle left out where it is too long."""
    if len(text) > longest:
        text = f"{text[: longest // 2]}…{text[-(longest // 2 - 1) :]}"
    return safe_text(text)


def absolute(name: str) -> str:
    """The name as it is remembered; of no name nothing is made, least of all this folder."""
    return name if is_sample(name) or not name.strip() else str(typed(name).absolute())


def typed(text: str) -> Path:
    """The path that was meant by what a person typed, pasted or dropped.

    Takes ~, $VARIABLES, quotes, file:// addresses and spaces around; what is there as it stands is
    taken as it stands.
    """
    if text and os.path.lexists(text):
        return Path(text)
    meant = text.strip()
    if len(meant) > 1 and meant[0] == meant[-1] and meant[0] in "'\"":
        meant = meant[1:-1]
    if meant.lower().startswith("file:"):
        address = urlsplit(meant.replace("#", "%23").replace("?", "%3F"))
        host = "" if address.netloc in ("", "localhost") else f"//{address.netloc}"
        place = unquote(address.path, errors="surrogateescape")
        drive = len(place) > 2 and place[0] == "/" and place[2] == ":"
        return Path(host + (place[1:] if drive and os.name == "nt" else place))
    return Path(os.path.expandvars(meant)).expanduser()


def decided(names: Sequence[str]) -> tuple[str, str | None, list[str]]:
    """Which of several names to open, what to say about it, and which others are worth keeping:
    what nobody can read drives nothing out of the recent files. Reads heads."""
    name, note = chosen(names)
    others = [n for n in names[:MOST] if n != name] if name in names else []
    return name, note, [n for n in others if _is_known(n)]


def chosen(names: Sequence[str]) -> tuple[str, str | None]:
    """Which of several dropped names to open, and what to say about the others. Reads heads."""
    if len(names) == 1:
        return names[0], None
    folder = Path(names[0]).parent
    if len(names) > 2 and all(Path(n).parent == folder and _is_slice(Path(n)) for n in names):
        return str(folder), f"{len(names)} slices: their folder is opened"
    first = next((n for n in names if _is_known(n)), None)
    if first is None:
        return names[0], f"{len(names)} files were given, none of a kind that is read"
    told = f"{len(names)} files were given; {title_of(first)} is opened"
    return first, f"{told}, the others are in File > Open Recent"


def _is_known(name: str) -> bool:
    """True for what looks as if it could be opened."""
    if is_sample(name) or is_scene_file(name):
        return True
    try:
        return bool(identify(Path(name)))
    except (VolvizError, OSError):
        return False


def _is_slice(path: Path) -> bool:
    """True for a file that is one image of a stack: DICOM, a picture, a TIFF of one page."""
    if not path.is_file():
        return path.suffix.lower() in (".dcm", ".ima")
    try:
        head = sniff.head(path)
        if sniff.is_tiff(head):
            return path.stat().st_size < 1 << 28 and probe(path).dims[2] == 1
        return bool(sniff.is_dicom(head) or sniff.is_image(head))
    except (VolvizError, OSError):
        return False


def with_source(scene: SceneState, path: str) -> SceneState:
    """The scene with its volume's place made absolute, so that it survives a change of folder."""
    if scene.source is None or is_sample(scene.source.path):
        return scene
    return replace(scene, source=replace(scene.source, path=absolute(scene.source.path)))
