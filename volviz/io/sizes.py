"""How many bytes an array needs, checked against the limit before anything is allocated."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence

import numpy as np
from numpy.typing import DTypeLike

from volviz.errors import InputError, LimitError
from volviz.io.options import Limits, ReadOptions
from volviz.text import binary_size

MAX_AXIS = 2**31 - 1


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
