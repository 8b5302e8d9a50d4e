"""A scene's surface as a file, for the window: on a worker, like everything that takes long."""

from __future__ import annotations

from pathlib import Path

from volviz.errors import UsageError
from volviz.io.mesh_files import FORMATS, check_mesh_path, save_mesh
from volviz.model.mesh import Mesh
from volviz.model.volume import VolumeInfo
from volviz.progress import Progress

COLORED = (".ply", ".obj", ".glb")
"""Formats that keep the colours of vertices."""


def problem(path: Path) -> str:
    """Why no mesh can be written under this name, "" if one can."""
    try:
        check_mesh_path(path)
    except UsageError:
        return f"The name must end in {', '.join(FORMATS)}"
    return ""


def write(mesh: Mesh, path: Path, info: VolumeInfo, overwrite: bool, progress: Progress) -> None:
    """As `save_mesh`: whole or not at all. Raises UsageError, OutputError, Cancelled.

    info: of the volume it comes from, which says whether its lengths are millimetres.
    """
    unit = "mm" if info.length_unit else None
    save_mesh(mesh, path, overwrite=overwrite, progress=progress, unit=unit)
