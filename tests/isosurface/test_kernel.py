"""How kernels are run: ranges, threads, thresholds, warming up, memory."""

from __future__ import annotations

import threading
import tracemalloc

import numpy as np
import pytest

from tests.isosurface.shapes import sphere
from volviz.errors import Cancelled
from volviz.isosurface import extract_surface, kernel
from volviz.isosurface.extractors.marching_cubes import extract
from volviz.isosurface.warm import warm
from volviz.model.volume import Volume
from volviz.progress import Progress, silent


@pytest.mark.parametrize("layers", [0, 1, 2, 7, 100])
def test_ranges_cover_all_layers_in_order(layers):
    ranges = kernel.in_slabs(lambda a, b: (a, b), layers, 1 << 18, silent(), "")
    assert [z for a, b in ranges for z in range(a, b)] == list(range(layers))


def test_an_error_in_a_range_is_raised():
    def task(a, b):
        raise ValueError("here")

    with pytest.raises(ValueError, match="here"):
        kernel.in_slabs(task, 9, 1 << 20, silent(), "")


def test_a_cancel_does_not_wait_for_a_long_range():
    """Compilation is such a range: it goes on behind, the caller is free."""
    release = threading.Event()
    progress = Progress()
    threading.Timer(0.05, progress.cancel).start()
    with pytest.raises(Cancelled):
        kernel.in_slabs(lambda a, b: release.wait(20), 1, 1, progress, "")
    release.set()


def test_threshold_decides_as_the_isovalue_does(rng):
    for dtype in (np.uint8, np.int16, np.int32, np.float32, np.float64):
        values = rng.normal(0, 40, 200).astype(dtype)
        for level in (*rng.normal(0, 40, 50), *values[:20].tolist(), 0.1, -0.1):
            limit = kernel.threshold(np.dtype(dtype), float(level))
            assert np.array_equal(values >= limit, values.astype(np.float64) >= level)
    assert kernel.threshold(np.dtype(np.uint8), 256) is None
    assert kernel.threshold(np.dtype(np.float32), 1e39) is None
    assert kernel.threshold(np.dtype(np.int16), -1e9) == -32768
    assert kernel.threshold(np.dtype(np.uint8), 255) == 255
    assert kernel.threshold(np.dtype(np.uint8), 254.5) == 255


def test_a_threshold_that_the_dtype_rounds_down_is_the_next_value_up():
    """Just above a sample, that sample is outside, though the isovalue rounds to it."""
    for sample in np.array([0.1, -0.1, 300.0, 1e-30], np.float32):
        level = np.nextafter(float(sample), np.inf)
        limit = kernel.threshold(np.dtype(np.float32), level)
        assert np.float32(level) == sample
        assert limit == np.nextafter(sample, np.float32(np.inf))
        assert (
            kernel.threshold(np.dtype(np.float32), np.nextafter(float(sample), -np.inf)) == sample
        )


def test_bits_are_counted():
    import numba

    @numba.njit
    def both(word):
        return kernel.popcount(word), kernel.lowest_bit(word)

    for word in (1, 2, 0x8000000000000000, 0xFFFFFFFFFFFFFFFF, 0x10F0):
        assert both(np.uint64(word)) == (word.bit_count(), (word & -word).bit_length() - 1)


def test_warm_reports_and_can_be_cancelled():
    seen = []
    warm(np.float32, Progress(lambda part, text: seen.append(text)))
    assert any("compiling" in text for text in seen)
    progress = Progress()
    progress.cancel()
    with pytest.raises(Cancelled):
        warm(np.float32, progress)


def test_memory_stays_below_a_fraction_of_the_volume_and_three_meshes():
    data = sphere(96).data
    volume = Volume.from_array(data)
    extract_surface(volume, 0.0)  # compiled
    tracemalloc.start()
    mesh = extract(volume, 0.0)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 3 * mesh.nbytes
