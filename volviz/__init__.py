"""volviz: see inside 3D data.

    import volviz
    scene = volviz.Scene.of(volviz.load("head.nrrd"))
    volviz.render(scene, size=(800, 600)).save("head.png")

Importing this loads numpy and nothing heavier; the rest comes in on first use.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from volviz._version import __version__
from volviz.errors import VolvizError

if TYPE_CHECKING:
    from volviz.classify.presets import presets
    from volviz.image import Image
    from volviz.io import load, probe
    from volviz.io.mesh_files import save_mesh
    from volviz.io.write import save_volume
    from volviz.isosurface import extract_surface
    from volviz.lab.compare import compare
    from volviz.model.camera import Camera
    from volviz.model.grids import TetMesh
    from volviz.model.mesh import Mesh
    from volviz.model.scene import Background, Light, Raycast
    from volviz.model.surface import Surface
    from volviz.model.surface_look import SceneSurface
    from volviz.model.transfer import TransferFunction
    from volviz.model.volume import Volume, VolumeInfo
    from volviz.progress import Progress
    from volviz.samples import sample
    from volviz.scene import Scene, render
    from volviz.ui.window import view

_HOMES = {
    "Background": "volviz.model.scene",
    "Camera": "volviz.model.camera",
    "Image": "volviz.image",
    "Light": "volviz.model.scene",
    "Mesh": "volviz.model.mesh",
    "Progress": "volviz.progress",
    "Raycast": "volviz.model.scene",
    "Scene": "volviz.scene",
    "SceneSurface": "volviz.model.surface_look",
    "Surface": "volviz.model.surface",
    "TetMesh": "volviz.model.grids",
    "TransferFunction": "volviz.model.transfer",
    "Volume": "volviz.model.volume",
    "VolumeInfo": "volviz.model.volume",
    "compare": "volviz.lab.compare",
    "extract_surface": "volviz.isosurface",
    "load": "volviz.io",
    "presets": "volviz.classify.presets",
    "probe": "volviz.io",
    "render": "volviz.scene",
    "sample": "volviz.samples",
    "save_mesh": "volviz.io.mesh_files",
    "save_volume": "volviz.io.write",
    "view": "volviz.ui.window",
}

__all__ = [
    "Background",
    "Camera",
    "Image",
    "Light",
    "Mesh",
    "Progress",
    "Raycast",
    "Scene",
    "SceneSurface",
    "Surface",
    "TetMesh",
    "TransferFunction",
    "Volume",
    "VolumeInfo",
    "VolvizError",
    "__version__",
    "compare",
    "extract_surface",
    "load",
    "presets",
    "probe",
    "render",
    "sample",
    "save_mesh",
    "save_volume",
    "view",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'volviz' has no attribute '{name}'")
    value = getattr(import_module(_HOMES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
