"""What panels may show besides the scene, and what they remember for themselves.

A panel is `panel(scene, facts) -> scene`. It changes nothing but the scene it returns and its own
notes in `Facts.local` (which points are selected, what is searched for): nothing of those is
undone or saved.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar, cast

from volviz.model.history import Step
from volviz.model.scene import SceneState

if TYPE_CHECKING:
    from volviz.app.opening import Choices, Part
    from volviz.fields.statistics import Statistics
    from volviz.resolve_surfaces import Extracted

L = TypeVar("L")


class Message(NamedTuple):
    """A line of the log. level: "info", "warning" or "error". time: seconds since 1970."""

    level: str
    text: str
    time: float = 0.0


class Busy(NamedTuple):
    """Work under way. fraction: 0..1, None if not known."""

    fraction: float | None
    message: str


class Local:
    """What the panels of one window remember between frames, one object per type."""

    def __init__(self) -> None:
        self._known: dict[type, Any] = {}

    def of(self, kind: Callable[[], L]) -> L:
        """The object of this class, made when it is first asked for."""
        key = cast(type, kind)
        if key not in self._known:
            self._known[key] = kind()
        return cast(L, self._known[key])


_SHARED = Local()


@dataclass(frozen=True, eq=False)
class Facts:
    """Answers of this moment, for the panels to show.

    statistics: of the volume, None while they are counted. aspect: width / height of the picture.
    frame_times: seconds of the latest frames, oldest first. rays: rays per pixel's side now, 1 at
    full quality. step: sample distance now, in the smallest voxel spacing. samples: pictures
    averaged so far. cpu_bytes, gpu_bytes: memory of this process and of our textures, None if not
    known. texture: samples along x, y, z as the graphics hold them, None before the first frame.
    notes: what to know about the picture (reductions). history: all steps, oldest first; present:
    index of the one shown. parts: series or arrays of the open source, where they were listed;
    wanted: choices of the one that is being read, None if none is. surfaces: what
    is drawn for each of the scene's. local: what the panels of this window remember.
    """

    statistics: Statistics | None = None
    renderer: str = ""
    aspect: float = 1.0
    frame_ms: float = 0.0
    frame_times: tuple[float, ...] = ()
    rays: float = 1.0
    step: float | None = None
    samples: int = 0
    cpu_bytes: int | None = None
    gpu_bytes: int | None = None
    texture: tuple[int, int, int] | None = None
    notes: tuple[str, ...] = ()
    messages: tuple[Message, ...] = ()
    history: tuple[Step[SceneState], ...] = ()
    present: int = 0
    busy: Busy | None = None
    parts: tuple[Part, ...] = ()
    wanted: Choices | None = None
    surfaces: tuple[Extracted | None, ...] = ()
    local: Local = field(default=_SHARED)


Panel = Callable[[SceneState, Facts], SceneState]
