"""A branching vessel as a CT angiogram shows it: known centre lines, known radii.

The tree obeys Murray's law: the cubes of the radii of two branches add up to that of their stem.
Trunk and first fork are straight and lie in the plane y = 0, so that cross-sections can be
checked by hand; what follows sways and turns.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from volviz.model.volume import Volume, affine_of
from volviz.progress import Progress
from volviz.samples.closed_form import Field, Floats
from volviz.samples.noise import blur, gaussian_taps
from volviz.samples.shapes import Array, Grid, add, carve, cone

BLOOD, TISSUE, PLAQUE = 380.0, 45.0, 1000.0
"""Hounsfield units of the filled vessel, of what it lies in, and of a plaque in its wall."""
EXTENT = np.array([128.0, 112.0, 160.0])
TRUNK_RADIUS, FORK_HEIGHT, FORK_LENGTH, FORK_ANGLE = 7.0, -40.0, 30.0, 22.0
LEVELS, PIECES = 6, 4
EDGE, SPREAD, NOISE = 1.5, 0.7, 12.0

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class Segment:
    """A straight piece of vessel: its ends (x, y, z) in mm and its radius; level 0 is the trunk."""

    start: tuple[float, float, float]
    end: tuple[float, float, float]
    radius: float
    level: int


@dataclass(frozen=True)
class Tree:
    """The truth of the sample: segments of the vessel, and centre and radius of the plaque."""

    segments: tuple[Segment, ...]
    plaque: tuple[tuple[float, float, float], float]

    def distance(self, grid: Grid) -> Array:
        """float32[z, y, x]: distance to the wall in mm, negative inside; only near it exact."""
        return carve(grid, (add(cone(s.start, s.end, s.radius, s.radius)) for s in self.segments))


def vessel(size: int | None, seed: int, progress: Progress) -> Volume:
    """int16[z, y, x] in HU; `size` samples along z (200, 0.8 mm). The seed is the noise's."""
    step = float(EXTENT[2] / (200 if size is None else size))
    dims = np.maximum(np.round(EXTENT / step).astype(int), 1)
    origin = -step * (dims - 1) / 2
    grid = Grid.of(*(o + step * np.arange(n) for o, n in zip(origin, dims, strict=True)))
    tree, rng = truth(), np.random.default_rng(seed)
    taps = gaussian_taps(SPREAD)
    kept = float(np.sqrt(2 * np.sum(taps**2) - taps[0] ** 2)) ** 3
    data = np.empty(grid.shape, np.float32)
    for start in range(0, dims[2], 16):
        progress(0.8 * start / dims[2], "filling the vessel")
        where = slice(start, start + 16)
        slab = _filled(tree, Grid(grid.x, grid.y, grid.z[where]), EDGE * step)
        noise = rng.standard_normal(slab.shape, dtype=np.float32)
        data[where] = blur(blur(slab + np.float32(NOISE / kept) * noise, taps, 2), taps, 1)
    data = blur(data, taps, 0)
    return Volume.from_array(
        np.clip(np.rint(data), -1024, 3071).astype(np.int16),
        affine=affine_of((step,) * 3, origin.tolist()),
        space="LPS",
        modality="CT",
        value_unit="HU",
        name="vessel",
    )


def _filled(tree: Tree, grid: Grid, edge: float) -> Array:
    """HU of the still and sharp tree, its borders blended over `edge` mm."""
    inside = tree.distance(grid)
    spot, radius = tree.plaque
    lump = np.maximum(carve(grid, (add(cone(spot, spot, radius, radius)),)), np.abs(inside) - 1)
    data = np.full(grid.shape, TISSUE, np.float32)
    for distance, value in ((inside, BLOOD), (lump, PLAQUE)):
        data += (np.float32(value) - data) * np.clip(0.5 - distance / np.float32(edge), 0, 1)
    return data


def field(volume: Volume) -> Field:
    """HU of the still and sharp tree, its borders blended as for samples so far apart: what the
    scanner blurs. The gradient is 0 where nothing changes."""
    tree, edge = truth(), EDGE * min(volume.spacing)
    (spot, radius), reach = tree.plaque, 2 * edge + 1

    def value_and_slope(points: Floats) -> tuple[Floats, Floats]:
        wall, away = _wall(tree.segments, points, reach)
        value, slope = np.full(len(points), TISSUE), np.zeros_like(points)
        from_spot = points - spot
        length = np.linalg.norm(from_spot, axis=1)
        lump, rim = length - radius, np.abs(wall) - 1
        outer = (lump > rim)[:, None]
        off = np.where(outer, from_spot / np.maximum(length, 1e-300)[:, None], away)
        off = np.where(outer, off, off * np.sign(wall)[:, None])
        for distance, normal, filling in (
            (wall, away, BLOOD),
            (np.maximum(lump, rim), off, PLAQUE),
        ):
            cover = np.clip(0.5 - distance / edge, 0, 1)
            blending = (cover > 0) & (cover < 1)
            slope *= (1 - cover)[:, None]
            slope -= ((filling - value) * blending / edge)[:, None] * normal
            value += (filling - value) * cover
        return value, slope

    return value_and_slope


def _wall(segments: tuple[Segment, ...], points: Floats, reach: float) -> tuple[Floats, Floats]:
    """Distance to the wall, negative inside, and its gradient; `reach` mm where it is farther."""
    wall, away = np.full(len(points), reach), np.zeros_like(points)
    order = np.argsort(points[:, 2])
    heights = points[order, 2]
    for s in segments:
        start, axis = np.array(s.start), np.subtract(s.end, s.start)
        room = s.radius + reach
        low, high = np.minimum(s.start, s.end) - room, np.maximum(s.start, s.end) + room
        near = order[slice(*np.searchsorted(heights, (low[2], high[2])))]
        at = points[near]
        within = ((at[:, :2] > low[:2]) & (at[:, :2] < high[:2])).all(axis=1)
        near, at = near[within], at[within] - start
        part = np.clip(at @ axis / (axis @ axis), 0, 1)
        off = at - part[:, None] * axis
        length = np.linalg.norm(off, axis=1)
        closer = length - s.radius < wall[near]
        wall[near[closer]] = (length - s.radius)[closer]
        away[near[closer]] = off[closer] / np.maximum(length[closer], 1e-300)[:, None]
    return wall, away


def truth(size: int | None = None) -> Tree:
    """The tree that the sample shows, whatever its size and seed."""
    del size
    fork = np.array([0.0, 0.0, FORK_HEIGHT])
    foot = (0.0, 0.0, -float(EXTENT[2]))
    segments = [Segment(foot, _xyz(fork), TRUNK_RADIUS, 0)]
    for side, radius in zip((-1, 1), murray(TRUNK_RADIUS, 0.5), strict=True):
        turn = side * math.radians(FORK_ANGLE)
        heading = np.array([math.sin(turn), 0.0, math.cos(turn)])
        end = fork + FORK_LENGTH * heading
        segments.append(Segment(_xyz(fork), _xyz(end), radius, 1))
        _fork(segments, Tip(end, heading, np.array([0.0, 1.0, 0.0]), radius), 2)
    return Tree(tuple(segments), ((TRUNK_RADIUS, 0.0, -60.0), 4.0))


def murray(radius: float, share: float) -> tuple[float, float]:
    """Radii of two branches of a stem; the first carries `share` of the flow."""
    return radius * share ** (1 / 3), radius * (1 - share) ** (1 / 3)


@dataclass(frozen=True, eq=False)
class Tip:
    """Where growth goes on: place, unit heading, unit vector square to it, radius.

    Branches leave in the plane of `heading` and `across`.
    """

    at: Vector
    heading: Vector
    across: Vector
    radius: float


def _fork(segments: list[Segment], stem: Tip, level: int) -> None:
    """Two branches from the end of a stem, and all that grows from them.

    The plane of each next fork is turned by a right angle or nearly so.
    """
    share = 0.5 + 0.14 * math.sin(5 * level + 0.3 * float(stem.at[0]))
    normal = np.cross(stem.heading, stem.across)
    for sign, radius in zip((-1, 1), murray(stem.radius, share), strict=True):
        angle = sign * math.radians(22 + 60 * (1 - radius / stem.radius))
        heading = math.cos(angle) * stem.heading + math.sin(angle) * stem.across
        end = _swaying(segments, Tip(stem.at, heading, normal, radius), level)
        if level < LEVELS:
            bent = math.radians(80 if level % 2 else 95)
            side = np.cross(end.heading, normal)
            turned = math.sin(bent) * normal + math.cos(bent) * side
            turned -= end.heading * float(turned @ end.heading)
            turned /= np.linalg.norm(turned)
            _fork(segments, Tip(end.at, end.heading, turned, radius), level + 1)


def _swaying(segments: list[Segment], tip: Tip, level: int) -> Tip:
    """The end of one branch that grows in short pieces, sways and strives upwards."""
    at, heading = tip.at, tip.heading
    length = (5.2 * tip.radius + 1.5) / PIECES
    for piece in range(PIECES):
        sway = 0.2 * math.sin(1.9 * piece + 1.3 * level + 0.2 * float(at[1]))
        heading = heading + sway * tip.across + np.array([0.0, 0.0, 0.1])
        heading = heading / np.linalg.norm(heading)
        end = at + length * heading
        segments.append(Segment(_xyz(at), _xyz(end), tip.radius, level))
        at = end
    return Tip(at, heading, tip.across, tip.radius)


def _xyz(point: Vector) -> tuple[float, float, float]:
    x, y, z = (float(v) for v in point)
    return x, y, z
