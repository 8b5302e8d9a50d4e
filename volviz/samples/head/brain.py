"""The brain of the sample head: folded cortex, white matter, nuclei, ventricles. mm, LPS."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from volviz.samples.head.canvas import Canvas
from volviz.samples.noise import Lattice
from volviz.samples.shapes import Array, Grid, Part, add, box, carve, cone, ellipsoid, tube

TENTORIUM = ellipsoid((0, 44, -14), (60, 44, 33), (6, 0, 0))
CEREBELLUM: tuple[Part, ...] = (
    add(ellipsoid((23, 45, -4), (29, 27, 19), (6, 0, 10))),
    add(ellipsoid((0, 42, 0), (14, 24, 20)), 6),
)
STEM: tuple[Part, ...] = (
    add(
        tube([(0, 2, 30), (0, 8, 16), (0, 12, 0), (0, 15, -18), (0, 17, -36)], [11, 10, 10, 8, 6.4])
    ),
    add(ellipsoid((0, 6, 0), (15, 9, 13)), 5),
    add(cone((0, 14, -4), (24, 30, -6), 8, 6), 5),
)
CORD: tuple[Part, ...] = (
    add(tube([(0, 16, -24), (0, 19, -40), (0, 19, -80), (0, 20, -140)], [6, 5.4, 5.6, 5.8])),
)
CANAL: tuple[Part, ...] = (
    add(tube([(0, 15, -20), (0, 19, -40), (0, 18.5, -80), (0, 20, -140)], [11, 9.5, 8.5, 8.8])),
)
CALLOSUM: tuple[Part, ...] = (
    add(tube([(0, -34, 32), (0, -46, 40), (0, -36, 50), (0, -8, 57), (0, 18, 54), (0, 28, 44)],
             [4, 5, 4.6, 4, 4.6, 5])),
)  # fmt: skip
NUCLEI: tuple[Part, ...] = (
    add(ellipsoid((11, 4, 37), (8.5, 14, 9), (0, 0, -16))),
    add(ellipsoid((25, -17, 33), (5.5, 18, 10), (0, 0, -12))),
    add(tube([(11, -36, 37), (15, -20, 48), (20, 4, 53), (26, 22, 46)], [7, 4, 2.6, 1.6])),
    add(ellipsoid((22, 12, 12), (6, 12, 5))),
    add(ellipsoid((15, 48, -6), (5, 7, 3))),
)
VENTRICLES: tuple[Part, ...] = (
    add(tube([(7, -48, 36), (7, -36, 42), (8, -14, 51), (13, 10, 52), (23, 30, 43), (24, 56, 37)],
             [3.5, 6, 5.6, 5.6, 7.4, 2.4])),
    add(tube([(24, 30, 41), (32, 22, 24), (35, 8, 15), (33, -8, 10)], [6.2, 4.2, 3.2, 2.2]), 4),
    add(ellipsoid((0, -1, 32), (3.2, 15, 11)), 1),
    add(cone((0, 12, 26), (0, 22, 8), 1.2, 1.2), 1),
    add(ellipsoid((0, 26, 0), (8, 5, 11)), 2),
)  # fmt: skip
PLEXUS: tuple[Part, ...] = (add(ellipsoid((22, 28, 42), (2, 4, 3))),)


LINKED = ellipsoid((0, -4, 34), (40, 43, 22))
"""Where the halves of the brain are joined; around it the long fissure parts them."""
SYLVIAN = box((50, -6, 26), (13, 30, 1.8), 1.5, (17, 0, 0))
DEEP = 12.0
CORTEX = 2.8
FOLD_SLOPE, FOLD_WIDTH = 5.5, 1.3
"""Folds: depth below the surface, thickness of the rind, mm per unit of the field, half width."""


@dataclass(frozen=True, eq=False)
class Room:
    """The part of a canvas that may hold brain: its window and what is known there.

    half: the window's grid with |x| in place of x. inside: distance to the inside of the skull.
    tent: to what lies under the tentorium. wave: the field whose zeros are the folds.
    """

    window: tuple[slice, slice, slice]
    half: Grid
    inside: Array
    tent: Array
    wave: Array


def paint_brain(canvas: Canvas, cavity: Array, folds: Lattice) -> None:
    """Paint fluid into the cavity, then the brain with its folds, then its chambers.

    cavity: distance to the inside of the skull on the canvas, which holds both halves of the
    head: left and right fold differently, as `folds` says.
    """
    window = canvas.grid.window((-74, -88, -40), (74, 88, 114), 0)
    if window is None:
        return
    grid = canvas.grid.part(window)
    inside = cavity[window]
    canvas.fill(inside, "csf", window)
    if float(inside.min()) > -1:
        return
    half = Grid(np.abs(grid.x), grid.y, grid.z)
    tent = TENTORIUM.distance(half.x, half.y, half.z)
    room = Room(window, half, inside, tent, folds.sample(grid))
    _paint_cerebrum(canvas, room)
    _paint_hind(canvas, room)


def _paint_cerebrum(canvas: Canvas, room: Room) -> None:
    """The two halves of the great brain, with fissures and folds: grey rind, white inside."""
    half = room.half
    mass = np.maximum(room.inside + np.float32(2.2), np.float32(1.5) - room.tent)
    gap = np.maximum(half.x - np.float32(1.1), -LINKED.distance(half.x, half.y, half.z))
    np.maximum(mass, -gap, out=mass)
    np.maximum(mass, -SYLVIAN.distance(half.x, half.y, half.z), out=mass)
    ditch = np.abs(room.wave) * np.float32(FOLD_SLOPE) - np.float32(FOLD_WIDTH)
    np.maximum(ditch, -(mass + np.float32(DEEP)), out=ditch)
    canvas.fill(np.maximum(mass, -ditch), "grey matter", room.window)
    white = np.maximum(mass + np.float32(CORTEX), np.float32(CORTEX - 0.4) - ditch)
    canvas.fill(white, "white matter", room.window)


def _paint_hind(canvas: Canvas, room: Room) -> None:
    """Cerebellum, stem, callosum, nuclei, chambers, and the large vein along the midline."""
    half, inside, window = room.half, room.inside, room.window
    bound = inside + np.float32(1.5)
    cerebellum = np.maximum(_body(half, CEREBELLUM), np.maximum(inside, room.tent) + np.float32(2))
    canvas.fill(cerebellum, "grey matter", window)
    leaves = np.float32(1.6) * np.sin(half.z * np.float32(1.3) + np.float32(0.8) * room.wave)
    canvas.fill(cerebellum + np.float32(5.5) + leaves, "white matter", window)
    for parts, material in (
        (STEM, "white matter"),
        (CALLOSUM, "white matter"),
        (NUCLEI, "grey matter"),
        (VENTRICLES, "csf"),
        (PLEXUS, "blood"),
    ):
        canvas.fill(np.maximum(_body(half, parts), bound), material, window)
    vein = np.maximum(half.x - np.float32(4), np.maximum(inside, -(inside + np.float32(4.5))))
    np.maximum(vein, np.float32(-50) - half.y, out=vein)
    np.maximum(vein, np.float32(8) - half.z, out=vein)
    canvas.fill(vein, "blood", window)


def _body(half: Grid, parts: tuple[Part, ...]) -> Array:
    """`carve` on a grid of |x| that runs down and up again: on its rising half, then mirrored."""
    sides, back = np.unique(half.x.ravel(), return_inverse=True)
    return carve(Grid(sides[None, None, :], half.y, half.z), parts)[:, :, back]
