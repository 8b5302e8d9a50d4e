"""Contour tracing: contours slice by slice, linked where they overlap, and tiled between.

After Keppel 1975, Fuchs, Kedem and Uselton 1977 and Barequet and Sharir 1996. Regions of two
slices that overlap are one, however many of either and also where the overlaps form a ring. The
surface between two slices falls into sheets: a contour with one contour is tiled with the least
area; contours without any beyond are capped half a slice further; what branches, or has handles,
are clefts between the contours and get triangles as they are (`clefts.triangles`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volviz.fields.statistics import padding_value
from volviz.isosurface.active import (
    Floats,
    Ids,
    averaged_normals,
    mirrored,
    skipped_cells,
    to_world,
)
from volviz.isosurface.clefts import triangles
from volviz.isosurface.contours import Contours, contours
from volviz.isosurface.kernel import aside, threshold
from volviz.isosurface.overlay import Overlay, overlay
from volviz.isosurface.tiling import FIXED, tile
from volviz.model.mesh import Mesh
from volviz.model.volume import Volume
from volviz.progress import Progress, silent

# Of the slices along an axis: the order of the array's axes, and of (u, v, slice) as x, y, z.
_ORDERS = {"z": ((0, 1, 2), (0, 1, 2)), "y": ((1, 2, 0), (1, 2, 0)), "x": ((2, 0, 1), (2, 0, 1))}
TIE = 1e-6  # samples at the isovalue count as so much above it, as a share of all values' span
_HEIGHTS = np.array([0.0, 1.0, 0.5])  # of points of both slices and of others


@dataclass
class _Parts:
    """Points (u, v, slice) and triangles as they are made. world: makes mm of them. heard: called
    between steps, raises Cancelled. doubled: an edge is used more than twice."""

    order: tuple[int, int, int]
    affine: Floats
    heard: Callable[[], None]
    doubled: bool = False
    count: int = 0
    points: list[Floats] = field(default_factory=list)
    faces: list[Ids] = field(default_factory=list)

    def world(self, points: Floats) -> Floats:
        """float64[n, 3]: mm."""
        return to_world(self.affine, points[:, list(self.order)])

    def add(self, flat: Floats, heights: Floats) -> int:
        """Number of the first of these points: u and v, and how high they are, in slices."""
        first = self.count
        self.points.append(np.column_stack([flat, heights]))
        self.count += len(flat)
        return first


def extract(
    volume: Volume,
    isovalue: float,
    cells: Ids | None = None,
    *,
    axis: str = "z",
    progress: Progress | None = None,
) -> Mesh:
    """The surface through the contours of all slices across an index axis ("x", "y" or "z").

    cells: not used; contours go on through all of a slice. The mesh is closed: it ends half a
    slice beyond its last contour, and half a sample beyond samples that have neighbours that are
    not valid or none. Every edge is used twice, once in each direction. It has the components and
    handles of the trilinear function between the samples, as marching cubes has with ambiguity
    "trilinear"; where the isovalue is a sample's, what touches there is linked. Nothing where no
    sample is outside. Tilings have the least area for rings of some hundred points, and are good
    ones beyond (`tiling.tile`); all else takes time in proportion to the contours' points. Memory
    beyond the mesh: that of two slices, and 100 bytes per triangle. Raises Cancelled.
    """
    del cells
    report = progress or silent()
    skipped = skipped_cells(volume, report.part(0, 0.1))
    nothing = Mesh(np.empty((0, 3), np.float32), space=volume.info.space, skipped=skipped)
    limit = threshold(volume.data.dtype, isovalue)
    if limit is None or min(volume.data.shape) < 2:
        return nothing
    turned, order = _ORDERS[axis]
    slices = volume.data.transpose(turned)
    done = 0.1
    parts = _Parts(order, volume.affine, lambda: report(done, "contours"))
    empty = np.full(slices.shape[1:], np.nan)
    span = _span_of_tied(slices, isovalue)
    level = isovalue if span is None else 0.0
    none = contours(empty, np.zeros(empty.shape, np.bool_), level)
    below, base, outside = none, 0, 0
    for k in range(len(slices) + 1):
        done = 0.1 + 0.8 * k / (len(slices) + 1)
        parts.heard()
        above = none
        if k < len(slices):
            values, inside = _samples(slices[k], limit, padding_value(volume))
            outside += int(np.count_nonzero(~inside & np.isfinite(values)))
            if span is not None:
                values = _untied((values - isovalue) / span)
            above = contours(values, inside, level)
        first = parts.add(above.points, np.full(len(above.points), float(k)))
        made = len(parts.faces)
        _between(parts, below, above, (base, first), k)
        parts.heard()
        parts.doubled = parts.doubled or _doubled(parts.faces[made:])
        below, base = above, first
    if not parts.faces or not outside:
        return nothing
    return _mesh(volume, parts, skipped, report)


def _span_of_tied(slices: NDArray[Any], isovalue: float) -> float | None:
    """How far the values go, if one of them is the isovalue."""
    if not any((s == isovalue).any() for s in slices):
        return None
    low, high = np.inf, -np.inf
    for s in slices:
        good = s[np.isfinite(s)]
        if good.size:
            low, high = min(low, float(good.min())), max(high, float(good.max()))
    span = high - low
    return span if 0 < span < np.inf else None


def _untied(above: Floats) -> Floats:
    """Values above the isovalue, none of them 0: a little raised, but none from below to above.

    So what touches at samples is linked, also where no number lies between two of them.
    """
    near = (above < 0) & (above > -2 * TIE)
    return np.where(near, above / 2, above + TIE)


def _samples(
    plane: NDArray[Any], limit: Any, padding: float | None
) -> tuple[Floats, NDArray[np.bool_]]:
    """Values of a slice, NaN where not valid, and what is inside."""
    valid = np.isfinite(plane) if padding is None else np.isfinite(plane) & (plane != padding)
    return np.where(valid, plane.astype(np.float64), np.nan), valid & (plane >= limit)


def _between(
    parts: _Parts, below: Contours, above: Contours, firsts: tuple[int, int], k: int
) -> None:
    """The sheets between slice k − 1 and slice k; firsts: numbers of their first points."""
    m, n = len(below.keys), len(above.keys)
    if not m + n:
        return
    over = overlay(below, above)
    parts.heard()
    pairs, tubes, capped = _sheets(over, below, above)
    flat = np.concatenate([below.points, above.points, over.extra])
    level = np.repeat(np.array([0, 1, 2], np.int8), [m, n, len(over.extra)])
    numbers = np.concatenate([firsts[0] + np.arange(m), firsts[1] + np.arange(n)])
    world = parts.world(np.column_stack([flat, k - 1 + _HEIGHTS[level]]))
    parts.faces += [numbers[tile(world, low, high)] for low, high in pairs]
    pieces = ~tubes[over.sheets]
    if not pieces.any():
        return
    lids = capped[over.sheets[: m + n]]
    level[: m + n][lids] = 2
    world = parts.world(np.column_stack([flat, k - 1 + _HEIGHTS[level]]))
    parts.heard()
    made, parents = triangles(over, pieces, flat, world, level)
    parts.heard()
    added = np.zeros(len(flat) + len(parents), np.bool_)
    added[over.nodes[pieces]] = True
    added[: m + n], added[len(flat) :] = lids, True
    middles = flat[parents].mean(axis=1)
    heights = np.full(len(added), 0.5)
    heights[len(flat) :] = _heights(below, above, middles)
    own = np.zeros(len(added), dtype=np.int64)
    own[: m + n] = numbers
    first = parts.add(np.concatenate([flat, middles])[added], k - 1 + heights[added])
    own[added] = first + np.arange(np.count_nonzero(added))
    parts.faces.append(own[made])
    _walls(parts, over, lids, numbers, own)
    _uprights(parts, over, pieces, own)


def _sheets(
    over: Overlay, below: Contours, above: Contours
) -> tuple[list[tuple[Ids, Ids]], NDArray[np.bool_], NDArray[np.bool_]]:
    """Pairs of contours with a plain sheet between them: their nodes; bool[sheets]: whether a
    sheet is such a one; bool[sheets]: whether it has contours of one slice only."""
    m, count = len(below.keys), len(over.euler)
    own = [over.sheets[below.order[below.starts[:-1]]]]
    own.append(over.sheets[m + above.order[above.starts[:-1]]])
    many = [np.bincount(o, minlength=count) for o in own]
    size = [
        np.bincount(o, np.diff(s.starts), count) for o, s in zip(own, (below, above), strict=True)
    ]
    tubes = (many[0] == 1) & (many[1] == 1) & (over.euler == 0) & (size[0] * size[1] <= FIXED)
    rings = below.rings, above.rings
    low = {int(own[0][c]): rings[0][c] for c in np.flatnonzero(tubes[own[0]])}
    high = {int(own[1][c]): m + rings[1][c] for c in np.flatnonzero(tubes[own[1]])}
    return [(low[s], high[s]) for s in low], tubes, (many[0] == 0) | (many[1] == 0)


def _heights(below: Contours, above: Contours, flat: Floats) -> Floats:
    """Where between the slices, 0..1, linear interpolation has the isovalue; half-way if in doubt.

    Away from the slices, where the next slab's surface may be.
    """
    low, high = (_sampled(s.values, flat + 1) for s in (below, above))
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (below.isovalue - low) / (high - low)
    return np.where(np.isfinite(t), np.clip(t, 0.1, 0.9), 0.5)


def _sampled(values: Floats, flat: Floats) -> Floats:
    """float64[n]: values at u, v by bilinear interpolation."""
    corner = np.clip(flat.astype(np.int64), 0, np.array(values.shape[::-1]) - 2)
    (u, v), (s, t) = corner.T, (flat - corner).T
    with np.errstate(invalid="ignore", over="ignore"):
        one = values[v, u] * (1 - s) + values[v, u + 1] * s
        two = values[v + 1, u] * (1 - s) + values[v + 1, u + 1] * s
        return np.asarray(one * (1 - t) + two * t)


def _walls(parts: _Parts, over: Overlay, lids: NDArray[np.bool_], numbers: Ids, own: Ids) -> None:
    """From contours that end to their lids. numbers: in their slices; own: in lids."""
    at = np.flatnonzero(lids)
    one, two = numbers[at], numbers[over.goals[at]]
    three, four = own[at], own[over.goals[at]]
    parts.faces.append(np.stack([one, two, three], axis=1))
    parts.faces.append(np.stack([two, four, three], axis=1))


def _uprights(parts: _Parts, over: Overlay, pieces: NDArray[np.bool_], own: Ids) -> None:
    """Between segments of contours and the crossings above or below them."""
    m, n, _ = over.counts
    at = np.flatnonzero(pieces & (over.follows >= m + n))
    nodes = over.nodes
    corners = np.stack([nodes[at], over.goals[at], nodes[over.follows[at]]], axis=1)
    parts.faces.append(own[corners])


def _mesh(volume: Volume, parts: _Parts, skipped: int, report: Progress) -> Mesh:
    points, faces = np.concatenate(parts.points), np.concatenate(parts.faces)
    flat, faces = _separated(points, faces, report) if parts.doubled else (points, faces)
    points = parts.world(flat)
    if mirrored(volume.affine):
        faces = faces[:, ::-1]
    short = np.ascontiguousarray(faces, dtype=np.uint32)
    spare, part = np.ones_like(points), report.part(0.95, 1.0)
    normals = aside(lambda: averaged_normals(points, short, spare), part, "normals")
    space = volume.info.space
    return Mesh(points.astype(np.float32), short, normals, space=space, skipped=skipped)


def _doubled(made: list[Ids]) -> bool:
    """Whether the triangles between two slices use an edge twice in one direction."""
    if not made:
        return False
    faces = np.concatenate(made)
    faces = faces - faces.min()
    keys = np.sort((faces * (int(faces.max()) + 1) + np.roll(faces, -1, axis=1)).ravel())
    return bool((keys[1:] == keys[:-1]).any())


def _separated(points: Floats, faces: Ids, report: Progress) -> tuple[Floats, Ids]:
    """The same surface, its edges used twice each: those used more often get a point of their own.

    A tiling that goes round one contour before the other comes back to its first edge.
    """
    while True:
        count = len(points)
        ends = np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2)
        keys = ends[:, 0] * count + ends[:, 1]
        order = aside(partial(np.argsort, keys, kind="stable"), report.part(0.9, 0.95), "closing")
        again = np.flatnonzero(keys[order][1:] == keys[order][:-1]) + 1
        if not again.size:
            return points, faces
        known, busy = keys[order], set[int]()
        middles, more = list[Floats](), list[Ids]()
        faces = faces.copy()
        for h in order[again].tolist():
            a, b = ends[h].tolist()
            back = order[np.searchsorted(known, b * count + a, side="right") - 1]
            pair = (h, int(back))
            if busy & {h // 3 for h in pair} or pair[0] // 3 == pair[1] // 3:
                continue
            busy |= {h // 3 for h in pair}
            new = count + len(middles)
            if faces[h // 3, (h + 2) % 3] == faces[pair[1] // 3, (pair[1] + 2) % 3]:
                # back to back on the same corners: one of them gets a point of its own first
                middles.append(points[faces[h // 3]].mean(axis=0))
                one, two, three = faces[h // 3]
                more += [np.array([two, three, new]), np.array([three, one, new])]
                faces[h // 3, 2] = new
                continue
            middles.append((points[a] + points[b]) / 2)
            for side in pair:
                t, corner = divmod(side, 3)
                more.append(np.roll(faces[t], -corner))
                more[-1][0] = new
                faces[t, (corner + 1) % 3] = new
        if not middles:
            return points, faces
        points, faces = np.concatenate([points, middles]), np.concatenate([faces, more])
