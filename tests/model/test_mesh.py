"""Meshes, tetrahedra and the knobs of a surface."""

from __future__ import annotations

import numpy as np
import pytest

from volviz.errors import UsageError
from volviz.model.grids import TetMesh
from volviz.model.knobs import knobs_of
from volviz.model.mesh import Mesh
from volviz.model.surface import AMBIGUITIES, NORMALS, Surface

CORNERS = np.eye(3, dtype=np.float64)


def test_a_mesh_is_read_only_and_of_its_types():
    mesh = Mesh(CORNERS, np.array([[0, 1, 2]]), CORNERS, values=np.arange(3))
    assert (mesh.vertices.dtype, mesh.faces.dtype) == (np.float32, np.uint32)
    assert mesh.values is not None
    assert mesh.values.dtype == np.float32
    assert np.array_equal(mesh.bounds, [[0, 0, 0], [1, 1, 1]])
    assert mesh.nbytes == 36 + 12 + 36 + 12
    for array in (mesh.vertices, mesh.bounds):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1
    CORNERS[0, 0] = 1  # the caller's own array stays writable


def test_points_and_nothing_are_meshes():
    assert Mesh(CORNERS).faces.shape == (0, 3)
    nothing = Mesh(np.empty((0, 3)))
    assert nothing.empty
    assert np.isnan(nothing.bounds).all()


@pytest.mark.parametrize(
    "wrong",
    [
        {"vertices": np.zeros((3, 2))},
        {"faces": np.array([[0, 1, 3]])},
        {"faces": np.array([[0, 1]])},
        {"normals": np.zeros((2, 3))},
        {"values": np.zeros(4)},
        {"colors": np.zeros((3, 3))},
        {"faces": np.array([[0, 1, -1]])},
        {"faces": np.array([[0, 1, 2**32]])},
        {"faces": np.array([[0.0, 1, 2]])},
        {"vertices": [["a", "b", "c"]]},
        {"vertices": None},
        {"normals": 5},
    ],
)
def test_arrays_of_other_shapes_are_refused(wrong):
    with pytest.raises(UsageError):
        Mesh(**{"vertices": CORNERS, **wrong})


def test_tetrahedra_name_vertices_that_are_there():
    cells = np.array([[0, 1, 2, 3]])
    grid = TetMesh(np.zeros((4, 3)), cells, np.arange(4, dtype=np.int16))
    assert grid.values.dtype == np.int16
    with pytest.raises(UsageError, match=r"outside 0\.\.3"):
        TetMesh(np.zeros((4, 3)), cells + 1, np.arange(4))
    with pytest.raises(UsageError, match="shape"):
        TetMesh(np.zeros((4, 3)), cells, np.arange(3))


def test_knobs_of_a_surface():
    assert [k.name for k in knobs_of(Surface)] == [
        "isovalue",
        "method",
        "finder",
        "ambiguity",
        "normals",
        "tetrahedra",
        "size",
        "size_pixels",
        "front_faces",
        "axis",
        "level",
        "level_pixels",
    ]
    assert Surface(300).isovalue == 300.0
    for wrong in ({"method": "cubes"}, {"ambiguity": "x"}, {"isovalue": float("nan")}):
        with pytest.raises(UsageError):
            Surface(**wrong)


def test_names_are_those_of_the_kernels():
    from volviz.isosurface.ambiguity import RULES
    from volviz.isosurface.slopes import OPERATORS

    assert set(RULES) == set(AMBIGUITIES)
    assert set(OPERATORS) == set(NORMALS)
