"""What the user wants to see: frozen intent, no answers.

A change is `dataclasses.replace`, undo is a list of scenes, a scene file is a scene. The public
`volviz.Scene` adds what needs the rooms above (suggestion, files, pictures).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from volviz.errors import UsageError, did_you_mean
from volviz.model.camera import Camera
from volviz.model.knobs import AS_SCENE, check_knobs, knob, knobs_of
from volviz.model.lens import Lens
from volviz.model.surface_look import SceneSurface
from volviz.model.transfer import TransferFunction
from volviz.model.volume import Volume

MODES = ("dvr", "mip")
CLASSIFICATIONS = ("post",)
SHADINGS = ("none", "phong", "blinn-phong")
GRADIENTS = ("central", "sobel", "forward", "backward")
INTERPOLATIONS = ("linear", "nearest")
MAX_NAME = 200


@dataclass(frozen=True)
class Raycast:
    """How rays are cast through the volume."""

    mode: str = knob(
        "dvr", "what a ray gathers: emission and absorption, or the maximum", choices=MODES
    )
    step: float = knob(
        0.5,
        "distance between samples",
        low=0.01,
        high=16,
        unit="smallest voxel spacing",
        fine=0.125,
    )
    classification: str = knob("post", "post: interpolate, then classify", choices=CLASSIFICATIONS)
    shading: str = knob("blinn-phong", "how gradients are lit", choices=SHADINGS)
    gradient: str = knob(
        "central",
        "gradient operator, in world units: sobel is smoother and takes longer",
        choices=GRADIENTS,
        fine=AS_SCENE,
    )
    interpolation: str = knob(
        "linear", "between samples; nearest for labels", choices=INTERPOLATIONS, fine=AS_SCENE
    )
    jitter: float = knob(
        1.0,
        "how far samples stray within their step; 0 puts them in its middle",
        low=0,
        high=1,
        fine=1.0,
    )
    seed: int = knob(0, "seed of the jitter", low=0, high=1_000_000, fine=0)
    samples: int = knob(8, "jittered pictures averaged into a still one", low=1, high=4096, fine=32)
    termination: float = knob(
        1 - 1 / 255, "opacity at which a ray ends; 1 never ends early", low=0.5, high=1, fine=1.0
    )
    show_volume: bool = knob(True, "draw the volume; without it only its surfaces are seen")

    def __post_init__(self) -> None:
        check_knobs(self)


@dataclass(frozen=True)
class Light:
    """One light that moves with the camera, and how surfaces answer it."""

    ambient: float = knob(0.15, "light from everywhere", low=0, high=2)
    diffuse: float = knob(0.85, "light from the lamp, by the angle it falls in", low=0, high=2)
    specular: float = knob(0.15, "highlight", low=0, high=2)
    exponent: float = knob(24.0, "sharpness of the highlight", low=1, high=1000)
    light_azimuth: float = knob(
        -25.0, "lamp to the left (−) or right of the camera", low=-180, high=180, unit="°"
    )
    light_elevation: float = knob(
        30.0, "lamp above or below (−) the camera", low=-90, high=90, unit="°"
    )

    def __post_init__(self) -> None:
        check_knobs(self)

    def direction(self) -> NDArray[np.float64]:
        """float64[3]: towards the lamp, in eye axes right, up, back."""
        a, e = np.radians(self.light_azimuth), np.radians(self.light_elevation)
        return np.array([np.sin(a) * np.cos(e), np.sin(e), np.cos(a) * np.cos(e)])


@dataclass(frozen=True)
class Background:
    """sRGB and opacity, 0..1, at the top and the bottom of the picture."""

    top: tuple[float, float, float, float] = (0.145, 0.165, 0.195, 1.0)
    bottom: tuple[float, float, float, float] = (0.035, 0.04, 0.05, 1.0)

    def __post_init__(self) -> None:
        for name in ("top", "bottom"):
            try:
                color = tuple(float(c) for c in getattr(self, name))
            except (TypeError, ValueError):
                color = ()
            if len(color) != 4 or not all(0 <= c <= 1 for c in color):
                raise UsageError(
                    "a background is red, green, blue, opacity, each from 0 to 1",
                    field=f"background.{name}",
                )
            object.__setattr__(self, name, color)

    @classmethod
    def plain(cls, color: Sequence[float]) -> Background:
        """The same colour everywhere; three numbers are opaque."""
        given = (*color, 1.0) if len(color) == 3 else tuple(color)
        return cls(given, given)  # type: ignore[arg-type]  # checked there


@dataclass(frozen=True)
class Source:
    """Where the volume came from, so that a scene file finds it again.

    path: as given, or `sample:name`. sha256: of the file's bytes (a folder: of its files' names
    and bytes in order). choices: reader options that were not the default.
    """

    path: str
    sha256: str = ""
    choices: tuple[tuple[str, Any], ...] = ()


@dataclass(frozen=True)
class Bookmark:
    """A view that was kept. name: what people call it, not empty, not unique."""

    name: str
    camera: Camera

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not 0 < len(self.name) <= MAX_NAME:
            raise UsageError(
                f"a bookmark's name has 1 to {MAX_NAME} letters", field="bookmarks.name"
            )


@dataclass(frozen=True)
class SceneState:
    """Everything that decides the picture but its size, and the views that were kept.

    `volume` is compared by identity.
    """

    volume: Volume
    transfer: TransferFunction
    camera: Camera
    raycast: Raycast = Raycast()
    light: Light = Light()
    background: Background = Background()
    source: Source | None = None
    bookmarks: tuple[Bookmark, ...] = ()
    surfaces: tuple[SceneSurface, ...] = ()
    lens: Lens = field(default_factory=Lens)

    def with_raycast(self, **knobs: Any) -> Self:
        """The same scene with knobs turned; unknown names raise UsageError."""
        return self.with_knobs(**knobs)

    def with_knobs(self, **knobs: Any) -> Self:
        """The same scene with knobs turned, found by name in raycast, light, camera and lens."""
        parts: dict[str, Any] = {
            p: getattr(self, p) for p in ("raycast", "light", "camera", "lens")
        }
        owners = {k.name: part for part, owner in parts.items() for k in knobs_of(type(owner))}
        turned: dict[str, dict[str, Any]] = {}
        for name, value in knobs.items():
            if name not in owners:
                raise UsageError(
                    f"unknown knob '{name}'", field=name, fix=did_you_mean(name, owners)
                )
            turned.setdefault(owners[name], {})[name] = value
        changed: dict[str, Any] = {p: replace(parts[p], **v) for p, v in turned.items()}
        return replace(self, **changed)

    def with_transfer(self, transfer: TransferFunction) -> Self:
        """The same scene with another transfer function."""
        return replace(self, transfer=transfer)

    def with_camera(self, camera: Camera) -> Self:
        """The same scene from another camera."""
        return replace(self, camera=camera)

    def with_bookmarks(self, bookmarks: Sequence[Bookmark]) -> Self:
        """The same scene with these kept views instead of its own."""
        return replace(self, bookmarks=tuple(bookmarks))

    def with_surfaces(self, surfaces: Iterable[SceneSurface]) -> Self:
        """The same scene with these isosurfaces instead of its own; UsageError for what is none."""
        given: tuple[Any, ...] = tuple(surfaces) if isinstance(surfaces, Iterable) else (None,)
        if not all(isinstance(s, SceneSurface) for s in given):
            raise UsageError(
                f"{surfaces!r} is no list of surfaces",
                field="surfaces",
                fix="give e.g. [volviz.SceneSurface.at(300)]",
            )
        return replace(self, surfaces=given)

    def with_background(self, *color: float) -> Self:
        """The same scene on a plain background: red, green, blue and, if given, opacity."""
        return replace(self, background=Background.plain(color))


def box_corners(volume: Volume) -> NDArray[np.float64]:
    """float64[8, 3]: world corners of the box of voxels, half a voxel beyond the outer centres."""
    x, y, z = volume.dims
    ends = np.array([[i, j, k] for k in (0, z) for j in (0, y) for i in (0, x)]) - 0.5
    return ends @ volume.affine[:3, :3].T + volume.affine[:3, 3]
