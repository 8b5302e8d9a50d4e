"""Levels on histograms whose parts are known."""

from __future__ import annotations

import numpy as np
import pytest

from volviz.classify.levels import extent, levels, otsu
from volviz.classify.texture import coverage_level, roughness
from volviz.fields.statistics import statistics
from volviz.model.volume import Volume


def test_otsu_divides_two_normal_curves() -> None:
    bins = np.arange(200)
    counts = np.exp(-((bins - 50) ** 2) / 200) + np.exp(-((bins - 150) ** 2) / 200)
    assert otsu(counts) == pytest.approx(100, abs=2)


@pytest.mark.parametrize("dtype", [np.uint8, np.int16, np.int32, np.float32, np.float64])
def test_background_and_contents(rng: np.random.Generator, dtype: type) -> None:
    array = np.concatenate([np.abs(rng.normal(0, 3, 30000)), rng.normal(150, 15, 19000), [200] * 8])
    volume = Volume.from_array(array.astype(dtype).reshape(8, 1, -1))
    at = levels(statistics(volume))
    assert 2 < at.background < 30
    assert 40 < at.threshold < 130
    assert at.tissue == pytest.approx(150, abs=10)
    assert 175 < at.high < 200
    assert at.share == pytest.approx(19 / 49, abs=0.02)
    assert at.empty == pytest.approx(30 / 49, abs=0.03)
    assert at.at(0) == at.background
    assert at.at(1) == at.high
    assert at.bimodality > 0.9


def test_no_background(rng: np.random.Generator) -> None:
    volume = Volume.from_array(rng.normal(120, 20, (30, 30, 30)))
    at = levels(statistics(volume))
    assert at.empty == 0
    assert at.bimodality == pytest.approx(0.64, abs=0.03)


@pytest.mark.parametrize(
    "array",
    [
        np.zeros((2, 2, 2)),
        np.full((2, 2, 2), np.nan),
        np.array([0, 5e-324] * 4).reshape(2, 2, 2),
        np.array([-1.7e308, 1.7e308] * 4).reshape(2, 2, 2),
        np.full((1, 1, 1), 3, np.uint8),
        np.array([0, 1] * 4, np.uint8).reshape(2, 2, 2),
    ],
)
def test_always_in_order(array: np.ndarray) -> None:
    at = levels(statistics(Volume.from_array(array)))
    assert at.low <= at.background <= at.threshold <= at.high
    assert at.low < at.high
    assert np.isfinite([at.at(0), at.at(0.5), at.at(1), at.tissue, at.share, at.bimodality]).all()


def test_extent() -> None:
    cube = Volume.from_array(np.zeros((10, 10, 10)), spacing=(2, 2, 2))
    assert extent(cube) == pytest.approx(20)
    flat = Volume.from_array(np.zeros((1, 100, 100)))
    assert extent(flat) == pytest.approx(4)


def test_roughness_tells_noise_from_waves(rng: np.random.Generator) -> None:
    x = np.linspace(0, 3, 40)
    wave = np.sin(x)[:, None, None] * np.sin(x)[:, None] * np.sin(x)
    assert roughness(Volume.from_array(wave), 0.0) < 0.1
    noise = Volume.from_array(rng.normal(size=(40, 40, 40)))
    assert roughness(noise, -10.0) == pytest.approx(np.sqrt(3), rel=0.05)
    assert roughness(Volume.from_array(np.zeros((3, 3, 3))), -1.0) == np.inf


def test_coverage_is_of_rays() -> None:
    array = np.zeros((10, 10, 10), np.float32)
    array[2:8, 2:8, 2:8] = 5
    array[0, 0, 0] = np.nan
    volume = Volume.from_array(array)
    assert coverage_level(volume, 0.3) == 5
    assert coverage_level(volume, 0.4) == 0
    nothing = Volume.from_array(np.full((2, 2, 2), np.nan))
    assert coverage_level(nothing, 0.5) == -np.inf
