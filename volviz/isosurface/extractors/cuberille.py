"""Cuberille: the faces between voxels inside and outside, as blocky as the data are.

Herman and Liu 1979; finer by resampling, but near the surface only. A voxel is the box round a
sample. Voxels inside that touch in an edge or a corner only are not joined (the solid is
6-connected): the vertices there are doubled, so that the mesh is a manifold.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from volviz.errors import UsageError
from volviz.isosurface.active import (
    PIECE,
    Floats,
    Ids,
    active_cells,
    averaged_normals,
    mirrored,
    numbered,
    pieces,
    skipped_cells,
    to_world,
)
from volviz.isosurface.cases import EDGES, FACES
from volviz.isosurface.kernel import aside
from volviz.isosurface.refined import Refined
from volviz.isosurface.shaded import gradient_normals
from volviz.model.camera import Camera
from volviz.model.mesh import Mesh
from volviz.model.volume import Volume
from volviz.progress import Progress, silent

# Of a voxel face across an axis: its corners (u, v) round the axis, the axes u, v being the next.
_SQUARE = ((0, 0), (1, 0), (1, 1), (0, 1))
_JOINTS = 8  # numbers for the vertices of one lattice point


def _sheets() -> NDArray[np.int64]:
    """int64[256, 12]: which sheet of the surface round a lattice point an edge's face is in.

    The samples round the point are a cell: bits of a case are its corners, as in `cases.py`.
    """
    out = np.zeros((256, 12), dtype=np.int64)
    for case in range(256):
        crossed = [e for e, (a, b) in enumerate(EDGES) if (case >> a ^ case >> b) & 1]
        sheet = {e: e for e in crossed}
        for face in FACES:
            on = [e for e in crossed if set(EDGES[e]) <= set(face)]
            for a in on:
                for b in on:
                    corner = set(EDGES[a]) & set(EDGES[b])
                    joined = len(on) == 2 or any(case >> c & 1 for c in corner)
                    if joined and sheet[a] != sheet[b]:
                        old, new = sheet[a], sheet[b]
                        sheet = {e: new if s == old else s for e, s in sheet.items()}
        known = sorted(set(sheet.values()))
        for e, s in sheet.items():
            out[case, e] = known.index(s)
    return out


_SHEETS = _sheets()
_EDGE = np.zeros((3, 8), dtype=np.int64)  # by axis and lower corner
for _e, (_a, _) in enumerate(EDGES):
    _EDGE[_e // 4, _a] = _e


def extract(
    volume: Volume,
    isovalue: float,
    cells: Ids | None = None,
    *,
    size: float = 0.0,
    normals: str = "central",
    front_faces: Sequence[float] | Camera | None = None,
    progress: Progress | None = None,
) -> Mesh:
    """The faces between voxels that are at least the isovalue and voxels that are not.

    cells: as in `marching_cubes.extract`; the mesh is the same as with None. size: largest side
    of a face in mm, by trilinear resampling of the cells that the surface meets; 0: the voxels as
    they are. front_faces: (x, y, z), the way a distant viewer looks, or a camera; faces that turn
    away are left out. Faces lie between samples that share a cell of valid samples. normals: of
    `slopes.OPERATORS`, of the gradient of the volume at the vertices, so that light shows more than
    blocks; where there is none, the mean of those of adjacent triangles. Memory beyond the mesh:
    8 bytes per cell met and about 300 per face. Raises UsageError for cells that are not there
    and a direction without length, LimitError for too many faces, Cancelled.
    """
    report = progress or silent()
    ids = active_cells(volume, isovalue, cells, report.part(0, 0.2))
    skipped = skipped_cells(volume, report.part(0.2, 0.3))
    nothing = Mesh(np.empty((0, 3), np.float32), space=volume.info.space, skipped=skipped)
    if not ids.size:
        return nothing
    grid = Refined.to_size(volume, isovalue, size)
    grid.check(ids.size)
    across = _crossed(grid, ids, report.part(0.3, 0.6))
    if front_faces is not None:
        across = across[_facing(grid, across, front_faces)]
    if not across.size:
        return nothing
    rims = [_rims(grid, p) for p in pieces(across, report.part(0.6, 0.8), "corners")]
    report(0.8, "numbering")
    points, faces = _mesh(grid, across, np.concatenate(rims))
    if normals == "none":
        return Mesh(points.astype(np.float32), faces, space=volume.info.space, skipped=skipped)
    ways = gradient_normals(
        volume,
        points,
        aside(partial(_own_normals, points, faces), report.part(0.85, 0.9), "normals"),
        normals,
        some_invalid=skipped > 0,
        report=report.part(0.9, 1.0),
    )
    return Mesh(points.astype(np.float32), faces, ways, space=volume.info.space, skipped=skipped)


def _own_normals(points: Floats, faces: NDArray[np.uint32]) -> NDArray[np.float32]:
    """The mean of those of the triangles."""
    a, b, c = (points[faces[:, k]] for k in range(3))
    some = np.empty_like(points)
    some[faces] = np.cross(b - a, c - a)[:, None]
    return averaged_normals(points, faces, some)


def _crossed(grid: Refined, ids: Ids, report: Progress) -> Ids:
    """Sorted 3 s + axis of the pairs of samples (s and its next) that a face lies between."""
    cells, found = tuple(n - 1 for n in grid.shape), []
    step = max(1, PIECE // int(np.prod(grid.factors)))
    for piece in pieces(ids, report, "faces", step):
        z, y, x = np.unravel_index(grid.cells(piece), cells)
        signs = [grid.inside(z + (c >> 2), y + (c >> 1 & 1), x + (c & 1)) for c in range(8)]
        some = []
        for e, (a, b) in enumerate(EDGES):
            own = signs[a] != signs[b]
            place = (z[own] + (a >> 2), y[own] + (a >> 1 & 1), x[own] + (a & 1))
            some.append(3 * np.ravel_multi_index(place, grid.shape) + e // 4)
        found.append(np.unique(np.concatenate(some)))
    return np.unique(np.concatenate(found)).astype(np.int64)


def _parts(grid: Refined, across: Ids) -> tuple[Ids, NDArray[np.int64], NDArray[np.bool_]]:
    """(axes, x y z of the lower samples as int64[n, 3], whether those are inside)."""
    z, y, x = np.unravel_index(across // 3, grid.shape)
    return across % 3, np.stack([x, y, z], axis=1), grid.inside(z, y, x)


def _facing(grid: Refined, across: Ids, way: Sequence[float] | Camera) -> NDArray[np.bool_]:
    """Which faces turn to a viewer that looks this way, or to a camera."""
    if isinstance(way, Camera):
        if way.projection == "perspective":
            return _facing_eye(grid, across, way.position)
        way = tuple(-way.axes()[2])
    direction = np.asarray(way, dtype=np.float64)
    if direction.shape != (3,) or not 0 < np.linalg.norm(direction) < np.inf:
        raise UsageError(f"{way!r} is no direction x, y, z", field="front_faces")
    axes, _, below = _parts(grid, across)
    along = np.linalg.inv(grid.affine[:3, :3]) @ direction
    return np.where(below, along[axes], -along[axes]) < 0


def _facing_eye(grid: Refined, across: Ids, eye: Sequence[float]) -> NDArray[np.bool_]:
    """Which faces lie between the eye and the voxel inside that they belong to."""
    axes, low, below = _parts(grid, across)
    there = np.linalg.inv(grid.affine) @ [*eye, 1.0]
    beyond = low[np.arange(len(axes)), axes] + 0.5 - there[axes]
    return np.where(below, beyond, -beyond) < 0


def _rims(grid: Refined, across: Ids) -> Ids:
    """int64[n, 8]: keys of the vertices round each face, and of those within its sides or −1."""
    axes, low, below = _parts(grid, across)
    u, v, rows = (axes + 1) % 3, (axes + 2) % 3, np.arange(len(axes))
    out = np.full((len(axes), 8), -1, dtype=np.int64)
    own, beside_u, beside_v, numbers = [], [], [], []
    for p, q in _SQUARE:
        at = low.copy()
        at[rows, u] += p - 1
        at[rows, v] += q - 1
        case, number = _case(grid, at)
        sheets = [
            _SHEETS[case, _EDGE[axes, ((1 - p) ^ i) << u | ((1 - q) ^ j) << v]]
            for i, j in ((0, 0), (1, 0), (0, 1))
        ]
        own.append(sheets[0])
        beside_u.append(sheets[1] == sheets[0])
        beside_v.append(sheets[2] == sheets[0])
        numbers.append(number)
        out[:, len(own) - 1] = _JOINTS * number + sheets[0]
    for k in range(4):
        n = (k + 1) % 4
        along, over, joined = (u, v, beside_v) if k % 2 == 0 else (v, u, beside_u)
        up = k in (1, 2)
        doubled = joined[k] & joined[n] & _alternate(grid, low, axes, over, 1 if up else -1)
        lowest = np.minimum(numbers[k], numbers[n])
        first = np.where(axes < over, ~below, not up)  # of the two inside: which one is ours
        key = -2 - ((3 * lowest + along) * 2 + first)
        out[:, 4 + k] = np.where(doubled, key, -1)
    return out


def _case(grid: Refined, at: NDArray[np.int64]) -> tuple[Ids, Ids]:
    """Case and number of lattice points (x, y, z of their lowest samples, −1 at the border)."""
    most = np.array(grid.shape[::-1]) - 1
    case = np.zeros(len(at), dtype=np.int64)
    for c in range(8):
        x, y, z = np.clip(at + np.array([c & 1, c >> 1 & 1, c >> 2]), 0, most).T
        case |= grid.inside(z, y, x).astype(np.int64) << c
    lattice = tuple(n + 1 for n in grid.shape)
    x, y, z = at.T + 1
    return case, np.asarray(np.ravel_multi_index((z, y, x), lattice), dtype=np.int64)


def _alternate(
    grid: Refined, low: NDArray[np.int64], axes: Ids, over: Ids, side: int
) -> NDArray[np.bool_]:
    """Where the two samples beside those of a face are the other way round."""
    rows, most = np.arange(len(axes)), np.array(grid.shape[::-1]) - 1
    at = low.copy()
    at[rows, over] += side
    there = np.all((at >= 0) & (at <= most), axis=1)
    at = np.clip(at, 0, most)
    high, beyond = low.copy(), at.copy()
    high[rows, axes] += 1
    beyond[rows, axes] += 1
    a, b, c, d = (grid.inside(*p.T[::-1]) for p in (low, high, at, beyond))
    return there & (a != b) & (c == b) & (d == a)


def _mesh(grid: Refined, across: Ids, rims: Ids) -> tuple[Floats, NDArray[np.uint32]]:
    """World places of the vertices, and the triangles."""
    keys, numbers = numbered(rims)
    if keys[-1] >= 0 and np.any(keys == -1):
        gap = int(np.flatnonzero(keys == -1)[0])
        keys = np.delete(keys, gap)
        numbers[numbers > gap] -= np.uint32(1)
    axes, low, below = _parts(grid, across)
    turn = below == mirrored(grid.affine)
    rims[turn] = rims[turn][:, [0, 3, 2, 1, 7, 6, 5, 4]]
    numbers[turn] = numbers[turn][:, [0, 3, 2, 1, 7, 6, 5, 4]]
    plain = np.all(rims[:, 4:] == -1, axis=1)
    quads = numbers[plain]
    made = [quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]
    rest = np.flatnonzero(~plain)
    middles = low[rest].astype(np.float64)
    middles[np.arange(rest.size), axes[rest]] += 0.5
    own = (len(keys) + np.arange(rest.size)).astype(np.uint32)
    for k in range(4):
        a, b, m = (numbers[rest, i] for i in (k, (k + 1) % 4, 4 + k))
        split = rims[rest, 4 + k] != -1
        made.append(np.stack([own, a, np.where(split, m, b)], axis=1))
        made.append(np.stack([own, m, b], axis=1)[split])
    points = np.concatenate([_places(grid, keys), middles])
    return to_world(grid.affine, points), np.concatenate(made)


def _places(grid: Refined, keys: Ids) -> Floats:
    """float64[n, 3]: refined index x, y, z of vertices."""
    code = -2 - keys
    number = np.where(keys >= 0, keys // _JOINTS, code // 6)
    z, y, x = np.unravel_index(number, tuple(n + 1 for n in grid.shape))
    points = np.stack([x, y, z], axis=1) - 0.5
    between = np.flatnonzero(keys < 0)
    points[between, code[between] // 2 % 3] += 0.5
    return np.asarray(points, dtype=np.float64)
