"""Cuberille against brute force: neighbours inside and outside, and the 6-connected solid."""

from __future__ import annotations

import numpy as np
import pytest

from tests.isosurface import oracles
from tests.isosurface.shapes import SHEARED, sphere
from volviz.errors import LimitError, UsageError
from volviz.isosurface.extractors.cuberille import extract
from volviz.model.volume import Volume


def neighbours(solid):
    return sum(int(np.count_nonzero(np.diff(solid.astype(int), axis=a))) for a in range(3))


def euler_of_voxels(solid):
    """χ of the border of the solid: twice that of the voxels, joined by faces.

    Outside, voxels are joined by faces and edges: two that touch in a corner only leave no hole.
    """
    blocks = np.lib.stride_tricks.sliding_window_view(solid, (2, 2, 2)).reshape(-1, 8)
    opposite = ~blocks[:, :4] & ~blocks[:, :3:-1]
    total = int(np.count_nonzero((blocks.sum(axis=1) == 6) & opposite.any(axis=1)))
    for pattern in np.ndindex(2, 2, 2):
        part = solid
        for axis, twice in enumerate(pattern):
            if twice:
                n = part.shape[axis]
                part = part.take(range(1, n), axis) & part.take(range(n - 1), axis)
        total += (-1) ** sum(pattern) * int(part.sum())
    return 2 * total


@pytest.mark.parametrize("density", [0.2, 0.5, 0.8])
def test_random_voxels(density):
    rng = np.random.default_rng(3)
    for _ in range(6):
        solid = np.pad(rng.random((6, 7, 5)) < density, 2)
        mesh = extract(Volume.from_array(solid), 1)
        oracles.assert_closed(mesh)
        assert oracles.area(mesh) == pytest.approx(neighbours(solid))
        assert oracles.volume_inside(mesh) == pytest.approx(solid.sum())
        assert oracles.euler(mesh) == euler_of_voxels(solid)
        assert np.allclose(mesh.vertices * 2, np.rint(mesh.vertices * 2))


def test_two_triangles_per_face_between_neighbours():
    ball = sphere(20)
    mesh = extract(ball, 0.0)
    assert len(mesh.faces) == 2 * neighbours(ball.data >= 0)


def test_open_at_the_border_of_the_volume(rng):
    solid = rng.random((4, 5, 6)) < 0.5
    mesh = extract(Volume.from_array(solid), 1)
    assert oracles.area(mesh) == pytest.approx(neighbours(solid))


@pytest.mark.parametrize("size", [0.5, 0.3])
def test_finer_faces_are_those_of_the_resampled_volume(size):
    from scipy.ndimage import map_coordinates

    data = np.pad(np.random.default_rng(1).standard_normal((3, 4, 5)), 1, constant_values=-2)
    m = int(np.ceil(1 / size))
    grid = np.indices([(n - 1) * m + 1 for n in data.shape]) / m
    fine = map_coordinates(data, grid, order=1, mode="nearest") >= 0.05
    mesh = extract(Volume.from_array(data), 0.05, size=size)
    oracles.assert_closed(mesh)
    assert oracles.area(mesh) == pytest.approx(neighbours(fine) / m**2, rel=1e-5)
    assert oracles.volume_inside(mesh) == pytest.approx(fine.sum() / m**3, rel=1e-5)


def test_finer_faces_come_nearer_to_the_sphere():
    errors = [
        np.abs(np.linalg.norm(extract(sphere(16), 0.0, size=s).vertices, axis=1) - 0.7).max()
        for s in (0.0, 0.07, 0.035)
    ]
    assert errors[0] > 1.5 * errors[1] > 2 * errors[2]


def test_plateaus_at_the_isovalue_are_inside_at_any_size():
    data = np.zeros((5, 5, 5))
    data[1:4, 1:4, 1:4] = 0.1
    mesh = extract(Volume.from_array(data), 0.1, size=0.3)
    oracles.assert_closed(mesh)
    m = 4
    assert oracles.volume_inside(mesh) == pytest.approx(((2 * m + 1) / m) ** 3, rel=1e-5)


@pytest.mark.parametrize("way", [(0, 0, 1), (1, -2, 0.5)])
def test_front_faces_are_those_that_face_the_viewer(way):
    volume = Volume.from_array(sphere(14).data, affine=SHEARED)
    whole, front = extract(volume, 0.0), extract(volume, 0.0, front_faces=way)

    def turned(mesh):
        a, b, c = np.moveaxis(oracles.corners(mesh), 1, 0)
        return np.cross(b - a, c - a) @ np.array(way, float)

    assert np.all(turned(front) < 0)
    assert len(front.faces) == np.count_nonzero(turned(whole) < -1e-6)
    with pytest.raises(UsageError, match="direction"):
        extract(volume, 0.0, front_faces=(0, 0, 0))


def test_too_many_faces_are_refused():
    with pytest.raises(LimitError, match="greater size"):
        extract(sphere(16), 0.0, size=1e-5)
