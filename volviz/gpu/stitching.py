"""Shaders as text: our own `#include "path"`, and where each line came from.

GLSL has no include, moderngl's does not nest, and Mesa loses the file of a `#line`. So the text is
stitched here (each file once, paths relative to shaders/) and a map from stitched line to file and
line is kept. A line `#include "@mode"` is a choice: it takes the file that `choices` maps "@mode"
to.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from types import MappingProxyType

from volviz import resources
from volviz.errors import GraphicsError, OutputError, did_you_mean

NO_CHOICES: Mapping[str, str] = MappingProxyType({})

_COMMENT = re.compile(r"//[^\n]*|/\*.*?\*/", re.DOTALL)
_INCLUDE = re.compile(r'^\s*#\s*include\b\s*(?:"([^"]+)"\s*$)?')
_VERSION = re.compile(r"^\s*#\s*version\b")
_UNIFORM = re.compile(r"\buniform\s+([^;{]*)([;{])")


@dataclass(frozen=True)
class Source:
    """A stitched shader. lines[i] is the (file, line) that text line i came from (i from 0)."""

    name: str
    text: str
    lines: tuple[tuple[str, int], ...]

    @cached_property
    def uniforms(self) -> frozenset[str]:
        """Names of the uniforms (and uniform blocks) declared anywhere in the text."""
        names: set[str] = set()
        for match in _UNIFORM.finditer(_blank_comments(self.text)):
            words = match[1].strip()
            if match[2] == "{":
                names.add(words)
                continue
            while (bare := re.sub(r"\([^()]*\)|\[[^]]*\]", " ", words)) != words:
                words = bare
            declared = re.sub(r"=[^,]*", " ", words).split(",")
            names.update(part.split()[-1] for part in declared if part.split())
        return frozenset(names)

    def where(self, line: int) -> tuple[str, int]:
        """The (file, line) behind a line of the stitched text, both counted from 1."""
        return self.lines[min(max(line, 1), len(self.lines)) - 1]

    def marked(self) -> str:
        """The stitched text with `// from: file` wherever another file begins."""
        out: list[str] = []
        last = self.lines[0][0]
        for text, (file, _) in zip(self.text.split("\n"), self.lines, strict=True):
            if file != last:
                out.append(f"// from: {file}")
                last = file
            out.append(text)
            if len(out) == 1:
                out.append(f"// from: {file}")
        return "\n".join(out) + "\n"

    def dump(self, path: Path) -> None:
        """Write `marked` to a file, to be read by a person. OutputError if that fails."""
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(self.marked(), encoding="utf-8")
        except OSError as error:
            raise OutputError(f"cannot write the shader: {error.strerror}", file=path) from error


def stitch(
    name: str,
    choices: Mapping[str, str] = NO_CHOICES,
    root: Path | None = None,
    stamps: dict[Path, int] | None = None,
) -> Source:
    """The text of a shader with its includes resolved.

    name: file relative to shaders/ (or `root`); its first line is `#version 330 core`. choices:
    "@mode" -> "raycast/modes/mip.glsl". stamps: filled with the time of every file that was looked
    at, also when it fails. Raises GraphicsError naming file and line for a missing
    file, a path outside the folder, or an `@name` that nothing was chosen for.
    """
    work = _Stitcher(
        (root or resources.shader_dir()).resolve(), choices, {} if stamps is None else stamps
    )
    work.add(name, None)
    if not work.text or not _VERSION.match(work.text[0]):
        raise GraphicsError("the first line must be #version 330 core", file=_shown(name, 1))
    return Source(name, "\n".join(work.text), tuple(work.lines))


class _Stitcher:
    """One walk through the includes: text and line map grow together.

    stamps: filled with the mtime of every file looked at, also when the walk fails.
    """

    def __init__(self, root: Path, choices: Mapping[str, str], stamps: dict[Path, int]) -> None:
        self.root = root
        self.choices = choices
        self.text: list[str] = []
        self.lines: list[tuple[str, int]] = []
        self.seen: set[Path] = set()
        self.stamps = stamps

    def add(self, name: str, asked_at: str | None) -> None:
        path = (self.root / name).resolve()
        if path in self.seen:
            return
        self.seen.add(path)
        content = self._read(path, name, asked_at)
        bare = _blank_comments(content).split("\n")
        for number, (line, code) in enumerate(zip(content.split("\n"), bare, strict=True), start=1):
            if (include := _INCLUDE.match(code)) is not None:
                here = _shown(name, number)
                self.add(self._target(include[1], here), here)
                continue
            if _VERSION.match(code) and self.text:
                raise GraphicsError(
                    "#version belongs in the first line of the main file only",
                    file=_shown(name, number),
                )
            self.text.append(line)
            self.lines.append((f"shaders/{name}", number))

    def _read(self, path: Path, name: str, asked_at: str | None) -> str:
        if not path.is_relative_to(self.root):
            raise GraphicsError(f"include of '{name}' leaves the shaders folder", file=asked_at)
        self.stamps[path] = stamp(path)
        try:
            return path.read_text(encoding="utf-8").removesuffix("\n")
        except (OSError, UnicodeDecodeError) as error:
            known = (p.relative_to(self.root).as_posix() for p in self.root.rglob("*.*"))
            raise GraphicsError(
                f"cannot read the shader '{name}'", file=asked_at, fix=did_you_mean(name, known)
            ) from error

    def _target(self, target: str | None, here: str) -> str:
        if not target:
            raise GraphicsError('write includes as #include "path"', file=here)
        if not target.startswith("@"):
            return target
        if target not in self.choices:
            raise GraphicsError(
                f"no file was chosen for '{target}'",
                file=here,
                fix=did_you_mean(target, self.choices),
            )
        return self.choices[target]


def _blank_comments(text: str) -> str:
    """The text with comments replaced by blanks, line for line."""
    return _COMMENT.sub(lambda match: re.sub(r"[^\n]", " ", match[0]), text)


def _shown(name: str, line: int) -> str:
    return f"shaders/{name}:{line}"


def stamp(path: Path) -> int:
    """mtime in ns, -1 where the file is gone (an editor may be replacing it right now)."""
    try:
        return path.stat().st_mtime_ns
    except OSError:
        return -1
