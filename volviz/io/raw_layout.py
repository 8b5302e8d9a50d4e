"""What a RAW file's name says of its layout, and which layouts its size would fit."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from volviz.io.dtypes import COMMON, SAMPLE_TYPES, sample_type

Dims = tuple[int, int, int]
_DIMS = re.compile(r"(\d{1,7})\s*[x×]\s*(\d{1,7})\s*[x×]\s*(\d{1,7})", re.IGNORECASE)
_WORDS = re.compile(r"[a-z]+\d*|\d+bits?", re.IGNORECASE)
_BIG = {"be", "big", "bigendian", "msb"}
_LITTLE = {"le", "little", "littleendian", "lsb"}
_WEAK = {
    "real",
    "word",
    "single",
    "byte",
    "long",
    "char",
    "half",
    "int",
    "short",
    "double",
    "float",
}
_SUGGESTED = 5
GUESS = {1: "uint8", 2: "uint16", 4: "float32", 8: "float64"}
"""The type that is assumed from the bytes per voxel where nobody says it."""


@dataclass(frozen=True)
class NameLayout:
    """What a file name says; None where it says nothing."""

    dims: Dims | None = None
    dtype: np.dtype[Any] | None = None
    endian: str | None = None


def layout_from_name(name: str) -> NameLayout:
    """Shape, type and byte order out of a name such as `foot_256x256x256_uint8_be.raw`."""
    found = _DIMS.search(name)
    dims = None
    if found is not None:
        x, y, z = (int(n) for n in found.groups())
        dims = (x, y, z) if min(x, y, z) > 0 else None
    rest = _DIMS.sub(" ", name).lower()
    words = [w.removesuffix("s") if w.endswith("bits") else w for w in _WORDS.findall(rest)]
    joined = [a + b for a, b in pairwise(words)]
    # Words of everyday language name a type only where a shape stands beside them.
    types = [w for w in (*joined, *words) if w in SAMPLE_TYPES and (dims or w not in _WEAK)]
    dtype = sample_type(types[0]) if types else None
    endian = "big" if _BIG & {*words} else "little" if _LITTLE & {*words} else None
    return NameLayout(dims, dtype, endian)


def fitting_layouts(nbytes: int, dims: Dims | None, dtype: np.dtype[Any] | None) -> list[str]:
    """Layouts that a file of this size fits exactly, the likeliest first, as text."""
    found: list[str] = []
    for text in _candidates(nbytes, dims, dtype):
        if text not in found:
            found.append(text)
        if len(found) == _SUGGESTED:
            break
    return found


def _candidates(nbytes: int, dims: Dims | None, dtype: np.dtype[Any] | None) -> Iterator[str]:
    sizes = {np.dtype(n).itemsize: n for n in reversed(COMMON)}
    if dims is not None:
        count = math.prod(dims)
        if nbytes % count == 0 and nbytes // count in sizes:
            names = [n for n in COMMON if np.dtype(n).itemsize == nbytes // count]
            yield from (_text(dims, n) for n in names[:3])
        widths = [dtype.itemsize] if dtype is not None else sorted(sizes)
        for width in widths:
            name = dtype.name if dtype is not None else sizes[width]
            for axis in range(2, -1, -1):
                others = math.prod(n for k, n in enumerate(dims) if k != axis) * width
                if nbytes % others == 0 and 0 < nbytes // others < 1 << 20:
                    changed = [*dims]
                    changed[axis] = nbytes // others
                    yield _text((changed[0], changed[1], changed[2]), name)
    for width in [dtype.itemsize] if dtype is not None else []:
        yield from _cubes(nbytes, width, dtype.name if dtype is not None else "")
    for width, name in sorted(sizes.items()):
        yield from _cubes(nbytes, width, name)
    for width, name in sorted(sizes.items()):
        yield from _square_slices(nbytes, width, name)


def _cubes(nbytes: int, width: int, name: str) -> Iterator[str]:
    if nbytes % width:
        return
    side = round((nbytes // width) ** (1 / 3))
    if side > 1 and side**3 * width == nbytes:
        yield _text((side, side, side), name)


def _square_slices(nbytes: int, width: int, name: str) -> Iterator[str]:
    """Slices of the usual sizes, as many as fit."""
    for side in (512, 256, 1024, 128, 2048, 64):
        count, rest = divmod(nbytes, side * side * width)
        if not rest and 8 <= count <= 4 * side:
            yield _text((side, side, count), name)


def _text(dims: Dims, name: str) -> str:
    return f"{dims[0]}x{dims[1]}x{dims[2]} {name}"
