"""The user's own presets: plain files in the configuration folder, of the schema of ours.

They are looked for anew whenever they are asked for, so that a file put there is found; for panels,
which ask with every frame, once a second. One that is broken is told, and the others are not
touched by it.
"""

from __future__ import annotations

import os
import re
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

from msgspec.structs import replace

from volviz.classify.preset_file import (
    Preset,
    decoded,
    encoded,
    load_preset,
    natural,
    plain,
    shipped,
)
from volviz.errors import InputError, OutputError, UsageError, safe_text
from volviz.files import write_atomically
from volviz.folders import config_folder

RESERVED = ("suggested", "labels")
"""What transfer functions are called that come from no preset."""
LONGEST = 60
OTHER_NAME = "choose another name"
LOOK_SECONDS = 1.0
"""Between two looks into the folder by `recent`."""


@dataclass(frozen=True)
class Own:
    """What a folder holds. presets, files: by name. broken: by the file's name without .json."""

    presets: dict[str, Preset] = field(default_factory=dict)
    files: dict[str, Path] = field(default_factory=dict)
    broken: dict[str, InputError] = field(default_factory=dict)


@dataclass(frozen=True)
class _Look:
    """What was found in a folder, and when."""

    place: Path
    when: float
    found: Own


_looks: list[_Look] = []
"""The last one, if there was any."""


def folder() -> Path:
    """Where the user's own presets are; it need not exist."""
    return config_folder() / "presets"


def own() -> Own:
    """The user's presets as their folder has them now. Never raises."""
    place = folder()
    found = _read(place, tuple(sorted(_signature(place))))
    _looks[:] = [_Look(place, time.monotonic(), found)]
    return found


def recent() -> Own:
    """`own` of a second ago at most, the same object until something changes; what this process
    saves, renames or deletes is known at once."""
    for last in _looks:
        if last.place == folder() and time.monotonic() - last.when <= LOOK_SECONDS:
            return last.found
    return own()


def name_of(title: str) -> str:
    """The name of a preset with this title: "My bone (2)" is "my-bone-2"."""
    words = re.findall(r"[^\W_]+", title.casefold())
    name = "-".join(words)
    while len(name.encode()) > 4 * LONGEST or len(name) > LONGEST:
        name = name[:-1]
    return name.strip("-")


def existing(title: str) -> str | None:
    """The name of the user's preset that this title would replace. Raises UsageError for a title
    that cannot be used: empty, or of a preset that volviz brings."""
    name = name_of(title)
    if not name:
        raise UsageError("a preset needs a name", field="name", fix="type letters or digits")
    if name in RESERVED:
        raise UsageError(f"'{name}' has a meaning of its own", field="name", fix=OTHER_NAME)
    theirs = {plain(n): n for n in shipped()}
    if plain(name) in theirs:
        raise UsageError(
            f"volviz brings a preset '{theirs[plain(name)]}'", field="name", fix=OTHER_NAME
        )
    return {plain(n): n for n in own().presets}.get(plain(name))


def save(preset: Preset, *, overwrite: bool = False) -> Path:
    """Write a preset under the name that its title gives it; the file.

    Raises UsageError for a name that is taken by volviz, OutputError if it is there already and
    not to be overwritten, or cannot be written.
    """
    taken = existing(preset.title)
    name = name_of(preset.title)
    known = own()
    file = known.files[taken] if taken is not None else folder() / f"{name}.json"
    if not overwrite and (taken is not None or os.path.lexists(file)):
        raise OutputError("exists already", file=file, fix=OTHER_NAME)
    content = encoded(replace(preset, name=name))
    try:
        decoded(content, file)
    except InputError as error:  # labels may have more points than a preset
        raise UsageError(error.what, field=error.field, fix=error.fix) from error
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        why = error.strerror or str(error)
        raise OutputError(f"the folder cannot be made: {why}", file=file.parent) from error
    write_atomically(file, content, overwrite=overwrite)
    own()  # what panels know
    return file


def rename(name: str, title: str) -> str:
    """Give one of the user's presets another title; its new name. Raises as `save` does."""
    old = _file(name)
    preset = replace(own().presets[name], title=title.strip())
    taken = existing(title)
    new = save(preset, overwrite=taken == name)
    if new != old:
        _remove(old)
    return name_of(title)


def delete(name: str) -> None:
    """Remove one of the user's presets for good. Raises UsageError, OutputError."""
    _remove(_file(name))


def _file(name: str) -> Path:
    files = own().files
    if name not in files:
        raise UsageError(f"'{name}' is none of your own presets", field="preset")
    return files[name]


def _remove(file: Path) -> None:
    try:
        file.unlink(missing_ok=True)
    except OSError as error:
        raise OutputError(
            f"cannot be deleted: {error.strerror or error}", file=file, fix="delete it by hand"
        ) from error
    own()


def _signature(place: Path) -> Iterator[tuple[str, int, int]]:
    """Names, times and sizes of the files, as long as the folder can be read."""
    try:
        with os.scandir(place) as entries:
            for entry in entries:
                if entry.name.endswith(".json") and not entry.name.startswith("."):
                    facts = entry.stat()
                    yield entry.name, facts.st_mtime_ns, facts.st_size
    except OSError:
        return


@lru_cache(maxsize=1)
def _read(place: Path, signature: tuple[tuple[str, int, int], ...]) -> Own:
    """The presets of a folder; remembered until a name, a time or a size in it changes."""
    found = Own()
    loaded: list[tuple[Path, Preset]] = []
    for file in (place / name for name, _, _ in signature):
        try:
            loaded.append((file, load_preset(file)))
        except InputError as error:
            found.broken[file.stem] = error
    # of two with one name the file that is called so has it; the other is a copy
    for file, preset in sorted(loaded, key=lambda p: p[0].stem != p[1].name):
        try:
            found.presets[preset.name] = _checked(preset, file, found)
            found.files[preset.name] = file
        except InputError as error:
            found.broken[file.stem] = error
    ordered = sorted(found.presets.items(), key=lambda p: natural(p[0]))
    return Own(dict(ordered), found.files, found.broken)


def _checked(preset: Preset, file: Path, found: Own) -> Preset:
    """The preset, unless its name is taken."""
    wanted = plain(preset.name)
    if not wanted or preset.name in RESERVED:
        what = f"'{safe_text(preset.name)}' is no name for a preset"
    elif wanted in {plain(n) for n in shipped()}:
        what = f"volviz brings a preset '{preset.name}' itself"
    elif wanted in {plain(n) for n in found.presets}:
        what = f"another of your presets is called '{preset.name}' too"
    else:
        return preset
    raise InputError(what, file=file, field="name", fix=OTHER_NAME)
