"""What is dark in bright surroundings is shown; a block with holes, and what is bright, stay."""

from __future__ import annotations

import numpy as np
import pytest

from tests.classify.test_suggest import suggested, visible
from volviz.classify.inverted import bright_ground, mirrored, turned
from volviz.fields.statistics import statistics
from volviz.model.transfer import TransferFunction
from volviz.model.volume import Volume

GRID = np.mgrid[-1:1:32j, -1:1:32j, -1:1:32j]
RADIUS = np.sqrt((GRID**2).sum(axis=0))


def brightfield(dtype: type) -> np.ndarray:
    """Two dark cells before a bright ground with noise, as a microscope sees them."""
    cells = (RADIUS < 0.3) | (np.abs(GRID - 0.5).max(axis=0) < 0.15)
    noise = np.random.default_rng(3).normal(0, 4, RADIUS.shape)
    return (np.where(cells, 60, 200) + noise).astype(dtype)


@pytest.mark.parametrize("dtype", [np.uint8, np.int16, np.float32])
def test_dark_things_before_a_bright_ground(dtype: type) -> None:
    data = brightfield(dtype)
    found, volume = suggested(data), Volume.from_array(data)
    shown = found.transfer.opacity_at(volume.data) > 0.02
    assert not shown[data > 150].any(), "the ground is clear"
    assert shown[data < 80].all()
    assert "bright round about" in found.why


@pytest.mark.parametrize("power", [1, 2])
def test_a_field_that_grows_outwards(power: int) -> None:
    """Distances from a thing: the corners would hide everything."""
    data = (RADIUS**power).astype(np.float32)
    found = suggested(data)
    opacity = found.transfer.opacity_at(data)
    assert opacity[RADIUS < 0.3].min() > 0.3
    assert np.median(opacity[0]) == 0, "nothing hides the view"
    assert opacity[RADIUS > 1.1].max() == 0


def test_signed_distances_from_a_ring() -> None:
    """Its sides are not far from it: no threshold divides them from it."""
    ring = np.abs(np.hypot(GRID[0], GRID[1]) - 0.6) + np.abs(GRID[2]) - 0.2
    opacity = suggested(ring.astype(np.float32)).transfer.opacity_at(ring)
    assert np.median(opacity[:, :, 0]) == 0
    assert opacity[ring < 0].min() > 0.1


@pytest.mark.parametrize(
    "data",
    [
        (GRID[0] * np.exp(-8 * RADIUS**2)).astype(np.float32),
        255 - brightfield(np.uint8),
        (-RADIUS).astype(np.float32),
        np.where(np.random.default_rng(1).random(RADIUS.shape) < 0.06, 10, 200).astype(np.uint8),
        GRID[0].astype(np.float32),
        np.random.default_rng(2).normal(size=RADIUS.shape).astype(np.float32),
    ],
    ids=["dipole", "fluorescence", "peak", "pores", "ramp", "noise"],
)
def test_others_are_as_they_were(data: np.ndarray) -> None:
    volume = Volume.from_array(data)
    assert bright_ground(volume, statistics(volume)) is None
    assert "bright round about" not in suggested(data).why


@pytest.mark.parametrize("dtype", [np.uint8, np.int16, np.float32])
def test_mirrored_statistics_are_those_of_the_mirrored_volume(dtype: type) -> None:
    rng = np.random.default_rng(4)
    data = (rng.gamma(2, 9, (9, 10, 11)) * 8).astype(dtype)
    if dtype == np.float32:
        data.flat[0] = 1e7  # an outlier: the fine histogram has its own ends
    known = statistics(Volume.from_array(data))
    total = known.low + known.high
    other = (total - data.astype(np.float64)).astype(dtype)
    expected, found = statistics(Volume.from_array(other)), mirrored(known)
    assert (found.low, found.high, found.count) == (expected.low, expected.high, expected.count)
    assert found.mean == pytest.approx(expected.mean, rel=1e-4)
    for p in (0.05, 1, 25, 50, 75, 99, 99.95):
        step = known.width if known.fine is None or not 0.1 <= p <= 99.9 else known.fine[2]
        assert found.percentile(p) == pytest.approx(
            expected.percentile(p), abs=2 * step + 2e-6 * total
        )


def test_a_turned_function_gives_mirrored_values_what_it_gave() -> None:
    known = statistics(Volume.from_array(np.arange(27, dtype=np.int16).reshape(3, 3, 3)))
    first = TransferFunction(((2, 0, 0, 0), (20, 1, 0.5, 0)), ((3, 0), (5, 0.2), (24, 1)), 1.0, "x")
    other = turned(first, known)
    values = np.linspace(0, 26, 53)
    np.testing.assert_allclose(other.opacity_at(values), first.opacity_at(26 - values), atol=1e-12)
    np.testing.assert_allclose(other.color_at(values), first.color_at(26 - values), atol=1e-12)


def test_little_of_a_bright_volume_is_seen() -> None:
    data = brightfield(np.uint8)
    assert 0 < visible(suggested(data), Volume.from_array(data)) < 0.1
