"""How many bytes an array needs, checked against the limit before anything is allocated."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence

import numpy as np
from numpy.typing import DTypeLike

from volviz.errors import InputError, LimitError
from volviz.io.options import Limits, ReadOptions

MAX_AXIS = 2**31 - 1


def binary_size(nbytes: int) -> str:
    """A count of bytes for people: 3.6 PiB, 64 MiB, 512 B."""
    size, units = (
        float(min(nbytes, 1 << 1000)),
        ["B", "KiB", "MiB", "GiB", "TiB", "PiB", "EiB", "ZiB", "YiB"],
    )
    while size >= 1024 and len(units) > 1:
        size /= 1024
        units.pop(0)
    digits = 0 if size >= 100 or size == int(size) else 1
    return f"{size:.{digits}f} {units[0]}"


def check_size(
    dims: Sequence[int],
    dtype: DTypeLike,
    limits: ReadOptions | Limits,
    *,
    file: str | os.PathLike[str],
    field: str,
) -> int:
    """Bytes of an array of these dims (any axis order), checked before anything is allocated.

    Raises InputError for an axis that is no integer in 1 … 2³¹-1, LimitError for more bytes than
    `limits.max_bytes`.
    """
    bounds = limits.limits if isinstance(limits, ReadOptions) else limits
    counts: list[int] = []
    for axis, value in enumerate(dims):
        whole = isinstance(value, (int, np.integer)) and not isinstance(value, (bool, np.bool_))
        if not whole or not 1 <= int(value) <= MAX_AXIS:
            raise InputError(
                f"axis {axis + 1} has {value} samples",
                file=file,
                field=field,
                fix=f"give whole numbers from 1 to {MAX_AXIS}",
            )
        counts.append(int(value))
    nbytes = math.prod(counts) * np.dtype(dtype).itemsize
    if nbytes > bounds.max_bytes:
        raise LimitError(
            f"{' × '.join(map(str, counts))} of {np.dtype(dtype).name} needs "
            f"{binary_size(nbytes)}; the limit is {binary_size(bounds.max_bytes)}",
            file=file,
            field=field,
            fix="raise it with --max-memory if the machine has that much, or check the header",
        )
    return nbytes
