"""Scene to Frame: intent to answers, as numpy arrays, remembered.

What is expensive depends on the volume only (statistics, the texture's encoding) and is kept with
it; a change of camera or transfer function costs microseconds.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar
from weakref import WeakKeyDictionary

from volviz.errors import LimitError
from volviz.fields.bricks import bricks, emptiness
from volviz.fields.encode import encode, texel_bytes
from volviz.fields.reduce import Factors, reduced, reduction
from volviz.fields.statistics import Statistics, statistics
from volviz.model.frame import ColorTable, Frame, Voxels
from volviz.model.lens import SIZE
from volviz.model.scene import SceneState
from volviz.model.transfer import TransferFunction
from volviz.model.views import check_drawable
from volviz.model.volume import Volume
from volviz.model.wanted import Wanted
from volviz.progress import Progress, silent
from volviz.resolve_surfaces import Extracted, Extractions, drawn, missing, shown, wanted_of

T = TypeVar("T")


@dataclass(frozen=True)
class TextureLimits:
    """What the graphics can hold: samples along one axis, and bytes of one texture.

    promote8: store 8-bit data in 16 bits, where the filter would round to 8 bits.
    """

    max_dim: int = 2048
    max_bytes: int = 1 << 30
    promote8: bool = True


class _Answer:
    """One answer, and the lock that whoever makes it holds."""

    def __init__(self) -> None:
        self.lock = threading.RLock()
        self.spec: Any = _UNKNOWN
        self.value: Any = None


_UNKNOWN = object()
_LARGE = ("emptiness", "surfaces")
"""Slots of large answers, beside those of texture and bricks, whose specs are tuples."""
_Answers = dict[Any, _Answer]


class Memo:
    """Remembers answers for as long as the volume lives that they belong to; for any thread.

    Each answer has a lock of its own: making one never holds up who asks for another.
    """

    def __init__(self) -> None:
        self._answers: WeakKeyDictionary[Volume, _Answers] = WeakKeyDictionary()
        self._lock = threading.Lock()

    def get(self, volume: Volume, spec: Any, make: Callable[[], T]) -> T:
        """The answer for (volume, spec), made now if it is not known."""
        return self.latest(volume, spec, None, make)

    def known(self, volume: Volume, spec: Any) -> Any:
        """The answer for (volume, spec) if it is there, else None; waits for nobody."""
        with self._lock:
            answer = self._answers.get(volume, {}).get(spec)
        return None if answer is None or answer.spec is _UNKNOWN else answer.value

    def share(self, volume: Volume, other: Volume) -> None:
        """From now on one volume's answers are the other's too: they hold the same voxels."""
        with self._lock:
            self._answers[other] = self._answers.setdefault(volume, {})

    def shed(self, volume: Volume) -> None:
        """Forget what is large and can be made again: texture, bricks, surfaces."""
        with self._lock:
            answers = self._answers.get(volume, {})
            for spec in [s for s in answers if isinstance(s, tuple) or s in _LARGE]:
                del answers[spec]

    def latest(self, volume: Volume, slot: Any, spec: Any, make: Callable[[], T]) -> T:
        """The same, but only the last answer of a slot is kept: for what changes with a drag."""
        with self._lock:
            answer = self._answers.setdefault(volume, {}).setdefault(slot, _Answer())
        with answer.lock:
            if answer.spec is _UNKNOWN or answer.spec != spec:
                answer.value = make()
                answer.spec = spec
            value: T = answer.value
            return value


MEMO = Memo()


def resolve(
    scene: SceneState,
    memo: Memo = MEMO,
    *,
    limits: TextureLimits | None = None,
    progress: Progress | None = None,
    surfaces: Sequence[Extracted | None] | None = None,
    size: tuple[int, int] = SIZE,
) -> Frame:
    """The Frame that draws this scene.

    limits: of the graphics that will draw it; a volume beyond them is reduced by whole factors
    and the frame's notes say so. surfaces: for each of the scene's, what is to be drawn for it
    (None: nothing); by default each is extracted first. size: of the picture, for surfaces that
    depend on how large a pixel is. Raises Cancelled through `progress`.
    """
    check_drawable(scene.volume)
    limits = limits or TextureLimits()
    progress = progress or silent()
    if surfaces is None:
        share = 0.5 if scene.surfaces else 0.0
        surfaces = _extracted(scene, memo, size, progress.part(0.0, share))
        progress = progress.part(share, 1.0)
    shown, voxels = _texture(scene.volume, memo, limits, progress.part(0.0, 0.8))
    table = memo.latest(
        shown, "table", scene.transfer, lambda: color_table(scene.transfer, scene.volume)
    )
    rest = progress.part(0.8, 1.0)
    found = memo.get(shown, _bricks_spec(limits), lambda: bricks(voxels, progress=rest))
    empty = memo.latest(
        shown, "emptiness", (scene.transfer, id(found)), lambda: emptiness(found, voxels, table)
    )
    notes = [w for w in shown.info.warnings if w not in scene.volume.info.warnings]
    if voxels.note:
        notes.append(voxels.note)
    meshes, told = drawn(scene, surfaces)
    notes += told
    frame = Frame(
        voxels=voxels,
        affine=shown.affine,
        table=table,
        camera=scene.camera,
        raycast=scene.raycast,
        light=scene.light,
        background=scene.background,
        emptiness=empty,
        meshes=meshes,
    )
    if frame.step > scene.raycast.step:
        notes.append(
            f"the volume is {frame.longest_side:.2g} times as long as a voxel: "
            f"the step is {frame.step:.2g} voxels"
        )
    return replace(frame, notes=tuple(notes))


def ready(
    scene: SceneState,
    memo: Memo = MEMO,
    *,
    limits: TextureLimits,
    surfaces: Sequence[Extracted | None] | None = None,
    size: tuple[int, int] = SIZE,
) -> bool:
    """True if `resolve` of the same has at hand what takes long, so that it answers at once."""
    volume = scene.volume
    if surfaces is None and scene.surfaces and missing(scene, extractions(volume, memo), size):
        return False
    facts = statistics_at_hand(volume, memo)
    if facts is None:
        return False
    factors = _factors(volume, facts, limits)
    voxels = memo.known(volume, _texture_spec(factors, limits))
    if voxels is None:
        return False
    shown = volume if factors == (1, 1, 1) else voxels[0]
    return memo.known(shown, _bricks_spec(limits)) is not None


def extractions(volume: Volume, memo: Memo = MEMO) -> Extractions:
    """What was extracted from this volume, and where more goes."""
    return memo.get(volume, "surfaces", Extractions)


def _extracted(
    scene: SceneState, memo: Memo, size: tuple[int, int], progress: Progress
) -> tuple[Extracted | None, ...]:
    """All visible surfaces, made now where they are not known."""
    if not scene.surfaces:
        return ()
    made = extractions(scene.volume, memo)
    wanted, new = shown(scene, size), missing(scene, made, size)
    found: dict[Wanted, Extracted] = {}  # of its own: others drop what they do not want
    for i, (one, fields) in enumerate(wanted.items()):
        part = progress.part(i / len(wanted), (i + 1) / len(wanted))
        found[one] = made.make(scene.volume, one, part, fields)
        if one in new:
            _check(found[one])
    made.keep(wanted_of(scene, size))
    return tuple(found.get(w) for w in wanted_of(scene, size))


def _check(made: Extracted) -> None:
    """Raise what kept a second field from being read: a picture for a file is right or not."""
    for field in made.fields.values():
        if field.error is not None:
            raise field.error


def statistics_at_hand(volume: Volume, memo: Memo = MEMO) -> Statistics | None:
    """`known_statistics` if they were made already, else None."""
    found: Statistics | None = memo.known(volume, "statistics")
    return found


def known_statistics(
    volume: Volume, memo: Memo = MEMO, progress: Progress | None = None
) -> Statistics:
    """Range, histogram and counts of a volume, made once."""
    return memo.get(volume, "statistics", lambda: statistics(volume, progress=progress))


def color_table(transfer: TransferFunction, volume: Volume) -> ColorTable:
    """The transfer function as numbers, as finely as the volume's values ask for."""
    size = transfer.table_size(integers=volume.data.dtype.kind in "iu")
    low, high = transfer.domain
    return ColorTable(transfer.table(size), low, high, transfer.unit_distance)


def _factors(volume: Volume, facts: Statistics, limits: TextureLimits) -> Factors:
    texel = texel_bytes(volume.data.dtype, facts, promote8=limits.promote8)
    return reduction(volume.dims, texel, limits.max_dim, limits.max_bytes)


def _texture_spec(factors: Factors, limits: TextureLimits) -> tuple[Any, ...]:
    return "texture", factors, limits.promote8


def _bricks_spec(limits: TextureLimits) -> tuple[Any, ...]:
    return "bricks", limits.promote8


def _texture(
    volume: Volume, memo: Memo, limits: TextureLimits, progress: Progress
) -> tuple[Volume, Voxels]:
    facts = known_statistics(volume, memo, progress.part(0.0, 0.3))
    factors = _factors(volume, facts, limits)
    rest = progress.part(0.3, 1.0)
    spec = _texture_spec(factors, limits)
    if factors == (1, 1, 1):
        return volume, memo.get(
            volume, spec, lambda: encode(volume, facts, promote8=limits.promote8, progress=rest)
        )
    if max(factors) > max(volume.dims):
        raise LimitError(f"the graphics cannot hold {volume.dims} samples even reduced")

    def reduce_and_encode() -> tuple[Volume, Voxels]:
        smaller = reduced(volume, factors, progress=rest.part(0.0, 0.7))
        facts_of_it = known_statistics(smaller, memo, rest.part(0.7, 0.8))
        last = rest.part(0.8, 1.0)
        return smaller, encode(smaller, facts_of_it, promote8=limits.promote8, progress=last)

    return memo.get(volume, spec, reduce_and_encode)
