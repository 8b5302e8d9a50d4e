"""The variants that the Compare panel tries: drawn a little with every frame that has nothing else
to do, measured, kept as small pictures; and the wipe between two of them.

A time is of one whole picture, drawn in parts after a first one that does not count; errors are
those of `volviz.lab.measure`. Surfaces are made on a thread, and measured once all is drawn.
"""

from __future__ import annotations

import time
from collections.abc import Generator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from volviz.app.jobs import Job
from volviz.app.resolving import Resolving
from volviz.errors import VolvizError
from volviz.gpu.checked import ContextLost
from volviz.gpu.progressive import Progressed
from volviz.gpu.still import Still
from volviz.image import Image
from volviz.lab import measure, vary
from volviz.lab.vary import Axis, Variant
from volviz.model.scene import SceneState
from volviz.model.volume import Volume
from volviz.ui.wipe import Wipe

if TYPE_CHECKING:
    import moderngl

    from volviz.ui.viewport import Viewport

SIDE = 128
"""Pixels of a side of each picture."""
BUDGET = 0.03
"""Seconds of one frame for drawing."""
PREPARING = 0.5
"""Of a picture that needs surfaces first."""
TINY = 16
REFERENCE = 16.0
"""How many times as long as a variant a reference is expected to take."""
MOST = 16
"""Variants of one run in the window: more would take long beside its own work."""


@dataclass(eq=False)
class Trial:
    """One variant, and what is known of it by now. reference: number of its reference. facts: of
    its surfaces, by name of `measure.SURFACE_COLUMNS`."""

    variant: Variant
    reference: int | None = None
    image: Image | None = None
    texture: moderngl.Texture | None = None
    ms: float | None = None
    rmse: float | None = None
    largest: int | None = None
    facts: dict[str, float] = field(default_factory=dict)

    @property
    def title(self) -> str:
        """Its values."""
        return " · ".join(map(vary.value_text, self.variant.changed.values()))


class Trials:
    """Those of one window; without one they stay without pictures."""

    def __init__(self) -> None:
        self.all: list[Trial] = []
        self.fraction = 1.0
        self.wipe: Wipe | None = None
        self._view: Viewport | None = None
        self._volume: Volume | None = None
        self._work: Generator[float, None, None] | None = None
        self._job: Job | None = None
        self._resolving: Resolving | None = None

    def connect(self, view: Viewport) -> Trials:
        """Belong to a view from now on; what was drawn for another is gone with it."""
        self.clear()
        self._view = view
        view.trials = self
        return self

    @property
    def running(self) -> bool:
        """True while something is to be drawn yet."""
        return self._work is not None

    @property
    def preparing(self) -> Job | None:
        """What the wipe waits for."""
        return None if self.wipe is None else self.wipe.job

    @property
    def eager(self) -> bool:
        """True if another frame is wanted."""
        job = self._job if self._resolving is None else self._resolving.job
        waiting = job is not None and not job.finished
        return (self.running and not waiting) or (self.wipe is not None and self.wipe.closed)

    def begin(self, scene: SceneState, axis: Axis, *, errors: bool = True) -> None:
        """Draw and time these variants, instead of those before. Raises VolvizError.

        errors: then draw what they are measured against, which takes many times as long.
        """
        variants = vary.variants(scene, [axis])
        self.clear()
        self._volume = scene.volume
        self.all = [Trial(v) for v in variants]
        if self._view is not None:
            self._work, self.fraction = self._all_pictures(scene, variants, errors), 0.0

    def stop(self) -> None:
        """What is drawn by now stays."""
        if self._work is not None:
            self._work.close()
        if self._job is not None:
            self._job.cancel()
        if self._resolving is not None:
            self._resolving.cancel()
        self._work, self._job, self._resolving, self.fraction = None, None, None, 1.0

    def advance(self) -> None:
        """After each frame: draw on for `BUDGET` seconds, if the view is at rest.

        Within a frame nothing may be freed: its pictures are drawn at its end.
        """
        view = self._view
        scene = None if view is None else view.app.scene
        if self.all and (scene is None or scene.volume is not self._volume):
            self.clear()
        if view is None or self._work is None or not view.resting:
            return
        try:
            self.fraction = next(self._work)
        except StopIteration:
            self.stop()
        except ContextLost:
            raise
        except VolvizError as error:
            self.stop()
            view.app.messages.add(error, "error")

    def clear(self) -> None:
        """Forget all, and free it."""
        self.stop()
        self.end_wipe()
        for trial in self.all:
            if trial.texture is not None:
                trial.texture.release()
        self.all, self._volume = [], None

    # --- drawing ---------------------------------------------------------------------------------

    def _all_pictures(
        self, scene: SceneState, variants: list[Variant], errors: bool
    ) -> Generator[float, None, None]:
        """All variants, then what they are measured against; the part that is done. A reference
        has more samples, and counts as many pictures."""
        everything = [v.scene for v in variants]
        wanted = [vary.fine(scene, s, everything) for s in everything] if errors else []
        different: list[SceneState] = []
        for one in wanted:
            if one not in different:
                different.append(one)
        weights = [1.0] * len(variants) + [REFERENCE] * len(different)
        done = 0.0
        for number, one in enumerate([*everything, *different]):
            drawing = self._picture(one)
            while True:
                try:
                    part = next(drawing)
                except StopIteration as end:
                    image, seconds = end.value
                    break
                yield (done + part * weights[number]) / sum(weights)
            done += weights[number]
            if number < len(variants):
                self._take(self.all[number], image, seconds)
            else:
                which = number - len(variants)
                for trial, fine in zip(self.all, wanted, strict=True):
                    if fine == one:
                        _measure(trial, image, which)
        if errors:
            yield from self._surfaces(everything)

    def _surfaces(self, scenes: list[SceneState]) -> Generator[float, None, None]:
        """Measure the surfaces of all variants; the part that is done."""
        view = self._view
        assert view is not None
        if not any(s.look.visible for scene in scenes for s in scene.surfaces):
            return

        def take(found: list[dict[str, float]]) -> None:
            for trial, facts in zip(self.all, found, strict=True):
                trial.facts = facts

        job = Job(
            "measuring surfaces",
            lambda progress: measure.surfaces_of(scenes, 1, progress),
            take,
            view.app.wake,
        )
        self._job = job
        while not job.finished:
            yield job.fraction or 0.0
        self._job = None
        job.deliver()

    def _picture(self, scene: SceneState) -> Generator[float, None, tuple[Image, float]]:
        """One picture; the part that is done, in the end it and the seconds that it took."""
        view = self._view
        assert view is not None
        made = Resolving("Preparing a picture", view.app.wake)
        self._resolving = made
        shown = any(s.look.visible for s in scene.surfaces)
        share = PREPARING if shown else 0.0
        while not made.follow(scene, view.app.limits, (SIDE, SIDE)):
            yield share * ((made.job and made.job.fraction) or 0.0)
        self._resolving, frame = None, made.frame
        assert frame is not None
        for side in (TINY, SIDE):  # the first compiles shaders and fills tables
            still = Still(view.gpu, view.resident, frame, (side, side))
            seconds, whole = 0.0, False
            try:
                while not whole:
                    start = time.perf_counter()
                    whole = still.advance(BUDGET)
                    seconds += time.perf_counter() - start
                    yield share + (1 - share) * (still.fraction if side == SIDE else 0.0)
            finally:
                still.release()
        return Image(still.pixels, view.gpu.renderer, frame.notes), seconds

    def _take(self, trial: Trial, image: Image, seconds: float) -> None:
        assert self._view is not None
        trial.image, trial.ms = image, 1000 * seconds
        pixels = np.ascontiguousarray(image.pixels)
        trial.texture = self._view.gpu.texture2d((SIDE, SIDE), 4, pixels, "f1", linear=True)

    # --- the wipe --------------------------------------------------------------------------------

    def begin_wipe(self, left: Trial, right: Trial) -> None:
        """Show two variants in the view, with a line between them."""
        self.end_wipe()
        view = self._view
        if view is not None:
            one, other = left.variant, right.variant
            ends = (one.label, one.changed), (other.label, other.changed)
            self.wipe = Wipe(view.gpu, view.resident, ends, view.app.wake)

    def end_wipe(self) -> None:
        """The view shows the scene again."""
        if self.wipe is not None:
            self.wipe.release()
            self.wipe = None

    def cast(self, size: tuple[int, int], budgets: tuple[float, float]) -> Progressed | None:
        """Instead of the view's own picture; None without a wipe. budgets: see `Wipe.cast`."""
        view, wipe = self._view, self.wipe
        scene = None if view is None else view.app.scene
        if wipe is not None and (wipe.closed or scene is None or scene.volume is not self._volume):
            self.end_wipe()
        if self.wipe is None or view is None or scene is None:
            return None
        try:
            return self.wipe.cast(scene, size, view.app.limits, budgets)
        except ContextLost:
            raise
        except VolvizError as error:
            self.end_wipe()
            view.app.messages.add(error, "error")
            return None


def _measure(trial: Trial, reference: Image, number: int) -> None:
    assert trial.image is not None
    apart = measure.difference(trial.image, reference)
    trial.rmse, trial.largest = measure.rmse(apart), int(apart.max())
    trial.reference = number
