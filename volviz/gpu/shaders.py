"""Shaders from files: our own `#include "path"`, errors that name our file and line, a cache.

GLSL has no include, moderngl's does not nest, and Mesa loses the file of a `#line`. So the text is
stitched here (each file once, paths relative to shaders/), a map from stitched line to file and
line is kept, and compiler logs are rewritten with it. A line `#include "@mode"` is a choice: it
takes the file that `choices` maps "@mode" to. In a checkout a changed file is compiled again, and
the last good program stays if it fails.
"""

from __future__ import annotations

import logging
import os
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Any

import moderngl
import numpy as np

from volviz import resources
from volviz.errors import GraphicsError, OutputError, did_you_mean
from volviz.gpu.checked import Gpu

DUMP_VARIABLE = "VOLVIZ_SHADER_DUMP"
NO_CHOICES: Mapping[str, str] = MappingProxyType({})
_log = logging.getLogger(__name__)

_COMMENT = re.compile(r"//[^\n]*|/\*.*?\*/", re.DOTALL)
_INCLUDE = re.compile(r'^\s*#\s*include\b\s*(?:"([^"]+)"\s*$)?')
_VERSION = re.compile(r"^\s*#\s*version\b")
_UNIFORM = re.compile(r"\buniform\s+([^;{]*)([;{])")
# Mesa `0:12(3): error: …`, NVIDIA `0(12) : error C1008: …`, AMD, Intel and Apple `ERROR: 0:12: …`.
_LOG_LINE = re.compile(
    r"^\s*(?:(?P<level>ERROR|WARNING):\s*)?\d+(?::(?P<a>\d+)(?:\(\d+\))?|\((?P<b>\d+)\))\s*:\s*"
    r"(?P<message>.*)$"
)


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


def stitch(name: str, choices: Mapping[str, str] = NO_CHOICES, root: Path | None = None) -> Source:
    """The text of a shader with its includes resolved.

    name: file relative to shaders/ (or `root`); its first line is `#version 330 core`. choices:
    "@mode" -> "raycast/modes/mip.glsl". Raises GraphicsError naming file and line for a missing
    file, a path outside the folder, or an `@name` that nothing was chosen for.
    """
    return _stitch(name, choices, root, {})


def _stitch(
    name: str, choices: Mapping[str, str], root: Path | None, stamps: dict[Path, int]
) -> Source:
    work = _Stitcher((root or resources.shader_dir()).resolve(), choices, stamps)
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
        self.stamps[path] = _stamp(path)
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


# --- programs --------------------------------------------------------------------------------


@dataclass
class _Entry:
    """A compiled program, what it came from, and the failure of the last reload, if any."""

    program: moderngl.Program
    stamps: dict[Path, int]
    error: str | None = None

    def changed(self) -> bool:
        """True in a checkout when a file is not as it was when it was read."""
        if resources.checkout() is None:
            return False
        return any(_stamp(path) != stamp for path, stamp in self.stamps.items())


def program(
    gpu: Gpu,
    vertex: str,
    fragment: str,
    choices: Mapping[str, str] = NO_CHOICES,
    *,
    root: Path | None = None,
) -> moderngl.Program:
    """The program of two shader files, compiled once per Gpu and choices.

    In a checkout the files are looked at on each call: after a change the new program comes back
    (another object, so vertex arrays are to be made again), or the last good one if it fails,
    with the error logged once and listed by `reload_errors`. Raises GraphicsError naming file
    and line if it does not compile the first time.
    """
    key = (vertex, fragment, tuple(sorted(choices.items())), root)
    entry: _Entry | None = gpu.owned.programs.get(key)
    if entry is not None and not entry.changed():
        return entry.program
    stamps: dict[Path, int] = {}
    try:
        sources = {
            "vertex_shader": _stitch(vertex, choices, root, stamps),
            "fragment_shader": _stitch(fragment, choices, root, stamps),
        }
        _dump_if_asked(sources.values(), choices)
        made = _compile(gpu, sources)
    except GraphicsError as error:
        if entry is None:
            raise
        entry.stamps, entry.error = {**entry.stamps, **stamps}, str(error)
        _log.error("%s (the last good program stays)", error)
        return entry.program
    gpu.owned.programs[key] = _Entry(made, stamps)
    return made


def reload_errors(gpu: Gpu) -> list[str]:
    """One line for each program whose changed files do not compile, for a red box."""
    return [entry.error for entry in gpu.owned.programs.values() if entry.error]


def _compile(gpu: Gpu, sources: Mapping[str, Source]) -> moderngl.Program:
    gpu.activate()
    gpu.check("a call before compiling")
    try:
        made = gpu.ctx.program(
            vertex_shader=sources["vertex_shader"].text,
            fragment_shader=sources["fragment_shader"].text,
        )
    except moderngl.Error as error:
        gpu.check("compiling")
        raise explain(str(error), sources) from error
    gpu.check(f"compiling {', '.join(source.name for source in sources.values())}")
    made.extra = frozenset().union(*(source.uniforms for source in sources.values()))
    return made


def explain(log: str, sources: Mapping[str, Source]) -> GraphicsError:
    """A compiler or linker log as a GraphicsError that names our file and line.

    sources: by the stage names that moderngl heads its log with. The first error makes the
    message, with its source line; the whole rewritten log is attached as a note.
    """
    source: Source | None = next(iter(sources.values()), None)
    rewritten: list[str] = []
    errors: list[tuple[str, str]] = []
    for line in log.splitlines():
        source = sources.get(line.strip(), source)
        match = _LOG_LINE.match(line)
        if match is None or source is None:
            rewritten.append(line)
            continue
        number = int(match["a"] or match["b"])
        message = _message(match)
        file, at = source.where(number)
        rewritten.append(f"{file}:{at}: {message}")
        if not message.lower().startswith("warning"):
            code = source.text.split("\n")[min(number, len(source.lines)) - 1].strip()
            errors.append((f"{file}:{at}", f"{message} in: {code}"))
    names = ", ".join(f"shaders/{s.name}" for s in sources.values())
    where, what = errors[0] if errors else (names, " ".join(log.split()))
    more = f" (and {len(errors) - 1} more)" if len(errors) > 1 else ""
    error = GraphicsError(what + more, file=where)
    error.add_note("\n".join(rewritten))
    return error


def _message(match: re.Match[str]) -> str:
    message = match["message"].strip()
    level = match["level"]
    return f"{level.lower()}: {message}" if level else message


# --- uniforms --------------------------------------------------------------------------------

# The last letter of moderngl's format of a uniform -> its numpy type.
_KINDS: dict[str, type[np.generic]] = {
    "f": np.float32,
    "d": np.float64,
    "i": np.int32,
    "I": np.uint32,
}

# GL's names of the matrix types -> (columns, rows).
_MATRICES = {
    0x8B5A: (2, 2),
    0x8B5B: (3, 3),
    0x8B5C: (4, 4),
    0x8B65: (2, 3),
    0x8B66: (2, 4),
    0x8B67: (3, 2),
    0x8B68: (3, 4),
    0x8B69: (4, 2),
    0x8B6A: (4, 3),
}


def set_uniforms(program: moderngl.Program, **values: Any) -> None:
    """Set uniforms by name: numbers, sequences, numpy arrays, texture units, block bindings.

    A matrix is given as numpy has it, value[row, column]; `m * v` in GLSL is then `value @ v`.
    A name that no source declares is a ValueError (a typo must fail); one that the compiler
    dropped because nothing reads it is ignored. ValueError for a wrong size or kind.
    """
    for name, value in values.items():
        member: Any = program.get(name, None)
        if member is None:
            declared: frozenset[str] = program.extra or frozenset(program)
            if re.split(r"[.\[]", name)[0] not in declared:
                raise ValueError(f"no uniform '{name}' is declared; {did_you_mean(name, declared)}")
        elif isinstance(member, moderngl.Uniform):
            member.write(_packed(name, member, value))
        else:
            member.binding = int(value)


def _packed(name: str, member: Any, value: Any) -> bytes:
    """The bytes of a uniform. member: moderngl.Uniform, whose stubs lack fmt and gl_type."""
    letter = member.fmt[-1]
    kind = _KINDS[letter]
    matrix = _MATRICES.get(member.gl_type)
    shape: tuple[int, ...] = ()
    if matrix is not None:
        shape = (matrix[1], matrix[0])
    elif member.dimension > 1:
        shape = (member.dimension,)
    if member.array_length > 1:
        shape = (member.array_length, *shape)
    given = np.asarray(value)
    if given.shape != shape or given.dtype.kind not in ("biuf" if letter in "fd" else "biu"):
        raise ValueError(
            f"uniform '{name}' takes {kind.__name__} of shape {shape}, "
            f"not {given.dtype} of shape {given.shape}"
        )
    if matrix is not None:
        given = given.swapaxes(-1, -2)
    return np.ascontiguousarray(given, dtype=kind).tobytes()


# --- files -----------------------------------------------------------------------------------


def _blank_comments(text: str) -> str:
    """The text with comments replaced by blanks, line for line."""
    return _COMMENT.sub(lambda match: re.sub(r"[^\n]", " ", match[0]), text)


def _shown(name: str, line: int) -> str:
    return f"shaders/{name}:{line}"


def _stamp(path: Path) -> int:
    """mtime in ns, -1 where the file is gone (an editor may be replacing it right now)."""
    try:
        return path.stat().st_mtime_ns
    except OSError:
        return -1


def _dump_if_asked(sources: Iterable[Source], choices: Mapping[str, str]) -> None:
    folder = os.environ.get(DUMP_VARIABLE)
    if not folder:
        return
    suffix = "".join(f"-{Path(path).stem}" for _, path in sorted(choices.items()))
    for source in sources:
        main = Path(source.name)
        source.dump(Path(folder) / f"{main.with_suffix('').name}{suffix}{main.suffix}")
