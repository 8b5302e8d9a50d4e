"""What marching cubes and its discretized form begin with: bits of samples, counts of rows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from volviz.errors import LimitError, UsageError
from volviz.fields.statistics import padding_value
from volviz.isosurface import marching, memory, signs
from volviz.isosurface.cases import cases
from volviz.isosurface.kernel import in_slabs
from volviz.isosurface.slopes import OPERATORS
from volviz.isosurface.turns import in_turns
from volviz.model.volume import Volume
from volviz.progress import Progress

Ids = NDArray[np.int64]
Rows = Callable[[Any, bool, NDArray[np.uint64]], None]
_Valid = tuple[NDArray[np.uint64], NDArray[np.uint64], int]
_BEYOND = 16  # words
_valid: WeakKeyDictionary[Volume, _Valid] = WeakKeyDictionary()


@dataclass(frozen=True, eq=False)
class Found:
    """Bits of the samples and cells (`signs.py`); cells left out because a sample is not valid."""

    signs: NDArray[np.uint64]
    mask: NDArray[np.uint64]
    valid: NDArray[np.uint64]
    skipped: int
    live: NDArray[np.uint64]
    everywhere: bool  # all words are live, neither `live` nor the list of rows is filled yet
    rows: int  # how many are listed
    scratch: memory.Scratch  # signs, live, and what `count_rows` fills


def classify(
    volume: Volume, limit: Any, cells: Ids | None, part: bool, rows: Rows | None, report: Progress
) -> Found:
    """Bits of samples and of the cells that may be used.

    limit: `kernel.threshold` of the isovalue. cells, part, rows: as `marching_cubes.extract` takes
    them. Raises Cancelled.
    """
    data, known = volume.data, _valid.get(volume)
    nz, ny, nx = data.shape
    scratch, layer, given = _scratch(data.shape), ny * nx, part and cells is not None
    bits, live, rows_left = scratch.arrays[0], scratch.arrays[1], scratch.arrays[5]
    bits = _words(bits, data.shape)
    near = known is not None and not given and (cells is not None or rows is not None)
    listed = nz * ny
    if known is not None and near:
        _mark(volume, limit, cells, rows, known[0].size > 0, live)
        listed = signs.live_rows(live, rows_left)
        few = partial(signs.pack_near, data, limit, live, rows_left[:listed])
        run = lambda turns, most: few(turns, most, bits)  # noqa: E731
        in_turns(run, nz * ny, nx, report, "classifying", rows_left[:listed])
    else:
        pack = partial(signs.pack_signs, data, limit)
        bad = in_turns(
            lambda turns, most: pack(turns, most, bits), nz * ny, nx, report, "classifying"
        )
        known = known or _valid.setdefault(volume, _validity(volume, any(bad), report))
    mask, valid, skipped = known
    if given:
        mask = np.zeros(bits.shape, dtype=np.uint64)
        signs.mark_cells(cells, nx - 1, ny - 1, mask)
        if valid.size:
            drop = partial(signs.mask_valid, valid, nx, True)
            lost = in_slabs(lambda a, b: drop(a, b, mask), nz - 1, layer, report, "what is valid")
            skipped = sum(lost)
    return Found(bits, mask, valid, skipped, live, not near, listed, scratch)


def _scratch(shape: tuple[int, ...]) -> memory.Scratch:
    """Signs (with a few words after them that are read in one go) and live words (`signs.py`);
    counts, where the vertices and triangles begin, and which rows have some."""
    words, rows = -(-shape[2] // 64) + 1, shape[0] * shape[1]
    return memory.Scratch(
        ((rows * words + _BEYOND,), np.uint64),
        ((*shape[:2], -(-words // 64)), np.uint64),
        ((rows, 5), np.int32),
        ((rows + 1,), np.int64),
        ((rows + 1,), np.int64),
        ((rows + 1,), np.int32),
    )


def _words(flat: NDArray[np.uint64], shape: tuple[int, ...]) -> NDArray[np.uint64]:
    return flat[:-_BEYOND].reshape(shape[0], shape[1], -1)


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


def checked(cells: Ids | None, shape: tuple[int, ...]) -> Ids | None:
    """The ids as the kernels take them."""
    if cells is None:
        return None
    ids = np.ascontiguousarray(cells, dtype=np.int64)
    count = (shape[0] - 1) * (shape[1] - 1) * (shape[2] - 1)
    if ids.size and not (ids[0] >= 0 and ids[-1] < count and np.all(ids[1:] > ids[:-1])):
        raise UsageError(f"cell ids are sorted and go from 0 to {count - 1}", field="cells")
    return ids


def count_rows(field: marching.Field, found: Found, report: Progress) -> marching.Layout:
    """How many vertices and triangles each row has, and where they begin. Raises LimitError."""
    counts, starts, faces, rows = found.scratch.arrays[2:]
    listed, size = rows[: found.rows], field.data.shape[2]
    task = partial(marching.count, field, cases(), found.everywhere, listed)
    run = lambda turns, most: task(turns, most, found.live, counts)  # noqa: E731
    in_turns(run, found.rows, size, report, "counting")
    left = marching.number(counts, found.everywhere, found.rows, rows, starts, faces)
    if starts[-1] >= 1 << 32:
        raise LimitError(
            f"the surface has {starts[-1]} vertices, more than 32 bits can number",
            fix="choose another isovalue or a smaller region",
        )
    return marching.Layout(rows[:left], counts, starts, faces[: left + 1], found.live)


def placing(volume: Volume, normals: str) -> marching.Placing:
    """How index coordinates become world coordinates, and gradients per sample normals."""
    return _placing(volume.affine[:3].tobytes(), OPERATORS[normals])


@lru_cache(maxsize=16)
def _placing(affine: bytes, operator: int) -> marching.Placing:
    """Of the upper three rows, float64."""
    rows = np.frombuffer(affine).reshape(3, 4)
    axes = rows[:, :3]
    lengths = np.linalg.norm(axes, axis=0)
    inverse = np.linalg.inv(axes / lengths) / lengths[:, None]
    return marching.Placing(
        tuple(float(a) for a in rows.ravel()),
        tuple(float(a) for a in inverse.T.ravel()),
        operator,
        bool(np.linalg.det(axes / lengths) < 0),
    )
