"""The text of a MetaImage header: `key = value` lines up to `ElementDataFile`, bounded.

https://itk.org/Wiki/ITK/MetaIO/Documentation. Unknown keys are kept for display and ignored.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BufferedReader, RawIOBase
from pathlib import Path
from typing import BinaryIO, cast

from volviz.errors import InputError, safe_text
from volviz.io.detached import expand_pattern
from volviz.io.options import Limits
from volviz.io.payload import open_regular

_MOST_LINES = 120_000
_MOST_VALUE = 1 << 16
_END = "elementdatafile"


@dataclass
class MetaHeader:
    """fields, spelled and lines: value, key as written and line number by lower-case key.

    names: what follows `ElementDataFile = LIST`. data_offset: where LOCAL data begin.
    """

    path: Path
    fields: dict[str, str] = field(default_factory=dict)
    spelled: dict[str, str] = field(default_factory=dict)
    lines: dict[str, int] = field(default_factory=dict)
    names: list[str] = field(default_factory=list)
    data_offset: int = 0

    def find(self, *keys: str) -> str | None:
        """The first of these keys that the header has, as written."""
        return next((k for k in keys if k.lower() in self.fields), None)

    def text(self, *keys: str) -> str | None:
        """The value under the first of these keys that the header has."""
        key = self.find(*keys)
        return None if key is None else self.fields[key.lower()]

    def required(self, key: str) -> str:
        """The value of a key that must be there."""
        value = self.text(key)
        if value is None:
            raise InputError(
                f"the header has no '{key}'",
                file=self.path,
                field=key,
                fix=f"add a line '{key} = …' before ElementDataFile",
            )
        return value

    def flag(self, *keys: str) -> bool:
        """True for T…, t… or 1, as MetaIO reads it; False without the key."""
        return (self.text(*keys) or "F")[:1] in ("T", "t", "1")

    def numbers(self, count: int, *keys: str) -> list[float] | None:
        """Exactly this many numbers (NaN allowed), None without the key."""
        key = self.find(*keys)
        if key is None:
            return None
        words = (
            self.fields[key.lower()].split() if len(self.fields[key.lower()]) < _MOST_VALUE else []
        )
        try:
            values = [float(word) for word in words]
        except ValueError:
            values = []
        if len(values) != count:
            shown = safe_text(self.fields[key.lower()], 60)
            raise self.error(key, f"'{shown}' are not {count} number{'s' if count > 1 else ''}")
        return values

    def integer(self, key: str, default: int | None = None) -> int:
        """A whole number; without a default the key must be there."""
        text = self.required(key) if default is None else (self.text(key) or str(default))
        if not re.fullmatch(r"[-+]?\d{1,18}", text):
            raise self.error(key, f"'{safe_text(text, 40)}' is no whole number")
        return int(text)

    def error(self, key: str, what: str, fix: str = "correct the header") -> InputError:
        """An InputError that names the key and its line."""
        line = self.lines.get(key.lower())
        where = f"line {line}: " if line else ""
        return InputError(where + what, file=self.path, field=key, fix=fix)

    def for_display(self) -> dict[str, str]:
        """The whole header as text."""
        shown = {self.spelled[key]: value for key, value in self.fields.items()}
        if self.names:
            shown["data files"] = "\n".join(self.names)
        return shown


def read_meta_header(path: Path, limits: Limits) -> MetaHeader:
    """Read the header only. Raises InputError."""
    header = MetaHeader(path)
    with BufferedReader(cast(RawIOBase, open_regular(path)), 1 << 16) as file:
        lines = _lines(header, file, limits)
        for number, line in lines:
            _take(header, line, number)
            if _END in header.fields:
                header.data_offset = file.tell()
                break
        else:
            raise InputError(
                "the header has no 'ElementDataFile'",
                file=path,
                field="ElementDataFile",
                fix="the file is cut off, or is no MetaImage",
            )
        if header.fields[_END].split()[:1] == ["LIST"]:
            header.names = [line.strip() for _, line in lines if line.strip()]
    return header


def _lines(header: MetaHeader, file: BinaryIO, limits: Limits) -> Iterator[tuple[int, str]]:
    left = limits.max_header
    for number in range(1, _MOST_LINES):
        line = file.readline(left)
        left -= len(line)
        if not line:
            return
        if left <= 0:
            break
        try:
            yield number, line.decode("utf-8").rstrip()
        except UnicodeDecodeError:
            yield number, line.decode("cp1252", "replace").rstrip()
    raise InputError(
        "the header does not end",
        file=header.path,
        field="ElementDataFile",
        fix="a line 'ElementDataFile = …' must end it",
    )


def _take(header: MetaHeader, line: str, number: int) -> None:
    key, sign, value = line.partition("=")
    if not sign:
        key, sign, value = line.partition(":")
    key, value = key.strip(), value.strip()
    if not line.strip():
        return
    if not sign or not re.fullmatch(r"[A-Za-z0-9_ .\-]{1,200}", key):
        raise InputError(
            f"line {number}: '{safe_text(line, 60)}' is not 'key = value'",
            file=header.path,
            field="header",
            fix="check that it is a MetaImage header",
        )
    folded = key.lower()
    if folded in header.fields and header.fields[folded] != value and folded != "comment":
        raise InputError(
            f"lines {header.lines[folded]} and {number} both give '{key}'",
            file=header.path,
            field=key,
            fix="delete one of them",
        )
    header.fields[folded], header.spelled[folded] = value, key
    header.lines[folded] = number


def sizes_of(header: MetaHeader) -> tuple[int, ...]:
    """DimSize, fastest axis first, checked against NDims."""
    dimension = header.integer("NDims")
    if not 1 <= dimension <= 10:
        raise header.error("NDims", f"{dimension} is no number of dimensions from 1 to 10")
    tokens = header.required("DimSize").split()
    if len(tokens) != dimension:
        raise header.error("DimSize", f"{len(tokens)} sizes for NDims {dimension}")
    for token in tokens:
        if not re.fullmatch(r"\+?\d{1,30}", token) or int(token) == 0:
            raise header.error("DimSize", f"'{safe_text(token, 30)}' is no positive whole number")
    return tuple(int(token) for token in tokens)


def files_of(header: MetaHeader, sizes: tuple[int, ...], limits: Limits) -> list[str]:
    """Names of the data files, as many as the sizes ask for; an empty list means LOCAL."""
    text = header.fields[_END]
    words = text.split()
    if len(text) > 4096 or not words:
        raise header.error("ElementDataFile", f"'{safe_text(text, 40)}' is no name of a file")
    if text in ("LOCAL", "Local", "local"):
        return []
    axes = len(sizes) - 1
    if words[0] == "LIST":
        names = header.names
        depth = words[1].removesuffix("D") if len(words) > 1 else str(axes)
        axes = int(depth) if re.fullmatch(r"\d{1,2}", depth) else -1
        if not 0 <= axes <= len(sizes):
            raise header.error("ElementDataFile", f"'{words[1]}' is no number of axes of a file")
    elif "%" in words[0] and len(words) > 1:
        names = _pattern(header, words, sizes[-1], limits)
    else:
        return [text]
    needed = math.prod(sizes[axes:])
    if len(names) != needed or len(names) > limits.max_files:
        raise header.error(
            "ElementDataFile",
            f"{len(names)} files, but DimSize asks for {needed}",
            "list every file, or correct DimSize",
        )
    return names


def _pattern(header: MetaHeader, words: list[str], count: int, limits: Limits) -> list[str]:
    first, last, step = _range(header, words[1:], count)
    return expand_pattern(
        words[0],
        first,
        last,
        step,
        file=header.path,
        field="ElementDataFile",
        most=limits.max_files,
    )


def _range(header: MetaHeader, words: list[str], count: int) -> tuple[int, int, int]:
    """First, last and step of a pattern; a step that is not given follows from the count."""
    if not all(re.fullmatch(r"[-+]?\d{1,9}", word) for word in words) or len(words) > 3:
        raise header.error("ElementDataFile", f"'{' '.join(words)[:40]}' is not 'first last step'")
    first, *more = (int(word) for word in words)
    last = more[0] if more else first + count - 1
    step = more[1] if len(more) > 1 else max((last - first) // max(count - 1, 1), 1)
    return first, last, step
