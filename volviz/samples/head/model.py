"""The whole sample head, painted slab by slab: Hounsfield units and materials, sharp and still."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from volviz.samples.head.bones import AIR_CELLS, DENSE, relief, skull
from volviz.samples.head.brain import CANAL, CORD, paint_brain
from volviz.samples.head.canvas import MATERIALS, Canvas
from volviz.samples.head.skin import SKIN, THIN, VAULT
from volviz.samples.head.soft import AIR, BEFORE_ORBITS, CONCHAE, DISCS, NAPE, ORBITS, SHEETS
from volviz.samples.head.teeth import filling, paint_teeth
from volviz.samples.noise import Lattice
from volviz.samples.shapes import Array, Grid, carve

SLAB = 12
SKIN_DEPTH = 1.9
TABLE = 1.9
FOLD_SEED, GRAIN_SEED, CLOUD_SEED = 11, 12, 13


def paint_head(grid: Grid, edge: float) -> Iterator[tuple[slice, Array, NDArray[np.uint8]]]:
    """Slabs of the head: where along z, HU float32[z, y, x] and material numbers uint8.

    edge: width in mm over which a border is blended. Anatomy is computed for x ≥ 0 and mirrored,
    but for the folds of the brain, the density of compact bone and the filling.
    """
    distances = np.round(np.abs(grid.x.ravel()), 4).astype(np.float32)
    sides, back = np.unique(distances, return_inverse=True)
    base = relief(Grid(sides[None, None, :], grid.y, grid.z))
    folds, grain = Lattice(FOLD_SEED, 8.5), Lattice(GRAIN_SEED, 2.2)
    cloud = Lattice(CLOUD_SEED, 6.0)
    for start in range(0, grid.z.size, SLAB):
        where = slice(start, min(start + SLAB, grid.z.size))
        whole = Grid(grid.x, grid.y, grid.z[where])
        half, cavity = _paint_half(
            Grid(sides[None, None, :], grid.y, grid.z[where]), edge, base, grain
        )
        canvas = Canvas(whole, edge)
        canvas.values, canvas.labels = half.values[:, :, back], half.labels[:, :, back]
        paint_brain(canvas, cavity[:, :, back], folds)
        _vary(canvas, "compact bone", cloud.sample(whole), 85)
        canvas.paint(filling(), "metal")
        yield where, canvas.values, canvas.labels


def _paint_half(
    grid: Grid, edge: float, base: tuple[Array, Array], grain: Lattice
) -> tuple[Canvas, Array]:
    """All that both halves share, and the distance to the space for the brain."""
    vault = carve(grid, VAULT)
    skin = carve(grid, SKIN, vault)
    bones, cavity = skull(grid, vault, base)
    canvas = Canvas(grid, edge)
    canvas.fill(skin, "skin")
    canvas.fill(np.maximum(skin + np.float32(SKIN_DEPTH), -carve(grid, THIN)), "fat")
    _paint_nape(canvas, skin)
    for material, parts in BEFORE_ORBITS:
        canvas.paint(parts, material, skin, 3.0)
    for material, parts in ORBITS:
        canvas.paint(parts, material, skin, SKIN_DEPTH)
    canvas.paint(DISCS, "cartilage")
    for material, parts in AIR:
        canvas.paint(parts, material)
    canvas.paint(CONCHAE, "compact bone")
    _paint_bones(canvas, bones, grain)
    canvas.paint(CANAL, "csf")
    canvas.paint(CORD, "white matter")
    paint_teeth(canvas)
    return canvas, cavity


def _paint_nape(canvas: Canvas, skin: Array) -> None:
    """The layered muscles at the back of the neck."""
    window = canvas.grid.window((-75, 0, -140), (75, 80, 0), 0)
    if window is None:
        return
    near, depth = canvas.grid.part(window), skin[window]
    nape = np.maximum(carve(near, NAPE), depth + np.float32(8))
    canvas.fill(nape, "muscle", window)
    sheets = [np.abs(depth + (np.float32(d) + np.float32(t) * near.x)) for d, t in SHEETS]
    fat = np.minimum(sheets[0], sheets[1]) - np.float32(0.6)
    fat = np.minimum(fat, near.x - np.float32(0.7))
    canvas.fill(np.maximum(fat, nape), "fat", window)


def _paint_bones(canvas: Canvas, bones: Array, grain: Lattice) -> None:
    """Compact tables, spongy bone between them with its grain, air cells behind the ear."""
    canvas.fill(bones, "compact bone")
    spongy = bones + np.float32(TABLE)
    if float(spongy.min()) > 0:
        return
    texture = grain.sample(canvas.grid)
    canvas.fill(spongy, "spongy bone")
    canvas.paint(DENSE, "compact bone", bones)
    cells = np.maximum(carve(canvas.grid, AIR_CELLS), np.float32(0.9) * (0.1 - texture))
    canvas.fill(np.maximum(cells, bones + np.float32(1.6)), "air")
    _vary(canvas, "spongy bone", texture, 110)


def _vary(canvas: Canvas, material: str, texture: Array, spread: float) -> None:
    """Let the values of a material follow a texture, by `spread` HU on average."""
    where = canvas.labels == MATERIALS[material][0]
    canvas.values[where] += np.float32(spread) * np.clip(texture[where], -2.5, 2.5)
