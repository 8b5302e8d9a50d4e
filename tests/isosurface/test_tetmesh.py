"""The public surface of tetrahedra: which method, any finder, VTK's contour beside ours."""

from __future__ import annotations

import numpy as np
import pytest

import volviz
from tests.isosurface import oracles
from volviz.errors import UsageError
from volviz.isosurface.extractors import EXTRACTORS
from volviz.isosurface.finders import FINDERS

LEVEL = 0.1


@pytest.fixture(scope="module")
def ball():
    """Random points in a box, joined by Delaunay; the value falls with the way from the middle."""
    from scipy.spatial import Delaunay

    points = np.random.default_rng(5).uniform(-1, 1, (3000, 3)).astype(np.float32)
    values = 0.7 - np.linalg.norm(points, axis=1).astype(np.float32)
    return volviz.TetMesh(points, Delaunay(points).simplices.astype(np.int64), values, space="LPS")


def test_tetrahedra_have_a_surface_without_a_word_about_the_method(ball):
    mesh = volviz.extract_surface(ball, LEVEL)
    oracles.assert_closed(mesh)
    assert mesh.space == "LPS"
    assert np.linalg.norm(mesh.vertices, axis=1).mean() == pytest.approx(0.6, abs=0.02)
    out = mesh.vertices / np.linalg.norm(mesh.vertices, axis=1, keepdims=True)
    assert (mesh.normals * out).sum(axis=1).mean() > 0.97, "towards lower values"
    inside = 4 / 3 * np.pi * 0.6**3
    assert oracles.volume_inside(mesh) == pytest.approx(inside, rel=0.05)


@pytest.mark.parametrize("finder", FINDERS)
def test_any_finder_gives_the_same_surface(ball, finder):
    mesh = volviz.extract_surface(ball, LEVEL, finder=finder)
    brute = volviz.extract_surface(ball, LEVEL, finder="brute-force")
    assert len(brute.faces) > 1000
    assert np.array_equal(mesh.vertices, brute.vertices)
    assert np.array_equal(mesh.faces, brute.faces)


def test_it_is_where_vtk_has_it(ball):
    vtk = pytest.importorskip("vtk", exc_type=ImportError)
    from vtk.util import numpy_support as convert

    grid = vtk.vtkUnstructuredGrid()
    points = vtk.vtkPoints()
    points.SetData(convert.numpy_to_vtk(ball.vertices, deep=True))
    grid.SetPoints(points)
    cells = vtk.vtkCellArray()
    ends = np.arange(0, 4 * len(ball.cells) + 1, 4)
    cells.SetData(
        convert.numpy_to_vtkIdTypeArray(ends, deep=True),
        convert.numpy_to_vtkIdTypeArray(ball.cells.ravel(), deep=True),
    )
    grid.SetCells(vtk.VTK_TETRA, cells)
    grid.GetPointData().SetScalars(convert.numpy_to_vtk(ball.values, deep=True))
    contour = vtk.vtkContourGrid()
    contour.SetInputData(grid)
    contour.SetValue(0, LEVEL)
    contour.Update()
    theirs = contour.GetOutput()
    mesh = volviz.extract_surface(ball, LEVEL)
    assert theirs.GetNumberOfPoints() == len(mesh.vertices)
    assert theirs.GetNumberOfCells() == len(mesh.faces)
    places = [convert.vtk_to_numpy(theirs.GetPoints().GetData()), mesh.vertices]
    ours, other = (np.sort(p.astype(float) @ [1.0, 1e-3, 1e-6]) for p in places)
    np.testing.assert_allclose(ours, other, atol=1e-5)


@pytest.mark.parametrize("method", [n for n, row in EXTRACTORS.items() if not row.tetrahedra])
def test_methods_of_regular_grids_say_what_to_use(ball, method):
    with pytest.raises(UsageError, match=f"{method} needs the regular grid") as caught:
        volviz.extract_surface(ball, LEVEL, method=method)
    assert "marching-tetrahedra" in caught.value.fix


def test_what_is_no_grid_is_refused():
    with pytest.raises(UsageError, match="needs a Volume or a TetMesh, not ndarray"):
        volviz.extract_surface(np.zeros((3, 3, 3)), 0.5)


def test_other_values_give_an_empty_mesh_and_nan_cells_are_counted(ball):
    assert volviz.extract_surface(ball, 5.0).empty
    values = ball.values.copy()
    values[0] = np.nan
    mesh = volviz.extract_surface(volviz.TetMesh(ball.vertices, ball.cells, values), LEVEL)
    assert mesh.skipped == (ball.cells == 0).any(axis=1).sum() > 0
