"""Where a line meets a mesh, against trimesh and against every triangle by itself."""

from __future__ import annotations

import numpy as np
import pytest

from tests.meshes import shapes
from volviz.meshes import ray
from volviz.model.mesh import Mesh


def every_triangle(mesh, origin, direction):
    """Möller and Trumbore 1997, without leaving anything out."""
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces].astype(float), 1, 0)
    p = np.cross(direction, c - a)
    det = ((b - a) * p).sum(1)
    good = np.abs(det) > 1e-12
    det = np.where(good, det, 1.0)
    u = ((origin - a) * p).sum(1) / det
    q = np.cross(origin - a, b - a)
    v = (q @ direction) / det
    t = ((c - a) * q).sum(1) / det
    return np.sort(t[good & (u >= 0) & (v >= 0) & (u + v <= 1)])


@pytest.mark.parametrize("block", [7, 1 << 18])
def test_crossings_are_those_of_every_triangle(rng, block, monkeypatch):
    monkeypatch.setattr(ray, "BLOCK", block)
    corners = rng.normal(size=(400, 3, 3)).astype(np.float32)
    mesh = Mesh(corners.reshape(-1, 3), np.arange(1200).reshape(-1, 3))
    met = 0
    for origin, direction in zip(rng.normal(size=(30, 3)), rng.normal(size=(30, 3)), strict=True):
        expected = every_triangle(mesh, origin, direction)
        np.testing.assert_allclose(ray.crossings(mesh, origin, direction), expected, atol=1e-4)
        met += len(expected)
    assert met > 300


def test_a_closed_surface_is_met_an_even_number_of_times(rng):
    mesh = shapes.sphere()
    for way in rng.normal(size=(20, 3)):
        met = ray.crossings(mesh, (0.011, 0.017, 0.013), way)
        assert (met > 0).sum() == (met < 0).sum() == 1
    assert len(ray.crossings(mesh, (50, 0, 0), (0, 0, 1))) == 0
    assert len(ray.crossings(Mesh(mesh.vertices), (0, 0, 0), (0, 0, 1))) == 0
