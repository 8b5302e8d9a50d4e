"""Small pictures of the open volume, drawn a little with every frame while nothing else is to do.

A worker makes a copy of few samples; what is wished for is then drawn in bands within a budget, on
the window's thread. Pictures live as long as their volume does.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Hashable, Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any
from weakref import ReferenceType, WeakKeyDictionary, ref

import numpy as np

from volviz.app.jobs import Job
from volviz.app.resolving import Resolving
from volviz.errors import Cancelled, VolvizError
from volviz.fields.reduce import reduced, reduction
from volviz.gpu.checked import ContextLost, Gpu
from volviz.gpu.progressive import Progressive
from volviz.gpu.residency import Residency
from volviz.model.frame import Frame
from volviz.model.lens import Lens
from volviz.model.scene import SceneState
from volviz.model.transfer import TransferFunction
from volviz.model.views import volume_camera
from volviz.model.volume import Volume
from volviz.progress import Progress
from volviz.resolve import TextureLimits, resolve

if TYPE_CHECKING:
    import moderngl

EDGE = 128
"""Samples along the longest side of the copy that is drawn."""
BUDGET = 0.015
"""Seconds of one frame for drawing."""
SAMPLES = 2

Making = Callable[[SceneState], SceneState]


@dataclass(frozen=True)
class Wish:
    """A picture that somebody wants. key: whose place it takes. stamp: what it depends on besides
    the volume; it is drawn anew when that changes. make: the scene to draw, of one on the copy.
    pixels: of its side."""

    key: Hashable
    stamp: Any
    make: Making
    pixels: int


@dataclass
class _Kept:
    stamp: Any
    texture: moderngl.Texture | None  # None: it could not be drawn


@dataclass
class _Drawing:
    wish: Wish
    scene: SceneState
    frame: Frame | None = None  # None: it is being prepared


class Thumbnails:
    """The pictures of one window. wake: called from the worker. failed: told each cause."""

    def __init__(
        self, gpu: Gpu, wake: Callable[[], None], failed: Callable[[Exception], None]
    ) -> None:
        self.gpu = gpu
        self._wake, self._failed = wake, failed
        self._resident = Residency(gpu)
        self._progressive = Progressive(gpu, self._resident)
        self._albums: WeakKeyDictionary[Volume, dict[Hashable, _Kept]] = WeakKeyDictionary()
        self._volume: Callable[[], Volume | None] = _nothing
        self._copy: Volume | None = None
        self._job: Job | None = None
        self._wishes: dict[Hashable, Wish] = {}
        self._drawing: _Drawing | None = None
        self._resolving = Resolving("thumbnails", wake)
        self._hopeless = False

    def wish(self, wishes: Iterable[Wish]) -> None:
        """In this frame these pictures are wanted, the most urgent first."""
        for wish in wishes:
            self._wishes.setdefault(wish.key, wish)

    def texture(self, key: Hashable) -> int | None:
        """OpenGL's name of a picture, row 0 on top; None if there is none yet."""
        kept = self._album.get(key)
        return None if kept is None or kept.texture is None else int(kept.texture.glo)

    def advance(self, scene: SceneState | None, *, free: bool, limits: TextureLimits) -> bool:
        """Draw what the last frame wished for, for `BUDGET` seconds, if this moment is free.

        True if another frame is wanted, to draw on or to show what was drawn. Call it every
        frame, so that a volume that is gone is let go of.
        """
        self._look_at(None if scene is None else scene.volume)
        wishes, self._wishes = self._wishes, {}
        missing = [w for w in wishes.values() if self._lacks(w)]
        if scene is None or not missing or self._hopeless or not self._prepared(limits):
            return False
        if not free:
            return False
        end = time.perf_counter() + BUDGET
        try:
            while missing and time.perf_counter() < end:
                if self._drawn(scene, missing[0], limits, end):
                    del missing[0]
                elif self._resolving.job is not None:
                    return False  # which wakes the window
        except ContextLost:
            raise
        except VolvizError as error:  # of this picture alone
            self._album[missing[0].key] = _Kept(missing[0].stamp, None)
            self._drawing = None
            self._failed(error)
        return True

    def release(self) -> None:
        """Free all that is on the GPU; end the worker."""
        self._look_at(None)
        for album in self._albums.values():
            for kept in album.values():
                if kept.texture is not None:
                    kept.texture.release()
        self._albums.clear()

    # --- the volume ------------------------------------------------------------------------------

    @property
    def _album(self) -> dict[Hashable, _Kept]:
        volume = self._volume()
        return {} if volume is None else self._albums.setdefault(volume, {})

    def _look_at(self, volume: Volume | None) -> None:
        """Drop what belongs to another volume than this; its finished pictures stay with it."""
        if volume is self._volume():
            return
        self._volume = _nothing if volume is None else ref(volume)
        if self._job is not None:
            self._job.cancel()
        self._job = self._copy = self._drawing = None
        self._resolving.cancel()
        self._resolving = Resolving("thumbnails", self._wake)
        self._hopeless = False
        self._progressive.release()
        self._resident.release()

    def _prepared(self, limits: TextureLimits) -> bool:
        """True once the copy is there; its making is begun with the first wish."""
        if self._copy is not None:
            return True
        volume = self._volume()
        if self._job is None and volume is not None:
            self._job = Job("thumbnails", _copying(ref(volume), limits), self._take, self._wake)
        if self._job is None or not self._job.finished:
            return False
        job, self._job = self._job, None
        try:
            job.deliver()
        except Cancelled:
            return False
        except Exception as error:
            self._hopeless = True
            self._failed(error)
        return self._copy is not None

    def _take(self, copy: Volume) -> None:
        self._copy = copy

    # --- drawing ---------------------------------------------------------------------------------

    def _lacks(self, wish: Wish) -> bool:
        kept = self._album.get(wish.key)
        return kept is None or not _same(kept.stamp, wish.stamp)

    def _drawn(self, scene: SceneState, wish: Wish, limits: TextureLimits, end: float) -> bool:
        """Go on with a picture until then; True once it is there."""
        now = self._drawing
        if now is None or now.wish.key != wish.key or not _same(now.wish.stamp, wish.stamp):
            assert self._copy is not None
            plain = replace(scene, volume=self._copy, bookmarks=())
            made = wish.make(plain)
            made = replace(made, raycast=replace(made.raycast, samples=SAMPLES), lens=Lens())
            now = self._drawing = _Drawing(wish, made)
        size = (now.wish.pixels, now.wish.pixels)
        if now.frame is None:
            if not self._resolving.follow(now.scene, limits, size):
                return False
            now.frame = self._resolving.frame
            assert now.frame is not None
        left = max(end - time.perf_counter(), 0.0)
        if not self._progressive.refine(now.frame, size, left).done:
            return False
        self._drawing = None
        pixels = np.ascontiguousarray(self._progressive.pixels())
        texture = self.gpu.texture2d(size, 4, pixels, "f1", linear=True)
        old = self._album.get(wish.key)
        if old is not None and old.texture is not None:
            old.texture.release()
        self._album[wish.key] = _Kept(wish.stamp, texture)
        return True


def few_samples(volume: Volume, progress: Progress | None = None) -> Volume:
    """A copy of a volume with at most `EDGE` samples along each side and the same place in space.

    Of very many samples some are left out before the rest is averaged, so that it takes no longer
    for a large volume.
    """
    factors = reduction(volume.dims, 1, EDGE, EDGE**3)
    sx, sy, sz = (max(f // 2, 1) for f in factors)
    affine = volume.affine @ np.diag((sx, sy, sz, 1.0))
    some = Volume(
        np.ascontiguousarray(volume.data[::sz, ::sy, ::sx]), replace(volume.info, affine=affine)
    )
    return reduced(some, reduction(some.dims, 1, EDGE, EDGE**3), progress)


def _copying(volume: ReferenceType[Volume], limits: TextureLimits) -> Callable[[Progress], Any]:
    """Work for a job: the copy, with all that `resolve` remembers of it already counted."""

    def work(progress: Progress) -> Volume:
        whole = volume()
        if whole is None:
            raise Cancelled
        copy = few_samples(whole, progress)
        plain = TransferFunction(((0.0, 1.0, 1.0, 1.0),), ((0.0, 1.0),))
        resolve(SceneState(copy, plain, volume_camera(copy)), limits=limits, progress=progress)
        return copy

    return work


def _nothing() -> None:
    return None


def _same(one: Any, other: Any) -> bool:
    return one is other or bool(one == other)
