"""Materials of the sample head, and the canvas they are painted on."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from volviz.samples.shapes import Array, Grid, Part, carve

MATERIALS: dict[str, tuple[int, float]] = {
    "air": (0, -1000.0),
    "skin": (1, 55.0),
    "fat": (2, -100.0),
    "muscle": (3, 62.0),
    "gland": (4, 20.0),
    "mucosa": (5, 42.0),
    "cartilage": (6, 130.0),
    "compact bone": (7, 1500.0),
    "spongy bone": (8, 480.0),
    "csf": (9, 8.0),
    "grey matter": (10, 37.0),
    "white matter": (11, 28.0),
    "vitreous": (12, 10.0),
    "sclera and nerve": (13, 48.0),
    "lens": (14, 110.0),
    "blood": (15, 45.0),
    "dentine": (16, 1750.0),
    "enamel": (17, 2850.0),
    "metal": (18, 8000.0),
}
"""Name -> (number in the truth volume, mean Hounsfield units)."""


@dataclass(eq=False)
class Canvas:
    """Hounsfield units and material numbers on a grid, painted over and over.

    edge: width in mm over which a border is blended, one sample spacing, as partial volume does.
    """

    grid: Grid
    edge: float
    values: Array = field(init=False)
    labels: NDArray[np.uint8] = field(init=False)

    def __post_init__(self) -> None:
        self.values = np.full(self.grid.shape, MATERIALS["air"][1], np.float32)
        self.labels = np.zeros(self.grid.shape, np.uint8)

    def fill(
        self,
        distance: Array,
        material: str,
        window: tuple[slice, slice, slice] = (slice(None),) * 3,
    ) -> None:
        """Paint where `distance` (of the window's shape) is negative."""
        number, value = MATERIALS[material]
        cover = np.clip(np.float32(0.5) - distance * np.float32(1 / self.edge), 0, 1)
        values = self.values[window]
        cover *= np.float32(value) - values
        values += cover
        self.labels[window][distance < 0] = number

    def paint(
        self, parts: Iterable[Part], material: str, within: Array | None = None, inset: float = 0.0
    ) -> None:
        """Paint a body; `within` is the distance to a body that it must not leave by `inset` mm."""
        parts = tuple(parts)
        boxes = np.array([[p.shape.low, p.shape.high] for p in parts if p.how == "add"])
        window = self.grid.window(boxes[:, 0].min(0).tolist(), boxes[:, 1].max(0).tolist(), 3.0)
        if window is None:
            return
        body = carve(self.grid.part(window), parts)
        if within is not None:
            np.maximum(body, within[window] + np.float32(inset), out=body)
        self.fill(body, material, window)
