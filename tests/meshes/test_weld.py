from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from tests.meshes.shapes import double_torus, mesh_of, sphere
from volviz.errors import UsageError
from volviz.meshes.measure import measure
from volviz.meshes.weld import weld
from volviz.model.mesh import Mesh


def soup(mesh):
    """Every face with corners of its own."""
    return mesh_of(
        mesh.vertices[mesh.faces].reshape(-1, 3), np.arange(mesh.faces.size).reshape(-1, 3)
    )


@pytest.mark.parametrize("shape", [sphere(5.0, 3), double_torus()])
def test_a_soup_becomes_the_mesh_again(shape):
    apart = soup(shape)
    assert measure(apart).components == len(shape.faces)
    whole = weld(apart)
    assert len(whole.vertices) == len(shape.vertices)
    assert np.array_equal(whole.vertices[whole.faces], shape.vertices[shape.faces])
    assert measure(whole).genus == measure(shape).genus
    assert weld(whole) is whole


def test_zero_has_no_sign():
    mesh = mesh_of([[0, 0, 0], [-0.0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 2, 3], [1, 3, 2]])
    assert len(weld(mesh).vertices) == 3


def test_what_goes_along_is_averaged_and_dead_faces_go():
    mesh = Mesh(
        np.array([[0, 0, 0], [0.1, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32),
        np.array([[0, 2, 3], [0, 1, 2]], np.uint32),
        normals=np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 1]], np.float32),
        values=np.array([1, 3, 5, 7], np.float32),
        colors=np.array([[0, 0, 0, 255], [100, 0, 0, 255], [9] * 4, [8] * 4], np.uint8),
        space="LPS",
    )
    made = weld(mesh, 0.2)
    assert made.faces.tolist() == [[0, 1, 2]]
    assert made.values.tolist() == [2, 5, 7]
    assert made.colors[0].tolist() == [50, 0, 0, 255]
    assert np.allclose(made.normals[0], [0.5**0.5, 0.5**0.5, 0])
    assert made.space == "LPS"


coordinates = st.floats(-100, 100, width=32)


@given(
    arrays(np.float32, st.tuples(st.integers(0, 40), st.just(3)), elements=coordinates),
    st.sampled_from([0.0, 1e-6, 0.5, 10.0, 1e3]),
)
@settings(max_examples=60)
def test_none_moves_too_far_and_the_kept_are_apart(points, tolerance):
    made = weld(Mesh(points), tolerance)
    kept = made.vertices.astype(np.float64)
    assert len(kept) <= len(points)
    if not len(points):
        return
    near = np.linalg.norm(points[:, None].astype(np.float64) - kept[None], axis=2).min(axis=1)
    assert near.max() <= tolerance * (1 + 1e-9)
    between = np.linalg.norm(kept[:, None] - kept[None], axis=2)
    assert np.all(between[~np.eye(len(kept), dtype=bool)] > tolerance * (1 - 1e-9))
    if tolerance == 0:
        assert len(kept) == len(np.unique(points + 0.0, axis=0))


def test_no_negative_tolerance():
    with pytest.raises(UsageError, match="--weld"):
        weld(sphere(), -1.0)
