"""From the scene to its frame without holding up the window: what takes long is a job.

The frame before stays until the new one is there, so there is always something to draw. Surfaces
follow on their own: until a new one is extracted the last good one of its place is drawn, and of
many values that a slider passes only the latest is extracted next.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

from volviz.app.jobs import Job
from volviz.errors import Cancelled, VolvizError
from volviz.model.camera import Camera
from volviz.model.frame import Frame
from volviz.model.lens import SIZE
from volviz.model.mesh import Mesh
from volviz.model.scene import SceneState
from volviz.model.volume import Volume
from volviz.model.wanted import Wanted
from volviz.progress import Progress
from volviz.resolve import TextureLimits, extractions, ready, resolve
from volviz.resolve_surfaces import (
    Extracted,
    Extractions,
    known,
    make_levels,
    missing,
    wanted_of,
    without_levels,
)

RESTED = 0.15
"""Seconds that a camera stands still before surfaces are made for it."""


class Frames:
    """The newest frame that is known. One thread (the window's) calls it.

    frame: None before the first. scene: what the frame shows. job: what is being prepared.
    extracting: the surface that is being made. surfaces: what is drawn for each of the scene's.
    detail: when there is nothing else to do, make coarser levels of heavy surfaces for while things
    move.
    """

    def __init__(self, wake: Callable[[], None], *, detail: bool = False) -> None:
        self.frame: Frame | None = None
        self.scene: SceneState | None = None
        self.job: Job | None = None
        self.extracting: Job | None = None
        self.surfaces: tuple[Extracted | None, ...] = ()
        self._surface: tuple[Volume, Wanted] | None = None
        self._place = 0
        self._failed: tuple[Volume, Wanted] | None = None
        self._news = False
        self._limits: TextureLimits | None = None
        self._preparing: tuple[Volume, TextureLimits] | None = None
        self._wake = wake
        self._size = SIZE
        self._detail = detail
        self._detailing: tuple[Job, Mesh] | None = None
        self._camera: tuple[Camera | None, float] = None, 0.0

    @property
    def lacking(self) -> bool:
        """True while a surface that is drawn is not the one that is wanted."""
        return self.extracting is not None

    def follow(
        self, scene: SceneState, limits: TextureLimits, size: tuple[int, int] = SIZE
    ) -> Frame | None:
        """The frame of this scene, or the one before while that is prepared on a worker.

        size: of the picture, in pixels, for surfaces that depend on it.
        Raises what went wrong there, once; then it is for the caller not to ask again.
        """
        same = scene is self.scene and limits == self._limits
        self._size = size
        if same:
            self._stop_preparing()
        elif not self._at_hand(scene, limits):
            return self.frame
        if self._extract(scene) or not same:
            self.frame = resolve(scene, limits=limits, surfaces=self.surfaces)
            self.scene, self._limits = scene, limits
        return self.frame

    def cancel(self) -> None:
        """Stop all work; it takes effect at the jobs' next reports."""
        self._stop_preparing()
        self._stop_extracting()
        self._stop_detailing()

    def _stop_preparing(self) -> None:
        if self.job is not None:
            self.job.cancel()
            self.job = None

    def _stop_extracting(self) -> None:
        if self.extracting is not None:
            self.extracting.cancel()
            self.extracting = self._surface = None

    def _at_hand(self, scene: SceneState, limits: TextureLimits) -> bool:
        """True if `resolve` is quick now; else a job sees to it."""
        job, wanted = self.job, (scene.volume, limits)
        if job is not None and job.finished and self._preparing == wanted:
            self.job = None
            deliver(job)
        if ready(scene, limits=limits, surfaces=()):
            self._stop_preparing()
            return True
        if self.job is None or self._preparing != wanted:
            self._stop_preparing()

            def work(progress: Progress) -> None:
                resolve(scene, limits=limits, progress=progress, surfaces=(None,) * count)

            count = len(scene.surfaces)
            name = scene.volume.name or "volume"
            self._preparing = wanted
            self.job = Job(f"Preparing {name}", work, lambda _: None, self._wake)
        return False

    def _extract(self, scene: SceneState) -> bool:
        """See to the surfaces that are not there yet; True if others are to be drawn now."""
        made = extractions(scene.volume)
        job = self.extracting
        if job is not None and job.finished:
            self.extracting, self._failed = None, self._surface
            deliver(job)
            self._failed = None
            self._passed(scene, made)
        wanted = missing(scene, made, self._size)
        if self._turning(scene):
            wanted = {w: f for w, f in wanted.items() if not w.by_camera}
        if self._surface is not None and (self._surface[0] is not scene.volume or not wanted):
            self._stop_extracting()
        if self.extracting is None and wanted:
            self._start(scene, wanted)
        if self.extracting is None and not wanted and self._detail:
            self._add_detail(scene, known(scene, made, self._size))
        else:
            self._stop_detailing()
        made.keep(wanted_of(scene, self._size))
        return self._choose(scene, known(scene, made, self._size))

    def _add_detail(self, scene: SceneState, found: Sequence[Extracted | None]) -> None:
        """Levels of detail of the next mesh that has none; nobody waits for them."""
        if self._detailing is not None and self._detailing[0].finished:
            job, self._detailing = self._detailing[0], None
            deliver(job)
        meshes = without_levels(found)
        if self._detailing is not None and self._detailing[1] not in meshes:
            self._stop_detailing()
        if self._detailing is None and meshes and not self._turning(scene):
            mesh = meshes[0]

            def work(progress: Progress) -> None:
                make_levels(mesh, progress)

            self._detailing = Job("Levels of detail", work, _nothing, _silent), mesh

    def _stop_detailing(self) -> None:
        if self._detailing is not None:
            self._detailing[0].cancel()
            self._detailing = None

    def _turning(self, scene: SceneState) -> bool:
        """True while the camera has not rested yet: what depends on it would be too late."""
        now = time.perf_counter()
        if self._camera[0] != scene.camera:
            first = self._camera[0] is None
            self._camera = scene.camera, -RESTED if first else now
        return now - self._camera[1] < RESTED

    def _passed(self, scene: SceneState, made: Extractions) -> None:
        """What was just made is the last good one of its place, though a slider has gone on."""
        volume, surface = self._surface or (None, None)
        found = made.get(surface) if surface is not None and volume is scene.volume else None
        self._surface = None
        if found is not None and self._place < len(self.surfaces):
            rest = self.surfaces[self._place + 1 :]
            self.surfaces = (*self.surfaces[: self._place], found, *rest)
            self._news = True

    def _start(self, scene: SceneState, wanted: dict[Wanted, set[str]]) -> None:
        volume, (surface, fields) = scene.volume, next(iter(wanted.items()))
        if self._failed == (volume, surface):
            return
        self._surface = (volume, surface)
        self._place = wanted_of(scene, self._size).index(surface)

        def work(progress: Progress) -> None:
            extractions(volume).make(volume, surface, progress, fields)

        self.extracting = Job(f"Surface at {surface.isovalue:g}", work, _nothing, self._wake)

    def _choose(self, scene: SceneState, found: tuple[Extracted | None, ...]) -> bool:
        """For each surface the one that is wanted, else the last good one of its place."""
        before = self.surfaces if self.scene and self.scene.volume is scene.volume else ()
        if len(before) != len(found):
            before = (*before, *(None,) * len(found))[: len(found)]
        chosen = tuple(f or b for f, b in zip(found, before, strict=True))
        if len(chosen) == len(self.surfaces) and all(
            a is b for a, b in zip(chosen, self.surfaces, strict=True)
        ):
            news, self._news = self._news, False
            return news
        self.surfaces, self._news = chosen, False
        return True


def _nothing(_: object) -> None:
    """Nothing to do with a result that is kept elsewhere."""


def _silent() -> None:
    """Nobody is woken by what nobody waits for."""


def deliver(job: Job) -> None:
    """Take over what a job made; raise what went wrong as a VolvizError, a cancel is nothing."""
    try:
        job.deliver()
    except Cancelled:
        pass
    except VolvizError:
        raise
    except Exception as error:
        kind = type(error).__name__
        raise VolvizError(f"{job.title}: a bug in volviz: {kind}: {error}") from error
