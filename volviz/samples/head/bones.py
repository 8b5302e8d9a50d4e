"""The bones of the sample head: braincase, face, jaw, upper neck. One half: x ≥ 0, mm, LPS.

Proportions follow textbook craniometry of an adult in the Frankfurt plane (z = 0 through the ear
canals and the lower rims of the orbits).
"""

from __future__ import annotations

import numpy as np

from volviz.samples.shapes import (
    Array,
    Grid,
    Part,
    add,
    box,
    carve,
    cone,
    cut,
    ellipsoid,
    ribbon,
    smooth_min,
    surface,
    tube,
    union,
)

SCALP = 6.0
FLOOR = (
    # front of the base: over the nose, over the orbits
    (0, -88, 30), (0, -74, 24), (14, -80, 32), (30, -80, 40), (30, -62, 39.5), (46, -64, 38),
    (0, -56, 28), (12, -50, 29), (34, -50, 32), (54, -52, 26),
    # middle: temporal lobes, saddle
    (38, -34, 0), (45, -20, 2), (26, -34, 3), (55, -30, 1), (60, -10, 8), (40, -46, 5),
    (0, -32, 18), (0, -22, 27), (14, -30, 14),
    # slope to the foramen, ridges of the petrous bones
    (0, -13, 4), (0, -5, -16), (18, -14, 13), (34, -3, 19), (50, 8, 22),
    # back: cerebellum
    (0, 14, -22), (16, 14, -20), (34, 24, -14), (24, 46, -24), (0, 62, -14), (46, 36, -2),
    (0, 80, 12), (40, 66, 8), (62, 34, 20), (74, 0, 16), (74, 50, 20),
)  # fmt: skip
"""Height z of the inside of the skull base at (|x|, y)."""

UNDER = (
    (0, -90, 14), (40, -90, 20), (0, -70, 4), (40, -66, 10), (0, -50, -4), (30, -50, -4),
    (0, -32, -3), (38, -34, -6), (56, -30, 0), (45, -18, -3), (62, -8, -2), (14, -30, -6),
    (0, -14, -14), (0, -5, -24), (16, -12, -12), (34, -3, -12), (50, 8, -16), (66, 0, -6),
    (0, 14, -28), (16, 14, -27), (36, 24, -22), (24, 46, -34), (0, 62, -26), (50, 36, -14),
    (0, 80, -6), (40, 66, -8), (66, 34, 0), (76, 50, 8),
)  # fmt: skip
"""Height z of its outside."""

BRAINCASE: tuple[Part, ...] = (
    # hollow of the temple
    cut(ellipsoid((76, -52, 12), (20, 30, 34)), 10),
    # petrous and mastoid
    add(cone((46, 0, 0), (16, -22, 4), 10, 6), 6),
    add(ellipsoid((53, 12, -12), (9, 12, 18), (-14, 0, 0)), 8),
    add(ellipsoid((58, -4, 6), (8, 14, 6)), 6),
    # joints with the neck, bump at the back
    add(ellipsoid((15, 6, -26), (6, 10, 5), (0, 0, 20)), 4),
    add(ellipsoid((0, 75, 2), (10, 7, 6)), 12),
    add(tube([(0, 77, 2), (24, 70, 2), (44, 51, 0)], [3, 3.5, 3]), 8),
    add(tube([(42, 3, -14), (40, -4, -28), (36, -12, -44)], [2.4, 1.6, 0.9]), 2),
)

FACE: tuple[Part, ...] = (
    # core between the orbits and behind the nose
    add(box((0, -68, 10), (15, 24, 22), 6), 4),
    add(ellipsoid((0, -38, 8), (17, 18, 14)), 6),
    # brow, orbit rim
    add(
        tube(
            [(0, -90, 31), (14, -89.5, 33), (32, -86, 38), (45, -76, 34), (51, -67, 24)],
            [6, 6, 5, 4.6, 4.6],
        ),
        8,
    ),
    add(tube([(50.5, -67, 26), (51, -66, 14), (48, -69, 0)], [4.2, 4.0, 5]), 5),
    add(
        tube([(48, -70, -3), (36, -79.5, -6), (22, -84.5, -3), (13, -86, 8)], [5, 4.5, 4.5, 4.5]), 6
    ),
    add(tube([(14, -82.5, 5), (11, -83, 18), (9, -87, 30)], [5, 4, 5]), 6),
    # outer and lower wall of the orbit
    add(box((43, -58, 14), (2.5, 14, 17), 2, (0, 0, 28)), 6),
    add(box((28, -63, -3), (15, 16, 2), 1.5, (-8, 0, 0)), 3),
    # nasal bones
    add(cone((0, -91, 28), (0, -102, 6), 5, 3.2), 6),
    add(cone((5, -90, 24), (5, -100, 5), 4, 3), 7),
    add(cone((7.5, -87, 20), (9, -92, 3), 3.2, 3), 6),
    # cheekbone and arch
    add(ellipsoid((43, -71, -11), (13, 10, 11.5), (0, 0, -32)), 8),
    add(
        ribbon(
            [
                (46, -68, -10, 3, 4),
                (58, -51, -6, 3, 2.8),
                (64.5, -33, -1.5, 2.4, 2.2),
                (63.5, -16, 2, 2, 2.4),
                (58, -2, 5, 2, 3.5),
            ]
        ),
        5,
    ),
    # upper jaw
    add(ellipsoid((22, -69, -18), (21, 20, 24)), 8),
    add(tube([(0, -90, -36), (13, -87, -36), (22, -76, -36), (27, -52, -36)], [7, 7, 7.5, 7.5]), 8),
    add(
        tube([(0, -93.5, -43), (11, -91, -43), (21, -79, -43), (26.5, -54, -42)], 4.4),
        5,
    ),
    add(box((0, -68, -33), (22, 22, 2.5), 2), 4),
    # wing plates behind it
    add(box((16, -41, -18), (1.6, 7, 17), 1.2, (0, 0, 24)), 3),
    add(box((10, -41, -18), (1.3, 6, 17), 1, (0, 0, -8)), 3),
)

ETHMOID = (
    ellipsoid((8.6, -80, 18), (3.0, 4.2, 6.0), (12, 0, 0)),
    ellipsoid((8.8, -80.5, 5), (3.0, 3.8, 5.2)),
    ellipsoid((9.2, -71, 15), (3.6, 4.4, 7.0), (-8, 0, 0)),
    ellipsoid((9.4, -71.5, 1), (3.4, 4.4, 5.0)),
    ellipsoid((9.0, -61, 17), (3.6, 4.6, 5.4), (14, 0, 0)),
    ellipsoid((9.2, -62, 5), (3.6, 4.8, 5.2)),
    ellipsoid((8.4, -52, 12), (3.4, 3.6, 6.6)),
)
"""Air cells between nose and orbit."""

FRONTAL_SINUS = ellipsoid((9, -90.2, 32.5), (7, 2.7, 5.2), (-8, 0, 0))

SPACES: tuple[Part, ...] = (
    # orbit, optic canal, fissures
    cut(
        union(
            (
                box((33.5, -86, 17.5), (19, 26, 17), 13, (0, 8, 0)),
                cone((29, -70, 17), (13, -44, 19), 16, 4),
            )
        ),
        3,
    ),
    cut(cone((13, -44, 20), (5, -32, 24), 2.6, 2.4), 1),
    cut(tube([(16, -46, 18), (24, -46, 23), (34, -52, 27)], [2.2, 1.6, 0.8]), 1),
    cut(tube([(22, -46, 4), (32, -58, -2), (36, -66, -4)], [2.2, 1.8, 1.2]), 1),
    # nose: opening, passages, ethmoid cells
    cut(ellipsoid((5.5, -98, -15.5), (6.5, 14, 11.5)), 4),
    cut(ellipsoid((0, -97, -8), (8, 12, 12)), 4),
    cut(box((0, -62, -15), (14, 22, 14), 5), 3),
    cut(box((0, -67, 4), (5, 19, 16), 1.2), 1),
    *(cut(cell, 0.6) for cell in ETHMOID),
    add(cone((0, -84, -31), (0, -96, -29), 4.5, 1.6), 4),
    # sinuses of the upper jaw, the brow and the wedge bone
    cut(ellipsoid((27.5, -69, -17), (12.5, 16, 15)), 4),
    cut(FRONTAL_SINUS, 3),
    cut(ellipsoid((7, -40, 8), (6.3, 11, 9)), 2),
    # roof of the mouth
    cut(ellipsoid((0, -64, -48), (19, 25, 12.5)), 3),
    # ear: canal, drum cavity
    cut(tube([(80, 1, -3), (66, 0, 0), (47, -3, 0)], [3.6, 3.4, 3.4]), 1),
    cut(ellipsoid((43, -4, 2), (3, 5, 6)), 1),
    # nerve holes of the cheek
    cut(cone((27, -95, -13), (27, -80, -8), 1.5, 1.5), 1),
)

JAW: tuple[Part, ...] = (
    # body
    add(
        ribbon(
            [
                (0, -86, -79, 8, 5.2),
                (10, -84.5, -79, 8, 5.2),
                (22, -74, -77.5, 8, 5.0),
                (32, -58, -74.5, 8, 4.8),
                (41, -38, -69, 8, 4.4),
                (46, -24, -62, 8, 3.6),
                (47.5, -15.5, -56, 6.5, 3),
            ]
        )
    ),
    add(tube([(0, -88, -89), (13, -85, -89), (27, -70, -85), (38, -48, -78)], [5, 5, 4, 3]), 6),
    add(ellipsoid((0, -88, -89), (16, 6, 6)), 10),
    # branch, with the notch between its two horns
    add(box((46.5, -27, -36), (3.0, 16, 30), 2.8, (-8, 3, 0)), 10),
    add(tube([(41, -38, -70), (46, -22, -68), (48, -13, -56)], [4, 4.6, 3.6]), 8),
    cut(ellipsoid((48, -28, -2), (16, 9, 19), (-8, 0, 0)), 4),
    add(tube([(44, -42, -44), (46, -42, -22), (46.5, -38, -8)], [4, 3.4, 2]), 6),
    add(cone((48, -15, -34), (50.5, -13, -9), 3.6, 3.6), 6),
    add(ellipsoid((51.5, -12.5, -6), (9, 4.6, 4.8), (0, 0, -16)), 3),
    # sockets of the teeth
    add(
        tube(
            [(0, -89, -65.5), (10, -87, -65.5), (20, -76, -65.5), (27, -54, -63.5)],
            [3.4, 3.8, 4.2, 4.8],
        ),
        5,
    ),
    cut(cone((27, -88, -78), (23, -76, -77), 1.4, 1.2), 1),
)


def _vertebra(y: float, z: float, spine: float) -> tuple[Part, ...]:
    """A vertebra of the neck with its body's centre at (0, y, z)."""
    return (
        add(box((0, y, z), (9.5, 8, 7.2), 4.5)),
        add(ribbon([(18, y + 7, z, 3.2, 5), (20, y + 11, z, 3.2, 5)]), 3),
        add(cone((8, y + 4, z), (18, y + 8, z), 3.4, 3.6), 2),
        add(tube([(10, y - 3, z), (20, y - 4, z - 1), (26, y + 1, z - 3)], [2.4, 2.2, 3]), 2),
        add(
            ribbon(
                [(19, y + 11, z, 4, 3), (12, y + 21, z - 1, 4, 2.4), (0, y + 26, z - 2, 3, 2.6)]
            ),
            3,
        ),
        add(cone((0, y + 25, z - 1), (2, y + 25 + spine, z - 1 - spine / 2), 3.2, 2.6), 3),
        cut(cone((19.5, y, z - 9), (19.5, y, z + 9), 2.4, 2.4), 1),
    )


SPINE: tuple[Part, ...] = (
    # atlas
    add(tube([(0, -8, -38), (10, -6, -38), (17, 0, -38)], [4, 3.4, 4]), 2),
    add(ellipsoid((19, 4, -37), (7, 9, 6.4), (0, 0, 20)), 3),
    add(tube([(20, 10, -38), (16, 24, -38), (0, 33, -38)], [3.4, 3, 4]), 3),
    add(tube([(22, 4, -38), (31, 5, -39), (38, 7, -40)], [4, 3.4, 4]), 3),
    cut(cone((29, 5, -50), (29, 5, -30), 2.6, 2.6), 1),
    # axis
    add(cone((0, 1, -58), (0, 0.5, -34), 6.5, 5), 2),
    add(ellipsoid((15, 5, -48), (8, 8, 4.5), (0, 20, 0)), 3),
    *_vertebra(3, -60, 16),
    # the next ones, and the tongue bone
    *_vertebra(1.5, -79, 9),
    *_vertebra(1, -97, 9),
    *_vertebra(2, -115, 11),
    *_vertebra(5, -133, 14),
    add(tube([(0, -46, -99), (12, -41, -98), (19, -30, -95), (21, -20, -92)], [3.4, 3, 2, 2]), 1),
)


DENSE: tuple[Part, ...] = (add(cone((40, -2, 2), (22, -17, 5), 5, 3)),)
"""The hard core of the petrous bones."""

AIR_CELLS: tuple[Part, ...] = (
    add(ellipsoid((53, 12, -10), (7.5, 10.5, 15), (-14, 0, 0))),
    add(ellipsoid((54, 8, 4), (6, 8, 8)), 4),
)
"""Behind the ear; only part of it is air."""


def relief(grid: Grid) -> tuple[Array, Array]:
    """Heights z float32[1, y, x] of the inside and the outside of the skull base."""
    return (
        surface(FLOOR, grid),
        surface(UNDER, grid),
    )


def _sutured(grid: Grid, case: Array, outside: Array) -> Array:
    """The braincase with the seams between its bones as grooves, `outside` being its surface."""
    x, y, z = grid.x, grid.y, grid.z
    if float(z.max()) < 8:
        return case
    wiggle = np.sin(0.9 * (x + z)) + 0.7 * np.sin(2.1 * x - 1.7 * z)
    fall = np.clip((115 - z) / 85, 0, 1.1)
    coronal = np.maximum(np.abs(y + 16 + 30 * fall**1.3 + wiggle), 2 * (26 - z))
    sagittal = np.maximum(x - 0.8 * np.sin(1.1 * y), np.maximum(-16 - y, y - 72))
    back = np.sin(0.8 * x) + 0.8 * np.sin(2.2 * x)
    lambdoid = np.maximum(
        np.abs(0.6 * (z - 84 + 1.35 * x + 1.4 * back)), np.maximum(30 - y, x - 54)
    )
    ring = np.sqrt((y + 14) ** 2 + (z - 2) ** 2) - 40
    squamous = np.maximum(np.abs(ring + 0.3 * wiggle), np.maximum(40 - x, 10 - z))
    seams = np.minimum(np.minimum(coronal, lambdoid), np.minimum(sagittal, squamous))
    groove = np.maximum(seams - 0.55, -(outside + 1.8))
    return np.maximum(case, -groove).astype(np.float32)


def skull(grid: Grid, vault: Array, base: tuple[Array, Array]) -> tuple[Array, Array]:
    """Distances float32[z, y, x] to the bones and to the space for the brain.

    vault: distance to the scalp's braincase. base: the `relief` of the grid. The cavities of the
    face are cut out of the bones.
    """
    floor, under = base
    thick = np.float32(5.2) + np.float32(2.6) * (1 - np.square(grid.x / np.float32(70)))
    cavity = -smooth_min(-(vault + (SCALP + thick)), np.float32(0.8) * (grid.z - floor), 6)
    cavity = carve(grid, (add(cone((0, 14, -32), (0, 14, -10), 14, 16), 4),), cavity)
    case = -smooth_min(-(vault + SCALP), grid.z - under, 8)
    bones = carve(grid, (*BRAINCASE, *FACE), _sutured(grid, case, vault + SCALP))
    bones = carve(grid, SPACES, np.maximum(bones, -cavity))
    for piece in (JAW, SPINE):
        np.minimum(bones, carve(grid, piece), out=bones)
    return bones, cavity
