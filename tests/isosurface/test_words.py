"""From the ranges of bricks straight to words of samples; and what those words are made with."""

from __future__ import annotations

import subprocess
import sys
import threading
import time

import numpy as np
import pytest

from tests.isosurface.shapes import sphere, volumes
from volviz.errors import Cancelled
from volviz.isosurface import kernel, memory, turns
from volviz.isosurface.cases import cases
from volviz.isosurface.cells import CellRanges
from volviz.isosurface.extractors.marching_cubes import extract
from volviz.isosurface.finders import FINDERS
from volviz.isosurface.plain import AMBIGUOUS, MOST, plain
from volviz.model.volume import Volume
from volviz.progress import Progress, silent

VOLUMES = {name: (volume, levels) for name, volume, levels in volumes()}


def same(one, other):
    return one.skipped == other.skipped and all(
        np.array_equal(getattr(one, k), getattr(other, k)) for k in ("vertices", "normals", "faces")
    )


@pytest.mark.parametrize("ambiguity", ["trilinear", "table15"])
@pytest.mark.parametrize("kind", VOLUMES)
def test_bricks_that_mark_words_give_the_mesh_of_all_cells(kind, ambiguity):
    volume, levels = VOLUMES[kind]
    finder = FINDERS["bricks"].build(CellRanges.of(volume), None)
    for level in levels:
        whole = extract(volume, level, ambiguity=ambiguity)
        assert same(extract(volume, level, rows=finder.rows, ambiguity=ambiguity), whole)


@pytest.mark.parametrize("width", [63, 127, 128, 129, 257, 4097, 4165])
def test_rows_of_any_length_to_their_ends(width, rng):
    """With the surface at the borders too; more than 64 words are more than one part."""
    data = np.full((5, 6, width), -1, np.float32)
    data[2:4, 2:4, : width // 3] = 1
    data[1:, 4:, -3:] = 1
    data[2, 2, width // 2] = 1
    holes = data.copy()
    holes[2, 3, width // 6] = np.nan
    for array in (data, holes, rng.standard_normal(data.shape).astype(np.float32)):
        volume = Volume.from_array(array)
        finder = FINDERS["bricks"].build(CellRanges.of(volume), None)
        whole = extract(volume, 0.25)
        assert len(whole.faces) > 0
        assert same(extract(volume, 0.25, rows=finder.rows), whole)
        assert same(extract(volume, 0.25, finder(0.25)), whole)


@pytest.mark.parametrize("dtype", ["uint8", "int16", "int32", "float32", "float64"])
def test_sixty_four_comparisons_at_once(dtype, rng):
    import numba

    @numba.njit
    def both(samples, at, limit):
        return kernel.at_least(samples, at, limit), kernel.finite(samples, at)

    samples = rng.normal(60, 40, 200).clip(0, 120).astype(dtype)
    if samples.dtype.kind == "f":
        samples[[3, 70, 71, 150]] = np.nan, np.inf, -np.inf, np.nan
    weights = 1 << np.arange(64, dtype=object)
    for at in (0, 7, 70, 136):
        piece = samples[at : at + 64]
        limit = samples.dtype.type(60)
        bits, good = both(samples, np.uint64(at), limit)
        assert bits == weights[piece >= limit].sum()
        assert good == weights[np.isfinite(piece.astype(float))].sum()


def test_rows_of_bytes_are_added(rng):
    import numba

    @numba.njit
    def add(target, source, table, at):
        kernel.add_bytes(target, source, table, at)

    source = rng.integers(0, 1 << 31, 16).astype(np.uint32)
    table, target = rng.integers(0, 256, 64).astype(np.uint8), np.zeros(18, np.uint32)
    add(target, source, table, np.uint64(33))
    assert np.array_equal(target[:16], source + table[33:49])
    assert not target[16:].any()


def test_tables_of_plain_cases_are_those_of_all_cases():
    table, quick = cases(), plain()
    for case in range(256):
        if table.ambiguous[case]:
            assert quick.size[case] == AMBIGUOUS
            continue
        entry = table.entry[case, 0]
        first, last = table.start[entry], table.start[entry + 1]
        assert quick.size[case] == last - first <= MOST
        assert table.center[entry, 0] == 0
        row = quick.rows.reshape(256, 16)[case, : 3 * (last - first)]
        assert np.array_equal(row.reshape(-1, 3), table.triangles[first:last])


@pytest.mark.parametrize("layers", [0, 1, 2, 7, 300])
def test_turns_cover_all_layers_once(layers):
    import numba

    @numba.njit(nogil=True)
    def task(given, most, seen):
        for _ in range(most):
            first, last = turns.take(given)
            if first < 0:
                return
            seen[first:last] += 1

    seen = np.zeros(layers, np.int64)
    turns.in_turns(lambda given, most: task(given, most, seen), layers, 1 << 18, silent(), "")
    assert np.all(seen == 1)


def test_an_error_in_a_turn_is_raised_and_a_cancel_does_not_wait():
    def task(given, most):
        raise ValueError("here")

    with pytest.raises(ValueError, match="here"):
        turns.in_turns(task, 9, 1 << 20, silent(), "")
    release, tasks = threading.Event(), []
    progress = Progress()

    def slow(given, most):
        tasks.append(given)
        if threading.current_thread() is threading.main_thread():
            time.sleep(0.05)  # longer than progress may be silent: one range at a time
            assert most == 1
        else:
            release.wait(20)

    threading.Timer(0.05, progress.cancel).start()
    with pytest.raises(Cancelled):
        turns.in_turns(slow, 99, 1, progress, "")
    assert tasks[0].taken.all()  # no further range is
    release.set()


def test_arrays_of_one_block_do_not_overlap():
    wanted = (((70_000, 3), np.float32), ((0, 3), np.float32), ((500_001,), np.uint32))
    for arrays in (memory.empty(*wanted), memory.Scratch(*wanted).arrays):
        for k, (array, (shape, dtype)) in enumerate(zip(arrays, wanted, strict=True)):
            assert array.shape == shape
            assert array.dtype == dtype
            array[:] = k
        assert [set(np.unique(a).tolist()) for a in arrays] == [{0}, set(), {2}]


def test_scratch_is_used_again_only_once_it_is_given_back():
    wanted = ((1 << 22,), np.uint8)
    first, second = memory.Scratch(wanted), memory.Scratch(wanted)
    assert not np.shares_memory(first.arrays[0], second.arrays[0])
    first.give_back()
    third, fourth = memory.Scratch(wanted), memory.Scratch(wanted)
    assert not np.shares_memory(second.arrays[0], third.arrays[0])
    assert not np.shares_memory(third.arrays[0], fourth.arrays[0])


def test_a_mesh_keeps_its_memory(rng):
    """No later extraction writes into it."""
    volume = sphere(90)
    finder = FINDERS["bricks"].build(CellRanges.of(volume), None)
    mesh = extract(volume, 0.0)
    kept = [mesh.vertices.copy(), mesh.faces.copy()]
    for level in rng.uniform(-0.2, 0.2, 5):
        extract(volume, level, rows=finder.rows)
    assert np.array_equal(mesh.vertices, kept[0])
    assert np.array_equal(mesh.faces, kept[1])


PEAK = """
import sys
import numpy as np
import volviz
from volviz.isosurface import extract_surface
from volviz.io import load

def high(name):
    with open("/proc/self/status") as lines:
        return next(1024 * int(line.split()[1]) for line in lines if line.startswith(name))

if sys.argv[1]:
    volume, level = load(sys.argv[1]), 300.0
else:
    z, y, x = np.ogrid[-1:1:256j, -1:1:256j, -1:1:256j]
    volume, level = volviz.Volume.from_array((0.7 - np.sqrt(x*x + y*y + z*z)).astype("f4")), 0.0
few = volviz.Volume.from_array(np.random.default_rng(1).normal(0, 9, (9, 9, 70)).astype(
    volume.data.dtype))
for _ in range(3):
    extract_surface(few, 1.0)
for _ in range(2):
    with open("/proc/self/clear_refs", "w") as file:
        file.write("5")
    before = high("VmRSS")
    mesh = extract_surface(volume, level)
    print(high("VmHWM") - before, mesh.nbytes)
    del mesh
"""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")
@pytest.mark.parametrize("source", ["", "ct/cranium_head_ct.nrrd"])
def test_peak_memory_of_real_sizes(source, data):
    """At most the volume and three times the mesh, the first time and with ranges of bricks."""
    path = str(data / source) if source else ""
    done = subprocess.run(
        [sys.executable, "-c", PEAK, path], capture_output=True, text=True, timeout=200, check=True
    )
    for line in done.stdout.splitlines():
        extra, mesh = map(int, line.split())
        assert 0 < extra < 3 * mesh
