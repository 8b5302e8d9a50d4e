"""What comes back from a texel is what was in the voxel."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from volviz.fields.encode import encode, texel_bytes
from volviz.fields.statistics import statistics
from volviz.model.frame import Voxels
from volviz.model.volume import Volume


def decoded(voxels: Voxels) -> NDArray[np.float64]:
    """Values as a shader reads them, in float64: normalised integers, raw floats."""
    texel = voxels.array.astype(np.float64)
    if voxels.array.dtype.kind == "u":
        texel /= np.iinfo(voxels.array.dtype).max
    if voxels.masked:
        with np.errstate(invalid="ignore"):
            texel = texel[..., 0] / texel[..., 1]
    return texel * voxels.scale + voxels.offset


def encoded(array: NDArray[np.generic], *, promote8: bool = True, **info: object) -> Voxels:
    volume = Volume.from_array(array, **info)
    return encode(volume, statistics(volume), promote8=promote8)


@pytest.mark.parametrize("promote8", [True, False])
@pytest.mark.parametrize("dtype", ["i1", "u1", "i2", "u2"])
def test_every_small_integer(dtype: str, promote8: bool) -> None:
    limits = np.iinfo(dtype)
    values = np.arange(limits.min, limits.max + 1, dtype=np.int64)
    array = values.astype(dtype).reshape(1, 16, -1)
    voxels = encoded(array, promote8=promote8)
    assert voxels.array.dtype == (np.uint8 if limits.bits == 8 and not promote8 else np.uint16)
    np.testing.assert_allclose(decoded(voxels).ravel(), values, atol=1e-9)


def test_uint16_and_float32_are_not_copied() -> None:
    for dtype in (np.uint16, np.float32):
        array = np.arange(24, dtype=dtype).reshape(2, 3, 4)
        assert np.shares_memory(encoded(array).array, array)


@pytest.mark.parametrize("dtype", ["i4", "u4", "i8", "u8"])
@pytest.mark.parametrize("base", [0, 1_000_000_000])
def test_wide_integers_in_a_narrow_range(dtype: str, base: int) -> None:
    array = (base + np.arange(65536)).astype(dtype).reshape(1, 256, 256)
    voxels = encoded(array)
    assert voxels.array.dtype == np.uint16
    np.testing.assert_allclose(decoded(voxels), array, atol=1e-6)


def test_differences_beyond_53_bits() -> None:
    array = ((1 << 60) + np.arange(8)).reshape(2, 2, 2)
    voxels = encoded(array)
    np.testing.assert_array_equal(np.diff(voxels.array.ravel().astype(int)), 1)


@pytest.mark.parametrize("dtype", ["i4", "u8", "f8"])
def test_wide_range_is_float32(rng: np.random.Generator, dtype: str) -> None:
    array = rng.integers(0, 1 << 22, (4, 5, 6)).astype(dtype)
    voxels = encoded(array)
    assert voxels.array.dtype == np.float32
    assert voxels.note is None
    np.testing.assert_array_equal(decoded(voxels), array)


def test_small_differences_of_large_floats_survive() -> None:
    array = 1e9 + np.linspace(0, 1, 64).reshape(4, 4, 4)
    voxels = encoded(array)
    np.testing.assert_allclose(decoded(voxels), array, atol=1e-7, rtol=0)
    assert voxels.note is None


def test_numbers_beyond_float32() -> None:
    for array in (np.linspace(-1e300, 1e300, 8), np.linspace(0, 1e-200, 8)):
        voxels = encoded(array.reshape(2, 2, 2))
        assert np.isfinite(voxels.array).all()
        np.testing.assert_allclose(decoded(voxels).ravel(), array, rtol=1e-6)


@pytest.mark.parametrize("power", [-44, -38, -31, -28, 0, 28, 31, 38])
def test_float32_near_its_ends_comes_in_a_comfortable_size(power: int) -> None:
    """Uniforms are float32 too: what turns a texel into an index must be one, for any texel."""
    array = np.linspace(-0.3, 1, 64).reshape(4, 4, 4) * 10.0**power
    array = array.astype(np.float32)
    voxels = encoded(array)
    np.testing.assert_allclose(decoded(voxels), array.astype(np.float64), rtol=1e-6)
    assert 1e-18 < np.abs(voxels.array).max() < 1e18


def test_what_float32_cannot_hold_is_said() -> None:
    voxels = encoded(np.array([0, 1, 1 << 30, 1 << 31], np.int64).reshape(1, 2, 2))
    assert voxels.note is not None
    assert "128" in voxels.note
    near = encoded(np.array([1e9, np.nextafter(1e9, 2e9)]).reshape(1, 1, 2))
    assert near.note is not None


def test_masked_floats() -> None:
    array = np.array([1, np.nan, 3, np.inf, -np.inf, 6, -999, 8], np.float32).reshape(2, 2, 2)
    voxels = encoded(array, padding=-999)
    assert voxels.masked
    assert np.isfinite(voxels.array).all()
    np.testing.assert_array_equal(voxels.array[..., 1].ravel(), [1, 0, 1, 0, 0, 1, 0, 1])
    np.testing.assert_array_equal(voxels.array[..., 0].ravel(), [1, 0, 3, 0, 0, 6, 0, 8])


@pytest.mark.parametrize("dtype", ["i1", "i2", "i4"])
def test_masked_integers(dtype: str) -> None:
    array = np.array([-100, 5, 100, 7, -100, 9, 10, 11], dtype).reshape(2, 2, 2)
    voxels = encoded(array, padding=-100)
    assert voxels.dims == (2, 2, 2)
    assert voxels.nbytes == 8 * 2 * 2
    got = decoded(voxels)
    np.testing.assert_array_equal(np.isnan(got), array == -100)
    np.testing.assert_allclose(got[array != -100], array[array != -100], atol=1e-9)
    assert (voxels.array[..., 0][array == -100] == 0).all()


def test_interpolation_with_the_mask_ignores_what_does_not_count() -> None:
    """Midway between 50 and padding, r/g gives 50, not something in between."""
    voxels = encoded(np.array([[[50, -1000]]], np.int16), padding=-1000)
    r, g = voxels.array.astype(np.float64)[0, 0].mean(axis=0)
    assert r / g * voxels.scale + voxels.offset == pytest.approx(50)


def test_nothing_counts() -> None:
    voxels = encoded(np.full((2, 2, 2), np.nan))
    assert not voxels.array.any()


@pytest.mark.parametrize("promote8", [True, False])
@pytest.mark.parametrize("dtype", ["u1", "i1", "u2", "i2", "u4", "i8", "f4", "f8"])
@pytest.mark.parametrize(("high", "hole"), [(100, False), (100, True), (120_000, False)])
def test_bytes_of_a_texel_are_known_before(
    dtype: str, promote8: bool, high: int, hole: bool
) -> None:
    data = np.linspace(0, high, 60).reshape(3, 4, 5).astype(dtype)
    volume = Volume.from_array(data, padding=0.0 if hole else None)
    facts = statistics(volume)
    told = texel_bytes(volume.data.dtype, facts, promote8=promote8)
    assert told * data.size == encode(volume, facts, promote8=promote8).nbytes


def test_integers_beyond_the_table_are_told() -> None:
    data = np.full((3, 4, 5), 2**64 - 1, np.uint64) - np.arange(60, dtype=np.uint64).reshape(
        3, 4, 5
    )
    volume = Volume.from_array(data)
    assert "2^53" in (encode(volume, statistics(volume)).note or "")
