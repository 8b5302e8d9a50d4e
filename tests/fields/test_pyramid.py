"""Coarser levels stand where they should and hold the means of what they stand for."""

from __future__ import annotations

import numpy as np
import pytest

from tests.isosurface.shapes import SHEARED
from volviz.fields.pyramid import depth, halved, level_of
from volviz.model.volume import Volume


def world(volume):
    """float64[z, y, x, 3]: where the samples are."""
    z, y, x = np.indices(volume.data.shape)
    return np.stack([x, y, z], axis=-1) @ volume.affine[:3, :3].T + volume.affine[:3, 3]


@pytest.mark.parametrize("shape", [(8, 8, 8), (9, 6, 7), (3, 5, 4), (2, 9, 1)])
def test_a_linear_field_is_the_same_field_on_every_level(shape):
    plain = Volume.from_array(np.zeros(shape, np.float32), affine=SHEARED)
    field = world(plain) @ np.array([3.0, -2.0, 0.7]) + 11
    volume = Volume.from_array(field.astype(np.float64), affine=SHEARED)
    for level in range(1, 4):
        coarse = level_of(volume, level)
        assert coarse.data == pytest.approx(world(coarse) @ np.array([3.0, -2.0, 0.7]) + 11)


def test_samples_are_means_of_eight():
    data = np.random.default_rng(1).integers(-900, 2000, (6, 8, 10)).astype(np.int16)
    coarse = halved(Volume.from_array(data)).data
    for z, y, x in np.ndindex(coarse.shape):
        block = data[2 * z : 2 * z + 2, 2 * y : 2 * y + 2, 2 * x : 2 * x + 2]
        assert coarse[z, y, x] == np.float32(block.mean(dtype=np.float64))


def test_what_is_not_valid_does_not_count():
    data = np.arange(64, dtype=np.float32).reshape(4, 4, 4)
    data[0, 0, 0] = np.nan
    data[2:, 2:, 2:] = -5
    coarse = halved(Volume.from_array(data, padding=-5)).data
    assert coarse[0, 0, 0] == pytest.approx(np.nanmean(data[:2, :2, :2]))
    assert np.isnan(coarse[1, 1, 1])
    assert np.isfinite(coarse).sum() == 7


def test_the_largest_numbers_do_not_overflow():
    top = float(np.finfo(np.float64).max)
    assert (halved(Volume.from_array(np.full((4, 4, 4), top))).data == top).all()


def test_levels_end_where_a_cell_is_left():
    volume = Volume.from_array(np.zeros((40, 9, 2), np.uint8))
    assert depth(volume) == 5
    assert level_of(volume, 8) is level_of(volume, 5)
    assert level_of(volume, 8).data.shape == (2, 2, 2)
    assert level_of(volume, 0) is volume
    assert depth(Volume.from_array(np.zeros((1, 1, 1), np.uint8))) == 0
