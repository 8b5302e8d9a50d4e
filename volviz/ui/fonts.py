"""Letters that our font lacks (Chinese, Japanese, Korean, Arabic, …), from a font of the system.

Nothing is looked for until a name or a message has such a letter. Then a worker asks fontconfig
which file has it, or takes the usual files of the system where there is no fontconfig, and the
file is merged into our font. What no font has stays a box.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from volviz.app.jobs import Job
from volviz.ui import theme
from volviz.ui.im import imgui

if TYPE_CHECKING:
    from volviz.app import App

SECONDS = 5.0
USUAL: dict[str, tuple[str, ...]] = {
    "win32": ("msyh.ttc", "YuGothM.ttc", "malgun.ttf", "segoeui.ttf", "Nirmala.ttf", "simsun.ttc"),
    "darwin": (
        "Supplemental/Arial Unicode.ttf",
        "PingFang.ttc",
        "Hiragino Sans GB.ttc",
        "AppleSDGothicNeo.ttc",
    ),
    "linux": (
        "opentype/noto/NotoSansCJK-Regular.ttc",
        "noto-cjk/NotoSansCJK-Regular.ttc",
        "google-noto-cjk/NotoSansCJK-Regular.ttc",
        "truetype/wqy/wqy-microhei.ttc",
        "truetype/droid/DroidSansFallbackFull.ttf",
        "truetype/dejavu/DejaVuSans.ttf",
    ),
}
FOLDERS = {
    "win32": Path("C:/Windows/Fonts"),
    "darwin": Path("/System/Library/Fonts"),
    "linux": Path("/usr/share/fonts"),
}


class Fallback:
    """The fonts that were merged by now. Only the window's thread calls it, between frames."""

    def __init__(self) -> None:
        self.files: list[Path] = []
        self._seen: set[str] = set()
        self._texts: tuple[str, ...] = ()
        self._missing: set[str] = set()
        self._job: Job | None = None
        self._font: object | None = None

    def cover(self, texts: Iterable[str], wake: Callable[[], None]) -> None:
        """See to it that these can be read, as far as this system has letters for them."""
        font = imgui.get_io().fonts.fonts[0]
        if self._font is not None and self._font is not font:  # a window that was built anew
            for file in self.files:
                _merge(file)
        self._font = font
        given = tuple(texts)
        if given != self._texts:
            self._texts = given
            new = set("".join(given)) - self._seen
            self._seen |= new
            self._missing |= {c for c in new if c.isprintable() and _lacks(c)}
        if self._job is not None and self._job.finished:
            job, self._job = self._job, None
            job.deliver()
        if self._missing and self._job is None:
            letter = min(self._missing)
            self._missing.discard(letter)
            self._job = Job(
                "fonts", lambda _: found(letter, self.files), lambda f: self._take(f, letter), wake
            )

    def _take(self, files: list[Path], letter: str) -> None:
        for file in files:
            if not _lacks(letter):
                break
            if _merge(file):
                self.files.append(file)
        self._missing = {c for c in self._missing if _lacks(c)}


def names(app: App) -> list[str]:
    """What is shown and may be in any script."""
    shown = [*app.settings.recent, *(m.text for m in app.messages.all[-8:])]
    scene = app.scene
    if scene is not None:
        info = scene.volume.info
        shown += [scene.volume.name or "", scene.source.path if scene.source else ""]
        shown += [info.value_unit or "", *info.channel_names]
        shown += [*info.fields, *map(str, info.fields.values())]
    return shown


def found(letter: str, known: Iterable[Path] = ()) -> list[Path]:
    """Font files that may have the letter, the best first; in any thread."""
    files = [file for file in (_asked(letter), *_usual()) if file is not None]
    return [f for f in dict.fromkeys(files) if f not in known and f.is_file()]


def _asked(letter: str) -> Path | None:
    """What fontconfig says."""
    program = shutil.which("fc-match")
    if program is None:
        return None
    command = [program, "-f", "%{file}", f"sans:charset={ord(letter):x}"]
    try:
        done = subprocess.run(command, capture_output=True, timeout=SECONDS, check=True)
    except (OSError, subprocess.SubprocessError):
        return None
    file = Path(done.stdout.decode("utf-8", "surrogateescape"))
    return file if file.suffix.lower() in (".ttf", ".ttc", ".otf") else None


def _usual() -> list[Path]:
    folder = FOLDERS.get(sys.platform)
    return [] if folder is None else [folder / name for name in USUAL[sys.platform]]


def _lacks(letter: str) -> bool:
    return not imgui.get_io().fonts.fonts[0].is_glyph_in_font(ord(letter))


def _merge(file: Path) -> bool:
    """Into our font; False for what is none."""
    merged = imgui.ImFontConfig()
    merged.merge_mode = True
    try:
        made = imgui.get_io().fonts.add_font_from_file_ttf(str(file), theme.FONT_SIZE, merged)
    except RuntimeError:
        return False
    return made is not None
