"""What the histogram cannot tell: how smooth a field is, and how much of a picture it fills."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from volviz.fields.statistics import padding_value, valid_slab
from volviz.model.volume import Volume

_SLICES = 32
_SMALLER = 2.0**-32  # so that sums over slices stay finite; the quotient stays the same


def roughness(volume: Volume, level: float) -> float:
    """Second differences over first ones along x and y, where values exceed `level`.

    Near 0 for smooth computed fields, 0.2 and more for measured ones, 1.7 for white noise;
    infinite where there is nothing to compare. Looks at 32 slices at most.
    """
    second = first = 0.0
    for z in np.unique(np.linspace(0, len(volume.data) - 1, _SLICES).astype(int)):
        plane = _valid_plane(volume, int(z), np.nan) * _SMALLER
        for rows in (plane, plane.T):
            inside = ~np.isnan(rows[2:] + rows[1:-1] + rows[:-2]) & (rows[1:-1] > level * _SMALLER)
            ahead, middle, behind = (part[inside] for part in (rows[2:], rows[1:-1], rows[:-2]))
            second += float(np.abs(ahead / 4 - middle / 2 + behind / 4).sum())
            first += float(np.abs(ahead / 4 - behind / 4).sum())
    return second / first if first > 0 and math.isfinite(second) else math.inf


def coverage_level(volume: Volume, part: float) -> float:
    """The value that is exceeded on `part` of the rays along z, y and x (on average over them).

    −inf if no voxel counts.
    """
    found = [float(np.quantile(m, 1 - part, method="lower")) for m in _largest(volume)]
    finite = [f / 3 for f in found if math.isfinite(f)]
    return sum(finite) * 3 / len(finite) if finite else -math.inf


def _largest(volume: Volume) -> list[NDArray[np.float64]]:
    """float64[y, x], [z, x], [z, y]: the largest value along z, y and x, −inf where none counts."""
    if volume.data.dtype.kind in "iu" and padding_value(volume) is None:
        return [volume.data.max(axis=axis).astype(np.float64) for axis in range(3)]
    z, y, x = volume.info.shape
    along_z, along_y, along_x = (np.full(s, -np.inf) for s in ((y, x), (z, x), (z, y)))
    for k in range(z):
        plane = _valid_plane(volume, k, -np.inf)
        np.maximum(along_z, plane, out=along_z)
        along_y[k], along_x[k] = plane.max(axis=0), plane.max(axis=1)
    return [along_z, along_y, along_x]


def _valid_plane(volume: Volume, z: int, fill: float) -> NDArray[np.float64]:
    """float64[y, x]: a slice with `fill` where voxels don't count."""
    plane = volume.data[z]
    valid = valid_slab(plane, padding_value(volume))
    return np.asarray(np.where(valid, plane, fill), dtype=np.float64)
