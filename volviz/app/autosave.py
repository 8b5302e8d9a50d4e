"""Scenes saved by themselves, so that a crash loses at most a minute.

One file per process, named by its id; a clean end deletes it. A file whose process is gone is
offered for recovery and kept until the user decides.
"""

from __future__ import annotations

import os
import time
from dataclasses import replace
from pathlib import Path

from volviz.app.settings import write_quietly
from volviz.model import scenefile
from volviz.model.scene import SceneState
from volviz.sources import fields_absolute_from, is_sample

EVERY_SECONDS = 60.0
SUFFIX = ".volviz.json"


class Autosave:
    """Writes the scene of this process now and then."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.file = folder / f"{os.getpid()}{SUFFIX}"
        self._last: SceneState | None = None
        self._when = time.monotonic()

    def tick(self, scene: SceneState | None, *, dirty: bool, now: bool = False) -> str | None:
        """Write if it is time and the scene changed; a notice if that failed."""
        due = now or time.monotonic() - self._when >= EVERY_SECONDS
        if scene is None or not dirty or scene is self._last or not due or scene.source is None:
            return None
        self._last, self._when = scene, time.monotonic()
        source = scene.source
        if not is_sample(source.path):
            source = replace(source, path=str(Path(source.path).absolute()))
        named = fields_absolute_from(scene, Path("here").absolute())
        return write_quietly(self.file, scenefile.encode(named, source))

    def discard(self) -> None:
        """The end was clean: nothing to recover."""
        self.file.unlink(missing_ok=True)

    def orphans(self) -> list[Path]:
        """Scenes of processes that ended without deleting them, newest first."""
        try:
            files = [f for f in self.folder.glob(f"*{SUFFIX}") if not _alive(f.name)]
            return sorted(files, key=lambda f: f.stat().st_mtime, reverse=True)
        except OSError:
            return []


def _alive(name: str) -> bool:
    number = name.removesuffix(SUFFIX)
    if not number.isdecimal():
        return False
    try:
        os.kill(int(number), 0)
    except (ProcessLookupError, OverflowError):
        return False
    except OSError:
        return True
    return True
