"""The text of an NRRD header: lines, fields and keys, bounded; values parsed by pynrrd.

http://teem.sourceforge.net/nrrd/format.html. `nrrd.read_header` gets one field at a time, so that
a bad value is blamed on its field and line; it never sees a file, a list of files or a key/value
pair, which it would confuse.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BufferedReader, RawIOBase
from pathlib import Path
from typing import Any, BinaryIO, cast

from volviz.errors import InputError, UnsupportedError, safe_text
from volviz.io.options import Limits
from volviz.io.payload import open_regular

_MAGIC = re.compile(r"NRRD(\d{4})$")
_MOST_LINES = 120_000
_MOST_VALUE = 1 << 16
_SYNONYM = {
    "datafile": "data file",
    "lineskip": "line skip",
    "byteskip": "byte skip",
    "axismins": "axis mins",
    "axismaxs": "axis maxs",
    "centers": "centerings",
    "oldmin": "old min",
    "oldmax": "old max",
    "sampleunits": "sample units",
    "spaceunits": "space units",
    "spaceorigin": "space origin",
    "spacedirections": "space directions",
    "spacedimension": "space dimension",
}


@dataclass
class NrrdHeader:
    """fields and lines: text and line number by canonical field name; keys: key/value pairs.

    names: what follows `data file: LIST`. data_offset: where attached data begin, None if the
    file ends with the header.
    """

    path: Path
    fields: dict[str, str] = field(default_factory=dict)
    lines: dict[str, int] = field(default_factory=dict)
    keys: dict[str, str] = field(default_factory=dict)
    comments: list[str] = field(default_factory=list)
    names: list[str] = field(default_factory=list)
    data_offset: int | None = None

    def value(self, name: str) -> Any:
        """The value as pynrrd parses it, None if the header lacks the field. Raises InputError."""
        text = self.fields.get(name)
        if text is None:
            return None
        if len(text) > _MOST_VALUE:
            raise self.error(name, f"{len(text)} characters are no sensible value")
        import nrrd
        import numpy as np

        tight = re.sub(r"\s*,\s*", ",", text)
        tight = re.sub(r"\(\s+|\s+\)", lambda m: m.group().strip(), tight).replace(")(", ") (")
        try:
            with np.errstate(all="ignore"):
                return nrrd.read_header(["NRRD0005", f"{name}: {tight}"])[name]
        except (nrrd.NRRDError, ValueError, IndexError, OverflowError, KeyError) as error:
            raise self.error(name, f"cannot read '{safe_text(text, 60)}'") from error

    def required(self, name: str) -> str:
        """The text of a field that must be there."""
        if name not in self.fields:
            raise InputError(
                f"the header has no field '{name}'",
                file=self.path,
                field=name,
                fix=f"add a line '{name}: …' to the header",
            )
        return self.fields[name]

    def error(self, name: str, what: str, fix: str = "correct the header") -> InputError:
        """An InputError that names the field and its line."""
        line = self.lines.get(name)
        where = f"line {line}: " if line else ""
        return InputError(where + what, file=self.path, field=name, fix=fix)

    def for_display(self) -> dict[str, str]:
        """The whole header as text."""
        shown = dict(self.fields)
        if self.names:
            shown["data files"] = "\n".join(self.names)
        for key, value in self.keys.items():
            shown[key if key not in shown else f"{key} :="] = value
        if self.comments:
            shown["comments"] = "\n".join(self.comments)
        return shown


def read_nrrd_header(path: Path, limits: Limits) -> NrrdHeader:
    """Read the header only. Raises InputError, or UnsupportedError for a later version."""
    header = NrrdHeader(path)
    with BufferedReader(cast(RawIOBase, open_regular(path)), 1 << 16) as file:
        _check_magic(path, file.readline(64))
        for number, line in enumerate(_lines(path, file, limits), start=2):
            if line is None:
                header.data_offset = file.tell()
                break
            _take(header, line, number)
    return header


def _check_magic(path: Path, line: bytes) -> None:
    found = _MAGIC.match(line.decode("latin-1").rstrip())
    if found is None:
        raise InputError(
            "the file does not begin with NRRD000x",
            file=path,
            field="magic",
            fix="check that it is an NRRD file",
        )
    if int(found.group(1)) > 5:
        raise UnsupportedError(
            f"NRRD version {int(found.group(1))}",
            file=path,
            field="magic",
            fix="save it as NRRD0005",
        )


def _lines(path: Path, file: BinaryIO, limits: Limits) -> Iterator[str | None]:
    """The lines after the magic as text, None for the blank one that ends the header."""
    left = limits.max_header
    for _ in range(_MOST_LINES):
        line = file.readline(left)
        left -= len(line)
        if not line:
            return
        if left <= 0:
            break
        text = _decode(line).rstrip()
        if not text:
            yield None
            return
        yield text
    raise InputError(
        "the header does not end", file=path, field="header", fix="a blank line must end it"
    )


def _decode(line: bytes) -> str:
    try:
        return line.decode("utf-8")
    except UnicodeDecodeError:
        return line.decode("cp1252", "replace")


def _take(header: NrrdHeader, line: str, number: int) -> None:
    """Put one line where it belongs."""
    if line.startswith("#"):
        header.comments.append(line[1:].strip())
        return
    if _is_list(header.fields.get("data file", "")):
        header.names.append(line.strip())
        return
    name, colon, rest = line.partition(":")
    if not colon:
        raise InputError(
            f"line {number}: '{safe_text(line, 60)}' is neither a field nor a key",
            file=header.path,
            field="header",
            fix="write 'field: value' or 'key:=value'",
        )
    if rest.startswith("="):
        header.keys[name.strip()] = _unescape(rest[1:].strip())
        return
    canonical = " ".join(name.lower().split())
    canonical = _SYNONYM.get(canonical, canonical)
    if canonical in header.fields:
        raise InputError(
            f"lines {header.lines[canonical]} and {number} both give '{canonical}'",
            file=header.path,
            field=canonical,
            fix="delete one of them",
        )
    header.fields[canonical] = rest.strip()
    header.lines[canonical] = number


def _is_list(text: str) -> bool:
    return text.split()[:1] == ["LIST"]


def _unescape(text: str) -> str:
    return re.sub(r"\\([n\\])", lambda m: "\n" if m.group(1) == "n" else "\\", text)
