"""A volume in a TIFF and its planes, as every kind of TIFF is described to the reader of pixels."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Plane:
    """One plane.

    page: its IFD (None where it has none of its own); offset: of its raw bytes, if they lie one
    behind the other; name, number: file and page of a plane that lies in another file.
    """

    page: Any = None
    offset: int | None = None
    name: str = ""
    number: int = 0


@dataclass(frozen=True)
class Layout:
    """A volume in a TIFF.

    key: the page that stands for all; plane(t, c, z): where it is, None if nowhere.

    colour: samples are R, G, B. sampled: channels are samples of one page. steps: mm or units, None
    where not given. unit: None if not known.
    """

    kind: str
    key: Any
    times: int
    channels: int
    depth: int
    plane: Callable[[int, int, int], Plane | None]
    colour: bool = False
    sampled: bool = False
    steps: tuple[float | None, float | None, float | None] = (None, None, None)
    unit: str | None = None
    window: tuple[float, float] | None = None
    name: str = ""
    channel_names: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    signed16: bool = False
    palette: NDArray[np.uint8] | None = None
    fields: Mapping[str, str] | None = None

    @property
    def width(self) -> int:
        """Samples along x."""
        return int(self.key.imagewidth)

    @property
    def height(self) -> int:
        """Samples along y."""
        return int(self.key.imagelength)
