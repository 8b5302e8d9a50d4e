"""What the test suites of scikit-image, VTK, PyMCubes and trimesh hold their surfaces to, held to.

After scikit-image's test_marching_cubes.py (ellipsoids, spacing, directions, masks, degenerate
triangles, wrong input), VTK's TestFlyingEdges (rotated image directions, every type of scalars),
PyMCubes' test_mcubes.py (empty, no duplicates, signs) and trimesh's checks of a volume.
"""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree

import volviz
from volviz.errors import UsageError
from volviz.meshes.measure import measure
from volviz.meshes.normals import turned
from volviz.meshes.weld import weld

SMOOTH = ("marching-cubes", "marching-tetrahedra")
CLOSED = (*SMOOTH, "cuberille", "discretized-marching-cubes")


def ellipsoid(spacing=(1.0, 1.0, 1.0)):
    """scikit-image's: half axes 6, 10, 16 along its first, second, third axis, negative inside."""
    draw = pytest.importorskip("skimage.draw", exc_type=ImportError)
    field = draw.ellipsoid(6, 10, 16, spacing=spacing, levelset=True).astype(np.float32)
    return field, draw.ellipsoid_stats(6, 10, 16)


@pytest.mark.parametrize("method", SMOOTH)
@pytest.mark.parametrize("spacing", [(1.0, 1.0, 1.0), (1.0, 10 / 6, 16 / 6)])
def test_area_and_volume_of_an_ellipsoid_as_near_as_theirs(method, spacing):
    field, (inside, area) = ellipsoid(spacing)
    volume = volviz.Volume.from_array(-field, spacing=spacing[::-1])
    report = measure(volviz.extract_surface(volume, 0.0, method=method))
    assert area * 0.985 < report.area < area
    assert (report.components, report.genus) == (1, 0)
    if report.closed:  # their grid of other spacing ends where the ellipsoid does
        assert inside * 0.98 < report.volume < inside
    assert report.closed == (spacing[1] == 1)


@pytest.mark.parametrize("method", CLOSED)
def test_of_negated_values_it_is_the_same_surface_inside_out(method):
    """gradient_direction='descent' and 'ascent': an object darker than what is round it."""
    field, _ = ellipsoid()
    bright = volviz.Volume.from_array(-field)
    dark = volviz.Volume.from_array(field)
    one = volviz.extract_surface(bright, 0.013, method=method)
    other = volviz.extract_surface(dark, -0.013, method=method)
    out, back = measure(one), measure(turned(other))
    assert measure(other).volume < 0 < out.volume
    assert back.volume == pytest.approx(out.volume, rel=1e-4)
    assert back.area == pytest.approx(out.area, rel=1e-4)
    assert np.allclose(np.linalg.norm(turned(other).normals, axis=1), 1, atol=1e-5)


def test_what_is_masked_is_left_open_where_the_mask_ends():
    field, _ = ellipsoid()
    whole = volviz.extract_surface(volviz.Volume.from_array(-field), 0.0)
    cut = field.shape[1] // 2 + 2
    masked = -field
    masked[:, cut:] = np.nan
    mesh = volviz.extract_surface(volviz.Volume.from_array(masked), 0.0)
    kept = whole.vertices[whole.faces][..., 1].max(axis=1) <= cut - 1
    sides = trimesh.Trimesh(whole.vertices, whole.faces[kept], process=False).area
    assert measure(mesh).area == pytest.approx(sides, rel=1e-5)
    assert mesh.skipped == (field.shape[0] - 1) * (field.shape[1] - cut) * (field.shape[2] - 1)
    assert measure(mesh).boundary_loops == 1


@pytest.mark.parametrize("method", SMOOTH)
def test_triangles_without_area_go_by_welding_and_nothing_else_does(method):
    """allow_degenerate=False: samples equal to the isovalue."""
    field, _ = ellipsoid()
    steps = volviz.Volume.from_array(np.round(-4 * field).astype(np.int16))
    mesh = volviz.extract_surface(steps, 0, method=method)
    before = measure(mesh)
    assert before.degenerate_faces > 10
    after = measure(weld(mesh, 1e-6))
    assert (after.degenerate_faces, after.duplicate_faces, after.closed) == (0, 0, True)
    assert (after.euler, after.components) == (before.euler, before.components) == (2, 1)
    assert after.volume == pytest.approx(before.volume, rel=1e-6)


@pytest.mark.parametrize("method", SMOOTH)
def test_no_vertex_is_there_twice_and_trimesh_calls_it_a_volume(method, rng):
    field, _ = ellipsoid((1.0, 2.0, 3.0))
    bumpy = -field + rng.normal(0, 0.05, field.shape).astype(np.float32)
    bumpy[[0, -1]], bumpy[:, [0, -1]], bumpy[:, :, [0, -1]] = -1, -1, -1
    mesh = volviz.extract_surface(volviz.Volume.from_array(bumpy), 0.0, method=method)
    assert len(np.unique(mesh.vertices, axis=0)) == len(mesh.vertices)
    judged = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    assert judged.is_watertight
    assert judged.is_winding_consistent
    assert judged.is_volume
    report = measure(mesh)
    assert judged.euler_number == report.euler
    assert judged.volume == pytest.approx(report.volume, rel=1e-9)
    assert judged.area == pytest.approx(report.area, rel=1e-9)
    assert judged.body_count == report.components


@pytest.mark.parametrize("value", [0.0, 1.0, -1.0, 1e30])
def test_an_empty_volume_gives_an_empty_mesh(value):
    mesh = volviz.extract_surface(
        volviz.Volume.from_array(np.zeros((32, 32, 32), np.float32)), value
    )
    assert (mesh.vertices.shape, mesh.faces.shape, mesh.normals.shape) == ((0, 3), (0, 3), (0, 3))
    assert mesh.faces.dtype == np.uint32


@pytest.mark.parametrize("turn", [0.0, 0.7, 2.5])
def test_on_a_turned_grid_the_points_and_normals_are_those_of_flying_edges(turn, rng):
    """vtkImageData with a direction matrix: oblique and anisotropic, world coordinates."""
    vtk = pytest.importorskip("vtk", exc_type=ImportError)
    from vtk.util.numpy_support import numpy_to_vtk, vtk_to_numpy

    axis = np.array([1.0, 2.0, -1.0])
    turning = trimesh.transformations.rotation_matrix(turn, axis)[:3, :3]
    field, _ = ellipsoid()
    spacing, origin = (0.7, 1.1, 2.3), (-30.0, 12.0, 100.0)
    affine = np.eye(4)
    affine[:3, :3], affine[:3, 3] = turning * spacing, origin
    mesh = volviz.extract_surface(volviz.Volume.from_array(-field, affine=affine), 0.013)
    image = vtk.vtkImageData()
    image.SetDimensions(field.shape[::-1])
    image.SetSpacing(spacing)
    image.SetOrigin(origin)
    image.SetDirectionMatrix(turning.ravel())
    image.GetPointData().SetScalars(numpy_to_vtk(-field.ravel(), deep=True))
    edges = vtk.vtkFlyingEdges3D()
    edges.SetInputData(image)
    edges.SetValue(0, 0.013)
    edges.ComputeNormalsOff()
    edges.Update()
    theirs = vtk_to_numpy(edges.GetOutput().GetPoints().GetData())
    assert len(theirs) == len(mesh.vertices)
    for some, others in ((theirs, mesh.vertices), (mesh.vertices, theirs)):
        assert cKDTree(others).query(some)[0].max() < 1e-3
    flat = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    assert flat.volume > 0
    assert (flat.vertex_normals * mesh.normals).sum(axis=1).min() > 0.9


@pytest.mark.parametrize(
    ("knobs", "word"),
    [
        ({"spacing": (1, 1, 1)}, r"from_array\(array, spacing"),
        ({"mask": None}, "NaN"),
        ({"gradient_direction": "ascent"}, "turned"),
        ({"allow_degenerate": False}, "weld"),
        ({"step_size": 2}, "level=1"),
        ({"ambiguty": "trilinear"}, "did you mean 'ambiguity'"),
        ({"method": "lewiner"}, "choose one of"),
        ({"method": "marching_cubes"}, "did you mean 'marching-cubes'"),
    ],
)
def test_names_of_others_are_told_where_it_is_here(knobs, word):
    volume = volviz.Volume.from_array(np.zeros((2, 2, 2), np.float32))
    with pytest.raises(UsageError, match=word):
        volviz.extract_surface(volume, 0.5, **knobs)


@pytest.mark.parametrize("isovalue", [None, "0.5", "abc", 1j, [0.5], float("nan"), -np.inf])
def test_an_isovalue_is_a_finite_number(isovalue):
    volume = volviz.Volume.from_array(np.zeros((2, 2, 2), np.float32))
    with pytest.raises(UsageError, match="isovalue"):
        volviz.extract_surface(volume, isovalue)


@pytest.mark.parametrize("given", [np.zeros((4, 4, 4)), "head.nrrd", None])
def test_what_is_no_volume_is_told_how_to_become_one(given):
    with pytest.raises(UsageError, match=r"volviz.load\(path\) or volviz.Volume.from_array"):
        volviz.extract_surface(given, 0.5)
