"""A plume of smoke that rises, rolls up and breaks into eddies: float density with sharp fronts.

Each sample is followed backwards through a divergence-free random flow that grows with height, to
the place where a calm plume would carry it; there the density is a closed form. The flow is the
curl of a smooth random potential: R. Bridson, J. Hourihan, M. Nordenstam, "Curl-noise for
procedural fluid flow", SIGGRAPH 2007. All smooth work is done on every third sample.
"""

from __future__ import annotations

import numpy as np

from volviz.model.volume import Volume
from volviz.progress import Progress
from volviz.samples.noise import Lattice
from volviz.samples.shapes import Array, Grid

HALF, HEIGHT = 64.0, 192.0
"""The box: |x|, |y| ≤ 64, 0 ≤ z ≤ 192 (one unit is a millimetre), the source at the origin."""
EDDIES = ((34.0, 9.0), (17.0, 6.0), (9.0, 3.6))
"""Size of the bumps of the potential, and how far they carry the smoke."""
STEPS = 5
COARSE = 3


def plume(size: int | None, seed: int, progress: Progress) -> Volume:
    """float32[z, y, x] density, 0 where there is no smoke; `size` samples along z (192).

    The seed is the flow's.
    """
    step = HEIGHT / (192 if size is None else size)
    wide = max(round(2 * HALF / step), 1)
    side = (step * (np.arange(wide) - (wide - 1) / 2)).astype(np.float32)
    up = (step * (np.arange(round(HEIGHT / step)) + 0.5)).astype(np.float32)
    coarse = [_thinned(axis, step) for axis in (side, side, up)]
    moved = _followed_back(Grid.of(*coarse), seed, progress)
    wisps = Lattice(seed + 7, 5.0, -80.0, 210.0)
    data = np.empty((len(up), wide, wide), np.float32)
    for start in range(0, len(up), 16):
        progress(0.5 + 0.5 * start / len(up), "filling the plume")
        grid = Grid.of(side, side, up[start : start + 16])
        x, y, z = (_refined(part, coarse, grid) for part in moved)
        density = _calm(x + grid.x, y + grid.y, z + grid.z, wisps.sample(grid))
        data[start : start + 16] = density
    origin = (float(side[0]), float(side[0]), float(up[0]))
    return Volume.from_array(data, (step,) * 3, origin, name="plume")


def _thinned(axis: Array, step: float) -> Array:
    """Every third position, and one beyond either end."""
    count = max(-(-len(axis) // COARSE), 1) + 2
    return axis[0] + COARSE * step * (np.arange(count) - 1)


def _followed_back(grid: Grid, seed: int, progress: Progress) -> list[Array]:
    """Offsets x, y, z float32 of where the smoke at each sample of a coarse grid came from."""
    flow = [np.zeros(grid.shape, np.float32) for _ in range(3)]
    spacing = [float(a.ravel()[1] - a.ravel()[0]) for a in (grid.z, grid.y, grid.x)]
    for number, (pitch, reach) in enumerate(EDDIES):
        progress(0.1 * number, "stirring")
        potential = [
            Lattice(1000 * seed + 10 * number + k, pitch, -90.0, 220.0).sample(grid)
            for k in range(3)
        ]
        gain = np.float32(reach * pitch * 0.5) * _restless(grid.z, pitch)
        dz, dy, dx = zip(*(np.gradient(gain * p, *spacing) for p in potential), strict=True)
        for k, curl in enumerate((dy[2] - dz[1], dz[0] - dx[2], dx[1] - dy[0])):
            flow[k] += curl.astype(np.float32)
    offsets = [np.zeros(grid.shape, np.float32) for _ in range(3)]
    indices = np.meshgrid(*(np.arange(n, dtype=np.float32) for n in grid.shape), indexing="ij")
    for number in range(STEPS):
        progress(0.3 + 0.04 * number, "stirring")
        place = [indices[i] + offsets[2 - i] / np.float32(spacing[i]) for i in range(3)]
        carried = _gathered(flow, place)
        for k in range(3):
            offsets[k] -= carried[k] / np.float32(STEPS)
    return offsets


def _restless(z: Array, pitch: float) -> Array:
    """How much of an eddy there is at a height: none at the source, small ones first."""
    rise = np.clip(z / np.float32(20 + 2.2 * pitch), 0, 1.6)
    return rise * rise * (3 - np.minimum(rise, 1) * 2) * np.float32(0.7)


def _gathered(fields: list[Array], place: list[Array]) -> list[Array]:
    """Fields at index positions (z, y, x), trilinear, the border going on beyond it."""
    shape = fields[0].shape
    first, weights = np.zeros(place[0].shape, np.int64), []
    strides = (shape[1] * shape[2], shape[2], 1)
    for p, n, stride in zip(place, shape, strides, strict=True):
        p = np.clip(p, 0, n - 1.001)
        cell = p.astype(np.int64)
        weights.append(p - cell)
        first += stride * cell
    results = [np.zeros(first.shape, np.float32) for _ in fields]
    for corner in range(8):
        far = [corner >> k & 1 for k in range(3)]
        z, y, x = (w if f else 1 - w for w, f in zip(weights, far, strict=True))
        share = z * y * x
        index = first + sum(stride for k, stride in enumerate(strides) if far[k])
        for result, field in zip(results, fields, strict=True):
            result += share * field.ravel()[index]
    return results


def _refined(field: Array, coarse: list[Array], grid: Grid) -> Array:
    """A coarse field on the fine grid, by cubic convolution (Keys), one axis after the other."""
    for axis, (old, fine) in enumerate(zip(coarse[::-1], (grid.z, grid.y, grid.x), strict=True)):
        new = fine.ravel().astype(np.float64)
        u = np.clip((new - old[0]) / (old[1] - old[0]), 0, len(old) - 1.001)
        cell = u.astype(int)
        t = u - cell
        taps = (
            ((-0.5 * t + 1) * t - 0.5) * t,
            (1.5 * t - 2.5) * t * t + 1,
            ((-1.5 * t + 2) * t + 0.5) * t,
            (0.5 * t - 0.5) * t * t,
        )
        matrix = np.zeros((len(new), len(old)), np.float32)
        for k, tap in enumerate(taps):
            np.add.at(matrix, (np.arange(len(new)), np.clip(cell - 1 + k, 0, len(old) - 1)), tap)
        field = np.moveaxis(np.tensordot(matrix, field, axes=(1, axis)), 0, axis)
    return np.ascontiguousarray(field)


def _calm(x: Array, y: Array, z: Array, wisps: Array) -> Array:
    """Density of the calm plume: puffs that widen and thin as they rise, hollow inside."""
    height = np.clip(z, 0, None) / np.float32(HEIGHT)
    sway_x = 10 * height * np.sin(2.6 * height + 0.4)
    sway_y = 7 * height * np.sin(3.4 * height + 2.0)
    puff = np.sin(2 * np.pi * 5.5 * height**0.8)
    width = (4.5 + 34 * height**1.1) * (1 + 0.32 * puff * np.minimum(4 * height, 1))
    radius = np.hypot(x - sway_x, y - sway_y) / width
    radius += 0.09 * wisps * np.minimum(3 * height + 0.1, 1)
    body = 1 / (1 + np.exp(np.clip(9 * (radius - 0.85), -30, 30)))
    hollow = 1 - 0.45 * np.exp(-4 * radius * radius)
    fade = 1 / (0.35 + 1.6 * height) * np.clip((1.06 - height) * 6, 0, 1)
    source = np.clip((z + 3) / 4, 0, 1)
    density = body * hollow * fade * source * np.clip(1 + 0.28 * wisps, 0.1, 2)
    return np.where(density < 1e-4, 0, density).astype(np.float32)
