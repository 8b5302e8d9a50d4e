"""What a picture decides of a surface: how small its parts are, and which faces turn away."""

from __future__ import annotations

from typing import Any

import numpy as np

from volviz.errors import UsageError
from volviz.isosurface.cells import Grid
from volviz.isosurface.extractors.dividing_cubes import pixel_size
from volviz.model.camera import Camera
from volviz.model.lens import SeenSurface, by_view
from volviz.model.surface import Surface
from volviz.model.volume import Volume

FINEST = 16
"""Parts of a voxel's longest side that cuberille's faces are at least."""


def knobs_by_view(volume: Grid, surface: Surface) -> dict[str, Any]:
    """Arguments of its extractor, instead of those of the knobs; none where no picture decides.

    dividing-cubes divides each cell as the camera is near it. All faces of cuberille have one
    size, that of the nearest corner of the volume. Raises UsageError for a surface of no picture.
    """
    if not by_view(surface) or not isinstance(volume, Volume):
        return {}
    viewing = surface.viewing if isinstance(surface, SeenSurface) else None
    if viewing is None:
        pixels = surface.size_pixels > 0
        raise UsageError(
            f"{'a size in pixels' if pixels else 'a front'} needs a camera",
            field="--size-pixels" if pixels else "--front-faces",
            fix="give --size in mm" if pixels else "draw it in a picture",
        )
    found: dict[str, Any] = {}
    if surface.size_pixels:
        across = min(viewing.size) / surface.size_pixels
        if surface.method == "dividing-cubes":
            found |= {"camera": viewing.camera, "pixels": across}
        else:
            found["size"] = _nearest(volume, viewing.camera, across)
    if surface.method == "cuberille" and surface.front_faces:
        found["front_faces"] = viewing.camera
    return found


def _nearest(volume: Volume, camera: Camera, pixels: float) -> float:
    """mm of a pixel at the nearest corner of the volume in front of the camera."""
    ends = np.array(np.meshgrid(*((0, n - 1) for n in volume.dims))).reshape(3, -1).T
    corners = ends @ volume.affine[:3, :3].T + volume.affine[:3, 3]
    least = max(volume.spacing) / FINEST
    widths = pixel_size(camera, pixels, corners)
    if not np.isfinite(widths).all():  # the camera is within it
        return least
    return max(float(widths.min()), least)
