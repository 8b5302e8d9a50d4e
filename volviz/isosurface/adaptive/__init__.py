"""View-dependent surfaces: as fine as one picture needs, and no cracks between the sizes.

Cells grow with their distance from a focus, none is smaller than a pixel, and what is outside the
frame or hidden by nearer parts of the surface is not made. Within the lens, where a sample is no
smaller than a pixel, the triangles are those of marching cubes.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volviz.errors import UsageError
from volviz.fields.statistics import padding_value
from volviz.isosurface import signs
from volviz.isosurface.active import averaged_normals, numbered, to_world
from volviz.isosurface.adaptive import dual, places, ranges, sweep
from volviz.isosurface.adaptive.leaves import HALF, Field, Leaves, Sight
from volviz.isosurface.ambiguity import RULES
from volviz.isosurface.cases import cases
from volviz.isosurface.classified import placing
from volviz.isosurface.kernel import in_slabs, threshold
from volviz.isosurface.marching import EMPTY, Placing
from volviz.model.lens import METHOD, SeenSurface, Viewing, reach
from volviz.model.mesh import Mesh
from volviz.model.surface import Surface
from volviz.model.volume import Volume
from volviz.progress import Progress, silent

SOME = 64
"""Blocks between two reports."""
MOST_PIXELS = 1 << 20
"""Of the picture in which it is looked up what hides what; larger ones are looked up coarser."""
_FIRST = 1 << 18  # triangles, before more room is made
_PART = 1 << 15  # vertices at a time


@dataclass(frozen=True)
class Culled:
    """Of the blocks of 16³ samples in or next to which the surface is: how many were made, were
    outside the picture, were hidden. seconds: that it all took."""

    made: int
    outside: int
    hidden: int
    seconds: float = 0.0


@dataclass(frozen=True, eq=False)
class Adaptive:
    """A surface for one picture, and what was spared. boundary: blocks left out, bool[z, y, x]."""

    mesh: Mesh
    culled: Culled
    left_out: NDArray[np.bool_]


@dataclass(eq=False)
class _Work:
    """Blocks, front to back, and what is known of them so far."""

    field: Field
    ranges: ranges.Ranges
    sight: Sight
    blocks: NDArray[np.int64]
    state: NDArray[np.int32]
    leaves: Leaves
    depth: NDArray[np.float64]
    options: tuple[int, bool, bool]


def under_lens(surface: SeenSurface) -> bool:
    """True if a lens is over this surface."""
    viewing = surface.viewing
    return viewing is not None and viewing.lens.lens and surface.method == METHOD


def extract(
    volume: Volume, surface: SeenSurface, progress: Progress | None = None, *, cull: bool = True
) -> Adaptive:
    """The surface as its `viewing` says. cull: without what is outside the frame or hidden.

    Memory beyond the mesh: 5 kB per block that the surface is in or next to, a sixtieth of the
    volume, 8 bytes per pixel; where some sample is not valid, a bit per sample. Raises UsageError
    where there is no lens, LimitError where 32 bits do not number the vertices, Cancelled.
    """
    if not under_lens(surface) or surface.viewing is None:
        raise UsageError("a view-dependent surface needs a lens", field="lens", fix="turn it on")
    report, start = progress or silent(), time.perf_counter()
    limit = threshold(volume.data.dtype, surface.isovalue)
    if limit is None or min(volume.data.shape) < 2:
        none = np.zeros((0, 0, 0), np.bool_)
        return Adaptive(_nothing(volume), Culled(0, 0, 0, time.perf_counter() - start), none)
    work = _prepared(volume, surface, surface.viewing, limit, cull, report.part(0.0, 0.2))
    made, counts = _swept(work, report.part(0.2, 0.8))
    mesh = _mesh(volume, surface, work, made, report.part(0.8, 1.0))
    culled = Culled(int(counts[2]), int(counts[3]), int(counts[4]), time.perf_counter() - start)
    return Adaptive(mesh, culled, work.state == dual.LEFT_OUT)


def _prepared(
    volume: Volume, surface: Surface, viewing: Viewing, limit: Any, cull: bool, report: Progress
) -> _Work:
    data, padding = volume.data, padding_value(volume)
    blank = data.dtype.type(0) if padding is None else padding
    sight = sight_of(volume, viewing)
    known = ranges.ranges_of(volume, report)
    holes = bool((known.valid4 != ranges.WHOLE).any())
    field = Field(data, blank, padding is not None, limit, float(surface.isovalue), holes)
    near = np.zeros(known.low4.shape, np.bool_)
    ranges.near_blocks(known, limit, near)
    blocks = np.argwhere(near)
    state = np.full(near.shape, dual.EMPTY, np.int32)
    state[near] = dual.WAITING
    middles = (blocks[:, ::-1] + 0.5) * ranges.SIDE
    eye = np.array(sight.eye).reshape(3, 4)
    away = middles @ eye[:, :3].T + eye[:, 3]
    far = np.linalg.norm(away, axis=1) if sight.perspective else away[:, 2]
    blocks = np.ascontiguousarray(blocks[np.argsort(far, kind="stable")])
    turned = placing(volume, "none").turned
    depth = np.full(sight.size[::-1] if cull and viewing.opaque else (0, 0), np.inf)
    room = min(len(blocks), 4 * SOME)
    return _Work(
        field, known, sight, blocks, state, _leaves(room), depth,
        (RULES[surface.ambiguity], turned, cull),
    )  # fmt: skip


def sight_of(volume: Volume, viewing: Viewing) -> Sight:
    """The numbers of a viewing for the kernels."""
    camera, lens = viewing.camera, viewing.lens
    width, height = viewing.size
    shrink = min(1.0, math.sqrt(MOST_PIXELS / (width * height)))
    eye = camera.view_matrix() @ volume.affine
    eye[2] *= -1
    perspective = camera.projection == "perspective"
    span = 2 * math.tan(math.radians(camera.fov) / 2) if perspective else camera.height
    spacing = np.array(volume.spacing)
    diagonal = float(np.linalg.norm(spacing * volume.dims))
    return Sight(
        world=tuple(float(v) for v in volume.affine[:3].ravel()),
        eye=tuple(float(v) for v in eye[:3].ravel()),
        perspective=perspective,
        half=camera.half(width / height),
        size=(max(round(width * shrink), 1), max(round(height * shrink), 1)),
        side=float(spacing.max()),
        pixel=span / min(width, height),
        focus=lens.focus,
        radius=reach(diagonal, lens),
        growth=lens.lens_growth,
        pixels=lens.lens_pixels,
    )


def _leaves(room: int) -> Leaves:
    groups = (room, HALF, HALF, HALF)
    return Leaves(np.empty(groups, np.uint8), np.empty(groups), np.empty(room, np.uint8))


def _swept(work: _Work, report: Progress) -> tuple[tuple[Any, Any], NDArray[np.int64]]:
    """(numbers of the corners of triangles, places inside cells); counts of `sweep`."""
    out = (np.empty((_FIRST, 3), np.int64), np.empty((_FIRST // 4, 4)))
    counts = np.zeros(5, np.int64)
    done, total = 0, len(work.blocks)
    while done < total:
        report(done / total, "what the picture shows")
        _make_room(work, int(counts[2]) + SOME)
        span = (done, min(done + SOME, total))
        after = sweep.sweep(
            work.field, work.ranges, work.sight, cases(), work.options, work.blocks, span,
            work.state, work.leaves, work.depth, out, counts,
        )  # fmt: skip
        if after < span[1]:
            out = (_longer(out[0], sweep.ROOM), _longer(out[1], sweep.ROOM // 4))
        done = after
    return (out[0][: counts[0]], out[1][: counts[1]]), counts


def _make_room(work: _Work, wanted: int) -> None:
    room = len(work.leaves.least)
    if wanted > room:
        more = _leaves(max(wanted, room * 3 // 2))
        more.level[:room], more.value[:room] = work.leaves.level, work.leaves.value
        more.least[:room] = work.leaves.least
        work.leaves = more


def _longer(array: NDArray[Any], least: int) -> NDArray[Any]:
    new = np.empty((len(array) * 3 // 2 + least, *array.shape[1:]), array.dtype)
    new[: len(array)] = array
    return new


def _nothing(volume: Volume) -> Mesh:
    return Mesh(np.empty((0, 3), np.float32), space=volume.info.space)


def _mesh(
    volume: Volume, surface: Surface, work: _Work, made: tuple[Any, Any], report: Progress
) -> Mesh:
    """Triangles by numbers of places to a mesh in the world."""
    corners, within = made
    if not len(corners):
        return _nothing(volume)
    report(0.0, "numbering")
    keys, faces = numbered(corners)
    index, gradients = np.empty((len(keys), 3)), np.empty((len(keys), 3))
    own = int(np.searchsorted(keys, 0))  # those inside cells come first, the last of them -1
    place = placing(volume, surface.normals)
    bits = _valid_bits(volume, report) if work.field.holes else EMPTY
    for first in range(own, len(keys), _PART):
        report(0.3 + 0.4 * first / len(keys), "vertices")
        last = min(first + _PART, len(keys))
        places.on_edges(
            work.field, bits, work.state, work.leaves, place.operator, keys, first, last,
            index, gradients,
        )  # fmt: skip
    which = np.ascontiguousarray(within[-1 - keys[:own]])
    index[:own] = which[:, :3]
    places.inside(work.field, bits, place.operator, which, gradients[:own])
    report(0.7, "normals")
    points = to_world(volume.affine, index)
    normals = np.empty((0, 3), np.float32)
    if place.operator >= 0:
        normals = _normals(points, faces, gradients, place)
    return Mesh(points.astype(np.float32), faces, normals, space=volume.info.space)


def _normals(
    points: NDArray[np.float64], faces: Any, gradients: NDArray[np.float64], place: Placing
) -> NDArray[np.float32]:
    """From the gradients where there are any, else the mean of those of the triangles."""
    out = averaged_normals(points, faces, np.zeros_like(points))
    way = -(gradients @ np.array(place.gradients).reshape(3, 3).T)
    length = np.linalg.norm(way, axis=1)
    known = (length > 0) & np.isfinite(length)
    out[known] = (way[known] / length[known, None]).astype(np.float32)
    return out


def _valid_bits(volume: Volume, report: Progress) -> Any:
    """Bits of the samples that are valid."""
    data, padding = volume.data, padding_value(volume)
    blank = data.dtype.type(0) if padding is None else padding
    bits = np.zeros((*data.shape[:2], -(-data.shape[2] // 64) + 1), np.uint64)

    def check(a: int, b: int) -> None:
        signs.pack_valid(data, blank, padding is not None, a, b, bits)

    in_slabs(check, len(data), data[0].size, report.part(0.1, 0.3), "what is valid")
    return bits
