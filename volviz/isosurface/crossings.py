"""Where the contours of two slices cross, square by square.

Contours are polylines, but what they stand for is the bilinear function of a square: arcs that are
monotone along u and v, of which the segments are the chords. Two segments whose ends alternate
along the border of their square cross once, whatever rounding says: that is told by whole numbers.
Two others may have arcs that bulge over one another and cross twice; so do the solids of slices
meet, or part, within a square only. Those get a bend on either segment between their crossings.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from volviz.isosurface.active import Floats, Ids
from volviz.isosurface.contours import Contours

WITHIN = 1e-7  # crossings of arcs are so far from the border of a square, in samples
EVEN = 1e-9  # what a saddle at the isovalue counts for above it, as a share of the values
ALIKE = 1e-8  # arcs that differ by less, as a share of the values, do not cross


@dataclass(frozen=True, eq=False)
class Stops:
    """Crossings and bends on the segments of slices A and B.

    first, second: int64[x], the segments of A and of B that cross. along, against: float64[x], by
    which those of one segment are sorted, as A runs and against B. points: float64[x + 2 y, 2], u
    and v of crossings, of bends on A, of bends on B. bent: int64[2, y], the segments of A and of B
    that bends are on; bends: float64[2, y], by which they are sorted among the crossings.
    """

    first: Ids
    second: Ids
    along: Floats
    against: Floats
    points: Floats
    bent: Ids
    bends: Floats


def stops(a: Contours, b: Contours, ranks: tuple[Ids, Ids]) -> Stops:
    """ranks: of the points of either slice, 1 if the other's lies before it on the same edge."""
    first, second = _pairs(a, b)
    cross, right, along, against = _alternating(a, b, ranks, first, second)
    roots, there = _meetings(a, b, first, second)
    twice = ~cross & _double(a, b, first, second, right, roots, there)
    points = _chords(a, b, first, second)
    # beside a pair of arcs that cross twice, segments have their crossings where the arcs have
    busy = np.isin(first, first[twice]) | np.isin(second, second[twice])
    once = busy & cross & (there[:, 0] != there[:, 1])
    points[once] = np.where(there[once, :1], roots[once, 0], roots[once, 1])
    along = np.where(busy, _way(points, a.points[first]), along)
    against = np.where(busy, _way(points, b.points[b.follows[second]]), against)
    whole = [points[cross], roots[twice, 0], roots[twice, 1]]
    ends = a.points[first[twice]], b.points[b.follows[second[twice]]]
    mids = roots[twice].mean(axis=1)
    bends = [_on_arc(s, k[twice], mids) for s, k in ((a, first), (b, second))]
    ways = [[_way(p, e) for p in whole[1:]] for e in ends]
    return Stops(
        np.concatenate([first[cross], first[twice], first[twice]]),
        np.concatenate([second[cross], second[twice], second[twice]]),
        np.concatenate([along[cross], *ways[0]]),
        np.concatenate([against[cross], *ways[1]]),
        np.concatenate(whole + bends),
        np.stack([first[twice], second[twice]]),
        np.stack([np.mean(w, axis=0) for w in ways]),
    )


def _double(
    a: Contours, b: Contours, first: Ids, second: Ids, right: NDArray[np.bool_], roots: Floats,
    there: NDArray[np.bool_],
) -> NDArray[np.bool_]:  # fmt: skip
    """Which of the pairs whose ends do not alternate have arcs that cross twice.

    right: B's ends are on the right of A. Where both end at one place, B is a little larger there,
    and the arcs may cross there: if they do once elsewhere, or if B's runs on the other side of A's
    than its ends. Those places are put into `roots`.
    """
    p, q = (s.points[np.stack([k, s.follows[k]], axis=1)] for s, k in ((a, first), (b, second)))
    ahead, back = (p == q).all(axis=2), (p == q[:, ::-1]).all(axis=2)
    tied = np.where((ahead.sum(axis=1) >= back.sum(axis=1))[:, None], ahead, back)
    met = np.count_nonzero(there, axis=1)
    one = met == 1  # the other is on the border
    end = np.where(tied[one, :1], p[one, 0], p[one, 1])
    roots[one] = np.where(there[one, :, None], roots[one], end[:, None])
    none = (met == 0) & tied.all(axis=1)
    middle = _on_arc(b, second, q.mean(axis=1)) - _corner(b, second)
    with np.errstate(all="ignore"):
        f = _bilinear(a, first)
        u, v = middle.T
        side = f[0] + f[1] * u + f[2] * v + f[3] * u * v
        none &= np.where(right, side, -side) > WITHIN * sum(np.abs(k) for k in f)
    roots[none] = p[none]
    return np.asarray((met == 2) | one | none)


def _pairs(a: Contours, b: Contours) -> tuple[Ids, Ids]:
    """Segments of A and of B that are in the same square, each with each."""
    by_square = np.argsort(b.squares, kind="stable")
    known = b.squares[by_square]
    low, high = (np.searchsorted(known, a.squares, side=s) for s in ("left", "right"))
    count = high - low
    first: Ids = np.repeat(np.arange(len(a.keys)), count)
    nth = np.arange(first.size) - np.repeat(np.cumsum(count) - count, count)
    return first, by_square[low[first] + nth]


def _ends(slice_: Contours, ranks: Ids, segments: Ids) -> tuple[Ids, Ids]:
    """Where segments start and end on the border of their squares: 0 to 7, counter-clockwise."""
    found = []
    for ends in (segments, slice_.follows[segments]):
        step = slice_.keys[ends] - 2 * slice_.squares[segments]
        edge = np.select([step == 0, step == 1, step == 3], [0, 3, 1], 2)
        rank = ranks[ends]
        found.append(2 * edge + np.where(edge < 2, rank, 1 - rank))
    return found[0], found[1]


def _alternating(
    a: Contours, b: Contours, ranks: tuple[Ids, Ids], first: Ids, second: Ids
) -> tuple[NDArray[np.bool_], NDArray[np.bool_], Ids, Ids]:
    """Whether the ends of segments alternate; whether B starts on the right of A; where crossings
    of those that do come on A, and against B."""
    (p0, p1), (q0, q1) = _ends(a, ranks[0], first), _ends(b, ranks[1], second)
    right = [(q - p0) % 8 < (p1 - p0) % 8 for q in (q0, q1)]
    within = (p0 - q1) % 8 < (q0 - q1) % 8
    along = (np.where(right[0], q0, q1) - p0) % 8
    against = (np.where(within, p0, p1) - q1) % 8
    return right[0] != right[1], right[0], along, against


def _chords(a: Contours, b: Contours, first: Ids, second: Ids) -> Floats:
    """Where lines through segments cross, on the segment of A whatever rounding says."""
    p, q = a.points[first], b.points[second]
    along, across = a.points[a.follows[first]] - p, b.points[b.follows[second]] - q
    apart = q - p
    size = along[:, 0] * across[:, 1] - along[:, 1] * across[:, 0]
    share = apart[:, 0] * across[:, 1] - apart[:, 1] * across[:, 0]
    t = np.divide(share, size, out=np.full(len(p), 0.5), where=size != 0)
    return np.asarray(p + np.clip(t, 0.0, 1.0)[:, None] * along)


def _way(points: Floats, start: Floats) -> Floats:
    """How far along an arc from where it starts: it is monotone along u and v."""
    return np.asarray(np.abs(points - start).sum(axis=1))


def _bilinear(slice_: Contours, segments: Ids) -> tuple[Floats, ...]:
    """Of the squares of segments: a, b, c, d so that value − isovalue = a + b u + c v + d u v."""
    values, square = slice_.values.ravel(), slice_.squares[segments]
    width = slice_.values.shape[1]
    low, right, up, far = (values[square + k] for k in (0, 1, width, width + 1))
    a, b, c, d = low - slice_.isovalue, right - low, up - low, low + far - right - up
    size = np.abs([a, b, c, d]).sum(axis=0)
    # a saddle at the isovalue counts as inside: the arcs beside it do not meet there
    return a + np.where(np.abs(a * d - b * c) <= EVEN**2 * size * size, EVEN * size, 0), b, c, d


def _corner(slice_: Contours, segments: Ids) -> Floats:
    """float64[n, 2]: u, v of the lowest samples of the squares of segments."""
    v, u = np.divmod(slice_.squares[segments], slice_.values.shape[1])
    return np.stack([u, v], axis=1) - 1.0


def _meetings(
    a: Contours, b: Contours, first: Ids, second: Ids
) -> tuple[Floats, NDArray[np.bool_]]:
    """Where two arcs cross: float64[n, 2, 2] places, and bool[n, 2] which of them there are."""
    corner = _corner(a, first)
    middles = [
        (s.points[k] + s.points[s.follows[k]])[:, 0] / 2 - corner[:, 0]
        for s, k in ((a, first), (b, second))
    ]
    with np.errstate(all="ignore"):
        f, g = _bilinear(a, first), _bilinear(b, second)
        square = g[1] * f[3] - g[3] * f[1]
        half = (g[0] * f[3] + g[1] * f[2] - g[2] * f[1] - g[3] * f[0]) / 2
        rest = g[0] * f[2] - g[2] * f[0]
        root = half + np.copysign(np.sqrt(half * half - square * rest), half)
        u = np.stack([-root / square, -rest / root], axis=1)
        size = np.abs(f).sum(axis=0) * np.abs(g).sum(axis=0)
        u[~(np.abs([square, half, rest]).max(axis=0) > ALIKE * size)] = np.nan
        by_f, by_g = (e[2][:, None] + e[3][:, None] * u for e in (f, g))
        steep = np.abs(by_g) * np.abs(f).sum(axis=0)[:, None]
        best = steep > np.abs(by_f) * np.abs(g).sum(axis=0)[:, None]
        on_f, on_g = (-(e[0][:, None] + e[1][:, None] * u) / d for e, d in ((f, by_f), (g, by_g)))
        v = np.where(best, on_g, on_f)
        there = (u > WITHIN) & (u < 1 - WITHIN) & (v > WITHIN) & (v < 1 - WITHIN)
        for e, middle in zip((f, g), middles, strict=True):
            # on the branch of the hyperbola that the segment is the chord of
            there &= ((e[2] + e[3] * middle) * (e[2][:, None] + e[3][:, None] * u).T > 0).T
        there &= (np.abs(u[:, 0] - u[:, 1]) > WITHIN)[:, None]  # not where they but touch
    return np.where(there[..., None], np.stack([u, v], axis=2), 0.5) + corner[:, None], there


def _on_arc(slice_: Contours, segments: Ids, places: Floats) -> Floats:
    """Places with their u, on the arcs."""
    corner = _corner(slice_, segments)
    f = _bilinear(slice_, segments)
    u = places[:, 0] - corner[:, 0]
    with np.errstate(all="ignore"):
        v = -(f[0] + f[1] * u) / (f[2] + f[3] * u)
    v = np.where((v >= 0) & (v <= 1), v, places[:, 1] - corner[:, 1])
    return np.stack([u, v], axis=1) + corner
