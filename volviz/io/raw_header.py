"""Little text files that describe a RAW file: Inviwo's and Voreen's .dat, and plain JSON.

Keys of the .dat, one `Key: value` a line: RawFile or ObjectFileName, Resolution, Format, and
SliceThickness or Spacing, ByteOffset, ByteOrder, Offset, BasisVector1 … 3. Keys of the JSON: file,
dims (or shape), dtype, byteorder, offset, spacing, origin. Sizes are in x, y, z order.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volviz.errors import InputError, UnsupportedError, safe_text
from volviz.io.dtypes import COMMON, sample_type
from volviz.io.geometry import matrix
from volviz.io.options import Limits

_MAX_TEXT = 1 << 20


@dataclass(frozen=True)
class RawHeader:
    """What a descriptor says.

    fields: its keys in lower case; dims: x, y, z; offset: bytes; spaced: it gives a spacing.
    """

    path: Path
    fields: dict[str, Any]
    file: str
    dims: tuple[int, int, int]
    dtype: np.dtype[Any]
    big: bool
    offset: int
    affine: NDArray[np.float64]
    spaced: bool


def read_raw_header(path: Path, limits: Limits) -> RawHeader:
    """Parse a descriptor. Raises InputError that names the key, UnsupportedError for colours."""
    size = path.stat().st_size
    if size > min(_MAX_TEXT, limits.max_header):
        raise InputError(
            f"{size} bytes are too long for a descriptor", file=path, fix="correct the descriptor"
        )
    text = path.read_bytes().decode("utf-8", "replace")
    fields = _json(text, path) if text.lstrip().startswith("{") else _lines(text)
    dims = _numbers(fields, ("resolution", "dims", "shape"), path, whole=True)
    if dims is None or min(dims) < 1:
        raise InputError(
            "three positive sizes x, y, z are missing",
            file=path,
            field="Resolution",
            fix="correct the descriptor",
        )
    x, y, z = (int(n) for n in dims)
    affine, spaced = _affine(fields, (x, y, z), path)
    return RawHeader(
        path,
        fields,
        _file_name(fields, path),
        (x, y, z),
        _dtype(fields, path),
        _is_big(fields, path),
        _offset(fields, path),
        affine,
        spaced,
    )


def _lines(text: str) -> dict[str, Any]:
    pairs = (line.partition(":") for line in text.splitlines()[:10_000])
    return {
        key.strip().lower(): value.strip()
        for key, colon, value in pairs
        if colon and not key.lstrip().startswith("#")
    }


def _json(text: str, path: Path) -> dict[str, Any]:
    try:
        value = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError("not readable as JSON", file=path, fix="correct the descriptor") from error
    if not isinstance(value, dict):
        raise InputError("no JSON object", file=path, fix="correct the descriptor")
    return {str(k).lower(): v for k, v in value.items()}


def _file_name(fields: dict[str, Any], path: Path) -> str:
    for key in ("rawfile", "objectfilename", "file"):
        if isinstance(fields.get(key), str) and fields[key]:
            return str(fields[key])
    raise InputError(
        "the name of the RAW file is missing",
        file=path,
        field="RawFile",
        fix="correct the descriptor",
    )


def _is_big(fields: dict[str, Any], path: Path) -> bool:
    order = str(fields.get("byteorder", fields.get("endianness", "little"))).strip().lower()
    if order.replace("-", "").removesuffix("endian") not in ("little", "big"):
        raise InputError(
            f"'{safe_text(order, 20)}' is no byte order",
            file=path,
            field="ByteOrder",
            fix="write little or big",
        )
    return order.startswith("big")


def _dtype(fields: dict[str, Any], path: Path) -> np.dtype[Any]:
    model = str(fields.get("objectmodel", "I")).upper()
    if model != "I":
        raise UnsupportedError(
            f"voxels of {safe_text(model, 20)} are not read",
            file=path,
            field="ObjectModel",
            fix="save it with one value per voxel",
        )
    text = str(fields.get("format", fields.get("dtype", "")))
    dtype = sample_type(text)
    if dtype is None:
        raise InputError(
            f"'{safe_text(text, 30)}' is no type",
            file=path,
            field="Format",
            fix=f"one of {', '.join(COMMON)}",
        )
    return dtype


def _offset(fields: dict[str, Any], path: Path) -> int:
    key = "byteoffset" if "byteoffset" in fields else "offset"
    text = fields.get(key, 0)
    if key == "offset" and len(str(text).split()) > 1:
        return 0  # Inviwo's Offset is a position in space
    try:
        value = int(str(text))
    except ValueError:
        value = -1
    if value < 0:
        raise InputError(
            f"'{safe_text(text, 30)}' is no count of bytes",
            file=path,
            field="ByteOffset",
            fix="correct the descriptor",
        )
    return value


def _affine(
    fields: dict[str, Any], dims: tuple[int, int, int], path: Path
) -> tuple[NDArray[np.float64], bool]:
    """Voxel index to world: basis vectors span the whole volume, spacings one voxel."""
    spans = [_numbers(fields, (f"basisvector{k}",), path) for k in (1, 2, 3)]
    if all(s is not None for s in spans):
        steps = np.array(spans, dtype=np.float64).T / np.asarray(dims)
        corner = _numbers(fields, ("offset",), path) or (0.0, 0.0, 0.0)
        return matrix(steps, np.asarray(corner) + steps.sum(axis=1) / 2), True
    spacing = _numbers(fields, ("spacing", "slicethickness"), path)
    origin = _numbers(fields, ("origin",), path) or (0.0, 0.0, 0.0)
    return matrix(np.diag(spacing or (1.0, 1.0, 1.0)), origin), spacing is not None


def _numbers(
    fields: dict[str, Any], keys: tuple[str, ...], path: Path, *, whole: bool = False
) -> tuple[float, float, float] | None:
    """Three finite numbers under the first of the keys that is there."""
    for key in keys:
        if key not in fields:
            continue
        value = fields[key]
        parts = value if isinstance(value, list) else str(value).replace(",", " ").split()
        try:
            x, y, z = (float(str(p)) for p in parts)
        except (ValueError, TypeError, OverflowError):
            x = y = z = math.nan
        good = all(map(math.isfinite, (x, y, z)))
        if not good or (whole and any(n != int(n) for n in (x, y, z))):
            raise InputError(
                f"'{safe_text(value, 40)}' are no three numbers",
                file=path,
                field=key,
                fix="correct the descriptor",
            )
        return x, y, z
    return None
