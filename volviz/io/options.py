"""What a reader is told besides the path, and the limits that hold for untrusted files."""

from __future__ import annotations

import os
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from volviz.progress import Progress, silent

GIB = 1 << 30


def default_max_bytes() -> int:
    """Half of the machine's memory, at most 16 GiB."""
    try:
        memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (ValueError, OSError, AttributeError):
        memory = 8 * GIB
    return min(memory // 2, 16 * GIB)


@dataclass(frozen=True)
class Limits:
    """Bounds checked before memory is taken. max_bytes: voxels; max_header: text of a header."""

    max_bytes: int = field(default_factory=default_max_bytes)
    max_header: int = 16 << 20
    max_files: int = 100_000


@dataclass(frozen=True)
class ReadOptions:
    """The user's choices for reading one file.

    series: DICOM series to take, its number in the list, or (part of) its UID or description.
    time, channel: which one of a file that has several. shape: x, y, z for RAW; dtype: numpy
    name, e.g. "uint16"; endian: "little" or "big"; offset: bytes before the RAW voxels; spacing:
    x, y, z in mm, overrides the file's. allow_outside: a folder besides the header's own from
    which detached data may come.
    """

    series: str | None = None
    time: int = 0
    channel: int = 0
    shape: tuple[int, int, int] | None = None
    dtype: str | None = None
    endian: str | None = None
    offset: int | None = None
    spacing: tuple[float, float, float] | None = None
    allow_outside: Path | None = None
    limits: Limits = field(default_factory=Limits)
    progress: Progress = field(default_factory=silent)

    def chosen(self) -> tuple[tuple[str, Any], ...]:
        """What was chosen besides the defaults, as (name, value), fit for a scene file."""
        given = [(name, getattr(self, name)) for name in CHOICES]
        return tuple((name, value) for name, value in given if value != _DEFAULTS[name])


CHOICES = ("series", "time", "channel", "shape", "dtype", "endian", "offset", "spacing")
_DEFAULTS = {f.name: f.default for f in fields(ReadOptions) if f.name in CHOICES}
