"""Normals of the volume itself at any points: for surfaces whose own triangles say little.

Shading by the gradient of the values ("gray-level gradient shading"): Höhne and Bernstein 1986.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from volviz.fields.statistics import padding_value
from volviz.isosurface.active import Floats, corner_samples, to_world
from volviz.isosurface.classified import placing
from volviz.isosurface.extractors.dividing_cubes import slopes_of, valid_bits
from volviz.isosurface.marching import EMPTY
from volviz.isosurface.slopes import OPERATORS
from volviz.model.volume import Volume
from volviz.progress import Progress

CHUNK = 1 << 17


def gradient_normals(
    volume: Volume,
    points: Floats,
    spare: NDArray[np.float32],
    operator: str,
    *,
    some_invalid: bool,
    report: Progress,
) -> NDArray[np.float32]:
    """float32[n, 3]: unit vectors to lower values at points (float64[n, 3], world mm), trilinear
    between the gradients of samples; `spare` (unit vectors, roughly those) where there is no
    slope, one to the other side, or a sample that is not valid. operator: a key of
    `slopes.OPERATORS` but "none"."""
    to_index: Floats = np.asarray(np.linalg.inv(volume.affine), np.float64)
    to_gradient = np.array(placing(volume, operator).gradients).reshape(3, 3)
    valid = valid_bits(volume, report.part(0, 0.1)) if some_invalid else EMPTY
    out, last = spare.copy(), np.array(volume.dims) - 1
    for start in range(0, len(points), CHUNK):
        report(0.1 + 0.9 * start / len(points), "normals")
        part = slice(start, start + CHUNK)
        index = np.clip(to_world(to_index, points[part]), 0, last)
        cell = np.minimum(index.astype(np.int64), last - 1)
        x, y, z = cell.T
        cells = (z * last[1] + y) * last[0] + x
        samples = corner_samples(volume.data.shape, cells)
        known, where = np.unique(samples, return_inverse=True)
        rises = np.empty((known.size, 3))
        slopes_of(volume.data, valid, known, OPERATORS[operator], rises)
        rises[_invalid(volume, known)] = np.nan
        t = index - cell
        total = np.zeros((len(t), 3))
        for corner, own in enumerate(where.reshape(samples.shape).T):
            share = np.ones(len(t))
            for axis in range(3):
                share *= t[:, axis] if corner >> axis & 1 else 1 - t[:, axis]
            total += share[:, None] * rises[own]
        ways = -total @ to_gradient.T
        length = np.linalg.norm(ways, axis=1)
        good = (length > 0) & (length < np.inf)
        good &= (ways * spare[part]).sum(axis=1) >= 0  # in thin parts the far side may be steeper
        out[part][good] = ways[good] / length[good, None]
    return out


def _invalid(volume: Volume, samples: NDArray[np.int64]) -> NDArray[np.bool_]:
    values, padding = volume.data.reshape(-1)[samples], padding_value(volume)
    bad = ~np.isfinite(values)
    return bad if padding is None else bad | (values == padding)
