"""Programs from shader files: errors that name our file and line, a cache, reloading, uniforms.

Compiler logs are rewritten with the line map of stitching.py. `reload` compiles changed files
again, and the last good program stays if that fails.
"""

from __future__ import annotations

import logging
import os
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import moderngl
import numpy as np

from volviz.errors import GraphicsError, did_you_mean
from volviz.gpu.checked import Gpu
from volviz.gpu.stitching import NO_CHOICES, Source, stamp, stitch

DUMP_VARIABLE = "VOLVIZ_SHADER_DUMP"
_log = logging.getLogger(__name__)

# Mesa `0:12(3): error: …`, NVIDIA `0(12) : error C1008: …`, AMD, Intel and Apple `ERROR: 0:12: …`.
_LOG_LINE = re.compile(
    r"^\s*(?:(?P<level>ERROR|WARNING):\s*)?\d+(?::(?P<a>\d+)(?:\(\d+\))?|\((?P<b>\d+)\))\s*:\s*"
    r"(?P<message>.*)$"
)


@dataclass
class _Entry:
    """A program, the files it came from, and why the latest of them do not compile, if so.

    program: None if it never compiled.
    """

    program: moderngl.Program | None
    stamps: dict[Path, int]
    error: str | None = None

    def changed(self) -> bool:
        """True when a file is not as it was when it was read."""
        return any(stamp(path) != then for path, then in self.stamps.items())


_Key = tuple[str, str, str | None, tuple[tuple[str, str], ...], Path | None]


def program(
    gpu: Gpu,
    vertex: str,
    fragment: str,
    choices: Mapping[str, str] = NO_CHOICES,
    *,
    geometry: str | None = None,
    root: Path | None = None,
) -> moderngl.Program:
    """The program of two shader files (three with geometry), compiled once per Gpu and choices.

    Raises GraphicsError naming file and line if it does not compile. `reload` compiles changed
    files again; then another object comes back, so vertex arrays are to be made again.
    """
    key: _Key = (vertex, fragment, geometry, tuple(sorted(choices.items())), root)
    entry: _Entry | None = gpu.owned.programs.get(key)
    if entry is not None and entry.program is not None:
        return entry.program
    stamps: dict[Path, int] = {}
    try:
        made = _made(gpu, key, stamps)
    except GraphicsError as error:
        gpu.owned.programs[key] = _Entry(None, stamps, str(error))
        raise
    gpu.owned.programs[key] = _Entry(made, stamps)
    return made


def reload(gpu: Gpu) -> bool:
    """Compile again what comes from changed files; True if there was something, good or not.

    Where that fails the last good program stays, with the error logged once and listed by
    `reload_errors`. It looks at the files' times only: call it twice a second, not per draw.
    """
    found = False
    for key, entry in gpu.owned.programs.items():
        if not entry.changed():
            continue
        found = True
        stamps: dict[Path, int] = {}
        try:
            entry.program, entry.error = _made(gpu, key, stamps), None
            entry.stamps = stamps
        except GraphicsError as error:
            entry.stamps, entry.error = {**entry.stamps, **stamps}, str(error)
            _log.error("%s (the last good program stays)", error)
    return found


def reload_errors(gpu: Gpu) -> list[str]:
    """One line for each cause why changed files do not compile, for a red box."""
    entries = gpu.owned.programs.values()
    return sorted({e.error for e in entries if e.error and e.program is not None})


def _made(gpu: Gpu, key: _Key, stamps: dict[Path, int]) -> moderngl.Program:
    vertex, fragment, geometry, pairs, root = key
    choices = dict(pairs)
    sources = {
        "vertex_shader": stitch(vertex, choices, root, stamps),
        "fragment_shader": stitch(fragment, choices, root, stamps),
    }
    if geometry is not None:
        sources["geometry_shader"] = stitch(geometry, choices, root, stamps)
    _dump_if_asked(sources.values(), choices)
    return _compile(gpu, sources)


def _compile(gpu: Gpu, sources: Mapping[str, Source]) -> moderngl.Program:
    gpu.activate()
    gpu.check("a call before compiling")
    try:
        texts: dict[str, Any] = {stage: source.text for stage, source in sources.items()}
        made = gpu.ctx.program(**texts)
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


def _dump_if_asked(sources: Iterable[Source], choices: Mapping[str, str]) -> None:
    folder = os.environ.get(DUMP_VARIABLE)
    if not folder:
        return
    suffix = "".join(f"-{Path(path).stem}" for _, path in sorted(choices.items()))
    for source in sources:
        main = Path(source.name)
        source.dump(Path(folder) / f"{main.with_suffix('').name}{suffix}{main.suffix}")
