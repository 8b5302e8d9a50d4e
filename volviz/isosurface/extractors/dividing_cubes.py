"""Dividing cubes: cells so small that a point does for the surface in them.

Cline, Lorensen, Ludke, Crawford and Teeter 1988. Cells that the surface meets are cut into equal
parts, as many as the wanted distance of points or the pixels of a camera ask for. Theirs lie in
the middles of the parts; ours go on to the surface itself (`landing.py`).
"""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volviz.errors import LimitError
from volviz.fields.statistics import padding_value
from volviz.isosurface import signs
from volviz.isosurface.active import (
    PIECE,
    Floats,
    Ids,
    active_cells,
    corner_samples,
    pieces,
    places,
    skipped_cells,
    to_world,
)
from volviz.isosurface.classified import placing
from volviz.isosurface.kernel import in_slabs, kernel
from volviz.isosurface.landing import landed
from volviz.isosurface.marching import EMPTY
from volviz.isosurface.refined import between
from volviz.isosurface.slopes import NO_NORMALS, OPERATORS, slopes
from volviz.model.camera import Camera
from volviz.model.mesh import Mesh
from volviz.model.volume import Volume
from volviz.progress import Progress, silent

MOST = 1 << 26  # points, about 24 bytes each
DEEPEST = 64  # parts along the side of a cell


def extract(
    volume: Volume,
    isovalue: float,
    cells: Ids | None = None,
    *,
    size: float = 0.0,
    normals: str = "central",
    camera: Camera | None = None,
    pixels: float = 1024,
    progress: Progress | None = None,
) -> Mesh:
    """Points where the trilinear volume crosses the isovalue: a Mesh without faces.

    Each part of a cell with corners on both sides has one point: in it (to float32's rounding),
    where the trilinear function is the isovalue, down the slope from the middle of the part.

    cells: as in `marching_cubes.extract`; the points are the same as with None. size: distance of
    points in mm, 0: one per cell. camera: instead of a size, parts of a cell are to be as small
    as its pixels, `pixels` being their number across the smaller side of the picture. normals: a
    key of `slopes.OPERATORS`. No cell has more than 64 parts along a side. Memory beyond the
    points: 8 bytes per active cell, and 70 megabytes at most. Raises UsageError for cells that
    are not there, LimitError for too many points, Cancelled.
    """
    report = progress or silent()
    ids = active_cells(volume, isovalue, cells, report.part(0, 0.2))
    skipped = skipped_cells(volume, report.part(0.2, 0.3))
    parts = _parts(volume, ids, size, camera, pixels)
    _check(parts)
    valid = valid_bits(volume, report.part(0.3, 0.4)) if skipped else EMPTY
    empty = np.empty((0, 3), dtype=np.float32)
    points, ways, rest = [empty], [empty], report.part(0.4, 1)
    kinds = np.unique(parts, axis=0) if ids.size else parts
    done = 0
    for kind in kinds:
        own = ids[np.all(parts == kind, axis=1)]
        share = rest.part(done / ids.size, (done + own.size) / ids.size)
        done += own.size
        for piece in pieces(own, share, "points", max(1, PIECE // int(np.prod(kind + 1)))):
            at, way = _points(volume, isovalue, piece, kind, valid, normals)
            points.append(at)
            ways.append(way)
    return Mesh(
        np.concatenate(points),
        normals=np.concatenate(ways),
        space=volume.info.space,
        skipped=skipped,
        # Points are the feet of the middles: what a plane has in a part is no farther from the
        # foot than from the middle, which is half the diagonal.
        apart=float(np.linalg.norm(np.array(volume.spacing) / kinds, axis=1).max(initial=0.0)),
    )


def _parts(
    volume: Volume, ids: Ids, size: float, camera: Camera | None, pixels: float
) -> NDArray[np.int64]:
    """int64[n, 3]: parts along x, y, z of each cell; powers of two where a camera decides."""
    spacing = np.array(volume.spacing)
    if camera is None:
        wanted = np.full(ids.size, size if size > 0 else spacing.max())
    else:
        corners = corner_samples(volume.data.shape, ids)[:, [0, 7]]
        middles = to_world(volume.affine, places(volume.data.shape, corners).mean(axis=1))
        wanted = pixel_size(camera, pixels, middles)
    with np.errstate(divide="ignore"):
        steps = np.maximum(np.ceil(spacing / wanted[:, None] - 1e-9), 1)
    if camera is not None:
        steps = np.exp2(np.ceil(np.log2(np.minimum(steps, DEEPEST))))
    return np.minimum(steps, DEEPEST).astype(np.int64)


def pixel_size(camera: Camera, pixels: float, points: Floats) -> Floats:
    """float64[n]: mm that a pixel is wide at points (float64[n, 3], world mm).

    pixels: their number across the smaller side of the picture. Infinite behind the camera.
    """
    if camera.projection != "perspective":
        return np.full(len(points), camera.height / pixels)
    depth = (np.asarray(camera.position) - points) @ camera.axes()[2]
    width = 2 * math.tan(math.radians(camera.fov) / 2) * depth / pixels
    return np.where(depth > 0, width, np.inf)


def _check(parts: NDArray[np.int64]) -> None:
    faces = parts[:, 0] * parts[:, 1] * parts[:, 2] // np.maximum(parts.min(axis=1, initial=64), 1)
    if faces.sum() > MOST:
        raise LimitError(
            f"about {int(faces.sum())} points are more than the {MOST} that are made",
            field="--size",
            fix="choose a greater distance of points, or a smaller region",
        )


def _points(
    volume: Volume, isovalue: float, ids: Ids, parts: NDArray[np.int64], valid: Any, normals: str
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Points and normals of cells that are all cut into the same parts."""
    samples = corner_samples(volume.data.shape, ids)
    values = volume.data.reshape(-1)[samples].astype(np.float64)
    lattice = _lattice(values, parts)
    inside = lattice >= isovalue
    some, every = np.zeros((), bool), np.ones((), bool)
    for c in range(8):
        z, y, x = (slice(b, n - 1 + b) for b, n in zip(_bits(c), inside.shape[1:], strict=True))
        some, every = some | inside[:, z, y, x], every & inside[:, z, y, x]
    cell, k, j, i = np.nonzero(some & ~every)
    corners = tuple(np.array([_bits(c) for c in range(8)]).T)  # z, y, x
    at = (cell[:, None], *(a[:, None] + b for a, b in zip((k, j, i), corners, strict=True)))
    axes = volume.affine[:3, :3] / parts
    steepest = np.linalg.inv(axes.T @ axes / np.trace(axes.T @ axes))
    own = landed(lattice[at], isovalue, inside[at], steepest)
    part = (np.stack([i, j, k], axis=1) + own) / parts
    index = places(volume.data.shape, samples[cell, 0]) + part
    points = to_world(volume.affine, index).astype(np.float32)
    place = placing(volume, normals)
    if place.operator == NO_NORMALS:
        return points, np.empty((0, 3), np.float32)
    known, numbers = np.unique(samples, return_inverse=True)
    rises = np.empty((known.size, 3))
    slopes_of(volume.data, valid, known, OPERATORS[normals], rises)
    rise = _trilinear(rises[numbers.reshape(samples.shape)[cell]], part)
    spare = _trilinear_slope(values[cell], part)
    return points, _normals(rise, spare, np.array(place.gradients).reshape(3, 3))


def _bits(corner: int) -> tuple[int, int, int]:
    return corner >> 2, corner >> 1 & 1, corner & 1


def _lattice(values: Floats, parts: NDArray[np.int64]) -> Floats:
    """float64[n, z, y, x]: values at the corners of the parts, never beyond the cell's own."""
    grid = values.reshape(-1, 2, 2, 2)
    for axis in range(3):
        t = np.arange(parts[2 - axis] + 1) / parts[2 - axis]
        t = t.reshape([-1 if a == axis else 1 for a in range(3)])
        low, high = (np.take(grid, [end], axis=1 + axis) for end in (0, 1))
        grid = between(low, high, t)
    return grid


def _weights(part: Floats) -> Floats:
    """float64[n, 8]: of the corners, at places 0..1 in a cell."""
    columns = []
    for c in range(8):
        z, y, x = _bits(c)
        columns.append(np.prod(np.where([x, y, z], part, 1 - part), axis=1))
    return np.stack(columns, axis=1)


def _trilinear(corners: Floats, part: Floats) -> Floats:
    return np.asarray(np.einsum("nc,nck->nk", _weights(part), corners))


def _trilinear_slope(values: Floats, part: Floats) -> Floats:
    """Slopes along x, y, z of the trilinear function itself."""
    out = []
    for axis in range(3):
        ends = []
        for end in (0.0, 1.0):
            at = part.copy()
            at[:, axis] = end
            ends.append(np.einsum("nc,nc->n", _weights(at), values))
        out.append(ends[1] - ends[0])
    return np.stack(out, axis=1)


def _normals(rise: Floats, spare: Floats, to_gradient: Floats) -> NDArray[np.float32]:
    """Unit vectors to lower values; `spare` where the slope is none, or x where both are."""
    flat = ~np.logical_and(np.isfinite(rise).all(axis=1), np.any(rise, axis=1))
    ways = np.where(flat[:, None], spare, rise)
    ways = -(ways / _largest(ways)) @ to_gradient.T
    ways = ways / _largest(ways)
    length = np.linalg.norm(ways, axis=1)
    ways[length == 0], length[length == 0] = (1.0, 0.0, 0.0), 1.0
    return (ways / length[:, None]).astype(np.float32)


def _largest(ways: Floats) -> Floats:
    """float64[n, 1]: the greatest coordinate by size, or 1: vectors over it have a length."""
    most = np.abs(ways).max(axis=1, keepdims=True, initial=0)
    return np.where((most > 0) & (most < np.inf), most, 1.0)


@kernel
def slopes_of(data: Any, valid: Any, samples: Any, operator: int, out: Any) -> None:
    """Fill float64[n, 3]: slopes per sample along x, y, z at samples by their flat numbers."""
    _, ny, nx = data.shape
    for n in range(samples.size):
        row, x = samples[n] // nx, samples[n] % nx
        slopes(data, valid, row // ny, row % ny, x, operator, out[n])


def valid_bits(volume: Volume, report: Progress) -> NDArray[np.uint64]:
    """Bits of the samples that are valid (`signs.py`)."""
    data, padding = volume.data, padding_value(volume)
    valid = np.zeros((*data.shape[:2], -(-data.shape[2] // 64) + 1), dtype=np.uint64)
    blank = data.dtype.type(0) if padding is None else padding
    task = partial(signs.pack_valid, data, blank, padding is not None)
    layer = data.shape[1] * data.shape[2]
    in_slabs(lambda a, b: task(a, b, valid), data.shape[0], layer, report, "what is valid")
    return valid
