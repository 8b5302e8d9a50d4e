"""Soft parts of the sample head: muscles, glands, eyes, vessels, airways. One half: x ≥ 0, mm, LPS.

Drawn onto fat, in order; the bones are painted over them.
"""

from __future__ import annotations

from volviz.samples.head.bones import ETHMOID, FRONTAL_SINUS
from volviz.samples.shapes import Part, add, box, cone, cut, ellipsoid, ribbon, tube, union

Strokes = tuple[tuple[str, tuple[Part, ...]], ...]

CHEWING: tuple[Part, ...] = (
    # temporalis
    add(ellipsoid((62, -28, 34), (11, 44, 42), (0, 10, 8))),
    add(tube([(56, -46, 14), (52, -44, -2), (47, -41, -18)], [9, 7, 4]), 4),
    # masseter
    add(ellipsoid((55.5, -36, -32), (6.5, 17, 34), (-10, 6, 0))),
    # pterygoids
    add(ellipsoid((38, -32, -38), (6, 11, 26), (-10, -14, 0))),
    add(cone((22, -42, -6), (46, -17, -9), 8, 5), 3),
    # buccinator
    add(ribbon([(30, -84, -50, 9, 2.4), (34, -66, -48, 10, 2.0), (32, -46, -44, 9, 1.8)])),
)

FACE: tuple[Part, ...] = (
    # around the mouth, to the cheekbone, around the eyes, forehead
    add(tube([(0, -97, -45), (14, -93, -46), (24, -85, -52)], [3.4, 3.4, 3])),
    add(tube([(0, -96, -60), (14, -91, -60), (24, -85, -53)], [4, 3.8, 3])),
    add(tube([(25, -86, -50), (36, -80, -34), (46, -74, -18)], [2.4, 2.4, 2.0])),
    add(tube([(14, -92, -26), (22, -90, -40), (25, -86, -50)], [2, 2, 2])),
    add(tube([(12, -94, -82), (20, -86, -70), (25, -85, -55)], [4, 3.4, 2.4])),
    add(tube([(6, -96, 34), (24, -95, 44), (36, -87, 58)], [1.6, 2.2, 1.6])),
    add(tube([(0, -97, -78), (0, -95, -70)], [5, 3]), 2),
)

TONGUE: tuple[Part, ...] = (
    add(ellipsoid((0, -62, -54), (20, 27, 13))),
    add(ellipsoid((0, -50, -68), (17, 22, 20)), 8),
    # floor of the mouth, to the tongue bone
    add(cone((0, -78, -78), (0, -52, -96), 9, 8), 6),
    add(cone((12, -80, -84), (8, -54, -98), 4, 4), 3),
    add(ribbon([(22, -74, -78, 4, 2), (32, -48, -76, 4, 2)]), 3),
    # soft palate
    add(tube([(0, -46, -33), (0, -36, -38), (0, -29, -50)], [5, 4.5, 3]), 2),
    add(tube([(12, -44, -34), (15, -34, -46), (15, -30, -64)], [4, 3.5, 4]), 3),
)

NECK: tuple[Part, ...] = (
    # sternocleidomastoid
    add(tube([(55, 15, -24), (50, 4, -62), (40, -14, -100), (30, -28, -136)], [6, 8.5, 9, 9])),
    # front of the spine, scalenes
    add(tube([(7, -8, -30), (7, -9, -80), (9, -7, -136)], [3.5, 5, 6])),
    add(tube([(30, 6, -50), (30, 6, -90), (33, 4, -136)], [4, 7, 9])),
    # strap muscles of the throat
    add(tube([(10, -50, -102), (11, -46, -120), (10, -42, -140)], [3.4, 3.6, 4])),
    add(tube([(22, -74, -84), (26, -48, -92), (40, -12, -62), (50, 8, -24)], [3.5, 3.5, 3.4, 3])),
)

THROAT: tuple[Part, ...] = (
    add(tube([(0, -32, -12), (0, -26, -40), (0, -24, -70), (0, -22, -96)], [15, 15, 15, 13])),
    add(cone((0, -24, -96), (0, -26, -140), 13, 13), 3),
    add(ellipsoid((0, -12, -126), (9, 5, 24)), 3),
)

AIRWAYS: tuple[Part, ...] = (
    # behind the nose, throat, windpipe
    add(ellipsoid((0, -34, -17), (13, 10, 13))),
    add(tube([(0, -30, -24), (0, -21, -46), (0, -22, -72), (0, -24, -92)], [9, 7, 8.5, 9]), 3),
    add(tube([(0, -25, -92), (0, -31, -108), (0, -29, -122), (0, -27, -150)], [8, 5.5, 8.5, 9]), 3),
    add(ellipsoid((14, -23, -98), (5, 5, 10)), 3),
    # between tongue and palate
    add(ribbon([(0, -86, -41, 0, 1.2), (0, -66, -38.5, 0, 1.3), (0, -46, -43, 0, 1.3)])),
    add(box((0, -68, -39.6), (15, 20, 1.3), 1.2), 1),
    # epiglottis stands in it
    cut(tube([(0, -40, -98), (0, -36, -88), (0, -32, -80)], [2.4, 2.2, 1.8]), 1),
    cut(tube([(6, -39, -96), (6, -35, -88)], [1.6, 1.4]), 1),
)

NASAL: tuple[Part, ...] = (
    # passages: a box less septum and conchae
    add(tube([(7.8, -107, -32), (7.4, -105, -23), (6.4, -97, -14), (6, -88, -12)], 3.4)),
    add(box((7, -64, -14), (6.2, 25, 12.6), 3)),
    add(box((3.4, -67, 4), (1.4, 18.5, 15.5), 1)),
    cut(box((0, -66, -4), (1.5, 40, 40), 0.5)),
    cut(tube([(9.5, -86, -21), (8.4, -68, -22), (8.6, -46, -20)], [3, 4.2, 3.4]), 2),
    cut(tube([(9.5, -82, -10), (7.6, -66, -10), (8, -48, -9)], [2.4, 3.4, 2.8]), 2),
)

CONCHAE: tuple[Part, ...] = (
    add(tube([(10.5, -84, -18), (8.4, -68, -21), (9.4, -48, -18)], 0.8)),
    add(tube([(10.5, -80, -7), (7.8, -66, -9), (9, -50, -7)], 0.7)),
    # septum: plate above, vomer below
    add(ellipsoid((0, -70, 6), (0.7, 19, 19))),
    add(ellipsoid((0, -60, -18), (0.7, 19, 13), (20, 0, 0))),
)

SINUSES: tuple[Part, ...] = (
    add(ellipsoid((27.5, -69, -17), (12.1, 15.6, 14.6))),
    add(FRONTAL_SINUS),
    *(add(cell) for cell in ETHMOID),
    add(ellipsoid((7, -40, 8), (6, 10.6, 8.6))),
    add(tube([(80, 1, -3), (66, 0, 0), (49, -3, 0)], [2.8, 2.6, 2.6])),
    add(ellipsoid((43.4, -4, 2), (2.6, 4.4, 5.4))),
)

ORBIT: tuple[Part, ...] = (
    add(
        union(
            (
                box((33.5, -84, 17.5), (18.6, 22, 16.6), 12.8, (0, 8, 0)),
                cone((29, -70, 17), (14, -46, 18.5), 15, 4),
            )
        )
    ),
)

EYE_MUSCLES: tuple[Part, ...] = (
    add(tube([(31, -84, 28.5), (28, -68, 29), (16, -48, 20)], [1.4, 2.2, 1.4])),
    add(tube([(31, -84, 5.5), (28, -68, 6), (16, -48, 17)], [1.4, 2.4, 1.4])),
    add(tube([(43, -84, 17), (40, -68, 17), (17, -48, 18)], [1.4, 2.2, 1.4])),
    add(tube([(19.5, -84, 17), (17, -68, 18), (14, -48, 19)], [1.4, 2.2, 1.4])),
)

EYE = ellipsoid((31.5, -78, 17), (12, 12.2, 12))
NERVE = tube([(30, -66, 17), (25, -57, 18), (14, -45, 19.5), (5, -32, 24)], [2.2, 2.2, 2.2, 2.2])
VITREOUS = ellipsoid((31.5, -78, 17), (10.8, 11, 10.8))
LENS = ellipsoid((31.5, -86.2, 17), (4.6, 2.2, 4.6))

VESSELS: tuple[Part, ...] = (
    # carotid with its fork, inner jugular vein, vertebral artery
    add(
        tube([(24, -16, -140), (25, -15, -100), (27, -10, -60), (25, -6, -18)], [4, 4.4, 3.2, 2.8])
    ),
    add(tube([(25, -16, -98), (30, -22, -84), (38, -16, -60)], [3, 2.4, 1.8])),
    add(tube([(32, -8, -140), (32, -6, -90), (30, -1, -50), (27, 2, -16)], [6, 5.6, 5, 4])),
    add(tube([(19.5, 1, -140), (19.5, 2, -60), (28, 5, -42), (16, 14, -31)], 1.9)),
    # face
    add(tube([(30, -60, -84), (36, -66, -66), (30, -82, -44), (18, -90, -10)], [1.4, 1.4, 1.2, 1])),
    add(tube([(66, -6, -10), (70, -8, 8), (70, -16, 34)], [1.6, 1.4, 1.1])),
)

LARYNX: tuple[Part, ...] = (
    add(ribbon([(0, -46, -117, 8, 1.5), (9, -38, -117, 9, 1.5), (16, -24, -115, 10, 1.4)])),
    add(
        tube([(0, -41, -132), (10, -36, -132), (12, -26, -131), (0, -17, -130)], [2.2, 2.2, 2.6, 3])
    ),
)

GLANDS: Strokes = (
    ("gland", (
        # parotid, submandibular, tear gland
        add(ellipsoid((58, -7, -32), (9, 13, 22), (0, 8, 0))),
        add(ellipsoid((62, -22, -26), (4, 14, 14)), 4),
        add(ellipsoid((34, -38, -84), (9, 14, 9), (0, 0, 30))),
    )),
)  # fmt: skip

BEFORE_ORBITS: Strokes = (
    ("muscle", CHEWING),
    *GLANDS,
    ("muscle", FACE),
    ("muscle", TONGUE),
    ("muscle", NECK),
    ("muscle", THROAT),
    ("blood", VESSELS),
    ("cartilage", LARYNX),
    ("mucosa", (add(box((0, -64, -3), (14, 30, 27), 4)),)),
)
"""Material and body, in the order of painting."""

ORBITS: Strokes = (
    ("fat", ORBIT),
    ("muscle", EYE_MUSCLES),
    ("gland", (add(ellipsoid((45, -80, 28), (4, 7, 4))),)),
    ("sclera and nerve", (add(NERVE), add(EYE, 2))),
    ("vitreous", (add(VITREOUS),)),
    ("lens", (add(LENS),)),
)

AIR: Strokes = (("air", AIRWAYS), ("air", NASAL), ("air", SINUSES))

DISCS: tuple[Part, ...] = (
    add(tube([(0, 3, -60), (0, 1.5, -79), (0, 1, -97), (0, 2, -115), (0, 5, -140)], 8)),
)

NAPE: tuple[Part, ...] = (
    add(tube([(0, 42, -8), (0, 34, -40), (0, 32, -80), (0, 32, -150)], [28, 33, 38, 44])),
    cut(box((0, -20, -80), (80, 38, 90), 8), 8),
)
"""The muscles behind the spine."""
SHEETS = ((15.0, 0.1), (25.0, -0.16))
"""Sheets of fat between them: depth below the skin, in mm, and how it changes with |x|."""
