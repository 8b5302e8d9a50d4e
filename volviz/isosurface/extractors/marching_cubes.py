"""Marching cubes on the volume's own grid: two triangles here, five there, one surface.

Lorensen and Cline 1987, with our own cases (`cases.py`), bits instead of bytes (`signs.py`) and
the topology of the trilinear function (`ambiguity.py`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

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
    progress: Progress | None = None,
) -> Mesh:
    """The surface where the trilinear volume crosses the isovalue.

    cells: sorted ids of the cells to look at, None for all; ids that contain every active cell
    give the same mesh, bit for bit. ambiguity: a key of `ambiguity.RULES`. normals: a key of
    `slopes.OPERATORS`, or "none". Memory beyond the mesh: a bit per sample (two more where some
    sample is not valid or cells are given) and 32 bytes per row. Raises LimitError where 32 bits
    do not number the vertices, Cancelled.
    """
    report = progress or silent()
    limit = threshold(volume.data.dtype, isovalue)
    if limit is None or min(volume.data.shape) < 2:
        return Mesh(np.empty((0, 3), np.float32), space=volume.info.space)
    found = _classify(volume, limit, cells, report.part(0, 0.3))
    rule = RULES[ambiguity]
    field = marching.Field(
        volume.data, float(isovalue), found.signs, found.mask, found.valid, rule
    )
    layout = _count(field, cases(), report.part(0.3, 0.5))
    arrays = _build(field, placing(volume, normals), layout, report.part(0.5, 1))
    return Mesh(*arrays, space=volume.info.space, skipped=found.skipped)


def _classify(volume: Volume, limit: Any, cells: Ids | None, report: Progress) -> _Found:
    data = volume.data
    shape = (data.shape[0], data.shape[1], -(-data.shape[2] // 64) + 1)
    layer = data.shape[1] * data.shape[2]
    bits = np.zeros(shape, dtype=np.uint64)
    mask = marching.EMPTY
    if cells is None:
        pack: Any = partial(signs.pack_signs, data, limit)
    else:
        mask = _given(cells, data.shape, shape)
        pack = partial(signs.pack_signs_near, data, limit, mask)
    bad = sum(in_slabs(lambda a, b: pack(a, b, bits), shape[0], layer, report, "classifying"))
    padding = padding_value(volume)
    if not bad and padding is None:
        return _Found(bits, mask, marching.EMPTY, 0)
    valid, given = np.zeros(shape, dtype=np.uint64), cells is not None
    blank = data.dtype.type(0) if padding is None else padding
    check = partial(signs.pack_valid, data, blank, padding is not None)
    in_slabs(lambda a, b: check(a, b, valid), shape[0], layer, report, "what is valid")
    if not given:
        mask = np.zeros(shape, dtype=np.uint64)
    drop = partial(signs.mask_valid, valid, data.shape[2], given)
    lost = in_slabs(lambda a, b: drop(a, b, mask), shape[0] - 1, layer, report, "what is valid")
    return _Found(bits, mask, valid, sum(lost))


def _given(cells: Ids, shape: tuple[int, ...], words: tuple[int, int, int]) -> NDArray[np.uint64]:
    """The mask of cells by their ids."""
    mask = np.zeros(words, dtype=np.uint64)
    ids = np.ascontiguousarray(cells, dtype=np.int64)
    last = (shape[0] - 1) * (shape[1] - 1) * (shape[2] - 1)
    if ids.size and not 0 <= ids[0] <= ids[-1] < last:
        raise UsageError(f"cell ids go from 0 to {last - 1}", field="cells")
    signs.mark_cells(ids, shape[2] - 1, shape[1] - 1, mask)
    return mask


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
        OPERATORS.get(normals, -1),
        bool(np.linalg.det(axes / lengths) < 0),
    )
