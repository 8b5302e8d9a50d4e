"""The user's settings: a JSON file in the configuration folder; a broken one is put aside."""

from __future__ import annotations

import json
import os
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path
from typing import Any

from volviz.errors import OutputError
from volviz.files import write_atomically

FILE = "settings.json"
SCHEMA = 1
RECENT = 12
THEMES = ("dark", "light")


@dataclass(frozen=True)
class Settings:
    """What the window remembers. scale: of text and widgets. favourites: names of presets.
    unknown: keys of a newer volviz."""

    theme: str = "dark"
    scale: float = 1.0
    turntable: bool = False
    box: bool = False
    axes: bool = True
    panels: bool = True
    hidden: tuple[str, ...] = ()
    recent: tuple[str, ...] = ()
    favourites: tuple[str, ...] = ()
    folder: str = ""
    size: tuple[int, int] = (1280, 800)
    unknown: dict[str, Any] = field(default_factory=dict)

    def opened(self, name: str) -> Settings:
        """The same with this name on top of the recent ones."""
        rest = tuple(n for n in self.recent if n != name)
        return replace(self, recent=(name, *rest)[:RECENT])


def load(folder: Path) -> tuple[Settings, str | None]:
    """The settings of a folder, and a notice if they were broken. Never raises."""
    file = folder / FILE
    try:
        if not file.exists():
            return Settings(), None
        raw = json.loads(file.read_bytes())
        if not isinstance(raw, dict):
            raise ValueError("not an object")
        return _checked(raw), None
    except (OSError, ValueError, TypeError, RecursionError) as error:
        return Settings(), _put_aside(file, error)


def save(settings: Settings, folder: Path) -> str | None:
    """Write the settings; a notice if that failed (the program goes on with them in memory)."""
    known = {k: v for k, v in asdict(settings).items() if k != "unknown"}
    document = {**settings.unknown, **known, "schema": SCHEMA}
    return write_quietly(folder / FILE, json.dumps(document, indent=2).encode() + b"\n")


def write_quietly(file: Path, content: bytes) -> str | None:
    """Write a file of the configuration; None, or why it could not be written."""
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(file, content)
    except (OSError, OutputError) as error:
        return f"settings are not kept: {error}"
    return None


def _checked(raw: dict[str, Any]) -> Settings:
    """Known keys of the right type; a wrong value raises ValueError."""
    plain = Settings()
    known: dict[str, Any] = {}
    for item in fields(Settings):
        if item.name == "unknown" or item.name not in raw:
            continue
        known[item.name] = _as(getattr(plain, item.name), raw[item.name], item.name)
    made = Settings(**known)
    if made.theme not in THEMES or not 0.5 <= made.scale <= 4 or len(made.size) != 2:
        raise ValueError("a value is out of range")
    unknown = {k: v for k, v in raw.items() if k not in known and k != "schema"}
    return replace(made, unknown=unknown)


def _as(like: Any, value: Any, name: str) -> Any:
    if isinstance(like, tuple):
        kind = int if name == "size" else str
        if not isinstance(value, list) or not all(isinstance(v, kind) for v in value):
            raise ValueError(f"{name} is not a list of {kind.__name__}")
        return tuple(value)
    if isinstance(like, float) and isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    if type(value) is not type(like):
        raise ValueError(f"{name} is not a {type(like).__name__}")
    return value


def _put_aside(file: Path, error: Exception) -> str:
    bad = file.with_name(file.name + ".bad")
    try:
        os.replace(file, bad)
    except OSError:
        return f"the settings in {file} cannot be read ({error}); defaults are used"
    return f"the settings could not be read ({error}); they are kept as {bad}, defaults are used"
