"""The isosurfaces of a scene as meshes: made once, kept while they are in use.

What is done to a mesh after extraction is kept apart from it, so that turning that does not
extract again. Both take their time, so the window asks for what is there (`known`) and has the rest
made on a worker (`make`); the command line waits.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from volviz.fields.reduce import reduced
from volviz.model.camera import Camera
from volviz.model.frame import DrawnMesh
from volviz.model.lens import SIZE, SeenSurface, Viewing, plain
from volviz.model.levels import Level, coarser, keep_coarser
from volviz.model.mesh import Mesh
from volviz.model.refining import Refining
from volviz.model.scene import SceneState
from volviz.model.surface import Surface
from volviz.model.surface_look import BY_TRANSFER, SceneSurface, SurfaceLook
from volviz.model.transfer import TransferFunction
from volviz.model.volume import Volume
from volviz.model.wanted import Wanted, done_to, only_turned, wanted
from volviz.progress import Progress, silent
from volviz.surface_colors import Sampled, painted, sampled

if TYPE_CHECKING:
    from volviz.isosurface.adaptive import Culled

KEPT = 6
"""Meshes besides those of the scene that undo and a slider's way back may want."""
FEW = 40_000
"""Triangles that even a processor draws many times a second; larger meshes get a coarse one."""
LEVELS, MEASURED = 5, 20_000
"""Levels of detail of a mesh, itself among them; vertices at which their errors are measured."""
STAND_IN = 96
"""Samples along a side that are left for what stands in for a surface under a lens."""
COMPILING = "preparing fast kernels, once"


@dataclass(frozen=True, eq=False)
class Extracted:
    """An isosurface of a volume. coarse: a lighter one of the same, for while things move; the mesh
    itself where it is light. seconds: that the extraction took. fields: second ones, by name.
    camera: of a surface under a lens, the only one that it is whole for; for others coarse stands
    in. culled: what it was spared. order: uint32[faces], the number of each face as it was
    extracted, None for those numbers. refining: what was done to it, in `refined` seconds; before:
    without that, None if it was nothing."""

    surface: Surface
    mesh: Mesh
    coarse: Mesh
    seconds: float
    fields: Mapping[str, Sampled] = field(default_factory=dict)
    camera: Camera | None = None
    culled: Culled | None = None
    order: NDArray[np.uint32] | None = None
    refining: Refining = field(default_factory=Refining)
    refined: float = 0.0
    before: Extracted | None = None

    @property
    def as_extracted(self) -> Mesh:
        """The mesh as `isosurface.extract` made it, its faces in that order."""
        if self.order is None:
            return self.mesh
        faces = np.empty_like(self.mesh.faces)
        faces[self.order] = self.mesh.faces
        return replace(self.mesh, faces=faces)


class Extractions:
    """What was extracted from one volume; for any thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._found: dict[Wanted, Extracted] = {}
        self._smaller: dict[int, Volume] = {}
        self._making = threading.Lock()
        self._stand_in: tuple[Surface | None, Mesh] = None, Mesh(np.empty((0, 3), np.float32))
        self._levels: WeakKeyDictionary[Mesh, Extracted] = WeakKeyDictionary()

    def get(self, wanted: Wanted) -> Extracted | None:
        """The surface if it was made; it is then the last to be dropped."""
        with self._lock:
            found = self._found.pop(wanted, None)
            if found is not None:
                self._found[wanted] = found
            return found

    def make(
        self,
        volume: Volume,
        wanted: Wanted,
        progress: Progress,
        fields: Collection[str] = (),
    ) -> Extracted:
        """The surface with these second fields, made now unless it is there.

        One is made at a time; who waits for another one hears a cancel.
        """
        while not self._making.acquire(timeout=0.1):
            progress(None, "waiting for another surface")
        try:
            found = self._made(volume, wanted, progress.part(0, 0.7 if fields else 1))
            for name in sorted(set(fields) - found.fields.keys()):
                more = sampled(volume, name, found.mesh, found.coarse, progress.part(0.7, 1))
                found = replace(found, fields={**found.fields, name: more})
                self._keep(wanted, found)
            return found
        finally:
            self._making.release()

    def _keep(self, wanted: Wanted, found: Extracted) -> None:
        with self._lock:
            self._found[wanted] = found

    def keep(self, wanted: Sequence[Wanted]) -> None:
        """Drop the oldest of those that are not wanted (`wanted_of`), nor refined for them."""
        used = {*wanted, *(w.extracted for w in wanted)}
        with self._lock:
            others = [w for w in self._found if w not in used]
            for one in others[: max(len(others) - KEPT, 0)]:
                del self._found[one]

    def _made(self, volume: Volume, wanted: Wanted, progress: Progress) -> Extracted:
        found = self.get(wanted)
        if found is None:
            refines = wanted.refining != Refining()
            whole, part = progress, progress.part(0, 0.5 if refines else 1)
            if refines:
                before = self._made(volume, wanted.extracted, part)
                found = self._refined(before, wanted.refining, whole.part(0.5, 1))
            else:
                found = self._extracted(volume, wanted.surface, part)
            self._keep(wanted, found)
        return found

    def _refined(self, before: Extracted, steps: Refining, progress: Progress) -> Extracted:
        """The same after these steps, its stand-in after about the same ones."""
        from volviz.meshes.refine import prepare, refine  # bring the compiler with them

        with self._lock:
            there = list(self._found.values())
        for known in there:  # another camera, but the same level
            if known.before is before and known.refining == steps:
                return known
        progress(None, COMPILING)
        prepare(steps)
        start = time.perf_counter()
        given = before.as_extracted
        made = refine(given, steps, progress.part(0, 0.9))
        seconds = time.perf_counter() - start
        mesh, order = (before.mesh, before.order) if made is given else _gathered(made)
        coarse = mesh
        if before.camera is not None or len(mesh.faces) > FEW:
            factor = max(float(np.sqrt(len(given.faces) / max(len(before.coarse.faces), 1))), 1.0)
            coarse = refine(before.coarse, steps.coarser(factor), progress.part(0.9, 1))
        fresh = {"fields": {}, "refining": steps, "refined": seconds, "before": before}
        light = mesh if coarse.empty else coarse
        return replace(before, mesh=mesh, coarse=light, order=order, **fresh)  # type: ignore[arg-type]

    def _extracted(self, volume: Volume, surface: Surface, progress: Progress) -> Extracted:
        from volviz.isosurface import extract  # brings the compiler with it

        warm(volume, surface, progress)
        if isinstance(surface, SeenSurface) and surface.viewing and surface.viewing.lens.lens:
            return self._under_lens(volume, surface, surface.viewing, progress.part(0.1, 1.0))
        start = time.perf_counter()
        mesh = extract(volume, surface, progress.part(0.1, 0.9))
        seconds, level = time.perf_counter() - start, mesh
        if level in self._levels:  # another camera, but the same level: it is on the GPU
            return self._levels[level]
        mesh, order = _gathered(mesh)
        factor = int(np.ceil(np.sqrt(len(mesh.faces) / FEW)))
        coarse = mesh
        if factor > 1 and min(volume.dims) >= 4 * factor:
            smaller = self._reduced(volume, factor, progress.part(0.9, 0.95))
            coarse = extract(smaller, _finest(surface), progress.part(0.95, 1.0))
        coarse = mesh if coarse.empty else coarse
        found = Extracted(plain(surface), mesh, coarse, seconds, order=order)
        if isinstance(surface, SeenSurface):
            self._levels[level] = found
        return found

    def _under_lens(
        self, volume: Volume, surface: SeenSurface, viewing: Viewing, progress: Progress
    ) -> Extracted:
        """For one picture; from elsewhere, what can be made quickly is seen until that follows."""
        from volviz.isosurface import adaptive, extract

        made = adaptive.extract(volume, surface, progress.part(0.0, 0.8))
        whole = _finest(surface)
        key, coarse = self._stand_in
        if key != whole:
            factor = -(-max(volume.dims) // STAND_IN)
            smaller = self._reduced(volume, factor, progress.part(0.8, 0.9))
            coarse = extract(smaller, whole, progress.part(0.9, 1.0))
            self._stand_in = whole, coarse
        mesh, order = _gathered(made.mesh)
        seconds, seen_by = made.culled.seconds, viewing.camera
        return Extracted(
            plain(surface), mesh, coarse, seconds, camera=seen_by, culled=made.culled, order=order
        )

    def _reduced(self, volume: Volume, factor: int, progress: Progress) -> Volume:
        if factor not in self._smaller:
            self._smaller[factor] = reduced(volume, (factor,) * 3, progress=progress)
        return self._smaller[factor]


def without_levels(found: Sequence[Extracted | None]) -> list[Mesh]:
    """Heavy meshes for which there are no coarser levels yet; those under a lens need none."""
    heavy = [f.mesh for f in found if f and f.camera is None and len(f.mesh.faces) > FEW]
    return [m for m in dict.fromkeys(heavy) if not coarser(m)]


def make_levels(mesh: Mesh, progress: Progress) -> None:
    """Coarser levels, to be drawn while things move; kept with the mesh, a third of its size."""
    from volviz.meshes.lod import levels_of  # brings the compiler with it

    made = levels_of(mesh, LEVELS, samples=MEASURED, progress=progress)
    # one that cannot be made coarser has itself
    keep_coarser(mesh, made[1:] or [Level(replace(mesh), 0.0)])


def _finest(surface: Surface) -> Surface:
    """The surface at the volume's own resolution, whoever looks at it."""
    values = {"level": 0, "level_pixels": 0.0, "size_pixels": 0.0, "front_faces": False}
    return plain(replace(surface, **values))  # type: ignore[arg-type]  # names and types are its


def _gathered(mesh: Mesh) -> tuple[Mesh, NDArray[np.uint32] | None]:
    """The same mesh, its triangles along a Z-order curve (Morton 1966) through 32³ blocks: so
    neighbours are drawn together, or left out together; and which of the given ones each is."""
    if not len(mesh.faces):
        return mesh, None
    low, high = mesh.bounds
    scale = 31.999 / np.maximum(high - low, 1e-30)
    cells = ((mesh.vertices[mesh.faces[:, 0]] - low) * scale).astype(np.uint8)
    spread = np.array([sum((i >> b & 1) << 3 * b for b in range(5)) for i in range(32)], np.uint16)
    curve = spread[cells[:, 0]] | spread[cells[:, 1]] << 1 | spread[cells[:, 2]] << 2
    order = np.argsort(curve, kind="stable")
    return replace(mesh, faces=mesh.faces[order]), order.astype(np.uint32)


_warmed: set[Any] = set()


def warm(volume: Volume, surface: Surface, progress: Progress) -> None:
    """Compile on a tiny volume, so that it is told and no measured time has it."""
    from volviz.isosurface import extract

    data = volume.data
    how = (surface.method, surface.finder, surface.ambiguity, surface.normals)
    key = (data.dtype, *how, isinstance(surface, SeenSurface), surface.level > 0)
    if key in _warmed:
        return
    progress(None, COMPILING)
    tiny = np.zeros((3, 3, 3), data.dtype)
    tiny[1, 1, 1] = 1
    extract(Volume.from_array(tiny), replace(surface, isovalue=0.5), silent())
    _warmed.add(key)


def wanted_of(scene: SceneState, size: tuple[int, int] = SIZE) -> tuple[Wanted, ...]:
    """For each of the scene's surfaces what is to be made for a picture of this size: itself, or
    itself as the camera sees it; and what is done to it."""
    return tuple(
        wanted(s, Viewing(scene.camera, size, scene.lens, _hides(s.look))) for s in scene.surfaces
    )


def _hides(look: SurfaceLook) -> bool:
    """True if nothing is seen through the surface, from whichever side."""
    return look.opacity >= 1.0 and look.wireframe != "only" and look.sides == "both"


def shown(scene: SceneState, size: tuple[int, int] = SIZE) -> dict[Wanted, set[str]]:
    """What is wanted of visible surfaces with its second fields, the scene's first one first."""
    found: dict[Wanted, set[str]] = {}
    for s, one in zip(scene.surfaces, wanted_of(scene, size), strict=True):
        if s.look.visible:
            fields = found.setdefault(one, set())
            fields |= {s.look.color_field} if s.look.coloring == "field" else set()
    return found


def missing(
    scene: SceneState, made: Extractions, size: tuple[int, int] = SIZE
) -> dict[Wanted, set[str]]:
    """Those of `shown` that are not made yet, or not with all their fields."""
    fields = shown(scene, size)
    found = {w: made.get(w) for w in fields}
    return {w: fields[w] for w, f in found.items() if f is None or fields[w] - f.fields.keys()}


def known(
    scene: SceneState, made: Extractions, size: tuple[int, int] = SIZE
) -> tuple[Extracted | None, ...]:
    """For each of the scene's surfaces what is there."""
    return tuple(made.get(w) for w in wanted_of(scene, size))


def drawn(
    scene: SceneState, found: Sequence[Extracted | None]
) -> tuple[tuple[DrawnMesh, ...], tuple[str, ...]]:
    """The visible surfaces of `found`, dressed as the scene says; and what to tell of them."""
    meshes: list[DrawnMesh] = []
    notes: list[str] = []
    for one, answer in zip(scene.surfaces, found, strict=True):
        look = one.look
        if answer is None or not look.visible or look.opacity <= 0.0:
            continue
        notes += _told(one, answer, scene)
        color = _color(look, scene.transfer, one.surface.isovalue)
        more = answer.fields.get(look.color_field) if look.coloring == "field" else None
        if more is not None and more.error is not None:
            notes.append(f"the field that colours the surface: {more.error}")
        whole = answer.camera is None or answer.camera == scene.camera
        if more is None or answer.mesh.empty:
            mesh, lighter, shade = answer.mesh, answer.coarse, color
        else:
            (mesh, lighter), shade = _painted(answer, more, look, scene.transfer), None
        coarse = None if lighter is mesh or answer.camera else lighter
        meshes.append(DrawnMesh(mesh if whole else lighter, look, shade, coarse))
    flat = scene.raycast.mode == "mip" and scene.raycast.show_volume
    if flat and any(not m.opaque for m in meshes):
        notes.append("a maximum has no depth: translucent surfaces lie in front of it")
    return tuple(meshes), tuple(notes)


def _told(one: SceneSurface, answer: Extracted, scene: SceneState) -> list[str]:
    """What a person should know of a surface that is drawn."""
    notes, name = [], f"the surface at {answer.surface.isovalue:g}"
    if answer.mesh.empty and answer.before is not None and not answer.before.mesh.empty:
        count = len(answer.before.mesh.faces)
        notes.append(f"{name} is empty: nothing is left of its {count} triangles")
    elif answer.mesh.empty:
        notes.append(f"{name} is empty")
    left = only_turned(one.surface, scene.lens)
    if left and one.refining.acting != done_to(one, scene.lens):
        done = replace(one.refining, flip=False).text
        notes.append(f"{name} is drawn without its steps after extraction ({done}): {left}")
    return notes


_dressed: WeakKeyDictionary[Sampled, tuple[Any, tuple[Mesh, Mesh]]] = WeakKeyDictionary()


def _painted(
    found: Extracted, more: Sampled, look: SurfaceLook, transfer: TransferFunction
) -> tuple[Mesh, Mesh]:
    """Both meshes in colours, the same ones while nothing changes: they are on the GPU."""
    by = transfer if look.colormap == BY_TRANSFER else None
    key = (look.colormap, look.color_low, look.color_high, by)
    if more not in _dressed or _dressed[more][0] != key:
        mesh = painted(found.mesh, more.values, look, more.span, transfer)
        coarse = mesh
        if found.coarse is not found.mesh:
            coarse = painted(found.coarse, more.coarse, look, more.span, transfer)
        _dressed[more] = key, (mesh, coarse)
    return _dressed[more][1]


def _color(
    look: SurfaceLook, transfer: TransferFunction, isovalue: float
) -> tuple[float, float, float]:
    if look.coloring != "transfer":
        return look.color
    red, green, blue = (float(c) for c in transfer.color_at(isovalue))
    return red, green, blue
