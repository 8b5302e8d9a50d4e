"""How an isosurface looks, apart from what it is made of (`surface.py`)."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from typing import Any, Self

from volviz.errors import UsageError, did_you_mean
from volviz.model.knobs import check_knobs, knob, knobs_of
from volviz.model.refining import Refining
from volviz.model.surface import Surface

SHADINGS = ("flat", "gouraud", "phong")
WIREFRAMES = ("off", "overlay", "only", "hidden-line")
SIDES = ("both", "front", "back")
COLORINGS = ("color", "transfer", "field")
FIELDS = ("gradient-magnitude", "x", "y", "z")
"""Fields that every volume has; any other name is that of another volume."""
BY_TRANSFER = "transfer"
COLORMAPS = (
    "viridis",
    "inferno",
    "coolwarm",
    "magma",
    "plasma",
    "cividis",
    "gray",
    "ember",
    "tissue",
    "clay",
    "ice",
    BY_TRANSFER,
)
"""Ramps of `classify.colormaps`, or the scene's transfer function."""
MAX_SURFACES = 64

Rgb = tuple[float, float, float]

# Bone, skin, then colours that can be told apart by most people (Okabe and Ito 2008), lightened.
COLORS: tuple[Rgb, ...] = (
    (0.93, 0.88, 0.76),
    (0.88, 0.62, 0.50),
    (0.40, 0.71, 0.91),
    (0.35, 0.76, 0.60),
    (0.90, 0.72, 0.25),
    (0.84, 0.50, 0.70),
)


@dataclass(frozen=True)
class SurfaceLook:
    """Colour, opacity and light of one surface. color: sRGB, 0..1."""

    color: Rgb = COLORS[0]
    opacity: float = knob(1.0, "1 hides what is behind; less lets it shine through", low=0, high=1)
    shading: str = knob(
        "phong", "light per triangle, at its vertices, or at every pixel", choices=SHADINGS
    )
    sides: str = knob("both", "which sides of the triangles are drawn", choices=SIDES)
    wireframe: str = knob(
        "off",
        "the edges of the triangles: over them, alone, or alone without those that the surface "
        "itself hides",
        choices=WIREFRAMES,
    )
    coloring: str = knob(
        "color",
        "its own colour, the transfer function's at the isovalue, or by a second field",
        choices=COLORINGS,
    )
    color_field: str = knob(
        "gradient-magnitude",
        "the second field: gradient-magnitude, x, y or z, or a file with another volume, "
        "sampled where the surface is in the world",
    )
    colormap: str = knob("viridis", "colours of the second field", choices=COLORMAPS)
    color_low: float = knob(0.0, "value of the first colour; as the last: 2nd to 98th percentile")
    color_high: float = knob(0.0, "value of the last colour; as the first: 2nd to 98th percentile")
    highlight: float = knob(0.3, "how strongly the lamp is mirrored", low=0, high=2)
    gloss: float = knob(32.0, "sharpness of the highlight", low=1, high=1000)
    point_size: float = knob(
        2.0,
        "of a surface made of points, at least; larger where they would leave holes",
        low=1,
        high=32,
        unit="pixels",
        used_with={"method": ("dividing-cubes",)},
    )
    visible: bool = knob(True, "draw this surface")

    def __post_init__(self) -> None:
        check_knobs(self)
        if not isinstance(self.color_field, str) or not self.color_field.strip():
            raise UsageError(
                "the field that colours the surface has no name",
                field="surface.color_field",
                fix=f"give {', '.join(FIELDS)} or a file",
            )
        try:
            color = tuple(float(c) for c in self.color)
        except (TypeError, ValueError):
            color = ()
        if len(color) != 3 or not all(0 <= c <= 1 for c in color):
            raise UsageError(
                "a surface's colour is red, green, blue, each from 0 to 1", field="surface.color"
            )
        object.__setattr__(self, "color", color)


@dataclass(frozen=True)
class SceneSurface:
    """One isosurface of a scene: what it is made of, how it looks, what is done to its mesh."""

    surface: Surface = field(default_factory=Surface)
    look: SurfaceLook = field(default_factory=SurfaceLook)
    refining: Refining = field(default_factory=Refining)

    @classmethod
    def at(cls, isovalue: float, **knobs: Any) -> Self:
        """A surface by its isovalue, with knobs of `Surface`, `SurfaceLook` and `Refining` by name.

        Raises UsageError for a knob that there is not, with the nearest name.
        """
        made = {k.name for k in knobs_of(Surface)} - {"isovalue"}
        done = {k.name for k in knobs_of(Refining)}
        known = made | done | {f.name for f in fields(SurfaceLook)}
        for name in knobs:
            if name not in known:
                raise UsageError(
                    f"a surface has no '{name}'", field=name, fix=did_you_mean(name, known)
                )
        spec = {n: v for n, v in knobs.items() if n in made}
        steps = {n: v for n, v in knobs.items() if n in done}
        look = {n: v for n, v in knobs.items() if n not in made | done}
        return cls(Surface(isovalue, **spec), SurfaceLook(**look), Refining(**steps))

    def with_isovalue(self, isovalue: float) -> Self:
        """The same surface at another value."""
        return replace(self, surface=replace(self.surface, isovalue=isovalue))
