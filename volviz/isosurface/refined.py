"""A volume resampled between its samples, but only where it is asked for.

The refined lattice has m steps to a cell along each axis, so that sample i lies at i / m; values
between samples are trilinear. A value never leaves the range of its neighbours (rounding would
let it), so that a cell that the surface does not meet has no refined cell that it meets.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volviz.errors import LimitError
from volviz.fields.statistics import padding_value
from volviz.isosurface.active import Floats, Ids
from volviz.isosurface.kernel import threshold
from volviz.model.volume import Volume

MOST = 1 << 26  # refined cells that are worked at; each makes some tens of bytes of mesh


@dataclass(frozen=True, eq=False)
class Refined:
    """factors: steps per cell along x, y, z."""

    volume: Volume
    isovalue: float
    factors: tuple[int, int, int]

    @classmethod
    def to_size(cls, volume: Volume, isovalue: float, size: float) -> Refined:
        """Steps of at most `size` mm; 0: the volume's own."""
        steps = [1 if size <= 0 else int(np.ceil(s / size - 1e-9)) for s in volume.spacing]
        a, b, c = (max(1, s) for s in steps)
        return cls(volume, isovalue, (a, b, c))

    @property
    def shape(self) -> tuple[int, int, int]:
        """Samples along z, y, x."""
        z, y, x = (
            (n - 1) * m + 1 for n, m in zip(self.volume.data.shape, self.factors[::-1], strict=True)
        )
        return z, y, x

    @property
    def affine(self) -> Floats:
        """float64[4, 4]: refined index to world mm."""
        scale = np.diag([*(1 / m for m in self.factors), 1.0])
        return np.asarray(self.volume.affine @ scale)

    def check(self, cells: int) -> None:
        """Raise LimitError if so many cells of the volume are too many to be refined."""
        count = cells * int(np.prod(self.factors, dtype=object))
        if count > MOST or np.prod([n + 1 for n in self.shape], dtype=object) > 1 << 58:
            raise LimitError(
                f"{count} refined cells are more than the {MOST} that are worked at",
                field="--size",
                fix="choose a greater size, or a smaller region",
            )

    def cells(self, ids: Ids) -> Ids:
        """Flat numbers of the refined cells that lie in cells of the volume, not sorted."""
        dims = tuple(n - 1 for n in self.volume.data.shape)
        z, y, x = np.unravel_index(ids, dims)
        mx, my, mz = self.factors
        k, j, i = (a.ravel() for a in np.indices((mz, my, mx)))
        fine = (z[:, None] * mz + k, y[:, None] * my + j, x[:, None] * mx + i)
        out = np.ravel_multi_index(fine, tuple(n - 1 for n in self.shape))
        return np.asarray(out, dtype=np.int64).ravel()

    def inside(self, z: Ids, y: Ids, x: Ids) -> NDArray[np.bool_]:
        """Which refined samples are at least the isovalue; those that are not valid are not."""
        data = self.volume.data
        limit = threshold(data.dtype, self.isovalue)
        if self.factors == (1, 1, 1):
            values = data[z, y, x]
            padding = padding_value(self.volume)
            found = values >= limit
            return found if padding is None else found & (values != padding)
        return np.asarray(self.values(z, y, x) >= self.isovalue)

    def values(self, z: Any, y: Any, x: Any) -> Floats:
        """Trilinear values at refined samples; NaN where a sample with a say is not valid."""
        data, padding = self.volume.data, padding_value(self.volume)
        low, part = [], []
        for at, m, n in zip((z, y, x), self.factors[::-1], data.shape, strict=True):
            base = np.minimum(at // m, n - 2)
            low.append(base)
            part.append((at - base * m) / m)
        row = []
        for c in range(8):
            value = data[low[0] + (c >> 2), low[1] + (c >> 1 & 1), low[2] + (c & 1)]
            number = value.astype(np.float64)
            row.append(number if padding is None else np.where(value == padding, np.nan, number))
        for t in part[::-1]:
            row = [between(a, b, t) for a, b in zip(row[::2], row[1::2], strict=True)]
        return row[0]


def between(a: Floats, b: Floats, t: Floats) -> Floats:
    """Linear between a (t = 0) and b (t = 1), never beyond them; exact at the ends."""
    with np.errstate(invalid="ignore"):
        mixed = np.clip((1 - t) * a + t * b, np.minimum(a, b), np.maximum(a, b))
    return np.where(t == 0, a, np.where(t == 1, b, mixed))
