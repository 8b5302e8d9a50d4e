"""The skin of the sample head, as strokes of clay in the world of ct_head.py. One half: x ≥ 0."""

from __future__ import annotations

from collections.abc import Sequence

from volviz.samples.shapes import Part, Point, add, cone, cut, ellipsoid, tube

VAULT: tuple[Part, ...] = (
    add(ellipsoid((0, 0, 42), (73, 91, 78)), 16),
    add(ellipsoid((0, -44, 40), (58, 56, 66)), 16),
    add(ellipsoid((0, 26, 48), (74, 60, 62)), 16),
    add(ellipsoid((0, 36, 20), (60, 56, 52)), 16),
)
"""Braincase, given for the scalp; the bone lies 6 mm deeper."""

FACE = (
    add(ellipsoid((0, -48, -8), (58, 47, 50)), 24),
    add(ellipsoid((0, -52, -50), (46, 43, 40)), 24),
    add(ellipsoid((0, -18, -22), (58, 44, 52)), 24),
    # cheekbones
    add(ellipsoid((42, -64, -8), (21, 18, 17), (0, 0, -20)), 18),
    add(tube([(46, -64, -9), (58, -48, -5), (64.5, -30, -1), (65, -10, 4)], [5, 5.5, 5.5, 5]), 18),
    add(ellipsoid((47.5, -31, -30), (12.5, 24, 32), (0, -5, -10)), 18),
    add(ellipsoid((54, -40, 22), (12, 30, 28), (0, 0, -8)), 18),
    # behind the ear
    add(ellipsoid((56, 15, -10), (12, 17, 20)), 12),
    # brow ridge
    add(
        tube(
            [(0, -92, 35), (16, -91.5, 36), (32, -86, 38), (46, -73, 35), (52, -58, 26)],
            [9, 9.2, 8.5, 8, 7],
        ),
        16,
    ),
    # jaw
    add(
        tube(
            [(51, -12, -34), (47, -22, -61), (34, -53, -79), (16, -78, -88), (0, -85, -88)],
            [8, 10.5, 11, 11, 11],
        ),
        22,
    ),
    # chin
    add(ellipsoid((0, -85.5, -87), (21, 13, 13)), 14),
    # muzzle
    add(ellipsoid((0, -76, -46), (36, 29, 26)), 16),
    # cheek
    add(ellipsoid((35, -62, -38), (18, 18, 22)), 20),
)

NECK = (
    add(cone((0, 8, -170), (0, 10, 0), 50, 45), 22),
    add(cone((0, 32, -170), (0, 34, 0), 48, 34), 22),
    # under the chin, larynx
    add(ellipsoid((0, -50, -88), (30, 28, 16)), 16),
    add(ellipsoid((0, -42, -120), (9, 10, 15)), 14),
    add(tube([(58, 14, -26), (50, -2, -80), (32, -32, -140)], [7, 8, 9]), 18),
)


def _on_lid(x: float, z: float, out: float = 0.0) -> Point:
    """The point of the eyelid's ellipsoid in front of (x, z), `out` mm before it."""
    u, w = (x - LID[0][0]) / LID[1][0], (z - LID[0][2]) / LID[1][2]
    return x, LID[0][1] - LID[1][1] * max(1 - u * u - w * w, 0.0) ** 0.5 - out, z


def _lid_line(points: Sequence[tuple[float, float]], out: float) -> list[Point]:
    return [_on_lid(x, z, out) for x, z in points]


LID = ((31.5, -78.0, 17.0), (16.0, 14.6, 13.0))
SLIT = ((18, 14.5), (24, 11.6), (31, 10.2), (38, 11.0), (45, 14.5))
CREASE = ((19, 20), (25, 24.5), (32, 25.6), (39, 24), (45, 19.5))

EYES = (
    # sockets
    cut(ellipsoid((32, -100, 16), (17, 16, 12.5)), 14),
    cut(ellipsoid((15, -105, 17), (6, 12, 9)), 10),
    # lids over the eyeball
    add(ellipsoid(*LID), 4),
    # between the lids, the edge of the lower lid, and the fold of the upper one
    cut(tube(_lid_line(SLIT, 1.2), [1.2, 1.6, 1.7, 1.6, 1.2]), 2),
    cut(tube(_lid_line(CREASE, 1.4), [1.0, 1.3, 1.4, 1.3, 1.0]), 4),
)

NOSE = (
    # bridge
    add(
        tube(
            [(0, -94, 34), (0, -95, 22), (0, -102, 8), (0, -108.5, -5), (0, -111, -14)],
            [7.5, 6.0, 5.5, 6.5, 7.5],
        ),
        10,
    ),
    # side walls
    add(tube([(7, -90.5, 20), (8.5, -94, -2), (11, -97, -16)], [7, 8, 8]), 8),
    # tip, wings, columella
    add(ellipsoid((0, -111.5, -16), (9.5, 9, 8.5)), 7),
    add(ellipsoid((11.5, -102, -20), (7.5, 10.5, 7.5), (0, 0, 12)), 5),
    add(ellipsoid((0, -103, -22), (4.5, 12, 5.5)), 6),
    # groove behind the wing
    cut(cone((20.5, -97.5, -14), (21, -94, -27), 1.2, 1.2), 5),
    # nostrils
    cut(tube([(7.8, -107, -31), (7.6, -105, -23), (6.5, -98, -14)], [3.4, 3.8, 3.6]), 1.5),
)

MOUTH = (
    # philtrum
    cut(cone((0, -109, -31), (0, -110, -42), 1.6, 2.2), 4),
    # lips
    add(
        tube(
            [(0, -102.2, -47.9), (4.5, -103, -46.7), (12, -99, -48.3), (21.5, -90.5, -51.2)],
            [4.6, 5.0, 4.4, 2.8],
        ),
        2.5,
    ),
    add(
        tube(
            [(0, -101.4, -57.4), (7, -100.4, -57.2), (14, -96, -56), (21.5, -90.5, -52.8)],
            [5.8, 5.6, 4.8, 2.8],
        ),
        2.5,
    ),
    cut(
        tube(
            [(0, -107.6, -52.6), (5, -107.4, -51.6), (12, -103.6, -52), (22, -94.4, -52.4)],
            [1.2, 1.2, 1.2, 0.9],
        ),
        1.5,
    ),
    # fold under the lower lip
    cut(ellipsoid((0, -110.5, -69), (17, 8, 4.5)), 12),
    # fold from the nose to the corner of the mouth
    cut(tube([(21, -100, -19), (29, -97.5, -32), (34, -92, -50)], [1.0, 1.4, 0.8]), 14),
)

EAR = (
    # root and plate
    add(ellipsoid((73, 8, -2), (6, 11, 22), (0, 0, -24)), 6),
    add(ellipsoid((82, 14, 4), (2.6, 17.5, 27), (0, 6, -27)), 2),
    # helix
    add(
        tube(
            [
                (77, 2, 2),
                (75.5, -3, 10),
                (78.5, -2, 20),
                (83, 6, 28.5),
                (87.5, 18, 29),
                (90, 27, 20),
                (89.5, 28, 6),
                (86, 22, -8),
                (81, 12, -19),
            ],
            [1.6, 2.0, 2.3, 2.7, 2.8, 2.7, 2.5, 2.4, 2.4],
        ),
        1.5,
    ),
    # antihelix
    add(tube([(85, 9, 20), (87.5, 17, 14), (87.5, 19, 4), (84.5, 14, -8), (82, 8, -12)], 2.3), 3),
    # bowl
    cut(ellipsoid((85, 6, -1), (7.5, 7.5, 9.5), (0, 0, -27)), 3),
    # tragus, lobe
    add(ellipsoid((74.5, -3.5, -3), (3.5, 3.5, 5), (0, 0, -30)), 5),
    add(ellipsoid((79, 5, -22), (3, 7, 8), (0, 0, -24)), 4),
)

SKIN: tuple[Part, ...] = (
    *FACE,
    *NECK,
    *EYES,
    *NOSE,
    *MOUTH,
    *EAR,
)
"""All of the skin but the braincase."""

THIN: tuple[Part, ...] = (
    add(ellipsoid((87, 12, 0), (15, 26, 38))),
    add(ellipsoid((0, -113, -18), (19, 13, 14))),
)
"""Ears and tip of the nose, where no fat lies under the skin."""
