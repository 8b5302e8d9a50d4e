"""Statistics against numpy on the whole array."""

from __future__ import annotations

import numpy as np
import pytest

from volviz.errors import Cancelled
from volviz.fields.statistics import statistics, valid_mask
from volviz.model.volume import Volume
from volviz.progress import Progress

DTYPES = ["i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8", "f4", "f8"]


@pytest.mark.parametrize("dtype", DTYPES)
def test_agrees_with_numpy(rng: np.random.Generator, dtype: str) -> None:
    low = 0 if dtype[0] == "u" else -100
    array = rng.integers(low, 100, (9, 11, 70)).astype(dtype)
    stats = statistics(Volume.from_array(array))
    assert (stats.low, stats.high, stats.count) == (array.min(), array.max(), array.size)
    assert stats.mean == pytest.approx(array.mean(dtype=np.float64), abs=1e-9)
    assert stats.std == pytest.approx(array.std(dtype=np.float64), rel=1e-9)
    assert stats.histogram.sum() == array.size
    assert not stats.constant
    for p in (0, 1, 25, 50, 99, 100):
        truth = np.percentile(array.astype(np.float64), p, method="inverted_cdf")
        assert stats.percentile(p) == pytest.approx(truth, abs=stats.width)


@pytest.mark.parametrize("dtype", ["u1", "i2", "u2", "i4", "i8", "u8"])
def test_one_bin_per_integer(rng: np.random.Generator, dtype: str) -> None:
    array = rng.integers(3, 90, (5, 6, 7)).astype(dtype)
    stats = statistics(Volume.from_array(array))
    counts = np.bincount(array.astype(int).ravel())[array.min() :]
    np.testing.assert_array_equal(stats.histogram, counts)
    np.testing.assert_array_equal(stats.centers, np.arange(array.min(), array.max() + 1))


def test_integers_at_the_ends_of_64_bits() -> None:
    ends = np.iinfo(np.int64)
    array = np.array([ends.min, ends.max, 0, 5], dtype=np.int64).reshape(1, 2, 2)
    stats = statistics(Volume.from_array(array))
    assert (stats.low, stats.high, stats.count) == (ends.min, float(ends.max), 4)
    assert stats.histogram.size <= 65536
    assert stats.histogram.sum() == 4
    assert stats.histogram[0] == 1
    assert stats.histogram[-1] == 1


def test_float_bins_hold_their_values(rng: np.random.Generator) -> None:
    array = rng.normal(50, 7, (16, 16, 64)).astype(np.float32)
    stats = statistics(Volume.from_array(array))
    counts, _ = np.histogram(array.astype(np.float64), bins=64, range=(stats.low, stats.high))
    coarse = stats.histogram.reshape(64, -1).sum(axis=1)
    assert np.abs(coarse - counts).max() <= 1


def test_what_does_not_count() -> None:
    array = np.array([1, 2, np.nan, np.inf, -np.inf, -999, 4, np.nan], dtype=np.float32)
    volume = Volume.from_array(array.reshape(2, 2, 2), padding=-999)
    stats = statistics(volume)
    assert (stats.low, stats.high, stats.count) == (1, 4, 3)
    assert (stats.nan_count, stats.inf_count, stats.padding_count) == (2, 2, 1)
    assert stats.mean == pytest.approx(7 / 3)
    mask = valid_mask(volume, stats)
    assert mask is not None
    np.testing.assert_array_equal(mask.ravel(), [1, 1, 0, 0, 0, 0, 1, 0])


@pytest.mark.parametrize("dtype", ["i2", "i4", "f4"])
def test_padding_is_left_out(dtype: str) -> None:
    array = np.full((3, 3, 3), -2000, dtype=dtype)
    array[1] = 40
    array[1, 1, 1] = 60
    volume = Volume.from_array(array, padding=-2000)
    stats = statistics(volume)
    assert (stats.low, stats.high, stats.count, stats.padding_count) == (40, 60, 9, 18)
    mask = valid_mask(volume)
    assert mask is not None
    assert mask.sum() == 9


def test_padding_that_no_voxel_can_hold() -> None:
    volume = Volume.from_array(np.arange(8, dtype=np.uint8).reshape(2, 2, 2), padding=-1)
    assert statistics(volume).padding_count == 0
    assert valid_mask(volume) is None
    assert valid_mask(Volume.from_array(np.zeros((2, 2, 2), np.float32))) is None


@pytest.mark.parametrize("value", [np.nan, np.inf, -5.0])
def test_nothing_left(value: float) -> None:
    stats = statistics(Volume.from_array(np.full((2, 3, 4), value, np.float32), padding=-5))
    assert (stats.low, stats.high, stats.count, stats.constant) == (0, 0, 0, True)
    assert stats.invalid_count == 24
    assert stats.percentile(50) == 0


@pytest.mark.parametrize("dtype", ["u1", "i2", "i4", "f4", "f8"])
def test_constant(dtype: str) -> None:
    stats = statistics(Volume.from_array(np.full((2, 2, 2), 7, dtype)))
    assert stats.constant
    assert (stats.mean, stats.std, stats.percentile(37)) == (7, 0, 7)
    assert stats.width > 0


def test_huge_floats_do_not_overflow() -> None:
    array = np.array([-1.7e308, 1.7e308, 0, 1.0]).reshape(1, 2, 2)
    stats = statistics(Volume.from_array(array))
    assert (stats.low, stats.high) == (-1.7e308, 1.7e308)
    assert stats.histogram.sum() == 4
    assert np.isfinite([stats.mean, stats.std, stats.width]).all()


def test_tiny_floats() -> None:
    array = np.linspace(0, 5e-320, 64).reshape(4, 4, 4)
    stats = statistics(Volume.from_array(array))
    assert stats.histogram.sum() == 64


def test_outliers_do_not_hide_the_rest(rng: np.random.Generator) -> None:
    array = rng.uniform(0, 1, (40, 40, 40)).astype(np.float32)
    array[0, 0, :5] = 1e9
    stats = statistics(Volume.from_array(array))
    assert stats.high == 1e9
    for p in (1, 50, 99):
        assert stats.percentile(p) == pytest.approx(p / 100, abs=0.01)


def test_progress_and_cancel() -> None:
    seen: list[float | None] = []
    volume = Volume.from_array(np.zeros((20, 400, 400), np.float32))
    statistics(volume, Progress(lambda f, m: seen.append(f)))
    assert seen == sorted(seen, key=lambda f: f or 0)
    stopped = Progress()
    stopped.cancel()
    with pytest.raises(Cancelled):
        statistics(volume, stopped)
