"""The teeth of the sample head: crowns with enamel, roots, two rows. One half: x ≥ 0, mm, LPS.

Sizes after the usual tables of dental anatomy (mesiodistal and buccolingual width of the crown,
height of the crown, length of the root).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from volviz.samples.head.canvas import Canvas
from volviz.samples.shapes import Part, Shape, add, box, cone, ellipsoid, spline

# width along the row, width across, height of the crown, length of the root, cusps, roots
UPPER = (
    (8.5, 7.0, 10.5, 13.0, 0, 1), (6.7, 6.2, 9.5, 13.0, 0, 1), (7.6, 8.0, 10.2, 16.5, 1, 1),
    (7.0, 9.0, 8.4, 14.0, 2, 2), (6.8, 9.0, 8.0, 14.0, 2, 1), (10.2, 11.0, 7.4, 12.5, 4, 3),
    (9.6, 11.0, 7.0, 11.5, 4, 3),
)  # fmt: skip
LOWER = (
    (5.4, 6.0, 9.0, 12.0, 0, 1), (5.9, 6.4, 9.4, 13.0, 0, 1), (7.0, 7.6, 10.8, 15.0, 1, 1),
    (7.1, 7.8, 8.6, 13.5, 2, 1), (7.2, 8.2, 8.2, 13.5, 2, 1), (11.2, 10.4, 7.6, 13.0, 4, 2),
    (10.6, 10.2, 7.2, 12.0, 4, 2),
)  # fmt: skip
UPPER_ROW = ((0, -97), (8, -95.4), (15, -91), (20.6, -84), (24, -75), (26.6, -64), (28.4, -52))
LOWER_ROW = (
    (0, -93.6),
    (7, -92.2),
    (13, -88.6),
    (18.4, -82),
    (22.4, -73),
    (25.6, -62),
    (28.2, -50),
)
UPPER_BITE, LOWER_BITE = -55.2, -55.6
FILLED_TOOTH = 5


@dataclass(frozen=True)
class Tooth:
    """A tooth: middle of its biting edge, turn of the row there in degrees, and its sizes.

    up: +1 if its root points up.
    """

    x: float
    y: float
    z: float
    turn: float
    up: int
    along: float
    across: float
    crown: float
    root: float
    cusps: int
    roots: int

    def place(self, u: float, v: float, w: float) -> tuple[float, float, float]:
        """World position of u mm along the row, v mm outwards, w mm towards the root."""
        c, s = math.cos(math.radians(self.turn)), math.sin(math.radians(self.turn))
        return self.x + u * c + v * s, self.y + u * s - v * c, self.z + self.up * w


def teeth() -> Iterator[Tooth]:
    """Both rows, from the middle outwards."""
    for rows, line, bite, up in (
        (UPPER, UPPER_ROW, UPPER_BITE, 1),
        (LOWER, LOWER_ROW, LOWER_BITE, -1),
    ):
        path = spline(np.asarray(line, float), 16)
        run = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
        start = 0.0
        for number, (along, across, crown, root, cusps, roots) in enumerate(rows):
            x, y, turn = _on(path, run, start + along / 2)
            # front teeth of the upper row bite past the lower ones
            z = bite + (-0.9 if up > 0 else 0.8) * max(0.0, 1 - number / 3)
            yield Tooth(x, y, z, turn, up, along, across, crown, root, cusps, roots)
            start += along


def _on(
    path: NDArray[np.float64], run: NDArray[np.float64], s: float
) -> tuple[float, float, float]:
    """Position x, y and direction in degrees, s mm along a path."""
    (x, y), (x0, y0), (x1, y1) = (
        (float(np.interp(t, run, path[:, 0])), float(np.interp(t, run, path[:, 1])))
        for t in (s, s - 2, s + 2)
    )
    return x, y, math.degrees(math.atan2(y1 - y0, x1 - x0))


def crown(tooth: Tooth) -> tuple[Part, ...]:
    """The crown, with its cusps or its edge."""
    a, b, h = 0.46 * tooth.along, 0.5 * tooth.across, tooth.crown
    turn = (0.0, 0.0, tooth.turn)
    if tooth.cusps == 0:
        # a wedge: broad edge below, thick neck above
        edge = box(tooth.place(0, 0.4, 0.32 * h), (a, 0.26 * tooth.across, 0.32 * h), 1.1, turn)
        neck = ellipsoid(tooth.place(0, -0.3, 0.68 * h), (0.84 * a, 0.92 * b, 0.42 * h), turn)
        return add(edge), add(neck, 3)
    if tooth.cusps == 1:
        tip = cone(tooth.place(0, 0.3, 1.4), tooth.place(0, 0, 0.62 * h), 1.2, 0.86 * a)
        body = ellipsoid(tooth.place(0, -0.2, 0.62 * h), (a, 0.92 * b, 0.44 * h), turn)
        return add(tip), add(body, 3)
    body = box(tooth.place(0, 0, 0.54 * h), (a, 0.94 * b, 0.46 * h), 2.2, turn)
    us = (0.0,) if tooth.cusps == 2 else (-0.48 * a, 0.48 * a)
    tips = [
        ellipsoid(tooth.place(u, v, 1.4), (0.46 * a if len(us) > 1 else 0.6 * a, 1.7, 1.5), turn)
        for u in us
        for v in (-0.5 * b, 0.5 * b)
    ]
    return add(body), *(add(tip, 1.4) for tip in tips)


def roots(tooth: Tooth) -> tuple[Part, ...]:
    """The roots, from within the crown to their tips."""
    a, b, start = 0.46 * tooth.along, 0.5 * tooth.across, 0.8 * tooth.crown
    end = tooth.crown + tooth.root
    if tooth.roots == 1:
        wide = min(0.72 * a, 0.72 * b)
        return (add(cone(tooth.place(0, -0.3, start), tooth.place(0.6, -0.8, end), wide, 1.0)),)
    spots = {2: ((-0.5, 0.0), (0.5, 0.0)), 3: ((-0.5, 0.45), (0.5, 0.45), (0.0, -0.5))}[tooth.roots]
    if tooth.cusps == 2:
        spots = ((0.0, -0.45), (0.0, 0.45))
    wide = 0.42 * min(a, b) + 0.4
    return tuple(
        add(
            cone(
                tooth.place(u * a, v * b, start),
                tooth.place(1.2 * u * a, 1.3 * v * b, end),
                wide,
                0.9,
            ),
            1.5,
        )
        for u, v in spots
    )


def core(tooth: Tooth) -> Shape:
    """The dentine inside the crown: what is beneath the enamel."""
    a, b, h = 0.46 * tooth.along, 0.5 * tooth.across, tooth.crown
    thick = 0.5 * b if tooth.cusps else 0.42 * b
    return ellipsoid(
        tooth.place(0, -0.2, 0.78 * h), (a - 1.3, thick, 0.5 * h), (0.0, 0.0, tooth.turn)
    )


def filling() -> tuple[Part, ...]:
    """Amalgam in the chewing face of the left first lower molar (not mirrored)."""
    tooth = [t for t in teeth() if t.up < 0][FILLED_TOOTH]
    turn = (0.0, 0.0, tooth.turn)
    return (
        add(box(tooth.place(0, 0, 2.2), (3.4, 2.2, 1.9), 0.8, turn)),
        add(box(tooth.place(2.4, 0, 2.8), (2.2, 1.6, 2.2), 0.8, turn)),
    )


def paint_teeth(canvas: Canvas) -> None:
    """Roots, crowns and what is in them, onto one half of the head."""
    low, high = float(canvas.grid.z.min()), float(canvas.grid.z.max())
    if high < LOWER_BITE - 30 or low > UPPER_BITE + 32:
        return
    for tooth in teeth():
        canvas.paint(roots(tooth), "dentine")
        canvas.paint(crown(tooth), "enamel")
        canvas.paint((add(core(tooth)),), "dentine")
