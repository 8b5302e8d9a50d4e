"""Save Surface As: which surface, as it is drawn, and the file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from volviz.app import mesh_saving
from volviz.model.mesh import Mesh
from volviz.model.surface_look import SceneSurface
from volviz.model.wanted import only_turned
from volviz.progress import Progress
from volviz.ui import widgets

if TYPE_CHECKING:
    from volviz.model.scene import SceneState
    from volviz.resolve_surfaces import Extracted
    from volviz.ui.shell import Shell


@dataclass
class Wish:
    """A surface whose button in the panel was pressed; the window asks for its file then."""

    number: int | None = None


class SurfaceForm:
    """What is chosen besides the file's name."""

    def __init__(self, shell: Shell, number: int = 0) -> None:
        assert shell.app.scene is not None
        self.shell, self.scene = shell, shell.app.scene
        self.number = min(number, len(self.scene.surfaces) - 1)

    @property
    def chosen(self) -> SceneSurface:
        """The surface that is written."""
        return self.scene.surfaces[self.number]

    @property
    def drawn(self) -> Extracted | None:
        """The same as it is drawn, if it is there whole and with all its steps."""
        found = self.shell.viewport.frames.surfaces
        one = found[self.number] if self.number < len(found) else None
        chosen = self.chosen
        if one is None or one.surface != chosen.surface or one.camera is not None:
            return None
        done = one.refining == chosen.refining.acting or not len(one.mesh.faces)
        return one if done and not chosen.surface.level_pixels else None

    def name(self) -> str:
        """The first name that is offered."""
        folder = Path(self.shell.app.settings.folder or Path.cwd())
        folder = folder if folder.is_dir() else Path.cwd()
        return str(folder / f"{self.shell.stem()}-{self.chosen.surface.isovalue:g}.stl")

    def draw(self) -> None:
        """The rows of the form, into the current window."""
        with widgets.form("surface.file", ["Surface"]) as shown:
            if shown:
                widgets.label("Surface")
                options = [
                    ("", str(i), f"{i + 1}: {s.surface.isovalue:g}", "Write this one.")
                    for i, s in enumerate(self.scene.surfaces)
                ]
                text = "Which of the scene's surfaces is written."
                now = str(self.number)
                picked = widgets.choice(
                    "surface.file.number", text, now, options, shown=options[self.number][2]
                )
                self.number = int(picked)

    def problem(self, path: Path) -> str:
        """Why this cannot be written there, "" if it can."""
        points = self.chosen.surface.method == "dividing-cubes"
        if points and path.suffix.lower() != ".ply":
            return "Points without triangles are only written as .ply"
        return mesh_saving.problem(path)

    def told(self) -> str:
        """What is written, as far as it is known."""
        found, steps = self.drawn, self.chosen.refining.text
        if found is None:
            whole = "Made whole" if only_turned(self.chosen.surface, self.scene.lens) else "Made"
            return f"{whole} for the file{', then: ' if steps else ''}{steps}"
        count = f"{len(found.mesh.faces):,} triangles"
        if not len(found.mesh.faces):
            return f"{len(found.mesh.vertices):,} points, as they are drawn"
        after = f": {steps}" if steps else "; smooth or decimate them in the Surfaces panel"
        return f"{count}, as they are drawn{after}"

    def save(self, path: Path, *, overwrite: bool) -> None:
        """Begin to write it; the window goes on."""
        scene, chosen, found = self.scene, self.chosen, self.drawn
        work = _work(scene, chosen, found, path=path, overwrite=overwrite)
        self.shell.exports.write_surface(path, work)


def _work(
    scene: SceneState,
    chosen: SceneSurface,
    found: Extracted | None,
    *,
    path: Path,
    overwrite: bool,
) -> Callable[[Progress], Mesh]:
    def work(progress: Progress) -> Mesh:
        from volviz.isosurface import extract  # bring the compiler with them
        from volviz.meshes.refine import refine

        if found is not None:
            mesh = found.mesh
        else:
            mesh = extract(scene.volume, chosen.surface, progress.part(0, 0.3))
            mesh = refine(mesh, chosen.refining, progress.part(0.3, 0.7))
        if chosen.look.coloring == "field" and path.suffix.lower() in mesh_saving.COLORED:
            mesh = _colored(mesh, scene, chosen, progress.part(0.7, 0.8))
        mesh_saving.write(mesh, path, scene.volume.info, overwrite, progress.part(0.8, 1.0))
        return mesh

    return work


def _colored(mesh: Mesh, scene: SceneState, chosen: SceneSurface, progress: Progress) -> Mesh:
    """With the colours of its second field, as they are drawn."""
    from volviz.surface_colors import field_values, painted, span_of

    values = field_values(scene.volume, chosen.look.color_field, mesh, progress)
    return painted(mesh, values, chosen.look, span_of(values), scene.transfer)
