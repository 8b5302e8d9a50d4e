"""A RAW file that nothing describes: what is to be asked, and what its size fits."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from volviz.errors import UsageError, VolvizError
from volviz.io import sniff
from volviz.io.dtypes import COMMON
from volviz.io.raw_layout import fitting_layouts

TYPES = COMMON
ORDERS = ("little", "big")
Dims = tuple[int, int, int]


@dataclass
class RawAnswer:
    """How the voxels are stored. dims: x, y, z. offset: bytes before them. spacing: mm."""

    dims: Dims = (1, 1, 1)
    dtype: str = "uint8"
    endian: str = "little"
    offset: int = 0
    spacing: tuple[float, float, float] = (1.0, 1.0, 1.0)

    @property
    def nbytes(self) -> int:
        """Bytes that such a file has."""
        return math.prod(self.dims) * np.dtype(self.dtype).itemsize + self.offset

    def choices(self) -> dict[str, Any]:
        """Fields of `ReadOptions`."""
        return {
            "shape": self.dims,
            "dtype": self.dtype,
            "endian": self.endian,
            "offset": self.offset,
            "spacing": self.spacing,
        }


@dataclass(frozen=True)
class RawQuestion:
    """path: the file. size: its bytes, None where it is packed. wrong: what was said against the
    answer before. guesses: shapes and types that it fits."""

    path: Path
    size: int | None
    wrong: str
    guesses: tuple[tuple[Dims, str], ...]


def raw_question(error: VolvizError) -> RawQuestion | None:
    """The question that an error of opening asks; None where it is no such error."""
    layout = isinstance(error, UsageError) and error.field in ("shape", "dtype", "offset")
    if not layout or error.file is None or not Path(error.file).is_file():
        return None
    path = Path(error.file)
    if sniff.is_gzip(path):
        return RawQuestion(path, None, error.what, ())
    size = path.stat().st_size
    return RawQuestion(path, size, error.what, tuple(_guesses(size)))


def _guesses(size: int) -> list[tuple[Dims, str]]:
    found = []
    for text in fitting_layouts(size, None, None):
        shape, dtype = text.split()
        x, y, z = (int(n) for n in shape.split("x"))
        found.append(((x, y, z), dtype))
    return found
