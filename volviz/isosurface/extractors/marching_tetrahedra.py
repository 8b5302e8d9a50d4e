"""Marching tetrahedra: a tetrahedron has one or two triangles, and no case is ambiguous.

A volume's cells are cut into five tetrahedra, mirrored in every other cell so that neighbours
agree on the diagonals of their faces (Bloomenthal 1994), or into six round the diagonal from the
corner 0 to the corner 7 (Kuhn 1960), alike in every cell. Grids of tetrahedra are taken as they
are.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from itertools import combinations, permutations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volviz.isosurface.active import (
    Floats,
    Ids,
    active_cells,
    averaged_normals,
    corner_samples,
    mirrored,
    numbered,
    pieces,
    places,
    skipped_cells,
    to_world,
)
from volviz.isosurface.cells import Grid
from volviz.isosurface.kernel import aside, threshold
from volviz.model.grids import TetMesh
from volviz.model.mesh import Mesh
from volviz.model.volume import Space
from volviz.progress import Progress, silent

Corners = NDArray[np.int64]
_PLACES = np.array([[c & 1, c >> 1 & 1, c >> 2 & 1] for c in range(8)])


def _turned(cells: list[tuple[int, ...]]) -> Corners:
    """The tetrahedra, each with a positive volume."""
    out = np.array(cells)
    edges = _PLACES[out[:, 1:]] - _PLACES[out[:, :1]]
    wrong = np.linalg.det(edges) < 0
    out[wrong, :2] = out[wrong, 1::-1]
    return out


_FIVE = np.stack(
    [
        _turned([(0, 3, 5, 6), (1, 0, 3, 5), (2, 0, 3, 6), (4, 0, 5, 6), (7, 3, 5, 6)]),
        _turned([(1, 2, 4, 7), (0, 1, 2, 4), (3, 1, 2, 7), (5, 1, 4, 7), (6, 2, 4, 7)]),
    ]
)
"""Of the cells whose x + y + z is even, and odd: the diagonals join samples with an even one."""

_SIX = _turned([(0, 1 << a, (1 << a) + (1 << b), 7) for a, b, _ in permutations(range(3))])


def _ring(inside: tuple[int, ...]) -> Corners:
    """The edges (corner inside, corner outside) that are crossed, round the way out."""
    outside = [c for c in range(4) if c not in inside]
    if len(inside) == 2:
        (a, b), (c, d) = inside, outside
        ring = [(a, c), (b, c), (b, d), (a, d)]
    else:
        ring = [(a, c) for a in inside for c in outside]
    simplex = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    middles = np.array([simplex[a] + simplex[b] for a, b in ring])
    way = simplex[outside].mean(axis=0) - simplex[list(inside)].mean(axis=0)
    round_ = np.cross(middles[1] - middles[0], middles[2] - middles[0]) @ way
    return np.array(ring if round_ > 0 else ring[::-1])


_RINGS = {
    sum(1 << c for c in inside): _ring(inside)
    for n in (1, 2, 3)
    for inside in combinations(range(4), n)
}
"""By the bits of the corners inside."""


def extract(
    grid: Grid,
    isovalue: float,
    cells: Ids | None = None,
    *,
    tetrahedra: int = 5,
    progress: Progress | None = None,
) -> Mesh:
    """The surface of the function that is linear in each tetrahedron, with the isovalue.

    grid: a Volume, cut into 5 or 6 `tetrahedra` per cell, or a TetMesh. cells: as in
    `marching_cubes.extract`; the mesh is the same as with None. Quadrilaterals are cut at the
    shorter diagonal; normals are the mean of those of the adjacent triangles, by area. Memory
    beyond the mesh: 8 bytes per active cell and about 100 per triangle. Raises UsageError for
    cells that are not there, LimitError where 32 bits do not number the vertices, Cancelled.
    """
    report = progress or silent()
    ids = active_cells(grid, isovalue, cells, report.part(0, 0.2))
    skipped = skipped_cells(grid, report.part(0.2, 0.3))
    if not ids.size:
        return Mesh(np.empty((0, 3), np.float32), space=_space(grid), skipped=skipped)
    flat = grid.values if isinstance(grid, TetMesh) else grid.data.reshape(-1)
    limit = threshold(flat.dtype, isovalue)

    def where(low: Ids, high: Ids) -> Floats:
        a, b = flat[low].astype(np.float64), flat[high].astype(np.float64)
        t = ((isovalue - a) / (b - a))[..., None]
        return (1 - t) * _place(grid, low) + t * _place(grid, high)

    made = []
    for piece in pieces(ids, report.part(0.3, 0.8), "triangles"):
        corners = _tetrahedra(grid, piece, tetrahedra)
        made.append(_triangles(corners, flat[corners] >= limit, where))
    ends = np.concatenate(made)
    report(0.8, "numbering")
    steps = np.unique(ends[..., 1] - ends[..., 0])
    codes = np.searchsorted(steps, ends[..., 1] - ends[..., 0])
    keys, faces = numbered(codes + steps.size * ends[..., 0])
    report(0.9, "normals")
    low = keys // steps.size
    high = low + steps[keys % steps.size]
    points, out = where(low, high), _place(grid, high) - _place(grid, low)
    out[flat[high] >= limit] *= -1
    mean = partial(averaged_normals, points, faces, out)
    normals = aside(mean, report.part(0.9, 1.0), "normals")
    return Mesh(points.astype(np.float32), faces, normals, space=_space(grid), skipped=skipped)


def _place(grid: Grid, samples: Ids) -> Floats:
    """float64[..., 3]: world mm of samples."""
    if isinstance(grid, TetMesh):
        return np.asarray(grid.vertices[samples], dtype=np.float64)
    return to_world(grid.affine, places(grid.data.shape, samples))


def _space(grid: Grid) -> Space | None:
    return grid.space if isinstance(grid, TetMesh) else grid.info.space


def _tetrahedra(grid: Grid, ids: Ids, count: int) -> Corners:
    """int64[n, 4]: samples of the tetrahedra of cells, each with a positive volume in the world."""
    if isinstance(grid, TetMesh):
        corners = grid.cells[ids].copy()
        at = grid.vertices[corners].astype(np.float64)
        wrong = np.linalg.det(at[:, 1:] - at[:, :1]) < 0
        corners[wrong, :2] = corners[wrong, 1::-1]
        return corners
    samples = corner_samples(grid.data.shape, ids)
    if count == 6:
        corners = samples[:, _SIX].reshape(-1, 4)
    else:
        odd = places(grid.data.shape, samples[:, 0]).sum(axis=1).astype(np.int64) & 1
        corners = samples[np.arange(len(ids))[:, None, None], _FIVE[odd]].reshape(-1, 4)
    return corners[:, [1, 0, 2, 3]] if mirrored(grid.affine) else corners


def _triangles(corners: Corners, inside: Any, where: Callable[[Ids, Ids], Floats]) -> Corners:
    """int64[n, 3, 2]: triangles by the samples, lower number first, of the edges they end on."""
    case = inside @ np.array([1, 2, 4, 8])
    made, owners = [], []
    for bits, ring in _RINGS.items():
        own = np.flatnonzero(case == bits)
        ends = np.sort(corners[own][:, ring], axis=2)
        if len(ring) == 4:
            at = where(ends[..., 0], ends[..., 1])
            first = np.linalg.norm(at[:, 0] - at[:, 2], axis=1)
            second = np.linalg.norm(at[:, 1] - at[:, 3], axis=1)
            turn = (np.arange(4) + (second < first)[:, None]) % 4
            ends = np.take_along_axis(ends, turn[:, :, None], axis=1)
            made.append(ends[:, [0, 2, 3]])
            owners.append(own)
        made.append(ends[:, :3])
        owners.append(own)
    order = np.argsort(np.concatenate(owners), kind="stable")
    return np.concatenate(made)[order]
