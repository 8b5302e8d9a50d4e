"""Values at the ends of what their dtype holds: the surface is that of the same values scaled."""

from __future__ import annotations

import numpy as np
import pytest

import volviz
from tests.isosurface.shapes import SHEARED, sphere
from volviz.errors import LimitError
from volviz.model.surface import METHODS

BALL = sphere(14).data.astype(np.float64)
CASES = {  # power of two and dtype: scaling by it is exact
    "huge float": (125, np.float32),
    "huge double": (1020, np.float64),
    "tiny double": (-1000, np.float64),
}


@pytest.mark.parametrize("kind", CASES)
@pytest.mark.parametrize("method", METHODS)
def test_scaled_values_have_the_same_surface(method, kind):
    power, dtype = CASES[kind]
    plain = BALL.astype(dtype)
    expected = volviz.extract_surface(made(plain), 0.25, method=method)
    scaled = np.ldexp(plain, power)
    assert np.all(np.isfinite(scaled))
    mesh = volviz.extract_surface(made(scaled), float(np.ldexp(0.25, power)), method=method)
    assert len(expected.vertices) > 20
    assert np.array_equal(mesh.faces, expected.faces)
    assert np.allclose(mesh.vertices, expected.vertices, rtol=0, atol=1e-5)
    assert np.allclose(np.linalg.norm(mesh.normals, axis=1), 1, atol=1e-5)
    alike = np.einsum("ij,ij->i", mesh.normals, expected.normals)
    assert alike.min() > (0 if dtype == np.float64 else 0.999)  # squares of doubles leave the range


@pytest.mark.parametrize("method", METHODS)
def test_a_step_between_two_neighbours_of_the_dtype(method):
    """No number lies between the values, and each may be the isovalue."""
    for dtype in (np.float32, np.float64):
        low = dtype(1)
        high = np.nextafter(low, dtype(2))
        volume = made(np.where(BALL > 0.25, high, low))
        assert volviz.extract_surface(volume, float(low), method=method).empty
        mesh = volviz.extract_surface(volume, float(high), method=method)
        step = made((BALL > 0.25).astype(np.uint8))
        assert np.array_equal(mesh.faces, volviz.extract_surface(step, 1, method=method).faces)
        assert len(mesh.vertices) > 20


def test_both_zeros_are_one_value():
    volume = made(np.where(BALL > 0.25, 0.0, -0.0).astype(np.float32))
    below = made(np.where(BALL > 0.25, -0.0, -1.0).astype(np.float32))
    for zero in (0.0, -0.0):
        assert volviz.extract_surface(volume, zero).empty
        assert len(volviz.extract_surface(below, zero).faces) > 20


@pytest.mark.parametrize("kind", ["int8", pytest.param("uint64", marks=pytest.mark.slow), "int64"])
def test_ends_of_whole_numbers(kind):
    ends = np.iinfo(kind)
    volume = made(np.where(BALL > 0.25, ends.max, ends.min).astype(kind))
    faces = len(volviz.extract_surface(made((BALL > 0.25).astype(np.uint8)), 1).faces)
    middle = (float(ends.max) + float(ends.min)) / 2
    assert len(volviz.extract_surface(volume, middle).faces) == faces
    assert volviz.extract_surface(volume, float(ends.min)).empty
    assert volviz.extract_surface(volume, 4 * float(ends.max)).empty


@pytest.mark.parametrize("method", [m for m in METHODS if m not in ("cuberille", "dividing-cubes")])
def test_values_too_far_apart_for_a_difference_are_refused_not_drawn(method):
    most = np.finfo(np.float64).max
    volume = made(np.where(BALL > 0.25, most, -most))
    if method in ("marching-cubes", "marching-tetrahedra"):
        with pytest.raises(LimitError, match="scale them down"):
            volviz.extract_surface(volume, most / 2, method=method)
    else:
        mesh = volviz.extract_surface(volume, most / 2, method=method)
        assert len(mesh.faces) > 20
        assert np.all(np.isfinite(mesh.vertices))


def made(data):
    return volviz.Volume.from_array(data, affine=SHEARED)
