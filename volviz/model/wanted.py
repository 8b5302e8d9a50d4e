"""What is to be made for a surface in one picture: its mesh, and what is done to that."""

from __future__ import annotations

from dataclasses import dataclass, field

from volviz.model.lens import METHOD, Lens, SeenSurface, Viewing, seen
from volviz.model.refining import Refining
from volviz.model.surface import Surface
from volviz.model.surface_look import SceneSurface


@dataclass(frozen=True)
class Wanted:
    """A mesh that a picture needs. surface: as the camera sees it, if that decides anything.

    refining: the steps that are done, `done_to`.
    """

    surface: Surface
    refining: Refining = field(default_factory=Refining)

    @property
    def isovalue(self) -> float:
        """Of the surface."""
        return self.surface.isovalue

    @property
    def by_camera(self) -> bool:
        """True if it is another one for another camera."""
        return isinstance(self.surface, SeenSurface)

    @property
    def extracted(self) -> Wanted:
        """The same before anything is done to it."""
        return Wanted(self.surface)


def wanted(surface: SceneSurface, viewing: Viewing) -> Wanted:
    """What is to be made of a surface in this picture."""
    return Wanted(seen(surface.surface, viewing), done_to(surface, viewing.lens))


def done_to(surface: SceneSurface, lens: Lens) -> Refining:
    """The steps of a surface that are done where it is drawn: all of them, where `only_turned`
    knows no reason against it. Equal ones make equal meshes."""
    steps = surface.refining
    return steps.turning if only_turned(surface.surface, lens) else steps.acting


def only_turned(surface: Surface, lens: Lens) -> str:
    """Why a surface is drawn without the steps that need it whole, "" if they are done."""
    if surface.method == "dividing-cubes":
        return "points have no triangles"
    if lens.lens and surface.method == METHOD:
        return "under the lens only a part of it is there"
    if surface.front_faces and surface.method == "cuberille":
        return "only its front faces are there"
    return ""
