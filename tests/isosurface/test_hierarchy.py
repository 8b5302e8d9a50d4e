"""Levels of resolution: where they lie, and that their errors are no smaller than they say."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from tests.isosurface.shapes import SHEARED, sphere
from volviz.errors import UsageError
from volviz.isosurface import extract
from volviz.isosurface.hierarchy import hierarchy
from volviz.meshes.distance import distances
from volviz.model.lens import Viewing, seen
from volviz.model.surface import Surface
from volviz.model.views import volume_camera
from volviz.model.volume import Volume


def scattered(mesh, count, seed):
    """float64[count, 3]: points evenly at random on a mesh."""
    rng = np.random.default_rng(seed)
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces].astype(np.float64), 1, 0)
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    face = rng.choice(len(areas), count, p=areas / areas.sum())
    s, t = np.sqrt(rng.random((count, 1))), rng.random((count, 1))
    return (1 - s) * a[face] + s * (1 - t) * b[face] + s * t * c[face]


@pytest.mark.parametrize("kind", ["sphere", "noise"])
def test_no_point_is_farther_than_the_error_promises(kind):
    volume = sphere(41)
    if kind == "noise":
        noise = np.random.default_rng(3).standard_normal((14, 21, 18)).astype(np.float32)
        volume = Volume.from_array(noise, affine=SHEARED)
    levels = hierarchy(volume, Surface(0.1))
    assert len(levels) >= 3
    assert levels[0].error == 0
    for level in levels[1:]:
        there = distances(scattered(level.mesh, 20_000, 1), levels[0].mesh).max()
        back = distances(scattered(levels[0].mesh, 20_000, 2), level.mesh).max()
        assert max(there, back) <= level.error
    assert [le.error for le in levels] == sorted(le.error for le in levels)


def test_a_level_does_not_move():
    volume = sphere(64)
    for level in (1, 2, 3):
        mesh = extract(volume, Surface(0.0, level=level))
        middle = (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)) / 2
        assert np.abs(middle).max() < 1e-3
        radius = np.linalg.norm(mesh.vertices, axis=1)
        side = 2 / 63 * 2**level
        assert np.abs(radius - 0.7).max() < side * side  # O(h²), as theory says


def test_the_finest_level_is_the_plain_surface_and_coarser_ones_have_fewer_triangles():
    volume = sphere(40)
    levels = hierarchy(volume, Surface(0.0))
    assert np.array_equal(levels[0].mesh.faces, extract(volume, Surface(0.0)).faces)
    counts = [len(le.mesh.faces) for le in levels]
    assert all(b < a / 2.5 for a, b in pairwise(counts))


@pytest.mark.parametrize("method", ["marching-tetrahedra", "cuberille"])
def test_every_method_has_levels(method):
    levels = hierarchy(sphere(20), Surface(0.0, method=method))
    assert len(levels) >= 3
    assert levels[1].error > 0


def test_a_level_by_pixels_errs_less_than_that_in_the_picture():
    volume = sphere(64)
    levels = hierarchy(volume, Surface(0.0))
    near = volume_camera(volume)
    counts = []
    for zoom in (1.0, 0.1, 0.01):
        viewing = Viewing(near.dollied(zoom), (800, 600))
        mesh = extract(volume, seen(Surface(0.0, level_pixels=1.0), viewing))
        counts.append(len(mesh.faces))
    finest = [len(le.mesh.faces) for le in levels]
    assert counts == sorted(counts, reverse=True)
    assert counts[-1] < counts[0]
    assert all(c in finest for c in counts)


def test_levels_by_pixels_ask_for_a_camera():
    with pytest.raises(UsageError, match="camera"):
        extract(sphere(10), Surface(0.0, level_pixels=1.0))


def test_nothing_has_one_level():
    volume = sphere(10)
    assert len(hierarchy(volume, Surface(9.0))) == 1
    assert len(hierarchy(volume, replace(Surface(0.0), method="dividing-cubes"))) == 1
