"""Frames for pictures beside the view, such as those of Compare and the wipe: what takes long,
surfaces above all, is a job, and the last good frame stays until it is done."""

from __future__ import annotations

from collections.abc import Callable

from volviz.app.frames import deliver
from volviz.app.jobs import Job
from volviz.model.frame import Frame
from volviz.model.lens import SIZE
from volviz.model.scene import SceneState
from volviz.progress import Progress
from volviz.resolve import TextureLimits, extractions, ready, resolve
from volviz.resolve_surfaces import known

_Asked = tuple[SceneState, TextureLimits, tuple[int, int]]


class Resolving:
    """The newest frame of a picture. One thread (the window's) calls it.

    frame: None before the first. scene: what the frame shows. job: what is being prepared.
    """

    def __init__(self, title: str, wake: Callable[[], None]) -> None:
        self.frame: Frame | None = None
        self.scene: SceneState | None = None
        self.job: Job | None = None
        self._title, self._wake = title, wake
        self._asked: _Asked | None = None
        self._known: _Asked | None = None

    def follow(
        self, scene: SceneState, limits: TextureLimits, size: tuple[int, int] = SIZE
    ) -> bool:
        """True once `frame` is that of this scene; until then a worker prepares it.

        size: of the picture, for surfaces that depend on it. Of many scenes that come while one is
        prepared only the latest is next. Raises what went wrong, once; then it is for the caller
        not to ask again.
        """
        wanted = (scene, limits, size)
        if self._known == wanted:
            return True
        if self.job is not None:
            if self._asked is not None and self._asked[0].volume is not scene.volume:
                self.cancel()
            elif not self.job.finished:
                return False
            else:
                job, self.job = self.job, None
                deliver(job)
                if self._known == wanted:
                    return True
        frame = _at_hand(*wanted)
        if frame is None:
            self._start(wanted)
            return False
        self._take(wanted, frame)
        return True

    def cancel(self) -> None:
        """Stop the work; it takes effect at its next report."""
        if self.job is not None:
            self.job.cancel()
            self.job = self._asked = None

    def _start(self, wanted: _Asked) -> None:
        scene, limits, size = wanted

        def work(progress: Progress) -> Frame:
            return resolve(scene, limits=limits, progress=progress, size=size)

        def take(frame: Frame) -> None:
            self._take(wanted, frame)

        self._asked = wanted
        self.job = Job(self._title, work, take, self._wake)

    def _take(self, wanted: _Asked, frame: Frame) -> None:
        self._known, self.scene, self.frame = wanted, wanted[0], frame


def _at_hand(scene: SceneState, limits: TextureLimits, size: tuple[int, int]) -> Frame | None:
    """The frame, if all that takes long is there: waits for nobody, and makes no surface."""
    if not ready(scene, limits=limits, size=size):
        return None
    found = known(scene, extractions(scene.volume), size)
    if any(f is None and s.look.visible for f, s in zip(found, scene.surfaces, strict=True)):
        return None  # dropped a moment ago
    return resolve(scene, limits=limits, surfaces=found, size=size)
