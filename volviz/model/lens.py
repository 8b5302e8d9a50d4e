"""View-dependent surfaces: a lens of full resolution, dragged over them; and what they depend on.

The lens is part of the scene. A surface that depends on where it is looked at from is made for a
`Viewing`, which is no part of the scene: whoever draws the scene puts it there (`seen`).
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from volviz.model.camera import Camera, Vec3
from volviz.model.knobs import check_knobs, knob
from volviz.model.surface import Surface

METHOD = "marching-cubes"
"""The method that a lens is for; surfaces of others stay whole."""
SIZE = (800, 600)
"""Of the picture where nobody says it."""


@dataclass(frozen=True)
class Lens:
    """Where surfaces are seen at full resolution, and how coarse they may be elsewhere."""

    lens: bool = knob(
        False,
        "surfaces at full resolution round a focus only, coarser away from it, and only what this "
        "camera sees of them (marching cubes)",
    )
    lens_x: float = knob(0.0, "focus of the lens: x in the world", unit="mm")
    lens_y: float = knob(0.0, "focus of the lens: y in the world", unit="mm")
    lens_z: float = knob(0.0, "focus of the lens: z in the world", unit="mm")
    lens_radius: float = knob(
        0.1, "full resolution so far round the focus", low=0, high=1, unit="volume's diagonal"
    )
    lens_growth: float = knob(
        0.08,
        "side of a cell against its distance beyond the lens; 0: full resolution everywhere",
        low=0,
        high=1,
    )
    lens_pixels: float = knob(
        1.0, "no cell is smaller than this in the picture", low=0, high=64, unit="pixels"
    )

    def __post_init__(self) -> None:
        check_knobs(self)

    @property
    def focus(self) -> Vec3:
        """World mm."""
        return self.lens_x, self.lens_y, self.lens_z


@dataclass(frozen=True)
class Viewing:
    """What a surface is looked at with. size: width, height of the picture in pixels.

    opaque: nothing is seen through the surface, so that what it hides need not be made.
    """

    camera: Camera
    size: tuple[int, int] = SIZE
    lens: Lens = Lens()
    opaque: bool = True


@dataclass(frozen=True)
class SeenSurface(Surface):
    """A surface as one camera sees it."""

    viewing: Viewing | None = None


def seen(surface: Surface, viewing: Viewing) -> Surface:
    """What to make of a surface in this picture: itself, where that does not depend on it."""
    lensed = viewing.lens.lens and surface.method == METHOD
    if not lensed and not surface.level_pixels and not by_view(surface):
        return surface
    if not lensed:
        viewing = Viewing(viewing.camera, viewing.size)
    return SeenSurface(
        **{f.name: getattr(surface, f.name) for f in fields(Surface)}, viewing=viewing
    )


def by_view(surface: Surface) -> bool:
    """True if the camera decides how small its parts are, or which of them are left out."""
    blocks = surface.method == "cuberille"
    by_pixels = surface.size_pixels > 0 and (blocks or surface.method == "dividing-cubes")
    return by_pixels or (surface.front_faces and blocks)


def plain(surface: Surface) -> Surface:
    """What is to be made, whoever looks at it."""
    if type(surface) is Surface:
        return surface
    return Surface(**{f.name: getattr(surface, f.name) for f in fields(Surface)})


def reach(diagonal: float, lens: Lens) -> float:
    """mm round the focus within which the resolution is full."""
    return float(np.float64(lens.lens_radius) * diagonal)
