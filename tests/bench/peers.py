"""volviz and VTK's two volume mappers behind one signature: draw(sample distance) -> pixels."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from tests.bench.scenes import BACKGROUND, LIGHT, Case, camera_numbers
from volviz.gpu.contexts import shared_gpu
from volviz.model.transfer import TransferFunction
from volviz.model.volume import Volume
from volviz.resolve import resolve
from volviz.scene import Scene, renderer_of, texture_limits


def classified(vtk: Any, transfer: TransferFunction, colors: Iterable[tuple[float, ...]]) -> Any:
    """A vtkVolumeProperty with the transfer function's opacities and these (value, r, g, b)."""
    color, opacity = vtk.vtkColorTransferFunction(), vtk.vtkPiecewiseFunction()
    for point in colors:
        color.AddRGBPoint(*point)
    for point in transfer.opacities:
        opacity.AddPoint(*point)
    made = vtk.vtkVolumeProperty()
    made.SetColor(color)
    made.SetScalarOpacity(opacity)
    made.SetScalarOpacityUnitDistance(transfer.unit_distance)
    made.SetInterpolationTypeToLinear()
    return made


class Volviz:
    """Our renderer, one jittered sample a pixel, as the window draws its first full frame."""

    name = "volviz"

    def __init__(self, case: Case, scene: Scene, size: int, threads: int) -> None:
        self.gpu = shared_gpu()
        self.renderer = renderer_of(self.gpu)
        self.scene, self.size, self.case = scene, size, case
        self.limits = texture_limits(self.gpu)

    def draw(self, sample_mm: float, samples: int = 1) -> np.ndarray:
        self.gpu.activate()
        step = sample_mm / min(self.scene.volume.spacing)
        scene = replace(self.scene, raycast=replace(self.scene.raycast, step=step))
        frame = resolve(scene, limits=self.limits)
        size = (self.size, self.size)
        return self.renderer.image(frame, size, samples=samples)[..., :3]

    def reference(self) -> np.ndarray:
        """Steps of an eighth, no jitter, rays through the middle of each pixel."""
        step = self.case.sample_mm / 8 / min(self.scene.volume.spacing)
        cast = replace(self.scene.raycast, step=step, jitter=0.0, termination=1.0)
        frame = resolve(replace(self.scene, raycast=cast), limits=self.limits)
        return self.renderer.image(frame, (self.size, self.size), samples=1)[..., :3]


def upright(volume: Volume) -> Volume:
    """The same volume stored along the world axes: the FixedPoint mapper knows no directions and
    would draw nothing. Only for volumes that are not oblique."""
    assert np.allclose(np.abs(volume.affine[:3, :3]), np.diag(volume.spacing))
    data, affine = volume.data, volume.affine.copy()
    for axis in range(3):
        if affine[axis, axis] < 0:
            data = np.flip(data, 2 - axis)
            affine[axis, 3] += affine[axis, axis] * (volume.dims[axis] - 1)
            affine[axis, axis] *= -1
    return Volume.from_array(data, affine=affine)


class Vtk:
    """A VTK mapper on the same voxels, matrices, points and light."""

    def __init__(self, case: Case, scene: Scene, size: int, threads: int) -> None:
        import vtk
        from vtk.util.numpy_support import numpy_to_vtk

        self.vtk, self.case, self.size = vtk, case, size
        volume = upright(scene.volume)
        image = vtk.vtkImageData()
        image.SetDimensions(*volume.dims)
        image.SetSpacing(*volume.spacing)
        image.SetOrigin(*volume.info.origin)
        self._array = numpy_to_vtk(volume.data.ravel())
        image.GetPointData().SetScalars(self._array)
        self.mapper = self._mapper(threads)
        self.mapper.SetInputData(image)
        actor = vtk.vtkVolume()
        actor.SetMapper(self.mapper)
        actor.SetProperty(self._property(scene))
        self.window = vtk.vtkRenderWindow()
        self.window.SetOffScreenRendering(1)
        self.window.SetMultiSamples(0)
        self.window.SetSize(size, size)
        renderer = vtk.vtkRenderer()
        renderer.SetBackground(*BACKGROUND.top[:3])
        renderer.AddVolume(actor)
        self.window.AddRenderer(renderer)
        position, target, up, angle = camera_numbers(scene.camera)
        camera = renderer.GetActiveCamera()
        camera.SetPosition(*position)
        camera.SetFocalPoint(*target)
        camera.SetViewUp(*up)
        camera.SetViewAngle(angle)
        renderer.ResetCameraClippingRange()

    def _property(self, scene: Scene):
        vtk = self.vtk
        made = classified(vtk, scene.transfer, scene.transfer.colors)
        made.SetShade(self.case.shaded)
        made.SetAmbient(LIGHT.ambient)
        made.SetDiffuse(LIGHT.diffuse)
        made.SetSpecular(LIGHT.specular)
        made.SetSpecularPower(LIGHT.exponent)
        return made

    def draw(self, sample_mm: float, samples: int = 1) -> np.ndarray:
        from vtk.util.numpy_support import vtk_to_numpy

        self.mapper.SetSampleDistance(sample_mm)
        self.window.Render()
        taken = self.vtk.vtkUnsignedCharArray()
        self.window.GetPixelData(0, 0, self.size - 1, self.size - 1, 1, taken, 0)
        return vtk_to_numpy(taken).reshape(self.size, self.size, 3)[::-1].copy()

    def reference(self) -> np.ndarray:
        return self.draw(self.case.sample_mm / 8)


class VtkGpu(Vtk):
    """vtkGPUVolumeRayCastMapper."""

    name = "VTK GPU mapper"

    def _mapper(self, threads: int):
        mapper = self.vtk.vtkGPUVolumeRayCastMapper()
        mapper.SetAutoAdjustSampleDistances(0)
        mapper.SetLockSampleDistanceToInputSpacing(0)
        return mapper


class VtkFixedPoint(Vtk):
    """vtkFixedPointVolumeRayCastMapper, on the CPU with its own threads."""

    name = "VTK FixedPoint"

    def _mapper(self, threads: int):
        mapper = self.vtk.vtkFixedPointVolumeRayCastMapper()
        mapper.SetAutoAdjustSampleDistances(0)
        mapper.SetInteractiveSampleDistance(self.case.sample_mm)
        mapper.SetNumberOfThreads(threads)
        return mapper


PEERS = {peer.name: peer for peer in (Volviz, VtkGpu, VtkFixedPoint)}
