"""A head as computed tomography shows it, made by code: known anatomy, known Hounsfield units.

The world is LPS millimetres with the origin between the ear canals and the Frankfurt plane at
z = 0. The anatomy never changes; the noise has a seed. Three acquisitions of the same head:

- ``ct-head``: 192 × 224 × 256 samples of 1 mm.
- ``ct-head-anisotropic``: 0.7 × 0.7 mm in plane, slices 2.5 mm thick.
- ``ct-head-oblique``: sampled on a grid that is turned about all three axes, 1.1 mm.

The scanner: borders are blended over 1.9 samples (partial volume), then a Gaussian point spread
of 0.75 samples and noise of 10 HU that the point spread has coloured.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from volviz.model.volume import Dims, Volume, affine_of
from volviz.progress import Progress, silent
from volviz.samples.closed_form import Field, interpolated
from volviz.samples.head.canvas import MATERIALS
from volviz.samples.head.model import paint_head
from volviz.samples.noise import blur, gaussian_taps
from volviz.samples.shapes import Array, Grid, rotation_of

__all__ = [
    "MATERIALS",
    "anisotropic",
    "field_anisotropic",
    "field_oblique",
    "field_upright",
    "head",
    "oblique",
    "truth_anisotropic",
    "truth_oblique",
    "truth_upright",
]

Slabs = Iterator[tuple[slice, Array, NDArray[np.uint8]]]
Affine = NDArray[np.float64]
Frame = tuple[Affine, Dims]

CENTRE = np.array([0.0, -15.0, 0.0])
EXTENT = np.array([192.0, 224.0, 256.0])
"""Middle and size of the field of view, mm along x, y, z."""

EDGE, SPREAD, NOISE = 1.9, 0.75, 10.0
THICK_SLICES = np.array([0.7, 0.7, 2.5])
SUBSLICES = 2
TURN = (12.0, -9.0, 17.0)
OBLIQUE_STEP, OBLIQUE_EXTENT = 1.1, np.array([211.2, 246.4, 272.8])


def head(size: int | None, seed: int, progress: Progress) -> Volume:
    """int16[z, y, x] in HU, upright; `size` samples along z (256, 1 mm)."""
    affine, dims = _upright(size)
    return _volume(_scan(_upright_slabs(affine, dims), dims, seed, progress), affine)


def anisotropic(size: int | None, seed: int, progress: Progress) -> Volume:
    """int16[z, y, x] in HU, thick slices; `size` samples along y (320, 0.7 mm)."""
    affine, dims = _thick(size)
    slabs = _thick_slabs(affine, dims)
    return _volume(_scan(slabs, dims, seed, progress, through_plane=False), affine)


def oblique(size: int | None, seed: int, progress: Progress) -> Volume:
    """int16[z, y, x] in HU on a turned grid; `size` samples along its z (248, 1.1 mm)."""
    affine, dims = _turned(size)
    slabs = _resampled(affine, dims, size, progress.part(0, 0.6))
    return _volume(_scan(slabs, dims, seed, progress.part(0.6, 1)), affine)


def field_upright(volume: Volume) -> Field:
    """HU before blur and noise, trilinear between the samples of `head`."""
    return _still(_upright_slabs(volume.affine, volume.dims), volume)


def field_anisotropic(volume: Volume) -> Field:
    """HU before blur and noise, trilinear between the samples of `anisotropic`."""
    return _still(_thick_slabs(volume.affine, volume.dims), volume)


def field_oblique(volume: Volume) -> Field:
    """HU before blur and noise, trilinear between the samples of `oblique`."""
    size = None if volume.dims == _turned(None)[1] else max(volume.dims)
    return _still(_resampled(volume.affine, volume.dims, size, silent()), volume)


def _still(slabs: Slabs, volume: Volume) -> Field:
    values = np.empty(volume.data.shape, np.float32)
    for where, painted, _ in slabs:
        values[where] = painted
    return interpolated(Volume.from_array(values, affine=volume.affine))


def _upright_slabs(affine: Affine, dims: Dims) -> Slabs:
    return paint_head(_grid(affine, dims), EDGE * float(affine[0, 0]))


def _thick_slabs(affine: Affine, dims: Dims) -> Slabs:
    fine = affine.copy()
    fine[2, 2] /= SUBSLICES
    fine[2, 3] -= fine[2, 2] * (SUBSLICES - 1) / 2
    grid = _grid(fine, (dims[0], dims[1], dims[2] * SUBSLICES))
    edge = EDGE * float(np.prod(np.diag(fine)[:3])) ** (1 / 3)
    return _averaged(paint_head(grid, edge))


def truth_upright(size: int | None) -> Volume:
    """Materials uint8[z, y, x] at the sample centres of `head`, numbered as in `MATERIALS`."""
    affine, dims = _upright(size)
    return _materials(paint_head(_grid(affine, dims), EDGE * affine[0, 0]), affine, dims)


def truth_anisotropic(size: int | None) -> Volume:
    """Materials at the sample centres of `anisotropic`: of the middle of the thick slice."""
    affine, dims = _thick(size)
    return _materials(paint_head(_grid(affine, dims), EDGE * affine[0, 0]), affine, dims)


def truth_oblique(size: int | None) -> Volume:
    """Materials at the sample centres of `oblique`, each from the nearest upright sample."""
    affine, dims = _turned(size)
    return _materials(_resampled(affine, dims, size, silent()), affine, dims)


def _materials(slabs: Slabs, affine: Affine, dims: Dims) -> Volume:
    """The label volume of painted slabs."""
    labels = np.zeros(dims[::-1], np.uint8)
    for where, _, numbers in slabs:
        labels[where] = numbers
    fields = {f"material {n}": f"{what}, {hu:g} HU" for what, (n, hu) in MATERIALS.items()}
    return Volume.from_array(
        labels,
        affine=affine,
        space="LPS",
        modality="CT",
        kind="labels",
        name="truth",
        fields=fields,
    )


def _upright(size: int | None) -> Frame:
    step = 1.0 if size is None else EXTENT[2] / size
    return _frame(np.full(3, step), EXTENT)


def _thick(size: int | None) -> Frame:
    scale = 1.0 if size is None else EXTENT[1] / (THICK_SLICES[1] * size)
    return _frame(THICK_SLICES * scale, EXTENT)


def _turned(size: int | None) -> Frame:
    step = OBLIQUE_STEP if size is None else OBLIQUE_EXTENT[2] / size
    return _frame(np.full(3, step), OBLIQUE_EXTENT, rotation_of(TURN))


def _frame(
    step: NDArray[np.float64], extent: NDArray[np.float64], turn: NDArray[np.float64] | None = None
) -> Frame:
    """Affine and dims of a grid about the middle of the field of view."""
    dims = np.maximum(np.round(extent / step).astype(int), 1)
    axes = np.eye(3) if turn is None else turn
    origin = CENTRE - axes @ (step * (dims - 1) / 2)
    return affine_of(step.tolist(), origin.tolist(), axes), (
        int(dims[0]),
        int(dims[1]),
        int(dims[2]),
    )


def _grid(affine: Affine, dims: Dims) -> Grid:
    return Grid.of(*(affine[i, 3] + affine[i, i] * np.arange(dims[i]) for i in range(3)))


def _scan(
    slabs: Slabs, dims: Dims, seed: int, progress: Progress, *, through_plane: bool = True
) -> NDArray[np.int16]:
    """Blur and noise, slab by slab, and the result in whole Hounsfield units."""
    taps = gaussian_taps(SPREAD)
    kept = float(np.sqrt(2 * np.sum(taps**2) - taps[0] ** 2)) ** (3 if through_plane else 2)
    rng = np.random.default_rng(seed)
    wet = np.empty(dims[::-1], np.float32)
    for where, values, _ in slabs:
        progress(where.start / dims[2], "painting the head")
        noise = rng.standard_normal(values.shape, dtype=np.float32)
        noise *= np.float32(NOISE / kept)
        noise += values
        wet[where] = blur(blur(noise, taps, 2), taps, 1)
    data = np.empty(wet.shape, np.int16)
    halo = len(taps) - 1 if through_plane else 0
    for start in range(0, len(wet), 16):
        progress(1.0, "blurring")
        low, stop = max(start - halo, 0), min(start + 16, len(wet))
        part = wet[low : stop + halo]
        if through_plane:
            part = blur(part, taps, 0)
        part = np.rint(part[start - low : start - low + stop - start])
        data[start:stop] = np.clip(part, -1024, 32767)
    return data


def _averaged(slabs: Slabs) -> Slabs:
    """Slices as thick as their distance: the mean of the slices that were painted for each."""
    for where, values, labels in slabs:
        shape = (-1, SUBSLICES, *values.shape[1:])
        thick = slice(where.start // SUBSLICES, where.stop // SUBSLICES)
        yield thick, values.reshape(shape).mean(axis=1), labels[::SUBSLICES]


def _resampled(affine: Affine, dims: Dims, size: int | None, progress: Progress) -> Slabs:
    """The upright head on another grid: values trilinear, materials from the nearest sample."""
    upright, _ = _upright(None if size is None else round(size * EXTENT[2] / OBLIQUE_EXTENT[2]))
    _, source_dims = _frame(np.diag(upright)[:3], EXTENT)
    values = np.empty(source_dims[::-1], np.float32)
    labels = np.empty(source_dims[::-1], np.uint8)
    for where, v, m in paint_head(_grid(upright, source_dims), EDGE * upright[0, 0]):
        progress(where.start / source_dims[2], "painting the head")
        values[where], labels[where] = v, m
    index = np.linalg.inv(upright) @ affine
    x, y = np.arange(dims[0])[None, None, :], np.arange(dims[1])[None, :, None]
    for start in range(0, dims[2], 8):
        z = np.arange(start, min(start + 8, dims[2]))[:, None, None]
        place = [
            (index[i, 0] * x + index[i, 1] * y + index[i, 2] * z + index[i, 3]).astype(np.float32)
            for i in range(3)
        ]
        yield slice(start, start + len(z)), *_trilinear(values, labels, place)


def _trilinear(
    values: Array, labels: NDArray[np.uint8], place: list[Array]
) -> tuple[Array, NDArray[np.uint8]]:
    """Values and labels at index positions (x, y, z); air beyond the field."""
    nz, ny, nx = values.shape
    counts = (nx, ny, nz)
    outside = np.zeros(place[0].shape, bool)
    cells, weights = [], []
    for p, n in zip(place, counts, strict=True):
        outside |= (p < -0.5) | (p > n - 0.5)
        p = np.clip(p, 0, n - 1)
        cell = np.minimum(p.astype(np.int32), max(n - 2, 0))
        cells.append(cell)
        weights.append(p - cell)
    first = (cells[2] * ny + cells[1]) * nx + cells[0]
    flat, result = values.ravel(), np.zeros(first.shape, np.float32)
    steps = (1 if nx > 1 else 0, nx if ny > 1 else 0, nx * ny if nz > 1 else 0)
    for corner in range(8):
        far = [corner >> axis & 1 for axis in range(3)]
        x, y, z = (w if f else 1 - w for w, f in zip(weights, far, strict=True))
        offset = sum(step for step, f in zip(steps, far, strict=True) if f)
        result += x * y * z * flat[first + offset]
    nearest = first + sum(
        s * (w >= 0.5).astype(np.int32) for s, w in zip(steps, weights, strict=True)
    )
    material = labels.ravel()[nearest]
    result[outside], material[outside] = MATERIALS["air"][1], MATERIALS["air"][0]
    return result, material


def _volume(data: NDArray[np.int16], affine: Affine) -> Volume:
    return Volume.from_array(
        data, affine=affine, space="LPS", modality="CT", value_unit="HU", name="ct-head"
    )
