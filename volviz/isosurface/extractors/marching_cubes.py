"""Marching cubes on the volume's own grid: two triangles here, five there, one surface.

Lorensen and Cline 1987, with our own cases (`cases.py`), bits instead of bytes (`signs.py`) and
the topology of the trilinear function (`ambiguity.py`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from volviz.errors import LimitError, UsageError
from volviz.fields.statistics import padding_value
from volviz.isosurface import marching, memory, signs
from volviz.isosurface.ambiguity import RULES
from volviz.isosurface.cases import cases
from volviz.isosurface.edges import vertices
from volviz.isosurface.kernel import in_slabs, in_turns, threshold
from volviz.isosurface.plain import plain
from volviz.isosurface.slopes import OPERATORS
from volviz.isosurface.triangles import triangles
from volviz.model.mesh import Mesh
from volviz.model.volume import Volume
from volviz.progress import Progress, silent

Ids = NDArray[np.int64]
Rows = Callable[[Any, bool, NDArray[np.uint64]], None]
_Valid = tuple[NDArray[np.uint64], NDArray[np.uint64], int]
_valid: WeakKeyDictionary[Volume, _Valid] = WeakKeyDictionary()


@dataclass(frozen=True, eq=False)
class _Found:
    """Bits of the samples and cells (`signs.py`); cells left out because a sample is not valid."""

    signs: NDArray[np.uint64]
    mask: NDArray[np.uint64]
    valid: NDArray[np.uint64]
    skipped: int
    live: NDArray[np.uint64]
    everywhere: bool  # all words are live, and `live` is not filled yet
    scratch: memory.Scratch  # signs, live, and what `_count` fills


def extract(
    volume: Volume,
    isovalue: float,
    cells: Ids | None = None,
    *,
    ambiguity: str = "trilinear",
    normals: str = "central",
    part: bool = False,
    rows: Rows | None = None,
    progress: Progress | None = None,
) -> Mesh:
    """The surface where the trilinear volume crosses the isovalue.

    cells: sorted ids of cells among which are all active ones, as a finder gives them; the mesh
    is the same, bit for bit, as with None, which looks at every cell. part: the cells are only
    some of them, and the surface ends where they do. ambiguity: a key of `ambiguity.RULES`.
    normals: a key of `slopes.OPERATORS`. Memory beyond the mesh: a bit per sample (two more,
    kept with the volume, where some sample is not valid, one more for a part) and 44 bytes per
    row. rows: `Bricks.rows` instead of cells. Raises UsageError for
    cells that are not there, LimitError where 32 bits do not number the vertices, Cancelled.
    """
    report = progress or silent()
    limit = threshold(volume.data.dtype, isovalue)
    if limit is None or min(volume.data.shape) < 2:
        return Mesh(np.empty((0, 3), np.float32), space=volume.info.space)
    ids = _checked(cells, volume.data.shape)
    found = _classify(volume, limit, ids, part, rows, report.part(0, 0.3))
    rule = RULES[ambiguity]
    field = marching.Field(volume.data, float(isovalue), found.signs, found.mask, found.valid, rule)
    layout = _count(field, found, report.part(0.3, 0.5))
    arrays = _build(field, placing(volume, normals), layout, report.part(0.5, 1))
    found.scratch.give_back()
    return Mesh(*arrays, space=volume.info.space, skipped=found.skipped)


def _classify(
    volume: Volume, limit: Any, cells: Ids | None, part: bool, rows: Rows | None, report: Progress
) -> _Found:
    """Bits of samples and of the cells that may be used."""
    data, known = volume.data, _valid.get(volume)
    nz, ny, nx = data.shape
    scratch, layer, given = _scratch(data.shape), ny * nx, part and cells is not None
    bits, live = scratch.arrays[:2]
    near = known is not None and not given and (cells is not None or rows is not None)
    if known is not None and near:
        _mark(volume, limit, cells, rows, known[0].size > 0, live)
        few = partial(signs.pack_near, data, limit, live)
        in_turns(lambda turns: few(turns, bits), nz, layer, report, "classifying")
    else:
        pack = partial(signs.pack_signs, data, limit)
        bad = in_turns(lambda turns: pack(turns, bits), nz, layer, report, "classifying")
        known = known or _valid.setdefault(volume, _validity(volume, any(bad), report))
    mask, valid, skipped = known
    if given:
        mask = np.zeros(bits.shape, dtype=np.uint64)
        signs.mark_cells(cells, nx - 1, ny - 1, mask)
        if valid.size:
            drop = partial(signs.mask_valid, valid, nx, True)
            lost = in_slabs(lambda a, b: drop(a, b, mask), nz - 1, layer, report, "what is valid")
            skipped = sum(lost)
    return _Found(bits, mask, valid, skipped, live, not near, scratch)


def _scratch(shape: tuple[int, ...]) -> memory.Scratch:
    """Signs and live words (`signs.py`); counts, and where the vertices and triangles begin."""
    words, rows = -(-shape[2] // 64) + 1, shape[0] * shape[1]
    return memory.Scratch(
        ((*shape[:2], words), np.uint64),
        ((*shape[:2], -(-words // 64)), np.uint64),
        ((rows, 5), np.int32),
        ((rows + 1,), np.int64),
        ((rows + 1,), np.int64),
    )


def _mark(
    volume: Volume, limit: Any, cells: Ids | None, rows: Rows | None, masked: bool,
    live: NDArray[np.uint64],
) -> None:  # fmt: skip
    """Which words may have something in them, as a finder says."""
    live[:] = 0
    if cells is not None:
        signs.live_near(cells, volume.data.shape[2] - 1, volume.data.shape[1] - 1, live)
    elif rows is not None:
        rows(limit, masked, live)


def _validity(volume: Volume, bad: bool, report: Progress) -> _Valid:
    """Bits of the cells that may be used and of the valid samples, if not all are; cells lost."""
    data, padding = volume.data, padding_value(volume)
    if not bad and padding is None:
        return marching.EMPTY, marching.EMPTY, 0
    words = (data.shape[0], data.shape[1], -(-data.shape[2] // 64) + 1)
    layer = data.shape[1] * data.shape[2]
    mask, valid = np.zeros(words, dtype=np.uint64), np.zeros(words, dtype=np.uint64)
    blank = data.dtype.type(0) if padding is None else padding
    check = partial(signs.pack_valid, data, blank, padding is not None)
    in_slabs(lambda a, b: check(a, b, valid), words[0], layer, report, "what is valid")
    drop = partial(signs.mask_valid, valid, data.shape[2], False)
    lost = in_slabs(lambda a, b: drop(a, b, mask), words[0] - 1, layer, report, "what is valid")
    return mask, valid, sum(lost)


def _checked(cells: Ids | None, shape: tuple[int, ...]) -> Ids | None:
    """The ids as the kernels take them."""
    if cells is None:
        return None
    ids = np.ascontiguousarray(cells, dtype=np.int64)
    count = (shape[0] - 1) * (shape[1] - 1) * (shape[2] - 1)
    if ids.size and not (ids[0] >= 0 and ids[-1] < count and np.all(ids[1:] > ids[:-1])):
        raise UsageError(f"cell ids are sorted and go from 0 to {count - 1}", field="cells")
    return ids


def _count(field: marching.Field, found: _Found, report: Progress) -> marching.Layout:
    nz, ny, nx = field.data.shape
    counts, starts, faces = found.scratch.arrays[2:]
    task = partial(marching.count, field, cases(), plain(), found.everywhere)
    in_turns(lambda turns: task(turns, found.live, counts), nz, ny * nx, report, "counting")
    marching.number(counts, starts, faces)
    if starts[-1] >= 1 << 32:
        raise LimitError(
            f"the surface has {starts[-1]} vertices, more than 32 bits can number",
            fix="choose another isovalue or a smaller region",
        )
    return marching.Layout(counts, starts, faces, found.live)


def _build(
    field: marching.Field, place: marching.Placing, layout: marching.Layout, report: Progress
) -> tuple[NDArray[np.float32], NDArray[np.uint32], NDArray[np.float32]]:
    nz, ny, nx = field.data.shape
    count = int(layout.vertices[-1])
    points, normals, faces = memory.empty(
        ((count, 3), np.float32),
        ((count if place.operator >= 0 else 0, 3), np.float32),
        ((int(layout.triangles[-1]), 3), np.uint32),
    )
    first = partial(vertices, field, place, layout)
    pair, out = (points, normals), (points, normals, faces)
    in_turns(lambda turns: first(turns, pair), nz, ny * nx, report.part(0, 0.5), "vertices")
    second = partial(triangles, field, cases(), plain(), place, layout)
    part = report.part(0.5, 1)
    in_turns(lambda turns: second(turns, out), nz - 1, ny * nx, part, "triangles")
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
