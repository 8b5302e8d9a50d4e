"""Normals from the volume's gradient: closed forms, samples that are not valid."""

from __future__ import annotations

import numpy as np
import pytest

from tests.isosurface.shapes import SHEARED, sphere
from volviz.isosurface.extractors.cuberille import extract
from volviz.isosurface.shaded import gradient_normals
from volviz.isosurface.slopes import OPERATORS
from volviz.model.volume import Volume
from volviz.progress import silent

NAMES = [n for n in OPERATORS if n != "none"]


@pytest.mark.parametrize("operator", NAMES)
def test_a_linear_function_has_one_normal_everywhere(operator, rng):
    z, y, x = np.indices((6, 7, 8)).astype(float)
    volume = Volume.from_array(x + 2 * y - z, affine=SHEARED)
    index = rng.uniform(-0.5, 5.5, (500, 3))
    points = index @ SHEARED[:3, :3].T + SHEARED[:3, 3]
    spare = np.zeros((500, 3), np.float32)
    found = gradient_normals(volume, points, spare, operator, some_invalid=False, report=silent())
    slope = np.linalg.inv(SHEARED[:3, :3]).T @ [1, 2, -1]
    assert np.allclose(found, -slope / np.linalg.norm(slope), atol=1e-6)


@pytest.mark.parametrize("operator", ["central", "sobel"])
def test_blocks_of_a_sphere_are_lit_as_a_sphere(operator):
    mesh = extract(sphere(33), 0.0, normals=operator)
    out = mesh.vertices / np.linalg.norm(mesh.vertices, axis=1, keepdims=True)
    assert (mesh.normals * out).sum(axis=1).min() > np.cos(np.radians(3))


def test_without_normals_there_are_none():
    plain, lit = (extract(sphere(12), 0.0, normals=n) for n in ("none", "central"))
    assert len(plain.normals) == 0
    assert np.array_equal(plain.vertices, lit.vertices)
    assert np.array_equal(plain.faces, lit.faces)


def test_where_nothing_slopes_or_is_valid_the_faces_tell(rng):
    solid = np.zeros((9, 9, 9), np.float32)
    solid[3:6, 3:6, 3:6] = 1
    flat = extract(Volume.from_array(solid), 0.5)
    assert np.allclose(np.linalg.norm(flat.normals, axis=1), 1, atol=1e-5)
    ball = sphere(17).data.copy()
    ball[8, 8, 9:] = np.nan
    mesh = extract(Volume.from_array(ball), 0.0)
    assert mesh.skipped > 0
    assert np.allclose(np.linalg.norm(mesh.normals, axis=1), 1, atol=1e-5)
