"""Marching tetrahedra against closed forms and against what a linear function must give."""

from __future__ import annotations

import numpy as np
import pytest

from tests.isosurface import oracles
from tests.isosurface.shapes import SHEARED, sphere
from volviz.isosurface.cells import CellRanges
from volviz.isosurface.extractors.marching_tetrahedra import extract
from volviz.isosurface.finders import FINDERS
from volviz.model.grids import TetMesh
from volviz.model.volume import Volume


@pytest.mark.parametrize("count", [5, 6])
def test_sphere_converges_in_second_order(count):
    errors = []
    for n in (17, 33, 65):
        mesh = extract(sphere(n), 0.0, tetrahedra=count)
        radius = np.linalg.norm(mesh.vertices.astype(float), axis=1)
        errors.append(
            (
                abs(oracles.area(mesh) - 4 * np.pi * 0.49),
                abs(oracles.volume_inside(mesh) - 4 / 3 * np.pi * 0.343),
                np.abs(radius - 0.7).max(),
            )
        )
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:])).mean(axis=0)
    assert np.all(orders > 1.7), orders


@pytest.mark.parametrize("count", [5, 6])
def test_a_linear_function_gives_its_plane(count):
    z, y, x = np.indices((5, 6, 7)).astype(float)
    mesh = extract(Volume.from_array(x + 2 * y - z, affine=SHEARED), 4.2, tetrahedra=count)
    slope = np.linalg.inv(SHEARED[:3, :3]).T @ [1, 2, -1]
    index = np.linalg.solve(SHEARED[:3, :3], (mesh.vertices - SHEARED[:3, 3]).T)
    assert np.allclose([1, 2, -1] @ index, 4.2, atol=1e-4)
    assert np.allclose(mesh.normals, -slope / np.linalg.norm(slope), atol=1e-3)


@pytest.mark.parametrize("count", [5, 6])
def test_both_cuts_are_closed_on_noise(count, rng):
    data = np.pad(rng.integers(0, 4, (6, 7, 8)), 1).astype(np.uint8)
    for level in (1, 1.5, 3):
        oracles.assert_closed(extract(Volume.from_array(data), level, tetrahedra=count))


def tetrahedra_of(volume):
    """The volume as a TetMesh: each cell cut into six along the steps x, y, z in any order."""
    nz, ny, nx = volume.data.shape
    z, y, x = np.indices((nz, ny, nx))
    points = np.stack([x, y, z], -1).reshape(-1, 3)
    ids = np.arange(nz * ny * nx).reshape(nz, ny, nx)[:-1, :-1, :-1].ravel()
    step, cells = np.array([1, nx, nx * ny]), []
    for a, b, c in ((0, 1, 2), (0, 2, 1), (1, 0, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0)):
        path = np.cumsum([0, step[a], step[b], step[c]])
        cells.append(ids[:, None] + path)
    world = points @ volume.affine[:3, :3].T + volume.affine[:3, 3]
    return TetMesh(world, np.concatenate(cells), volume.data.ravel())


def test_a_grid_of_tetrahedra_is_the_same_surface():
    volume = sphere(12)
    whole, grid = extract(volume, 0.1, tetrahedra=6), tetrahedra_of(volume)
    mesh = extract(grid, 0.1)
    oracles.assert_closed(mesh)
    assert np.allclose(mesh.vertices, whole.vertices, atol=1e-6)
    assert oracles.volume_inside(mesh) == pytest.approx(oracles.volume_inside(whole), rel=1e-5)
    for row in FINDERS.values():
        found = extract(grid, 0.1, row.build(CellRanges.of(grid), None)(0.1))
        assert np.array_equal(found.vertices, mesh.vertices)
        assert np.array_equal(found.faces, mesh.faces)


def test_values_of_tetrahedra_that_are_not_finite():
    grid = tetrahedra_of(sphere(8))
    values = grid.values.copy()
    values[100] = np.nan
    mesh = extract(TetMesh(grid.vertices, grid.cells, values), 0.0)
    assert mesh.skipped == np.any(grid.cells == 100, axis=1).sum()
    assert extract(TetMesh(grid.vertices, grid.cells[:0], values), 0.0).empty


def test_quadrilaterals_are_cut_at_the_shorter_diagonal():
    points = np.array([[0, 0, 0], [0, 0, 4], [6, 1, 0], [6, -1, 4.0]])
    mesh = extract(TetMesh(points, [[0, 1, 2, 3]], np.array([1.0, 1, 0, 0])), 0.5)
    assert len(mesh.faces) == 2
    shared = np.intersect1d(*mesh.faces)
    rest = np.setxor1d(*mesh.faces)
    ends = mesh.vertices[shared], mesh.vertices[rest]
    assert np.linalg.norm(np.subtract(*ends[0])) < np.linalg.norm(np.subtract(*ends[1]))
