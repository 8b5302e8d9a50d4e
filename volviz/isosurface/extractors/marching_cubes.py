"""Marching cubes on the volume's own grid: two triangles here, five there, one surface.

Lorensen and Cline 1987, with our own cases (`cases.py`), bits instead of bytes (`signs.py`) and
the topology of the trilinear function (`ambiguity.py`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from volviz.errors import LimitError, UsageError
from volviz.fields.statistics import padding_value
from volviz.isosurface import marching, signs
from volviz.isosurface.ambiguity import RULES
from volviz.isosurface.cases import Cases, cases
from volviz.isosurface.kernel import in_slabs, threshold
from volviz.isosurface.slopes import OPERATORS
from volviz.isosurface.triangles import triangles
from volviz.model.mesh import Mesh
from volviz.model.volume import Volume
from volviz.progress import Progress, silent

Ids = NDArray[np.int64]
_whole: WeakKeyDictionary[Volume, bool] = WeakKeyDictionary()  # every sample is valid


@dataclass(frozen=True, eq=False)
class _Found:
    """Bits of the samples and cells (`signs.py`); cells left out because a sample is not valid."""

    signs: NDArray[np.uint64]
    mask: NDArray[np.uint64]
    valid: NDArray[np.uint64]
    skipped: int


def extract(
    volume: Volume,
    isovalue: float,
    cells: Ids | None = None,
    *,
    ambiguity: str = "trilinear",
    normals: str = "central",
    part: bool = False,
    progress: Progress | None = None,
) -> Mesh:
    """The surface where the trilinear volume crosses the isovalue.

    cells: sorted ids of cells among which are all active ones, as a finder gives them; the mesh
    is the same, bit for bit, as with None, which looks at every cell. part: the cells are only
    some of them, and the surface ends where they do. ambiguity: a key of `ambiguity.RULES`.
    normals: a key of `slopes.OPERATORS`. Memory beyond the mesh: a bit per sample (two more where
    some sample is not valid, one more for a part) and 32 bytes per row. Raises UsageError for
    cells that are not there, LimitError where 32 bits do not number the vertices, Cancelled.
    """
    report = progress or silent()
    limit = threshold(volume.data.dtype, isovalue)
    if limit is None or min(volume.data.shape) < 2:
        return Mesh(np.empty((0, 3), np.float32), space=volume.info.space)
    ids = _checked(cells, volume.data.shape)
    found = _classify(volume, limit, ids, part, report.part(0, 0.3))
    rule = RULES[ambiguity]
    field = marching.Field(volume.data, float(isovalue), found.signs, found.mask, found.valid, rule)
    layout = _count(field, cases(), report.part(0.3, 0.5))
    arrays = _build(field, placing(volume, normals), layout, report.part(0.5, 1))
    return Mesh(*arrays, space=volume.info.space, skipped=found.skipped)


def _classify(
    volume: Volume, limit: Any, cells: Ids | None, part: bool, report: Progress
) -> _Found:
    """Bits of samples and of the cells that may be used."""
    data = volume.data
    words = (data.shape[0], data.shape[1], -(-data.shape[2] // 64) + 1)
    layer = data.shape[1] * data.shape[2]
    bits = np.zeros(words, dtype=np.uint64)
    if cells is not None and not part and _whole.get(volume, False):
        needed = np.zeros((*words[:2], words[2] - 1), dtype=np.bool_)
        signs.need_words(cells, data.shape[2] - 1, data.shape[1] - 1, needed)
        near = partial(signs.pack_signs_near, data, limit, needed)
        in_slabs(lambda a, b: near(a, b, bits), words[0], layer, report, "classifying")
        return _Found(bits, marching.EMPTY, marching.EMPTY, 0)
    pack = partial(signs.pack_signs, data, limit)
    bad = sum(in_slabs(lambda a, b: pack(a, b, bits), words[0], layer, report, "classifying"))
    padding = padding_value(volume)
    _whole[volume] = not bad and padding is None
    if _whole[volume] and not (part and cells is not None):
        return _Found(bits, marching.EMPTY, marching.EMPTY, 0)
    mask, given = np.zeros(words, dtype=np.uint64), part and cells is not None
    if given:
        signs.mark_cells(cells, data.shape[2] - 1, data.shape[1] - 1, mask)
    valid = np.zeros(words, dtype=np.uint64)
    blank = data.dtype.type(0) if padding is None else padding
    check = partial(signs.pack_valid, data, blank, padding is not None)
    in_slabs(lambda a, b: check(a, b, valid), words[0], layer, report, "what is valid")
    drop = partial(signs.mask_valid, valid, data.shape[2], given)
    lost = in_slabs(lambda a, b: drop(a, b, mask), words[0] - 1, layer, report, "what is valid")
    return _Found(bits, mask, marching.EMPTY if _whole[volume] else valid, sum(lost))


def _checked(cells: Ids | None, shape: tuple[int, ...]) -> Ids | None:
    """The ids as the kernels take them."""
    if cells is None:
        return None
    ids = np.ascontiguousarray(cells, dtype=np.int64)
    count = (shape[0] - 1) * (shape[1] - 1) * (shape[2] - 1)
    if ids.size and not (ids[0] >= 0 and ids[-1] < count and np.all(ids[1:] > ids[:-1])):
        raise UsageError(f"cell ids are sorted and go from 0 to {count - 1}", field="cells")
    return ids


def _count(field: marching.Field, table: Cases, report: Progress) -> marching.Layout:
    nz, ny, nx = field.data.shape
    edges = np.zeros((nz * ny, 3), dtype=np.int32)
    inner, faces = np.zeros(nz * ny, dtype=np.int32), np.zeros(nz * ny, dtype=np.int32)
    task = partial(marching.count, field, table)
    in_slabs(lambda a, b: task(a, b, edges, inner, faces), nz, ny * nx, report, "counting")
    own = edges.sum(axis=1, dtype=np.int64)
    layout = marching.Layout(edges, _starts(own + inner), _starts(faces))
    if layout.vertices[-1] >= 1 << 32:
        raise LimitError(
            f"the surface has {layout.vertices[-1]} vertices, more than 32 bits can number",
            fix="choose another isovalue or a smaller region",
        )
    return layout


def _starts(counts: NDArray[Any]) -> NDArray[np.int64]:
    starts = np.zeros(counts.size + 1, dtype=np.int64)
    np.cumsum(counts, out=starts[1:])
    return starts


def _build(
    field: marching.Field, place: marching.Placing, layout: marching.Layout, report: Progress
) -> tuple[NDArray[np.float32], NDArray[np.uint32], NDArray[np.float32]]:
    nz, ny, nx = field.data.shape
    count = int(layout.vertices[-1])
    points = np.empty((count, 3), dtype=np.float32)
    normals = np.empty((count if place.operator >= 0 else 0, 3), dtype=np.float32)
    faces = np.empty((int(layout.triangles[-1]), 3), dtype=np.uint32)
    first = partial(marching.vertices, field, place, layout)
    pair = (points, normals)
    in_slabs(lambda a, b: first(a, b, pair), nz, ny * nx, report.part(0, 0.5), "vertices")
    second = partial(triangles, field, cases(), place, layout)
    out = (points, normals, faces)
    in_slabs(lambda a, b: second(a, b, out), nz - 1, ny * nx, report.part(0.5, 1), "triangles")
    return points, faces, normals


def placing(volume: Volume, normals: str) -> marching.Placing:
    """How index coordinates become world coordinates, and gradients per sample normals."""
    axes = volume.affine[:3, :3]
    lengths = np.linalg.norm(axes, axis=0)
    inverse = np.linalg.inv(axes / lengths) / lengths[:, None]
    return marching.Placing(
        tuple(float(a) for a in volume.affine[:3].ravel()),
        tuple(float(a) for a in inverse.T.ravel()),
        OPERATORS[normals],
        bool(np.linalg.det(axes / lengths) < 0),
    )
