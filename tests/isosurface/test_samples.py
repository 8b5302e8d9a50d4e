"""What marching cubes finds out for 64 cells at once, and samples without their type."""

from __future__ import annotations

import gc

import numba
import numpy as np
import pytest

from volviz.isosurface import kernel, memory, signs
from volviz.isosurface.cases import EDGES, cases, inside
from volviz.isosurface.extractors.marching_cubes import extract
from volviz.isosurface.plain import AMBIGUOUS, plain
from volviz.isosurface.samples import samples, value_at
from volviz.model.volume import Volume

KINDS = ("i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8", "f4", "f8")


def words_of(case):
    """The eight words of `signs.load` for 64 cells that are all of this case."""
    corners = (0, 2, 4, 6, 1, 3, 5, 7)
    return tuple(np.uint64(0xFFFFFFFFFFFFFFFF if case >> c & 1 else 0) for c in corners)


def test_words_tell_ambiguous_cells_and_triangles_as_the_tables_do():
    @numba.njit
    def found(words):
        return signs.doubtful(words), signs.crossings(words, np.uint64(0x10))

    table, quick = cases(), plain()
    for case in range(256):
        doubtful, crossings = found(words_of(case))
        assert doubtful == (0xFFFFFFFFFFFFFFFF if table.ambiguous[case] else 0)
        assert crossings == sum(inside(case, a) != inside(case, b) for a, b in EDGES)
        if quick.size[case] not in (0, AMBIGUOUS):
            assert quick.size[case] == crossings - 2


def test_eight_words_of_a_row_of_cells_at_once(rng):
    @numba.njit
    def found(flat, rows):
        one = 0
        for w in range(8):
            at = np.uint64(w)
            if signs.mixed(signs.load(flat, rows, at)):
                one |= 1 << w
        return one, kernel.uneven(flat, rows[0], rows[1], rows[2], rows[3])

    full = np.uint64(0xFFFFFFFFFFFFFFFF)
    for _ in range(300):
        flat = rng.choice(np.array([0, 0, 0, full, full, full, 1, 1 << 63], np.uint64), 40)
        flat[: rng.integers(40)] = rng.choice(np.array([0, full], np.uint64))
        rows = tuple(np.uint64(n) for n in rng.integers(0, 31, 4))
        one, eight = found(flat, rows)
        assert one == eight


@pytest.mark.parametrize("kind", KINDS)
def test_samples_are_the_same_without_their_type(kind, rng):
    ends = np.iinfo(kind) if kind[0] in "iu" else np.finfo(kind)
    data = rng.integers(0, 256, (3, 4, 5 * int(kind[1])), dtype=np.uint8).view(kind)
    data.flat[:2] = ends.min, ends.max

    read = numba.njit(_all_values)
    with np.errstate(invalid="ignore", over="ignore"):
        assert np.array_equal(read(samples(data)), data.astype(float), equal_nan=True)
        assert np.array_equal(read(data), data.astype(float), equal_nan=True)


def _all_values(data):
    out = np.empty(data.shape)
    for z in range(data.shape[0]):
        for y in range(data.shape[1]):
            for x in range(data.shape[2]):
                out[z, y, x] = value_at(data, z, y, x)
    return out


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_samples_has_the_vertices_and_normals_of_float64(kind, rng):
    """Away from the border and at it; values that every kind can hold."""
    values = rng.integers(0, 100, (9, 8, 70))
    level = 41.5
    mesh = extract(Volume.from_array(values.astype(kind)), level)
    same = extract(Volume.from_array(values.astype(np.float64)), level)
    assert np.array_equal(mesh.vertices, same.vertices)
    assert np.array_equal(mesh.normals, same.normals)
    assert np.array_equal(mesh.faces, same.faces)


def test_memory_of_a_mesh_is_used_again_once_no_view_of_it_is_left():
    wanted = (((1 << 20,), np.float32), ((1 << 10, 3), np.uint32))
    first = memory.empty(*wanted)
    place, part = first[0].ctypes.data, first[0][5:9]
    del first
    gc.collect()
    second = memory.empty(*wanted)
    assert not np.shares_memory(part, second[0])
    assert second[0].ctypes.data != place
    del part, second
    gc.collect()
    held = [memory.empty(*wanted) for _ in range(3)]
    for i, one in enumerate(held):
        assert not any(np.shares_memory(one[0], other[0]) for other in held[:i])


def test_meshes_are_read_only(rng):
    mesh = extract(Volume.from_array(rng.random((5, 6, 7), dtype=np.float32)), 0.5)
    for array in (mesh.vertices, mesh.normals, mesh.faces):
        with pytest.raises(ValueError, match="read-only"):
            array[:] = 0
