"""A scene's surfaces, and its volume if it is shown, drawn by VTK off the screen."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

import volviz
from tests.bench.peers import classified
from volviz.model.surface_look import SceneSurface
from volviz.model.transfer import srgb_to_linear

FINE = 2
"""Pixels along a side of one of the picture: the mean is what both smooth their edges with."""
PHONG = 0.25
"""Of a highlight's exponent: so is Phong's about as wide as Blinn's."""


def draw(scene: volviz.Scene, size: tuple[int, int]) -> tuple[Any, Any, Any]:
    """(pixels, covered, depth) as in `stills.Picture`."""
    import vtk

    window, renderer = _window(vtk, scene, (FINE * size[0], FINE * size[1]))
    image = _image(vtk, scene.volume)
    for surface in scene.surfaces:
        renderer.AddActor(_actor(vtk, image, scene, surface))
    if scene.raycast.show_volume:
        renderer.AddVolume(_volume(vtk, image, scene))
    renderer.ResetCameraClippingRange()
    renderer.SetBackground(0, 0, 0)
    light = _pixels(vtk, window)
    renderer.SetBackground(1, 1, 1)
    covered = 1 - np.clip(_pixels(vtk, window) - light, 0, 1).mean(axis=2)
    for actor in renderer.GetActors():
        actor.GetProperty().SetOpacity(1.0)
    for volume in renderer.GetVolumes():
        volume.VisibilityOff()
    depth = _depth(vtk, window, renderer, scene, size)
    from tests.bench.stills import encoded

    mean = _mean(light, size)
    return encoded(mean), _mean(covered[..., None], size)[..., 0], depth


def _window(vtk: Any, scene: volviz.Scene, size: tuple[int, int]) -> tuple[Any, Any]:
    window, renderer = vtk.vtkRenderWindow(), vtk.vtkRenderer()
    window.SetOffScreenRendering(1)
    window.SetMultiSamples(0)
    window.SetAlphaBitPlanes(1)
    window.SetSize(*size)
    window.AddRenderer(renderer)
    renderer.SetUseDepthPeeling(1)
    renderer.SetUseDepthPeelingForVolumes(1)
    renderer.SetMaximumNumberOfPeels(64)
    renderer.SetOcclusionRatio(0.0)
    lamp = vtk.vtkLight()
    lamp.SetLightTypeToCameraLight()
    lamp.SetPosition(*scene.light.direction())
    lamp.SetFocalPoint(0, 0, 0)
    renderer.SetAutomaticLightCreation(0)
    renderer.AddLight(lamp)
    camera, seen = renderer.GetActiveCamera(), scene.camera
    camera.SetPosition(*seen.position)
    camera.SetFocalPoint(*seen.target)
    camera.SetViewUp(*seen.up)
    camera.SetViewAngle(seen.fov)
    if seen.projection != "perspective":
        camera.ParallelProjectionOn()
        camera.SetParallelScale(seen.height / 2)
    return window, renderer


def _image(vtk: Any, volume: volviz.Volume) -> Any:
    """On its own grid, directions as well; the columns of the affine are at right angles."""
    from vtk.util.numpy_support import numpy_to_vtk

    image = vtk.vtkImageData()
    image.SetDimensions(*volume.dims)
    image.SetSpacing(*volume.spacing)
    image.SetOrigin(*volume.info.origin)
    turn = volume.affine[:3, :3] / np.linalg.norm(volume.affine[:3, :3], axis=0)
    assert np.allclose(turn.T @ turn, np.eye(3), atol=1e-4), "VTK knows no shear"
    image.SetDirectionMatrix(*map(float, turn.ravel()))
    image.GetPointData().SetScalars(numpy_to_vtk(np.ascontiguousarray(volume.data).ravel(), True))
    return image


def _actor(vtk: Any, image: Any, scene: volviz.Scene, surface: SceneSurface) -> Any:
    edges, mapper, actor = vtk.vtkFlyingEdges3D(), vtk.vtkPolyDataMapper(), vtk.vtkActor()
    edges.SetInputData(image)
    edges.SetValue(0, surface.surface.isovalue)
    edges.ComputeNormalsOn()
    mapper.SetInputConnection(edges.GetOutputPort())
    mapper.ScalarVisibilityOff()
    actor.SetMapper(mapper)
    look, made = surface.look, actor.GetProperty()
    made.SetColor(*srgb_to_linear(look.color))
    made.SetOpacity(look.opacity)
    made.SetAmbient(scene.light.ambient)
    made.SetDiffuse(scene.light.diffuse)
    made.SetSpecular(look.highlight)
    made.SetSpecularColor(1, 1, 1)
    made.SetSpecularPower(PHONG * look.gloss)
    {"flat": made.SetInterpolationToFlat, "gouraud": made.SetInterpolationToGouraud}.get(
        look.shading, made.SetInterpolationToPhong
    )()
    made.SetFrontfaceCulling(look.sides == "back")
    made.SetBackfaceCulling(look.sides == "front")
    if look.wireframe == "only":
        made.SetRepresentationToWireframe()
    made.SetLineWidth(FINE)  # one pixel of the picture
    made.SetEdgeVisibility(look.wireframe == "overlay")
    made.SetEdgeColor(*(0.12 * c for c in srgb_to_linear(look.color)))
    return actor


def _volume(vtk: Any, image: Any, scene: volviz.Scene) -> Any:
    mapper, actor = vtk.vtkGPUVolumeRayCastMapper(), vtk.vtkVolume()
    mapper.SetInputData(image)
    mapper.SetAutoAdjustSampleDistances(0)
    mapper.SetLockSampleDistanceToInputSpacing(0)
    mapper.SetSampleDistance(scene.raycast.step * min(scene.volume.spacing) / 2)
    mapper.UseJitteringOn()
    colors = [(value, *srgb_to_linear(tuple(rgb))) for value, *rgb in scene.transfer.colors]
    made = classified(vtk, scene.transfer, colors)
    made.ShadeOff()
    actor.SetMapper(mapper)
    actor.SetProperty(made)
    return actor


def _pixels(vtk: Any, window: Any) -> NDArray[np.float32]:
    """float32[h, w, 3], 0 to 1, row 0 on top."""
    from vtk.util.numpy_support import vtk_to_numpy

    window.Render()
    width, height = window.GetSize()
    taken = vtk.vtkUnsignedCharArray()
    window.GetPixelData(0, 0, width - 1, height - 1, 1, taken, 0)
    return vtk_to_numpy(taken).reshape(height, width, 3)[::-1].astype(np.float32) / 255


def _depth(
    vtk: Any, window: Any, renderer: Any, scene: volviz.Scene, size: tuple[int, int]
) -> NDArray[np.float32]:
    """As in `stills.Picture`, of rays through the middles of the pixels."""
    from vtk.util.numpy_support import vtk_to_numpy

    window.SetSize(*size)
    window.Render()
    taken = vtk.vtkFloatArray()
    window.GetZbufferData(0, 0, size[0] - 1, size[1] - 1, taken)
    z = vtk_to_numpy(taken).reshape(size[1], size[0])[::-1].astype(np.float64)
    near, far = renderer.GetActiveCamera().GetClippingRange()
    wide, high = scene.camera.half(size[0] / size[1])
    if scene.camera.projection != "perspective":
        along = near + z * (far - near)
    else:
        x = (2 * (np.arange(size[0]) + 0.5) / size[0] - 1) * wide
        y = (1 - 2 * (np.arange(size[1]) + 0.5) / size[1]) * high
        along = near * far / (far - z * (far - near))
        along = along * np.sqrt(1 + x[None] ** 2 + y[:, None] ** 2)
    return np.where(z < 1, along, np.inf).astype(np.float32)


def _mean(light: NDArray[np.float32], size: tuple[int, int]) -> NDArray[np.float32]:
    parts = light.reshape(size[1], FINE, size[0], FINE, -1)
    return np.asarray(parts.mean(axis=(1, 3)), dtype=np.float32)
