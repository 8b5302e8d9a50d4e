"""What the renderer gets: answers as numpy arrays, and the choices that it needs to draw them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from volviz.model.camera import Camera
from volviz.model.mesh import Mesh
from volviz.model.scene import Background, Light, Raycast
from volviz.model.surface_look import SurfaceLook

MAX_STEPS = 1 << 18


@dataclass(frozen=True, eq=False)
class Voxels:
    """A volume as the texture gets it.

    array: uint8, uint16 or float32, [z, y, x] or, masked, [z, y, x, 2] with (value·valid, valid).
    A value is texel·scale + offset, the texel being 0..1 for integers and the number itself for
    floats. Compared by identity.
    """

    array: NDArray[np.uint8] | NDArray[np.uint16] | NDArray[np.float32]
    scale: float
    offset: float
    note: str | None = None

    @property
    def masked(self) -> bool:
        """True if there is a validity channel."""
        return self.array.ndim == 4

    @property
    def dims(self) -> tuple[int, int, int]:
        """Samples along x, y, z."""
        return self.array.shape[2], self.array.shape[1], self.array.shape[0]

    @property
    def nbytes(self) -> int:
        """Bytes of the texture."""
        return self.array.nbytes


@dataclass(frozen=True, eq=False)
class ColorTable:
    """A transfer function as numbers. entries: float32[n, 4], linear-light colour (not
    premultiplied) and opacity per unit distance, evenly spaced over the values low..high."""

    entries: NDArray[np.float32]
    low: float
    high: float
    unit_distance: float

    @property
    def per_value(self) -> float:
        """Entries per unit of value; 0 where all values share one."""
        span = self.high - self.low
        return (len(self.entries) - 1) / span if span > 1e-300 else 0.0


@dataclass(frozen=True, eq=False)
class Emptiness:
    """Where a ray sees nothing. distance: uint8[bz, by, bx], in bricks of `side` samples, to the
    nearest brick that shows something (0: this one). shown: part of the bricks that do."""

    distance: NDArray[np.uint8]
    side: int
    shown: float


@dataclass(frozen=True, eq=False)
class DrawnMesh:
    """A mesh and how it looks. color: of the whole mesh, sRGB; None: the mesh's own colours.

    coarse: a lighter mesh for while things move, None if that one is light.
    """

    mesh: Mesh
    look: SurfaceLook
    color: tuple[float, float, float] | None
    coarse: Mesh | None = None

    @property
    def opaque(self) -> bool:
        """True if nothing shines through it anywhere, or nothing is to."""
        if self.look.wireframe == "hidden-line" and len(self.mesh.faces):
            return True
        own = self.mesh.colors if self.color is None else None
        return self.look.opacity >= 1.0 and (own is None or bool((own[:, 3] == 255).all()))


@dataclass(frozen=True, eq=False)
class Frame:
    """All that a picture needs. affine: float64[4, 4], voxel-centre index to world mm, of `voxels`.

    emptiness: bricks to leap over, None to take every sample. meshes: surfaces that stand in the
    volume. notes: what a person should be told about this picture.
    """

    voxels: Voxels
    affine: NDArray[np.float64]
    table: ColorTable
    camera: Camera
    raycast: Raycast
    light: Light
    background: Background
    emptiness: Emptiness | None = None
    meshes: tuple[DrawnMesh, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def spacing(self) -> float:
        """Smallest distance between neighbouring samples, mm; axes of one sample don't count."""
        steps = np.linalg.norm(self.affine[:3, :3], axis=0)
        long = [s for s, n in zip(steps, self.voxels.dims, strict=True) if n > 1]
        return float(min(long or steps))

    @property
    def longest_side(self) -> float:
        """Of the box, in units of `spacing`."""
        return float(max(np.linalg.norm(self.affine[:3, :3], axis=0) * self.voxels.dims)) / (
            self.spacing
        )

    @property
    def step(self) -> float:
        """Distance between samples, in units of `spacing`: the knob's, but at most `MAX_STEPS`
        samples along a side, which only grids thousands of times longer than a voxel ask for."""
        return max(self.raycast.step, self.longest_side / MAX_STEPS)
