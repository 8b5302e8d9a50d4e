"""Where the voxels of an NRRD lie: in the header's own file, in another, in a list or a pattern.

http://teem.sourceforge.net/nrrd/format.html, sections 3 (detached headers) and 4 (line and byte
skip: lines are skipped as stored, bytes as decoded).
"""

from __future__ import annotations

import math
import re
from dataclasses import replace

from volviz.errors import InputError
from volviz.io.detached import expand_pattern
from volviz.io.nrrd_header import NrrdHeader
from volviz.io.options import Limits, ReadOptions
from volviz.io.payload import Part, open_regular, resolve_sibling


def parts_of(
    header: NrrdHeader,
    sizes: tuple[int, ...],
    *,
    total: int,
    encoding: str,
    options: ReadOptions,
) -> tuple[Part, ...]:
    """The parts in order. total: decoded bytes of all. Raises InputError."""
    names = _names(header, sizes, options.limits)
    if names is None:
        if header.data_offset is None:
            raise InputError(
                "the file ends with its header; there are no voxels",
                file=header.path,
                field="data",
                fix="the file is cut off, or lacks a 'data file' field",
            )
        return (_skipped(header, Part(header.path, header.data_offset, total), encoding, options),)
    parts = []
    for name in names:
        where = resolve_sibling(
            header.path, name, field="data file", allow_outside=options.allow_outside
        )
        part = Part(where, 0, total // len(names))
        parts.append(_skipped(header, part, encoding, options))
    return tuple(parts)


def _names(header: NrrdHeader, sizes: tuple[int, ...], limits: Limits) -> list[str] | None:
    """The names of detached data files, None for attached data."""
    text = header.fields.get("data file")
    if text is None:
        return None
    if len(text) > 4096:
        raise header.error("data file", f"{len(text)} characters are no name of a file")
    words = text.split()
    pattern = re.fullmatch(r"(.*%.*?)((?:\s+[-+]?\d+){3,4})", text)
    if words[:1] == ["LIST"]:
        names, subdim = header.names, words[1:]
    elif pattern is not None:
        first, last, step, *subdim = pattern.group(2).split()
        names = expand_pattern(
            pattern.group(1).strip(),
            int(first),
            int(last),
            int(step),
            file=header.path,
            field="data file",
            most=limits.max_files,
        )
    else:
        return [text]
    _check_count(header, sizes, len(names), subdim)
    if len(names) > limits.max_files:
        raise header.error("data file", f"{len(names)} files are more than {limits.max_files}")
    return names


def _check_count(header: NrrdHeader, sizes: tuple[int, ...], count: int, subdim: list[str]) -> None:
    """The number of files must fit the sizes: each holds the first `subdim` axes."""
    dimension = len(sizes)
    if len(subdim) > 1 or (subdim and not re.fullmatch(r"\d{1,2}", subdim[0])):
        raise header.error("data file", f"'{' '.join(subdim)[:30]}' is no number of axes")
    axes = int(subdim[0]) if subdim else dimension - 1
    if not 1 <= axes <= dimension and (axes or dimension > 1):
        raise header.error("data file", f"a file of {axes} axes in data of {dimension}")
    needed = math.prod(sizes[axes:])
    split = axes == dimension and count > 0 and sizes[-1] % count == 0
    if not split and count != needed:
        raise header.error(
            "data file",
            f"{count} files, but the sizes ask for {needed}",
            "list every file, or correct the sizes",
        )


def _skipped(header: NrrdHeader, part: Part, encoding: str, options: ReadOptions) -> Part:
    """The part moved on by `line skip` and `byte skip`."""
    lines, count = header.value("line skip") or 0, header.value("byte skip") or 0
    size = part.path.stat().st_size
    if lines < 0 or lines > size:
        raise header.error("line skip", f"{lines} lines cannot be skipped")
    if count < -size or (count > size and encoding in ("raw", "ascii", "hex")):
        raise header.error("byte skip", f"{count} bytes cannot be skipped in a file of {size}")
    if lines:
        part = replace(part, offset=_after_lines(header, part, lines, options.limits))
    if count >= 0 and encoding in ("gzip", "bzip2"):
        return replace(part, skip=count)
    if count >= 0:
        return replace(part, offset=part.offset + count)
    if encoding == "raw":
        offset, found = size - part.nbytes + count + 1, size - part.offset
        if offset < part.offset:
            what = (
                f"expected {part.nbytes} bytes, found {found} ({100 * found / part.nbytes:.3g} %)"
            )
            fix = "the file is cut off or its header is wrong: copy it again"
            raise InputError(what, file=part.path, field="data", fix=fix)
        return replace(part, offset=offset)
    if count == -1 and encoding in ("gzip", "bzip2"):
        return replace(part, skip=-1)
    raise header.error("byte skip", f"{count} is only for raw data")


def _after_lines(header: NrrdHeader, part: Part, lines: int, limits: Limits) -> int:
    """The offset in the file after this many lines, found in blocks."""
    left, at = lines, part.offset
    with open_regular(part.path, field="data file") as file:
        file.seek(at)
        while left and at - part.offset <= limits.max_header:
            block = file.read(1 << 16)
            if not block:
                break
            ends = [m.end() for m in re.finditer(b"\n", block)][:left]
            left -= len(ends)
            at += ends[-1] if ends and not left else len(block)
    if left:
        raise header.error("line skip", f"the file has no {lines} lines to skip")
    return at
