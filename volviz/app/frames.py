"""From the scene to its frame without holding up the window: what takes long is a job.

The frame before stays until the new one is there, so there is always something to draw.
"""

from __future__ import annotations

from collections.abc import Callable

from volviz.app.jobs import Job
from volviz.errors import Cancelled, VolvizError
from volviz.model.frame import Frame
from volviz.model.scene import SceneState
from volviz.model.volume import Volume
from volviz.progress import Progress
from volviz.resolve import TextureLimits, ready, resolve


class Frames:
    """The newest frame that is known. One thread (the window's) calls it.

    frame: None before the first. scene: what the frame shows. job: what is being prepared.
    """

    def __init__(self, wake: Callable[[], None]) -> None:
        self.frame: Frame | None = None
        self.scene: SceneState | None = None
        self.job: Job | None = None
        self._limits: TextureLimits | None = None
        self._preparing: tuple[Volume, TextureLimits] | None = None
        self._wake = wake

    def follow(self, scene: SceneState, limits: TextureLimits) -> Frame | None:
        """The frame of this scene, or the one before while that is prepared on a worker.

        Raises what went wrong there, once; then it is for the caller not to ask again.
        """
        if scene is self.scene and limits == self._limits:
            self.cancel()
        elif self._at_hand(scene, limits):
            self.frame = resolve(scene, limits=limits)
            self.scene, self._limits = scene, limits
        return self.frame

    def cancel(self) -> None:
        """Stop preparing; it takes effect at the job's next report."""
        if self.job is not None:
            self.job.cancel()
            self.job = None

    def _at_hand(self, scene: SceneState, limits: TextureLimits) -> bool:
        """True if `resolve` is quick now; else a job sees to it."""
        job, wanted = self.job, (scene.volume, limits)
        if job is not None and job.finished and self._preparing == wanted:
            self.job = None
            _deliver(job)
        if ready(scene, limits=limits):
            self.cancel()
            return True
        if self.job is None or self._preparing != wanted:
            self.cancel()

            def work(progress: Progress) -> None:
                resolve(scene, limits=limits, progress=progress)

            name = scene.volume.name or "volume"
            self._preparing = wanted
            self.job = Job(f"Preparing {name}", work, lambda _: None, self._wake)
        return False


def _deliver(job: Job) -> None:
    try:
        job.deliver()
    except Cancelled:
        pass
    except VolvizError:
        raise
    except Exception as error:
        kind = type(error).__name__
        raise VolvizError(f"{job.title}: a bug in volviz: {kind}: {error}") from error
