"""What is done to a mesh after extraction, in this order: welded, parts dropped, smoothed,
decimated, turned inside out."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from volviz.meshes.attributes import faces_kept
from volviz.meshes.components import largest_component, without_islands
from volviz.meshes.decimate import decimate
from volviz.meshes.normals import turned
from volviz.meshes.smooth import smooth
from volviz.meshes.weld import weld
from volviz.model.mesh import Mesh
from volviz.model.refining import Refining
from volviz.progress import Progress, silent

Step = Callable[[Mesh, Refining, Progress], Mesh]


def _welded(mesh: Mesh, steps: Refining, progress: Progress) -> Mesh:
    return weld(mesh, steps.weld, progress) if steps.weld else mesh


def _largest(mesh: Mesh, steps: Refining, progress: Progress) -> Mesh:
    return largest_component(mesh, progress) if steps.keep_largest else mesh


def _no_islands(mesh: Mesh, steps: Refining, progress: Progress) -> Mesh:
    if steps.min_triangles or steps.min_area:
        return without_islands(mesh, steps.min_triangles, steps.min_area, progress)
    return mesh


def _smoothed(mesh: Mesh, steps: Refining, progress: Progress) -> Mesh:
    fixed = steps.boundary == "fixed"
    return smooth(mesh, steps.smooth, fixed_boundary=fixed, progress=progress)


def _decimated(mesh: Mesh, steps: Refining, progress: Progress) -> Mesh:
    if not steps.decimate and not steps.max_error:
        return mesh
    return decimate(
        mesh,
        steps.decimate or 1.0,
        max_error=steps.max_error,
        boundary=steps.boundary,
        progress=progress,
    )


def _turned(mesh: Mesh, steps: Refining, progress: Progress) -> Mesh:
    return turned(mesh) if steps.flip else mesh


# what is done: how
STEPS: dict[str, Step] = {
    "welding": _welded,
    "keeping the largest part": _largest,
    "dropping islands": _no_islands,
    "smoothing": _smoothed,
    "decimating": _decimated,
    "turning inside out": _turned,
}


def refine(mesh: Mesh, steps: Refining, progress: Progress | None = None) -> Mesh:
    """The mesh after all steps that are asked for; itself if none is. Raises Cancelled."""
    progress = progress or silent()
    if not len(mesh.faces):
        return turned(mesh) if steps.flip else mesh
    for k, (name, step) in enumerate(STEPS.items()):
        share = progress.part(k / len(STEPS), (k + 1) / len(STEPS))
        share(0.0, name)
        mesh = step(mesh, steps, share)
        if not len(mesh.faces):  # nothing is left, not even a vertex to be drawn as a point
            return faces_kept(mesh, np.zeros(0, bool))
    return mesh


_prepared: set[Refining] = set()


def prepare(steps: Refining) -> None:
    """Compile what these steps need on a tiny mesh, so that no measured time has it."""
    few = Refining(
        weld=1e-6 if steps.weld else 0.0,
        keep_largest=steps.keep_largest,
        min_triangles=1 if steps.min_triangles or steps.min_area else 0,
        smooth=1 if steps.smooth else 0,
        decimate=0.5 if steps.decimate or steps.max_error else 0.0,
        max_error=1.0 if steps.max_error else 0.0,
        boundary=steps.boundary,
    )
    if few in _prepared:
        return
    ends = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1]], np.float32)
    faces = [(x, y, z) for x in (0, 3) for y in (1, 4) for z in (2, 5)]
    vertices = np.concatenate([ends, -ends])
    refine(Mesh(vertices, np.array(faces, np.uint32), vertices), few)
    _prepared.add(few)
