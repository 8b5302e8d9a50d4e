"""NRRD files by hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np

ARRAY = (np.arange(4 * 5 * 6).reshape(4, 5, 6) % 120).astype("<i2")


def write(
    path: Path, header: str, payload: bytes = b"", *, end: str = "\n", end_blank: bool = True
) -> Path:
    """An attached NRRD of these header lines, plus `end` as line ends."""
    lines = ["NRRD0004", *(line.strip() for line in header.strip().splitlines())]
    path.write_bytes((end.join(lines) + end + end * end_blank).encode() + payload)
    return path


def simple(array: np.ndarray, more: str = "", encoding: str = "raw") -> str:
    """Header lines for `array[z, y, x]`."""
    names = {
        "i1": "int8",
        "u1": "uchar",
        "i2": "short",
        "u2": "ushort",
        "i4": "int",
        "f4": "float",
        "f8": "double",
    }
    endian = "big" if array.dtype.byteorder == ">" else "little"
    return f"""type: {names.get(array.dtype.str[1:], array.dtype.name)}
        dimension: {array.ndim}
        sizes: {" ".join(map(str, array.shape[::-1]))}
        endian: {endian}
        encoding: {encoding}
        {more}""".rstrip()
