"""Which entry of the cases a cell has: asymptotic decider on faces, saddles inside.

Faces (Nielson and Hamann 1991): the bilinear function on an ambiguous face has a saddle; if its
value is inside, the inside corners are joined. Only the sign of a difference of two products is
needed, which both cells of the face compute from the same four numbers in the same way.

Inside (Chernyaev 1995 as corrected by Custodio et al. 2013; the saddles as in Grosso 2016): height
along z, restricted to the surface in the cell, has its critical points where the hyperbolas of a
slice degenerate into crossing lines, at most two. If a cell has two loops or more, two such points
inside the cell mean that two loops are the ends of one tube. Six lines of the surface, parallel to
the axes, run round its neck through these points; their corners are the vertices of the tube.

A sample equal to the isovalue counts as inside. That is the surface of an isovalue lower by
nothing to speak of, and so is every decision here: a saddle at the isovalue is inside, and the
saddles inside are looked for a little below.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from volviz.isosurface.cases import FACES
from volviz.isosurface.kernel import bare, hot, lowest_bit
from volviz.isosurface.samples import fill_corners

HISTORIC, FACES_ONLY, TRILINEAR = 0, 1, 2
RULES = {"trilinear": TRILINEAR, "asymptotic": FACES_ONLY, "table15": HISTORIC}

_RINGS = np.array(FACES)
_LOWER = 1e-7  # of the largest corner value: how far below the isovalue saddles are looked for
_NEAR = 1e-9  # of the same: how near to the isovalue one must be to be on the surface


@hot
def corner_values(data: Any, isovalue: float, z: int, y: int, x: int, values: Any) -> None:
    """float64[8]: samples minus the isovalue at the corners x + 2y + 4z of a cell.

    data: an array or `Samples`.
    """
    fill_corners(data, z, y, x, values)
    for c in range(8):
        values[c] -= isovalue


@bare
def joined_faces(values: Any, ambiguous: int) -> int:
    """The bits of those ambiguous faces whose inside corners are joined."""
    bits: Any = 0
    left = np.uint64(ambiguous & 63)
    while left:
        f = np.uint64(lowest_bit(left))
        left &= left - np.uint64(1)
        even = values[_RINGS[f, 0]] * values[_RINGS[f, 2]]
        odd = values[_RINGS[f, 1]] * values[_RINGS[f, 3]]
        above = even - odd if values[_RINGS[f, 0]] >= 0 else odd - even
        if above >= 0:
            bits |= 1 << np.int64(f)
    return bits


@bare
def saddles(values: Any, found: Any) -> int:
    """How many height saddles (x, y, z; 0..1) are inside the cell; they fill float64[2, 3]."""
    size = 0.0
    for c in range(8):
        size = max(size, abs(values[c]))
    lift = _LOWER * size
    a, b, c, d = values[0] + lift, values[1] + lift, values[3] + lift, values[2] + lift
    da, db = values[4] - values[0], values[5] - values[1]
    dc, dd = values[7] - values[3], values[6] - values[2]
    square, constant = da * dc - db * dd, a * c - b * d
    linear = a * dc + c * da - b * dd - d * db
    under = linear * linear - 4 * square * constant
    if not under > 0 or square == 0:
        return 0
    far = -0.5 * (linear + np.sqrt(under) * (1 if linear >= 0 else -1))
    count = 0
    for k in range(2):
        w = far / square if k == 0 else constant / far
        p, q, r, s = a + w * da, b + w * db, c + w * dc, d + w * dd
        u, v = (p - s) / (p + r - q - s), (p - q) / (p + r - q - s)
        inside = 0 < w < 1 and 0 < u < 1 and 0 < v < 1
        # four equal values solve the quadratic too, without being on the surface
        if inside and abs(trilinear(values, u, v, w) + lift) < _NEAR * size:
            found[count, 0], found[count, 1], found[count, 2] = u, v, w
            count += 1
    return count


@hot
def decide(values: Any, case: int, cases: Any, rule: int, found: Any) -> Any:
    """(entry, row of `cases.tubes` or −1) of an ambiguous case with these corner values."""
    if rule == HISTORIC:
        return np.int64(cases.historic[case]), -1
    bits = joined_faces(values, np.int64(cases.ambiguous[case]))
    entry = np.int64(cases.entry[case, bits])
    if rule == FACES_ONLY or cases.tube[entry, 0] < 0 or saddles(values, found) < 2:
        return entry, -1
    filled = trilinear(values, *_between(found)) >= 0
    return entry, np.int64(cases.tube[entry, 1 if filled else 0])


@bare
def _between(found: Any) -> Any:
    return (
        0.5 * (found[0, 0] + found[1, 0]),
        0.5 * (found[0, 1] + found[1, 1]),
        0.5 * (found[0, 2] + found[1, 2]),
    )


@bare
def trilinear(values: Any, x: float, y: float, z: float) -> float:
    """Value between eight corner values."""
    total = 0.0
    for c in range(8):
        weight = (x if c & 1 else 1 - x) * (y if c & 2 else 1 - y) * (z if c & 4 else 1 - z)
        total += weight * values[c]
    return total
