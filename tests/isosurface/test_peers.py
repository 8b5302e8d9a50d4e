"""The field's own measures of the same volumes: VTK, and SimpleITK's statistics of a label."""

from __future__ import annotations

import numpy as np
import pytest

import volviz
from tests.isosurface import oracles
from tests.isosurface.shapes import sphere
from volviz.meshes.measure import measure


def flying_edges(volume, level):
    """(area, volume, bounds as x, x, y, y, z, z) by vtkFlyingEdges3D and vtkMassProperties."""
    vtk = pytest.importorskip("vtk", exc_type=ImportError)
    from vtk.util.numpy_support import numpy_to_vtk

    image = vtk.vtkImageData()
    image.SetDimensions(*volume.dims)
    image.SetSpacing(*volume.spacing)
    image.SetOrigin(*volume.affine[:3, 3])
    image.GetPointData().SetScalars(numpy_to_vtk(volume.data.ravel(), deep=True))
    edges, mass = vtk.vtkFlyingEdges3D(), vtk.vtkMassProperties()
    edges.SetInputData(image)
    edges.SetValue(0, level)
    mass.SetInputConnection(edges.GetOutputPort())
    mass.Update()
    return mass.GetSurfaceArea(), mass.GetVolume(), edges.GetOutput().GetBounds()


def centroid(mesh):
    a, b, c = np.moveaxis(oracles.corners(mesh), 1, 0)
    parts = np.einsum("ij,ij->i", a, np.cross(b, c))
    return ((a + b + c) / 4 * parts[:, None]).sum(axis=0) / parts.sum()


@pytest.fixture(scope="module")
def block(data):
    """Part of a head with air round it, which every peer closes."""
    head = volviz.load(data / "ct" / "cranium_head_ct.nrrd")
    inner = head.data[20:60, 90:150, 70:140].astype(np.float32)
    padded = np.pad(inner, 1, constant_values=-1024)
    return volviz.Volume.from_array(padded, spacing=head.spacing, origin=(5, -7, 11))


def test_a_head_measures_as_in_vtk(block):
    report = measure(volviz.extract_surface(block, -300.0))
    area, inside, bounds = flying_edges(block, -300.0)
    assert report.closed
    assert report.area == pytest.approx(area, rel=5e-3)  # its table cuts ambiguous cells otherwise
    assert report.volume == pytest.approx(inside, rel=1e-3)
    assert np.allclose(np.ravel([report.low, report.high], order="F"), bounds, atol=1e-4)


def test_a_head_measures_as_its_label_in_simpleitk(block):
    """Voxels count whole there: half of those at the surface, on average, lie within half a mm."""
    sitk = pytest.importorskip("SimpleITK")
    image = sitk.GetImageFromArray((block.data >= -300).astype(np.uint8))
    image.SetSpacing(block.spacing)
    image.SetOrigin(tuple(map(float, block.affine[:3, 3])))
    label = sitk.LabelShapeStatisticsImageFilter()
    label.Execute(image)
    mesh = volviz.extract_surface(block, -300.0)
    report = measure(mesh)
    assert report.volume == pytest.approx(label.GetPhysicalSize(1), rel=0.03)
    assert np.allclose(centroid(mesh), label.GetCentroid(1), atol=0.2)
    first, size = np.reshape(label.GetBoundingBox(1), (2, 3))
    low = (first - 0.5) * block.spacing + block.affine[:3, 3]
    high = low + size * np.array(block.spacing)
    assert np.all(np.abs(np.subtract(report.low, low)) <= block.spacing)
    assert np.all(np.abs(np.subtract(report.high, high)) <= block.spacing)


def test_vtk_and_we_come_together_in_second_order():
    gaps = []
    for n in (17, 33, 65):
        ball = sphere(n)
        report = measure(volviz.extract_surface(ball, 0.0))
        area, inside, _ = flying_edges(ball, 0.0)
        true = np.array([4 * np.pi * 0.49, 4 / 3 * np.pi * 0.343])
        ours, theirs = np.array([report.area, report.volume]), np.array([area, inside])
        assert np.all(np.abs(ours - theirs) <= 0.5 * np.abs(true - theirs))
        gaps.append(np.abs(true - ours))
    assert np.all(np.array(gaps[:-1]) / np.array(gaps[1:]) > 3.2)
