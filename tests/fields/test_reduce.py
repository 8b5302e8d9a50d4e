"""Reduction against block means written out, and against the world positions of samples."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from numpy.typing import NDArray

from volviz.errors import Cancelled, UsageError
from volviz.fields.reduce import reduced, reduction
from volviz.model.volume import Volume
from volviz.progress import Progress


def block_means(array: NDArray[np.generic], factors: tuple[int, int, int]) -> NDArray[np.float64]:
    fx, fy, fz = factors
    starts = [range(0, n, f) for n, f in zip(array.shape, (fz, fy, fx), strict=True)]
    out = np.empty([len(s) for s in starts])
    for k, j, i in itertools.product(*(range(len(s)) for s in starts)):
        block = array[k * fz : (k + 1) * fz, j * fy : (j + 1) * fy, i * fx : (i + 1) * fx]
        out[k, j, i] = np.nanmean(block.astype(np.float64))
    return out


@pytest.mark.parametrize("dtype", ["u1", "i2", "u2", "i4", "u8", "f4", "f8"])
@pytest.mark.parametrize("factors", [(2, 2, 2), (1, 3, 2), (4, 1, 1), (20, 20, 20)])
def test_means(rng: np.random.Generator, dtype: str, factors: tuple[int, int, int]) -> None:
    low = 0 if dtype[0] == "u" else -120
    array = rng.integers(low, 120, (5, 7, 9)).astype(dtype)
    small = reduced(Volume.from_array(array), factors)
    assert small.data.dtype == array.dtype
    truth = block_means(array, factors)
    close = 1e-5 if dtype[0] == "f" else 0.5 + 1e-9
    np.testing.assert_allclose(small.data, truth, atol=close)


def test_large_numbers_do_not_overflow() -> None:
    for dtype in (np.int64, np.uint64):
        limits = np.iinfo(dtype)
        full = Volume.from_array(np.full((2, 2, 2), limits.max, dtype))
        assert reduced(full, (2, 2, 2)).data[0, 0, 0] == limits.max
        ends = np.array([limits.min, limits.max] * 4, dtype).reshape(2, 2, 2)
        middle = float(reduced(Volume.from_array(ends), (2, 2, 2)).data[0, 0, 0])
        assert middle == pytest.approx((float(limits.min) + float(limits.max)) / 2, abs=2**12)
    huge = Volume.from_array(np.full((2, 2, 2), 1.5e308))
    assert reduced(huge, (2, 2, 2)).data[0, 0, 0] == pytest.approx(1.5e308)


def test_what_does_not_count_is_left_out() -> None:
    array = np.array([1, np.nan, np.inf, 3, 5, 7, -9, 9], np.float32).reshape(2, 2, 2)
    assert reduced(Volume.from_array(array, padding=-9), (2, 2, 2)).data[0, 0, 0] == 5
    empty = reduced(Volume.from_array(np.full((2, 2, 4), np.nan)), (2, 2, 2))
    assert np.isnan(empty.data).all()
    padded = np.full((1, 1, 4), -2000, np.int16)
    padded[..., 3] = 10
    small = reduced(Volume.from_array(padded, padding=-2000), (2, 1, 1))
    np.testing.assert_array_equal(small.data.ravel(), [-2000, 10])


def test_world_positions_stay() -> None:
    """The centre of a block of samples is where the new sample says it is."""
    affine = np.eye(4)
    affine[:3] = [[0.5, 0.1, 0, 7], [-0.1, 0.6, 0.2, -3], [0, 0.3, 2, 11]]
    array = np.zeros((4, 6, 8), np.float32)
    small = reduced(Volume.from_array(array, affine=affine), (4, 3, 2))
    for index in itertools.product(range(2), range(2), range(2)):
        block = [np.arange(i * f, (i + 1) * f) for i, f in zip(index, (4, 3, 2), strict=True)]
        centre = affine @ [*(b.mean() for b in block), 1]
        np.testing.assert_allclose(small.affine @ [*index, 1], centre, atol=1e-12)
    assert small.info.warnings[-1].startswith("shown at 1/4 × 1/3 × 1/2 resolution")


def test_labels_are_not_mixed() -> None:
    array = np.arange(125, dtype=np.uint16).reshape(5, 5, 5)
    small = reduced(Volume.from_array(array, kind="labels"), (3, 3, 3))
    assert small.data[0, 0, 0] == array[1, 1, 1]
    assert small.data[1, 1, 1] == array[3, 3, 3]
    assert np.isin(small.data, array).all()


@pytest.mark.parametrize(
    ("dims", "max_dim", "max_bytes", "expected"),
    [
        ((100, 100, 100), 2048, 10**9, (1, 1, 1)),
        ((5000, 100, 100), 2048, 10**9, (3, 1, 1)),
        ((512, 512, 512), 2048, 2 * 512**3 // 2, (2, 1, 1)),
        ((512, 512, 512), 2048, 2 * 256**3, (2, 2, 2)),
        ((4096, 4096, 10), 2048, 10**9, (2, 2, 1)),
        ((4, 4, 4), 2048, 1, (4, 4, 4)),
    ],
)
def test_factors(
    dims: tuple[int, int, int], max_dim: int, max_bytes: int, expected: tuple[int, int, int]
) -> None:
    assert reduction(dims, 2, max_dim, max_bytes) == expected


def test_no_factor_is_no_change_and_zero_is_wrong() -> None:
    volume = Volume.from_array(np.zeros((2, 2, 2)))
    assert reduced(volume, (1, 1, 1)) is volume
    with pytest.raises(UsageError):
        reduced(volume, (0, 1, 1))


def test_cancel() -> None:
    stopped = Progress()
    stopped.cancel()
    with pytest.raises(Cancelled):
        reduced(Volume.from_array(np.zeros((4, 4, 4))), (2, 2, 2), stopped)
