from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.ndimage import distance_transform_cdt

from volviz.fields import bricks as brick_module
from volviz.fields.bricks import MOST_BRICKS, bricks, chessboard_distance, occupied, side_for
from volviz.fields.encode import encode
from volviz.fields.statistics import statistics
from volviz.model.frame import ColorTable
from volviz.model.transfer import TransferFunction
from volviz.model.volume import Volume


@pytest.mark.parametrize("shape", [(9, 8, 13), (1, 1, 1), (4, 5, 1), (17, 3, 4)])
@pytest.mark.parametrize("masked", [False, True])
def test_ranges_by_brute_force(rng, shape, masked):
    data = rng.random(shape, dtype=np.float32)
    if masked:
        data[rng.random(shape) < 0.7] = np.nan
    volume = Volume.from_array(data)
    voxels = encode(volume, statistics(volume))
    found = bricks(voxels)
    for index in np.ndindex(found.low.shape):
        box = tuple(slice(4 * i, 4 * i + 5) for i in index)
        values = data[box][np.isfinite(data[box])]
        if len(values) == 0:
            assert found.low[index] > found.high[index]
        else:
            assert found.low[index] * voxels.scale + voxels.offset == pytest.approx(values.min())
            assert found.high[index] * voxels.scale + voxels.offset == pytest.approx(values.max())


@given(st.integers(0, 2**32 - 1), st.floats(0.001, 0.3), st.tuples(*[st.integers(1, 9)] * 3))
def test_distance_is_scipys(seed, part, shape):
    shown = np.random.default_rng(seed).random(shape) < part
    distance = chessboard_distance(shown, far=31)
    if shown.any():
        assert np.array_equal(distance, distance_transform_cdt(~shown, metric="chessboard"))
    else:
        assert (distance == 31).all()


@pytest.mark.parametrize("dtype", [np.uint8, np.int16, np.uint16, np.float32, np.int32])
def test_no_visible_value_is_in_an_empty_brick(rng, dtype):
    data = (np.linspace(0, 1, 24)[:, None, None] ** 2 * rng.random((24, 12, 12)) ** 4 * 200).astype(
        dtype
    )
    volume = Volume.from_array(data)
    voxels = encode(volume, statistics(volume))
    found = bricks(voxels)
    transfer = TransferFunction(
        ((0, 1, 1, 1),), ((20, 0), (30, 0.5), (40, 0), (150, 0), (180, 1)), 1.0
    )
    entries = transfer.table(transfer.table_size(integers=dtype != np.float32))
    shown = occupied(found, voxels, ColorTable(entries, *transfer.domain, 1.0))
    for index in np.ndindex(shown.shape):
        box = data[tuple(slice(4 * i, 4 * i + 5) for i in index)].astype(float)
        between = np.linspace(box.min(), box.max(), 500)
        if transfer.opacity_at(between).max() > 1e-3:
            assert shown[index]
    assert 0 < shown.mean() < 1


@pytest.mark.parametrize("dtype", [np.uint8, np.int16, np.float32])
def test_runs_and_running_count_agree(rng, dtype, monkeypatch):
    data = (rng.random((30, 29, 28)) ** 3 * 220).astype(dtype)
    volume = Volume.from_array(data)
    voxels = encode(volume, statistics(volume))
    found = bricks(voxels)
    for seed in range(12):
        places = np.sort(np.random.default_rng(seed).uniform(0, 220, 6))
        opacities = tuple((float(v), float(i % 2)) for i, v in enumerate(places))
        opacities += ((float(places[-1]), 0.0),)
        transfer = TransferFunction(((0, 1, 1, 1),), opacities, 1.0)
        table = ColorTable(transfer.table(512), *transfer.domain, 1.0)
        monkeypatch.setattr(brick_module, "MOST_RUNS", 16)
        by_runs = occupied(found, voxels, table)
        monkeypatch.setattr(brick_module, "MOST_RUNS", -1)
        by_count = occupied(found, voxels, table)
        assert not (by_count & ~by_runs).any()
        assert (by_runs & ~by_count).mean() < 0.02  # rounded outwards
        assert by_count.mean() > 0


@pytest.mark.parametrize("side", [4, 8, 16])
def test_larger_bricks_are_those_of_brute_force(rng, side):
    data = rng.random((37, 18, 25), dtype=np.float32)
    volume = Volume.from_array(data)
    found = bricks(encode(volume, statistics(volume)), side)
    for index in np.ndindex(found.low.shape):
        box = tuple(slice(side * i, side * (i + 1) + 1) for i in index)
        assert (found.low[index], found.high[index]) == (data[box].min(), data[box].max())


def test_there_are_never_too_many_bricks():
    assert side_for((512, 512, 512)) == 4
    for dims in ((513, 512, 512), (2048, 2048, 2048), (1, 1, 1 << 26), (1, 1, 1)):
        side = side_for(dims)
        assert np.prod([-(-n // side) for n in dims]) <= MOST_BRICKS
