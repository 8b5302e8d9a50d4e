"""View-dependent surfaces: as fine as one picture needs, and no cracks between the sizes.

Cells grow with their distance from a focus, none is smaller than a pixel, and what is outside the
frame or hidden by nearer parts of the surface is not made. Within the lens, where a sample is no
smaller than a pixel, the triangles are those of marching cubes. Where only the lens has moved since
the picture before, what is the same is taken from that (`sweep`): following it costs less.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from volviz.errors import UsageError
from volviz.fields.statistics import padding_value
from volviz.isosurface import signs
from volviz.isosurface.adaptive import dual, places, ranges, sweep, vertices
from volviz.isosurface.adaptive.leaves import HALF, Field, Leaves, Sight
from volviz.isosurface.ambiguity import RULES
from volviz.isosurface.cases import cases
from volviz.isosurface.classified import placing
from volviz.isosurface.kernel import in_slabs, threshold
from volviz.isosurface.marching import EMPTY
from volviz.model.lens import METHOD, Lens, SeenSurface, Viewing, reach
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
_KEPT = 2
"""Surfaces of a volume whose last picture is kept."""


@dataclass(frozen=True)
class Culled:
    """Of the blocks of 16³ samples in or next to which the surface is: how many were made, were
    outside the picture, were hidden. seconds: that it all took. again: of those made, how many are
    as they were in the picture before."""

    made: int
    outside: int
    hidden: int
    seconds: float = 0.0
    again: int = 0


@dataclass(frozen=True, eq=False)
class Adaptive:
    """A surface for one picture, and what was spared. boundary: blocks left out, bool[z, y, x]."""

    mesh: Mesh
    culled: Culled
    left_out: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class _Last:
    """A picture: its blocks, and its mesh as it was made. own: float32[n, 3], normals by the
    gradient, NaN where there is none."""

    run: sweep.Run
    faces: NDArray[np.uint32]
    keys: NDArray[np.int64]
    vertices: NDArray[np.float32]
    own: NDArray[np.float32]


_last: WeakKeyDictionary[Volume, dict[object, _Last]] = WeakKeyDictionary()


@dataclass(eq=False)
class _Work:
    """Blocks, front to back, what was there before, and what is known of them so far. news: as in
    `sweep`."""

    field: Field
    ranges: ranges.Ranges
    sight: Sight
    blocks: NDArray[np.int64]
    run: sweep.Run
    last: _Last
    news: tuple[NDArray[np.bool_], NDArray[np.int64]]
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
    volume, 8 bytes per pixel, 28 per triangle; where some sample is not valid, a bit per sample.
    What is kept for the next picture: the blocks', and 32 bytes per triangle. Raises UsageError
    where there is no lens, LimitError where 32 bits do not number the vertices, Cancelled.
    """
    if not under_lens(surface) or surface.viewing is None:
        raise UsageError("a view-dependent surface needs a lens", field="lens", fix="turn it on")
    report, start = progress or silent(), time.perf_counter()
    limit = threshold(volume.data.dtype, surface.isovalue)
    if limit is None or min(volume.data.shape) < 2:
        none = np.zeros((0, 0, 0), np.bool_)
        return Adaptive(_nothing(volume), Culled(0, 0, 0, time.perf_counter() - start), none)
    kept, key = _last.setdefault(volume, {}), (_still(surface, surface.viewing), cull)
    work = _prepared(volume, surface, surface.viewing, limit, cull, report.part(0.0, 0.2))
    work = _after(work, kept.get(key))
    made, counts = _swept(work, report.part(0.2, 0.8))
    mesh, now = _mesh(volume, surface, work, made, report.part(0.8, 1.0))
    kept.pop(key, None)
    for old in list(kept)[: max(len(kept) - _KEPT + 1, 0)]:
        kept.pop(old, None)
    kept[key] = now
    again = int((work.news[1] >= 0).sum())
    seconds = time.perf_counter() - start
    culled = Culled(int(counts[2]), int(counts[3]), int(counts[4]), seconds, again)
    return Adaptive(mesh, culled, work.run.state == dual.LEFT_OUT)


def forget(volume: Volume) -> None:
    """Make the next picture of this volume from nothing."""
    _last.pop(volume, None)


def _still(surface: SeenSurface, viewing: Viewing) -> SeenSurface:
    """The surface with its lens nowhere: the same for pictures in which only the lens moves."""
    pixels = viewing.lens.lens_pixels
    nowhere = Lens(lens=True, lens_radius=0.0, lens_growth=0.0, lens_pixels=pixels)
    return replace(surface, viewing=replace(viewing, lens=nowhere))


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
    count = len(blocks)
    news = np.ones(count, np.bool_), np.full(count, -1)
    return _Work(
        field, known, sight, blocks, _run(state, count), _nothing_before(), news, depth,
        (RULES[surface.ambiguity], turned, cull),
    )  # fmt: skip


def _run(state: NDArray[np.int32], count: int) -> sweep.Run:
    groups = (count + 1, HALF, HALF, HALF)
    leaves = Leaves(
        np.empty(groups, np.uint8),
        np.empty(groups),
        np.empty(count + 1, np.uint8),
        np.empty(groups, np.uint8),
        np.zeros(count + 1, np.bool_),
    )
    codes, spans = np.full(count, sweep.MIXED), np.zeros((count, 2), np.int64)
    return sweep.Run(state, leaves, codes, spans, np.empty((0, 7), np.float32))


def _nothing_before() -> _Last:
    none = np.empty((0, 3), np.float32)
    run = _run(np.empty((0, 0, 0), np.int32), 0)
    return _Last(run, np.empty((0, 3), np.uint32), np.empty(0, np.int64), none, none)


def _after(work: _Work, last: _Last | None) -> _Work:
    """The work that begins where another picture of the same blocks ended."""
    if last is None:
        return work
    old = last.run.leaves
    mine = {name: getattr(old, name).copy() for name in ("level", "value", "least")}
    leaves = old._replace(**mine)
    return replace(work, run=work.run._replace(leaves=leaves), last=last)


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
        reach=_half_diagonal(volume),
        pixel=span / min(width, height),
        focus=lens.focus,
        radius=reach(diagonal, lens),
        growth=lens.lens_growth,
        pixels=lens.lens_pixels,
    )


def _half_diagonal(volume: Volume) -> float:
    """Of a block, the longest one, mm."""
    x, y, z = volume.affine[:3, :3].T * ranges.SIDE / 2
    return float(max(np.linalg.norm(x + a * y + b * z) for a in (-1, 1) for b in (-1, 1)))


def _swept(work: _Work, report: Progress) -> tuple[tuple[Any, Any, Any], NDArray[np.int64]]:
    """(numbers of the corners of triangles, places inside cells, places in the picture); counts
    of `sweep`."""
    first = max(_FIRST, len(work.last.faces) * 5 // 4)
    screen = first if work.depth.size else 0
    out: tuple[Any, Any, Any] = (
        np.empty((first, 3), np.int64),
        np.empty((max(first // 4, sweep.ROOM), 4)),
        np.empty((screen, 7), np.float32),
    )
    counts = np.zeros(5, np.int64)
    done, total = 0, len(work.blocks)
    while done < total:
        report(done / total, "what the picture shows")
        span = (done, min(done + SOME, total))
        after = sweep.sweep(
            work.field, work.ranges, work.sight, cases(), work.options, work.blocks, span,
            work.run, work.last.run, work.news, work.depth, out, counts,
        )  # fmt: skip
        if after < span[1]:
            room = sweep.ROOM
            longer = _longer(out[2], room) if work.depth.size else out[2]
            out = (_longer(out[0], room), _longer(out[1], room // 4), longer)
        done = after
    return (out[0][: counts[0]], out[1][: counts[1]], out[2][: counts[0]]), counts


def _longer(array: NDArray[Any], least: int) -> NDArray[Any]:
    new = np.empty((len(array) * 3 // 2 + least, *array.shape[1:]), array.dtype)
    new[: len(array)] = array
    return new


def _nothing(volume: Volume) -> Mesh:
    return Mesh(np.empty((0, 3), np.float32), space=volume.info.space)


def _mesh(
    volume: Volume, surface: Surface, work: _Work, made: tuple[Any, Any, Any], report: Progress
) -> tuple[Mesh, _Last]:
    """Triangles by numbers of places to a mesh in the world, and what is kept of it."""
    corners, within, screen = made
    report(0.0, "numbering")
    last, run = work.last, work.run._replace(screen=screen.copy())
    found = vertices.welded(run.spans, work.news[1], corners, last.faces, last.keys)
    kept = found.origin >= 0
    points = np.empty((len(kept), 3), np.float32)
    own = np.empty((len(kept), 3), np.float32)
    points[kept], own[kept] = last.vertices[found.origin[kept]], last.own[found.origin[kept]]
    points[~kept], own[~kept] = _placed(volume, surface, work, found.keys[~kept], within, report)
    now = _Last(run, found.faces, found.keys, points, own)
    if not len(found.faces):
        return _nothing(volume), now
    report(0.7, "normals")
    normals = np.empty((0, 3), np.float32)
    if placing(volume, surface.normals).operator >= 0:
        normals = own.copy()
        vertices.fill_normals(points, found.faces, normals)
    return Mesh(points, found.faces, normals, space=volume.info.space), now


def _placed(
    volume: Volume, surface: Surface, work: _Work, keys: Any, within: Any, report: Progress
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Where vertices are, and their normals by the gradient (NaN: none)."""
    place = placing(volume, surface.normals)
    bits = _valid_bits(volume, report) if work.field.holes and len(keys) else EMPTY
    index, gradients = np.empty((len(keys), 3)), np.empty((len(keys), 3))
    for first in range(0, len(keys), _PART):
        report(0.3 + 0.4 * first / len(keys), "vertices")
        last = min(first + _PART, len(keys))
        places.on_edges(
            work.field, bits, work.run.state, work.run.leaves, place.operator, keys, first, last,
            index, gradients,
        )  # fmt: skip
    inside = np.flatnonzero(keys < 0)
    which = np.ascontiguousarray(within[-1 - keys[inside]])
    there = np.empty((len(inside), 3))
    places.inside(work.field, bits, place.operator, which, there)
    index[inside], gradients[inside] = which[:, :3], there
    points, own = np.empty((len(keys), 3), np.float32), np.empty((len(keys), 3), np.float32)
    affine = np.ascontiguousarray(volume.affine[:3])
    vertices.in_world(index, gradients, affine, np.array(place.gradients), points, own)
    return points, own


def _valid_bits(volume: Volume, report: Progress) -> Any:
    """Bits of the samples that are valid."""
    data, padding = volume.data, padding_value(volume)
    blank = data.dtype.type(0) if padding is None else padding
    bits = np.zeros((*data.shape[:2], -(-data.shape[2] // 64) + 1), np.uint64)

    def check(a: int, b: int) -> None:
        signs.pack_valid(data, blank, padding is not None, a, b, bits)

    in_slabs(check, len(data), data[0].size, report.part(0.1, 0.3), "what is valid")
    return bits
