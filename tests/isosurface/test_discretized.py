"""Discretized marching cubes against marching cubes: where it lies, and what it saves."""

from __future__ import annotations

import threading

import numpy as np
import pytest
from scipy.spatial import cKDTree

from tests.isosurface import oracles
from tests.isosurface.shapes import SHEARED, sphere, torus
from volviz.errors import Cancelled
from volviz.isosurface import coplanar
from volviz.isosurface.extractors import marching_cubes
from volviz.isosurface.extractors.discretized_marching_cubes import extract_with_saving
from volviz.model.volume import Volume
from volviz.progress import Progress


def on_surface(mesh, step):
    """Points all over the triangles, no two neighbours further apart than `step`."""
    out = []
    for a, b, c in oracles.corners(mesh):
        n = int(np.ceil(max(np.linalg.norm(b - a), np.linalg.norm(c - a)) / step)) + 1
        i, j = np.meshgrid(np.arange(n + 1), np.arange(n + 1))
        i, j = i[i + j <= n] / n, j[i + j <= n] / n
        out.append(a + i[:, None] * (b - a) + j[:, None] * (c - a))
    return np.concatenate(out)


def distance(one, two, step):
    a, b = on_surface(one, step), on_surface(two, step)
    return max(cKDTree(a).query(b)[0].max(), cKDTree(b).query(a)[0].max())


@pytest.mark.parametrize("affine", [np.eye(4), SHEARED])
def test_at_most_half_a_diagonal_from_marching_cubes(affine):
    noise = np.pad(np.random.default_rng(8).standard_normal((4, 4, 4)), 1, constant_values=-2)
    for data, level in ((sphere(10).data, 0.0), (noise, 0.1)):
        volume = Volume.from_array(data, affine=affine)
        mesh, _ = extract_with_saving(volume, level)
        plain = marching_cubes.extract(volume, level, ambiguity="asymptotic")
        corners = np.array(list(np.ndindex(2, 2, 2))) - 0.5
        half = np.linalg.norm(corners @ affine[:3, :3].T, axis=1).max()
        step = half / 8
        assert distance(mesh, plain, step) <= half + step
        assert oracles.euler(mesh) == oracles.euler(plain)
        assert oracles.parts(mesh)[0] == oracles.parts(plain)[0]


def test_vertices_are_middles_of_edges_and_cells():
    data = np.random.default_rng(2).standard_normal((6, 7, 8))
    mesh, _ = extract_with_saving(Volume.from_array(data), 0.0)
    twice = 2 * mesh.vertices
    assert np.array_equal(twice, np.rint(twice))
    odd = (twice.astype(int) % 2).sum(axis=1)
    assert set(odd.tolist()) <= {1, 3}


def test_merging_changes_neither_volume_nor_closedness():
    """A box is twelve triangles beside its bevelled edges; volumes as of the middles of edges."""
    for volume, level in ((sphere(24), 0.0), (torus(30), 0.0)):
        mesh, saving = extract_with_saving(volume, level)
        plain = marching_cubes.extract(
            Volume.from_array((volume.data >= 0).astype(np.float32), affine=volume.affine), 0.5
        )
        oracles.assert_closed(mesh)
        assert oracles.volume_inside(mesh) == pytest.approx(oracles.volume_inside(plain), rel=1e-5)
        assert oracles.area(mesh) == pytest.approx(oracles.area(plain), rel=1e-5)
        assert saving.before == len(plain.faces)
        assert saving.after == len(mesh.faces)
        assert saving.polygons <= saving.after
        assert saving.share > 0.4


def test_a_box_has_the_fewest_triangles():
    data = np.zeros((20, 14, 16), np.uint8)
    data[3:17, 3:11, 3:13] = 1
    mesh, saving = extract_with_saving(Volume.from_array(data), 0.5)
    oracles.assert_closed(mesh)
    assert saving.polygons == 6 + 12 + 8
    assert len(mesh.vertices) == 24
    assert len(mesh.faces) == 44


def test_a_plate_with_a_hole_keeps_it():
    data = np.zeros((6, 30, 30), np.uint8)
    data[2:4, 3:27, 3:27] = 1
    data[:, 10:18, 11:20] = 0
    mesh, saving = extract_with_saving(Volume.from_array(data), 0.5)
    oracles.assert_closed(mesh)
    assert oracles.euler(mesh) == 0
    assert saving.share > 0.9


def test_the_border_of_the_volume_stays(rng):
    data = rng.standard_normal((6, 7, 8)).astype(np.float32)
    mesh, _ = extract_with_saving(Volume.from_array(data), 0.0)
    plain = marching_cubes.extract(Volume.from_array(data), 0.0, ambiguity="asymptotic")
    assert oracles.boundary_edges(mesh) == oracles.boundary_edges(plain)


def test_a_cancel_does_not_wait_for_the_sorting_of_edges(monkeypatch):
    """Most of a second in a noisy CT."""
    begun, go_on, ended = threading.Event(), threading.Event(), []
    twins, progress = coplanar._twins, Progress()

    def slow(faces, count):
        begun.set()
        go_on.wait(20)
        ended.append(count)
        return twins(faces, count)

    monkeypatch.setattr(coplanar, "_twins", slow)
    stopping = threading.Thread(target=lambda: (begun.wait(20), progress.cancel()))
    stopping.start()
    with pytest.raises(Cancelled):
        extract_with_saving(sphere(10), 0.0, progress=progress)
    assert ended == []
    go_on.set()
    stopping.join()
