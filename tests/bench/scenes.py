"""What is measured: a volume, points of a transfer function, a camera; the same for every peer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import volviz
from volviz.model.camera import Camera
from volviz.model.scene import Background, Light, Raycast
from volviz.model.transfer import TransferFunction
from volviz.model.views import volume_camera
from volviz.scene import Scene
from volviz.sources import open_volume

DATA = Path(__file__).resolve().parents[2].parent / "shared" / "data"
LIGHT = Light(0.1, 0.9, 0.2, 10.0, 0.0, 0.0)
BACKGROUND = Background.plain((0.1, 0.1, 0.15))


@dataclass(frozen=True)
class Case:
    """sample_mm: distance between samples; values in the volume's units."""

    name: str
    volume: Callable[[], volviz.Volume]
    transfer: TransferFunction
    sample_mm: float
    view: tuple[str, float, float] = ("anterior", 15.0, 15.0)
    shaded: bool = True
    zoom: float = 1.0

    def scene(self) -> Scene:
        volume = self.volume()
        step = self.sample_mm / min(volume.spacing)
        cast = Raycast(
            step=step, shading="blinn-phong" if self.shaded else "none", samples=1, jitter=1.0
        )
        name, azimuth, elevation = self.view
        camera = volume_camera(volume, name, azimuth=azimuth, elevation=elevation, zoom=self.zoom)
        return Scene(volume, self.transfer, camera, cast, LIGHT, BACKGROUND)


def _file(name: str) -> Callable[[], volviz.Volume]:
    return lambda: volviz.load(DATA / name)


# the points of the familiar CT-Bone preset (3D Slicer), as the anchor pictures were made
CT_BONE = TransferFunction(
    (
        (-3024, 0, 0, 0),
        (-16.446, 0.729, 0.255, 0.302),
        (641.385, 0.906, 0.816, 0.553),
        (3071, 1, 1, 1),
    ),
    ((-3024, 0), (-16.446, 0), (641.385, 0.716), (3071, 0.706)),
)
OPAQUE = TransferFunction(
    ((0, 0.3, 0.2, 0.1), (90, 0.7, 0.5, 0.3), (255, 1, 1, 0.9)),
    ((0, 0), (60, 0), (90, 0.9), (255, 1)),
)
TRANSLUCENT = TransferFunction(
    ((0, 0.1, 0.1, 0.6), (128, 0.9, 0.5, 0.1), (255, 1, 1, 1)), ((0, 0), (20, 0), (255, 0.25)), 2.0
)
FOG = TransferFunction(((0, 0.2, 0.3, 0.8), (255, 1, 0.9, 0.7)), ((0, 0.002), (255, 0.02)))

CASES = {
    "ct-bone": Case("ct-bone", _file("ct/cranium_head_ct.nrrd"), CT_BONE, 0.5, zoom=1.4),
    "bonsai-opaque": Case("bonsai-opaque", _file("classics/bonsai_256.nii.gz"), OPAQUE, 0.5),
    "heptane-translucent": Case(
        "heptane-translucent",
        _file("simulation/heptane_302.nii.gz"),
        TRANSLUCENT,
        0.5,
        shaded=False,
    ),
    "mri-fog": Case("mri-fog", _file("mri/ch2_colin27_t1.nii.gz"), FOG, 0.5, shaded=False),
    "sample-head": Case("sample-head", lambda: open_volume("sample:ct-head"), CT_BONE, 0.5),
}


def camera_numbers(camera: Camera) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """Position, target, up, angle for a peer (square pictures)."""
    return (
        np.array(camera.position),
        np.array(camera.target),
        np.array(camera.up),
        camera.fov,
    )
