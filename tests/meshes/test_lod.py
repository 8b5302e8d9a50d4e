from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from tests.meshes.shapes import sphere
from volviz.meshes.distance import distances
from volviz.meshes.lod import Level, choose, levels_of, pixel_size
from volviz.meshes.measure import measure
from volviz.model.camera import Camera

BOX = [[-10, -10, -10], [10, 10, 10]]


def test_a_pixel_of_both_projections():
    flat = Camera((0, -100, 0), projection="orthographic", height=50.0)
    assert pixel_size(flat, (800, 500), BOX) == pytest.approx(0.1)
    near = Camera((0, -100, 0), fov=90.0)
    # 90 mm to the nearest face, tan 45° = 1: 180 mm across the smaller side
    assert pixel_size(near, (800, 500), BOX) == pytest.approx(180 / 500)
    assert pixel_size(near, (500, 800), BOX) == pytest.approx(180 / 500)
    assert pixel_size(Camera((0, -5, 0)), (800, 500), BOX) == 0


def test_a_pixel_agrees_with_the_projection_matrix():
    camera = Camera((30, -80, 20), (1, 2, 3), fov=40.0)
    corners = np.array(np.meshgrid([-10, 10], [-10, 10], [-10, 10])).reshape(3, -1).T
    _, up, back = camera.axes()
    nearest = corners[np.argmax(corners @ back)]
    size = (640, 480)
    clip = camera.projection_matrix(640 / 480, 1, 500) @ camera.view_matrix()
    tall = []
    for point in (nearest, nearest + up):
        x = clip @ np.append(point, 1.0)
        tall.append(x[1] / x[3] * size[1] / 2)
    assert pixel_size(camera, size, BOX) == pytest.approx(1 / (tall[1] - tall[0]), rel=1e-6)


def test_levels_promise_what_they_keep():
    levels = levels_of(sphere(10.0, 5))
    counts = [len(level.mesh.faces) for level in levels]
    errors = [level.error for level in levels]
    assert counts[0] == 20480
    assert errors[0] == 0
    assert errors == sorted(errors)
    assert counts[-1] < 4 * 500  # below that no coarser one is made
    for one, two in pairwise(counts):
        assert two == pytest.approx(one / 4, abs=2)
    for level in levels[1:]:
        assert distances(level.mesh.vertices, levels[0].mesh).max() <= level.error
        assert distances(levels[0].mesh.vertices, level.mesh).max() <= level.error
        assert measure(level.mesh).genus == 0


def test_the_coarsest_that_is_good_enough_is_chosen():
    mesh = sphere(10.0, 2)
    levels = [Level(mesh, e) for e in (0.0, 0.01, 0.1, 1.0)]
    size = (500, 500)
    orthographic = [
        Camera((0, -100, 0), projection="orthographic", height=h) for h in (1, 6, 60, 600, 1e5)
    ]
    assert [choose(levels, c, size) for c in orthographic] == [0, 1, 2, 3, 3]
    assert choose(levels, orthographic[1], size, pixels=10) == 2
    away = [choose(levels, Camera((0, -d, 0)), size) for d in (1, 15, 50, 200, 2000)]
    assert away == sorted(away)
    assert (away[0], away[-1]) == (0, 3)


def test_small_meshes_have_one_level():
    assert len(levels_of(sphere(1.0, 2))) == 1
