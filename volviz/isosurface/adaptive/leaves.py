"""A block of 16³ samples as leaves of an octree: as fine as the picture needs there, no finer.

A node is cut where the surface may be in it or within its own size of it, where its side is
greater than the lens allows, and where the halves are no smaller than the pixels allow. A node in
which, or next to which, samples are not valid is cut whatever its size, so that holes stay where
they are. A leaf has the mean of its samples, in the middle of them; the finest leaves are the
samples.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from volviz.isosurface.adaptive.ranges import BLOCK, holes, near
from volviz.isosurface.kernel import hot, inline

HALF = 1 << (BLOCK - 1)
"""Groups of 2³ samples along the side of a block: leaves of one sample are not kept."""


class Field(NamedTuple):
    """Samples, the value that stands for nothing (if padded), the isovalue, the least value of
    the samples' dtype that is at least as high, and whether some sample is not valid."""

    data: NDArray[Any]
    blank: Any
    padded: bool
    limit: Any
    isovalue: float
    holes: bool


class Sight(NamedTuple):
    """What decides the size of leaves, and where they are in the picture.

    world, eye: rows of 3 × 4 numbers from index x, y, z to mm, and to mm right, up and away from
    the camera. half: of the picture, as `Camera.half`. size: pixels. side: longest side of a
    voxel, reach: half the longest diagonal of a block, mm. pixel: mm across a pixel (perspective:
    at distance 1). focus, radius: of the lens, mm. growth, pixels: its knobs.
    """

    world: tuple[float, ...]
    eye: tuple[float, ...]
    perspective: bool
    half: tuple[float, float]
    size: tuple[int, int]
    side: float
    reach: float
    pixel: float
    focus: tuple[float, float, float]
    radius: float
    growth: float
    pixels: float


class Leaves(NamedTuple):
    """Per block that was cut, of each of its 8³ groups of 2³ samples: the level of the leaf there
    (0: a leaf per sample), its value (NaN: no sample is valid); and the least level of all. near:
    of each group, two bits per level of the node there, the finest lowest: the surface may be near
    it, samples near it are not valid; whatever the lens. known: whether `near` is there yet."""

    level: NDArray[np.uint8]
    value: NDArray[np.float64]
    least: NDArray[np.uint8]
    near: NDArray[np.uint8]
    known: NDArray[np.bool_]


@hot
def row(matrix: Any, r: int, x: float, y: float, z: float) -> float:
    """One coordinate of a point under 3 × 4 numbers."""
    k = 4 * r
    return float(matrix[k] * x + matrix[k + 1] * y + matrix[k + 2] * z + matrix[k + 3])


@inline
def allowed(sight: Any, x: float, y: float, z: float, half: float) -> Any:
    """mm: how long the side of a leaf round a place may be for the lens, how short for the pixels.

    half: mm, half of the diagonal of the node there: its part nearest to the focus counts.
    """
    away = 0.0
    for r in range(3):
        off = row(sight.world, r, x, y, z) - sight.focus[r]
        away += off * off
    beyond = np.sqrt(away) - half - sight.radius
    least = sight.pixels * sight.pixel
    if sight.perspective:
        least *= max(row(sight.eye, 2, x, y, z), 0.0)
    return sight.growth * max(beyond, 0.0), least


@inline
def _near_surface(field: Any, ranges: Any, level: int, z: int, y: int, x: int) -> Any:
    """(the surface may be near the node at this sample, samples near it are not valid)."""
    limit, k, j, i = field.limit, z >> level, y >> level, x >> level
    if level == 2:
        surface = near(ranges.low2, ranges.high2, limit, k, j, i)
        return surface, field.holes and holes(ranges.valid2, k, j, i)
    if level == 3:
        surface = near(ranges.low3, ranges.high3, limit, k, j, i)
        return surface, field.holes and holes(ranges.valid3, k, j, i)
    if level == 4:
        surface = near(ranges.low4, ranges.high4, limit, k, j, i)
        return surface, field.holes and holes(ranges.valid4, k, j, i)
    data = field.data
    above = below = bad = False
    for c in range(max(z - 1, 0), min(z + 3, data.shape[0])):
        for b in range(max(y - 1, 0), min(y + 3, data.shape[1])):
            for a in range(max(x - 1, 0), min(x + 3, data.shape[2])):
                value = data[c, b, a]
                if valid(field, value):
                    above, below = above or value >= field.limit, below or value < field.limit
                else:
                    bad = True
    return above and below, bad


@hot
def valid(field: Any, value: Any) -> bool:
    """True if a sample counts."""
    return (value - value) == 0 and not (field.padded and value == field.blank)


@inline
def _mean(field: Any, level: int, z: int, y: int, x: int) -> float:
    """Of the valid samples of a node, NaN if there are none; never outside their range."""
    data, size = field.data, 1 << level
    total, count, low, high = 0.0, 0, np.inf, -np.inf
    for c in range(z, min(z + size, data.shape[0])):
        for b in range(y, min(y + size, data.shape[1])):
            for a in range(x, min(x + size, data.shape[2])):
                sample = data[c, b, a]
                if valid(field, sample):
                    value = np.float64(sample)
                    total += value
                    count += 1
                    low, high = min(low, value), max(high, value)
    return min(max(total / count, low), high) if count else np.nan


@inline
def _fill(array: Any, k: int, j: int, i: int, wide: int, value: Any) -> None:
    """The groups of a node; loops compile several times as fast as slices."""
    for c in range(k, k + wide):
        for b in range(j, j + wide):
            for a in range(i, i + wide):
                array[c, b, a] = value


@inline
def take_over(leaves: Any, slot: int, source: int) -> bool:
    """The leaves of a slot from another one; True if they were not the same."""
    changed = False
    for c in range(HALF):
        for b in range(HALF):
            for a in range(HALF):
                changed = changed or leaves.level[slot, c, b, a] != leaves.level[source, c, b, a]
                leaves.level[slot, c, b, a] = leaves.level[source, c, b, a]
                leaves.value[slot, c, b, a] = leaves.value[source, c, b, a]
    leaves.least[slot] = leaves.least[source]
    return changed


@inline
def _find_near(field: Any, ranges: Any, block: Any, out: Any) -> None:
    """`Leaves.near` of a block, (z, y, x) in blocks."""
    _fill(out, 0, 0, 0, HALF, 0)
    z0, y0, x0 = block[0] << BLOCK, block[1] << BLOCK, block[2] << BLOCK
    nz, ny, nx = field.data.shape
    for n in range(BLOCK, 0, -1):
        wide, shift = 1 << (n - 1), 2 * (n - 1)
        for k in range(0, HALF, wide):
            for j in range(0, HALF, wide):
                for i in range(0, HALF, wide):
                    z, y, x = z0 + 2 * k, y0 + 2 * j, x0 + 2 * i
                    if z >= nz or y >= ny or x >= nx:
                        continue
                    if n < BLOCK and out[k, j, i] >> (shift + 2) & 3 == 0:
                        continue  # nor is anything near a part of what it is not near to
                    surface, bad = _near_surface(field, ranges, n, z, y, x)
                    bits = (np.int64(surface) | np.int64(bad) << 1) << shift
                    _fill(out, k, j, i, wide, out[k, j, i] | bits)


@inline
def cut(
    field: Any, ranges: Any, sight: Any, block: Any, leaves: Any, slot: int, number: int
) -> None:
    """Fill the leaves of a block, (z, y, x) in blocks; number: its own, whatever the slot."""
    if not leaves.known[number]:
        _find_near(field, ranges, block, leaves.near[number])
        leaves.known[number] = True
    level, value, around = leaves.level[slot], leaves.value[slot], leaves.near[number]
    _fill(level, 0, 0, 0, HALF, BLOCK)
    z0, y0, x0 = block[0] << BLOCK, block[1] << BLOCK, block[2] << BLOCK
    nz, ny, nx = field.data.shape
    least = BLOCK
    for n in range(BLOCK, 0, -1):
        wide = 1 << (n - 1)
        for k in range(0, HALF, wide):
            for j in range(0, HALF, wide):
                for i in range(0, HALF, wide):
                    z, y, x = z0 + 2 * k, y0 + 2 * j, x0 + 2 * i
                    if level[k, j, i] != n or z >= nz or y >= ny or x >= nx:
                        continue
                    bits = around[k, j, i] >> 2 * (n - 1) & 3
                    if bits & 1 and (bits & 2 or not _is_fine(sight, n, z, y, x)):
                        _fill(level, k, j, i, wide, n - 1)
                        least = min(least, n - 1)
                    else:
                        mean = _mean(field, n, z, y, x)
                        _fill(value, k, j, i, wide, mean)
    leaves.least[slot] = least


@inline
def _is_fine(sight: Any, level: int, z: int, y: int, x: int) -> bool:
    """True if the picture needs no smaller nodes here."""
    half = 0.5 * ((1 << level) - 1)
    side = sight.side * (1 << level)
    most, least = allowed(sight, x + half, y + half, z + half, 0.87 * side)
    return side <= most or side < 2 * least
