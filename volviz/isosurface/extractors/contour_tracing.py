"""Contour tracing: contours slice by slice, linked where they overlap, and tiled between.

After Keppel 1975, Fuchs, Kedem and Uselton 1977 and Ekoule, Peyrin and Odet 1991. Two slices'
regions of the inside that overlap are one, and regions of the outside that overlap are one; the
contours between one and one make a sheet: tiled if both slices have some, capped half a slice
further if one has. Several contours on one side are first joined by bridges within their slice.
"""

from __future__ import annotations

from dataclasses import dataclass, field
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
from volviz.isosurface.contours import Contours, Sets, contours
from volviz.isosurface.kernel import threshold
from volviz.isosurface.tiling import filled, joined, tile
from volviz.model.mesh import Mesh
from volviz.model.volume import Volume
from volviz.progress import Progress, silent

# Of the slices along an axis: the order of the array's axes, and of (u, v, slice) as x, y, z.
_ORDERS = {"z": ((0, 1, 2), (0, 1, 2)), "y": ((1, 2, 0), (1, 2, 0)), "x": ((2, 0, 1), (2, 0, 1))}
_Group = tuple[list[int], list[int]]


@dataclass
class _Parts:
    """Points (u, v, slice) and triangles as they are made. world: makes mm of them."""

    order: tuple[int, int, int]
    affine: Floats
    count: int = 0
    points: list[Floats] = field(default_factory=list)
    faces: list[Ids] = field(default_factory=list)

    def world(self, points: Floats) -> Floats:
        """float64[n, 3]: mm."""
        return to_world(self.affine, points[:, list(self.order)])

    def add(self, flat: Floats, height: float) -> int:
        """Number of the first of these points u, v of a slice."""
        first = self.count
        self.points.append(np.column_stack([flat, np.full(len(flat), height)]))
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
    not valid or none. Nothing where no sample is outside. Tilings have the least area for rings
    of some hundred points, and are good ones beyond (`tiling.tile`). Memory beyond the mesh: that
    of two slices, and 100 bytes per triangle. Raises Cancelled.
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
    parts = _Parts(order, volume.affine)
    below, base, outside = None, 0, 0
    for k in range(len(slices) + 1):
        report(0.1 + 0.8 * k / (len(slices) + 1), "contours")
        above, first = None, parts.count
        if k < len(slices):
            values, inside = _samples(slices[k], limit, padding_value(volume))
            outside += int(np.count_nonzero(~inside & np.isfinite(values)))
            above = contours(values, inside, isovalue)
            first = parts.add(above.points, k)
        _between(parts, below, above, (base, first), k)
        below, base = above, first
    if not parts.faces or not outside:
        return nothing
    return _mesh(volume, parts, skipped, report)


def _samples(
    plane: NDArray[Any], limit: Any, padding: float | None
) -> tuple[Floats, NDArray[np.bool_]]:
    """Values of a slice, NaN where not valid, and what is inside."""
    valid = np.isfinite(plane) if padding is None else np.isfinite(plane) & (plane != padding)
    return np.where(valid, plane.astype(np.float64), np.nan), valid & (plane >= limit)


def _groups(below: Contours | None, above: Contours | None) -> list[_Group]:
    """Contours of two slices (None: nothing but outside) that bound one sheet between them."""
    ends = [0 if c is None else len(c.rings) for c in (below, above)]
    solid, empty = Sets(sum(ends) + 2), Sets(sum(ends) + 2)
    some = below if above is None else above
    assert some is not None
    regions, inside = [], []
    for slice_, first, count in ((below, 0, ends[0]), (above, ends[0] + 1, ends[1])):
        none = np.full(some.regions.shape, count)
        regions.append(first + (none if slice_ is None else slice_.regions))
        inside.append(np.zeros(none.shape, np.bool_) if slice_ is None else slice_.inside)
    both, neither = inside[0] & inside[1], ~inside[0] & ~inside[1]
    solid.join(regions[0][both], regions[1][both])
    empty.join(regions[0][neither], regions[1][neither])
    found: dict[tuple[int, int], _Group] = {}
    for side, (slice_, first) in enumerate(((below, 0), (above, ends[0] + 1))):
        for c in range(ends[side]):
            assert slice_ is not None
            key = (
                solid.root(first + int(slice_.solid[c])),
                empty.root(first + int(slice_.empty[c])),
            )
            found.setdefault(key, ([], []))[side].append(c)
    return list(found.values())


def _between(
    parts: _Parts, below: Contours | None, above: Contours | None, firsts: tuple[int, int], k: int
) -> None:
    """The sheets between slice k − 1 and slice k; firsts: numbers of their first points."""
    if below is None and above is None:
        return
    planes = [np.empty((0, 2)) if c is None else c.points for c in (below, above)]
    heights = np.repeat([k - 1.0, k], [len(p) for p in planes])
    flat = np.concatenate(planes)
    world = parts.world(np.column_stack([flat, heights]))
    count = len(planes[0])
    numbers = np.concatenate([firsts[0] + np.arange(count), firsts[1] + np.arange(len(planes[1]))])
    changes = _changes(below, above)
    for group in _groups(below, above):
        low = [below.rings[c] for c in group[0]] if below is not None else []
        high = [count + above.rings[c] for c in group[1]] if above is not None else []
        if low and high:
            bridges = list[tuple[int, int]]()
            one = joined(world, low, flat, changes, bridges)
            made = tile(world, one, joined(world, high, flat, changes, bridges))
            parts.faces.append(numbers[made])
        else:
            _cap(parts, flat, world, numbers, low or high, k - 0.5, not high)


def _changes(below: Contours | None, above: Contours | None) -> NDArray[np.bool_]:
    """bool[v, u] of the samples: inside in one slice only, where the sheets between them lie.

    A bridge elsewhere would join what stays apart there, and plates would lead to it.
    """
    if below is None or above is None:
        return np.ones((1, 1), np.bool_)
    changes: NDArray[np.bool_] = (below.inside ^ above.inside)[1:-1, 1:-1]
    return changes


def _cap(
    parts: _Parts, flat: Floats, world: Floats, numbers: Ids, rings: list[Ids], height: float,
    above: bool,
) -> None:  # fmt: skip
    """Close rings half a slice above (or below) theirs: straight walls and a lid."""
    known = np.concatenate(rings)
    copies = np.empty(len(flat), dtype=np.int64)
    copies[known] = parts.add(flat[known], height) + np.arange(known.size)
    for ring in rings:
        lower, upper = (numbers[ring], copies[ring]) if above else (copies[ring], numbers[ring])
        one, two = np.roll(lower, -1), np.roll(upper, -1)
        parts.faces.append(np.stack([lower, one, upper], axis=1))
        parts.faces.append(np.stack([one, two, upper], axis=1))
    whole = joined(world, rings)
    u, v = flat[whole].T
    left = float(np.sum(u * np.roll(v, -1) - v * np.roll(u, -1))) >= 0
    lid = filled(flat, whole if left else whole[::-1])
    a, b, c = lid.T
    lid = lid[(a != b) & (b != c) & (c != a)]  # where a bridge ends: there and back
    parts.faces.append(copies[lid if left == above else lid[:, ::-1]])


def _mesh(volume: Volume, parts: _Parts, skipped: int, report: Progress) -> Mesh:
    points, faces = np.concatenate(parts.points), np.concatenate(parts.faces)
    flat, faces = _separated(points, faces, report)
    points = parts.world(flat)
    if mirrored(volume.affine):
        faces = faces[:, ::-1]
    short = np.ascontiguousarray(faces, dtype=np.uint32)
    normals = averaged_normals(points, short, np.ones_like(points))
    space = volume.info.space
    return Mesh(points.astype(np.float32), short, normals, space=space, skipped=skipped)


def _separated(points: Floats, faces: Ids, report: Progress) -> tuple[Floats, Ids]:
    """The same surface, its edges used twice each: those used more often get a point of their own.

    Bridges have their ends twice in a ring, so that two sheets may use the same edge.
    """
    while True:
        report(0.9, "closing")
        count = len(points)
        ends = np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2)
        keys = ends[:, 0] * count + ends[:, 1]
        order = np.argsort(keys, kind="stable")
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
        points, faces = np.concatenate([points, middles]), np.concatenate([faces, more])
