"""Discretized marching cubes: thirteen places for a vertex, so that much of the surface is flat.

Montani, Scateni and Scopigno 1994. Vertices lie in the middle of a cell's edges or of the cell,
twice their index coordinates are integers, and coplanar triangles are merged into polygons.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volviz.isosurface import marching
from volviz.isosurface.active import Ids, averaged_normals, to_world
from volviz.isosurface.ambiguity import RULES
from volviz.isosurface.cases import cases
from volviz.isosurface.classified import checked, classify, count_rows, placing
from volviz.isosurface.coplanar import merge
from volviz.isosurface.kernel import aside, in_slabs, kernel, lowest_bit, threshold
from volviz.isosurface.plain import plain
from volviz.isosurface.samples import samples
from volviz.isosurface.signs import ONE, cells_in_word, load, own_edges, rows_of
from volviz.isosurface.triangles import triangles
from volviz.isosurface.turns import in_turns
from volviz.model.mesh import Mesh
from volviz.model.volume import Volume
from volviz.progress import Progress, silent


@dataclass(frozen=True)
class Saving:
    """Triangles before (as many as marching cubes makes) and after, and the polygons between."""

    before: int = 0
    after: int = 0
    polygons: int = 0

    @property
    def share(self) -> float:
        """Part of the triangles that was saved, 0..1."""
        return 1 - self.after / self.before if self.before else 0.0


def extract(
    volume: Volume, isovalue: float, cells: Ids | None = None, *, progress: Progress | None = None
) -> Mesh:
    """`extract_with_saving` without its figures."""
    return extract_with_saving(volume, isovalue, cells, progress=progress)[0]


def extract_with_saving(
    volume: Volume, isovalue: float, cells: Ids | None = None, *, progress: Progress | None = None
) -> tuple[Mesh, Saving]:
    """The surface of marching cubes (ambiguity "asymptotic") with its vertices in the middle of
    edges and cells, coplanar triangles merged; and what that saved.

    cells: as in `marching_cubes.extract`; the mesh is the same as with None. It is at most half a
    cell's diagonal from that of marching cubes. Normals are the mean of those of the adjacent
    triangles, by area. Memory beyond that of marching cubes: 24 bytes per vertex and 60 per
    triangle. Raises as `marching_cubes.extract` does.
    """
    report = progress or silent()
    limit = threshold(volume.data.dtype, isovalue)
    space = volume.info.space
    if limit is None or min(volume.data.shape) < 2:
        return Mesh(np.empty((0, 3), np.float32), space=space), Saving()
    ids = checked(cells, volume.data.shape)
    found = classify(volume, limit, ids, False, None, report.part(0, 0.2))
    rule = RULES["asymptotic"]
    bits = (found.signs, found.mask, found.valid)
    field = marching.Field(samples(volume.data), float(isovalue), *bits, rule)
    layout = count_rows(field, found, report.part(0.2, 0.3))
    if not layout.triangles[-1]:
        return Mesh(np.empty((0, 3), np.float32), space=space, skipped=found.skipped), Saving()
    points, faces = _build(volume, field, layout, report.part(0.3, 0.5))
    before = len(faces)
    faces, count = merge(points, faces, report.part(0.5, 0.95))
    used, numbers = np.unique(faces, return_inverse=True)
    short = numbers.reshape(-1, 3).astype(np.uint32)
    at = to_world(volume.affine, points[used] / 2)
    mean = partial(averaged_normals, at, short, np.ones_like(at))
    normals = aside(mean, report.part(0.95, 1.0), "normals")
    mesh = Mesh(at.astype(np.float32), short, normals, space=space, skipped=found.skipped)
    return mesh, Saving(before, len(faces), count)


def _build(
    volume: Volume, field: marching.Field, layout: marching.Layout, report: Progress
) -> tuple[NDArray[np.int32], NDArray[np.int64]]:
    """Twice the index coordinates x, y, z of the vertices, and the triangles."""
    nz, ny, nx = volume.data.shape
    count = int(layout.vertices[-1])
    points = np.full((count, 3), np.iinfo(np.int32).max, dtype=np.int32)
    first = partial(midpoints, volume.data.shape, field.signs, field.mask, layout)
    in_slabs(lambda a, b: first(a, b, points), nz, ny * nx, report.part(0, 0.5), "vertices")
    place = placing(volume, "none")
    faces = np.empty((int(layout.triangles[-1]), 3), dtype=np.uint32)
    out = (np.empty((count, 3), np.float32), np.empty((0, 3), np.float32), faces)
    second = partial(triangles, field, cases(), plain(), place, layout)
    part = report.part(0.5, 1)
    rows = len(layout.rows)
    in_turns(lambda turns, most: second(turns, most, out), rows, nx, part, "triangles")
    centres = np.flatnonzero(points[:, 0] == np.iinfo(np.int32).max)
    if centres.size:
        _put_centres(points, faces, centres)
    return points, faces.astype(np.int64)


def _put_centres(
    points: NDArray[np.int32], faces: NDArray[np.uint32], centres: NDArray[np.int64]
) -> None:
    """Vertices inside cells, from the middles of edges round them, which span the cell."""
    inner = np.zeros(len(points), dtype=np.bool_)
    inner[centres] = True
    for k in range(3):
        own = faces[inner[faces[:, k]]]
        for other in ((k + 1) % 3, (k + 2) % 3):
            np.minimum.at(points, own[:, k], points[own[:, other]])
    points[centres] = points[centres] // 2 * 2 + 1


@kernel
def midpoints(
    shape: Any, signs: Any, mask: Any, layout: Any, first: int, last: int, out: Any
) -> None:
    """Fill int32[n, 3]: twice the index coordinates of the middles of crossed edges."""
    _, ny, nx = shape
    starts, words, live = layout.vertices, signs.ravel(), layout.live
    n = np.empty(3, np.int64)
    for z in range(first, last):
        for y in range(ny):
            row = z * ny + y
            n[0], n[1] = starts[row], starts[row] + layout.counts[row, 0]
            n[2] = n[1] + layout.counts[row, 1]
            around = rows_of(signs.shape, z, y)
            for w in range(signs.shape[2] - 1):
                if live[z, y, w >> 6] >> np.uint64(w & 63) & ONE == 0:
                    continue
                corners = load(words, around, np.uint64(w))
                edges = own_edges(mask, corners, cells_in_word(nx, w), z, y, w)
                for axis in range(3):
                    left = edges[axis]
                    while left:
                        x = 64 * w + lowest_bit(left)
                        left &= left - ONE
                        out[n[axis], 0] = 2 * x + (axis == 0)
                        out[n[axis], 1] = 2 * y + (axis == 1)
                        out[n[axis], 2] = 2 * z + (axis == 2)
                        n[axis] += 1
