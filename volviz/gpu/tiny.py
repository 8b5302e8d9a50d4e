"""Frames by what compiling their shaders depends on, and the smallest frame of the same kind.

That is which shader files are taken, the kind of each texture, whether its sides are powers of two
(llvmpipe makes code for either), and how surfaces look; no number that a slider changes.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from volviz.gpu.passes import raycast
from volviz.gpu.passes.raycast import Ends
from volviz.model.camera import Camera
from volviz.model.frame import DrawnMesh, Emptiness, Frame, Voxels
from volviz.model.mesh import Mesh

POWER, NO_POWER = 4, 5
"""Sides of tiny textures."""


def key_of(frame: Frame) -> str:
    """Frames of the same kind have the same key, a word of ASCII."""
    empty = raycast.leaps(frame)
    kinds = (
        sorted(raycast.choices(frame, Ends()).items()),
        frame.raycast.show_volume,
        frame.raycast.interpolation,
        frame.voxels.array.dtype.name,
        frame.voxels.masked,
        tuple(map(_side, frame.voxels.dims)),
        len(frame.table.entries),
        None if empty is None else tuple(map(_side, empty.distance.shape)),
        sorted({_looks(m) for m in frame.meshes if not m.mesh.empty}),
    )
    return hashlib.sha256(repr(kinds).encode()).hexdigest()[:24]


def tiny(frame: Frame) -> Frame:
    """A frame of the same kind with a few samples and triangles, all in sight."""
    voxels = frame.voxels
    nx, ny, nz = map(_side, voxels.dims)
    shape = (nz, ny, nx, 2) if voxels.masked else (nz, ny, nx)
    empty = raycast.leaps(frame)
    if empty is not None:
        sides = tuple(map(_side, empty.distance.shape))
        empty = Emptiness(np.zeros(sides, np.uint8), empty.side, empty.shown)
    middle = np.array((nx - 1, ny - 1, nz - 1)) / 2
    entries = np.full_like(frame.table.entries, 0.5)
    return replace(
        frame,
        voxels=Voxels(np.ones(shape, voxels.array.dtype), voxels.scale, voxels.offset),
        affine=np.eye(4),
        table=replace(frame.table, entries=entries),
        camera=Camera(position=(middle[0], middle[1] - 30.0, middle[2]), target=tuple(middle)),
        raycast=replace(frame.raycast, samples=1),
        emptiness=empty,
        meshes=tuple(_few(_kinds(frame.meshes), middle)),
        notes=(),
    )


def _side(count: int) -> int:
    return POWER if count & (count - 1) == 0 else NO_POWER


def _kinds(meshes: Sequence[DrawnMesh]) -> list[DrawnMesh]:
    """One of each kind."""
    return list({_looks(m): m for m in meshes if not m.mesh.empty}.values())


def _looks(drawn: DrawnMesh) -> tuple[Any, ...]:
    mesh, look = drawn.mesh, drawn.look
    parts = len(mesh.faces) > 0, len(mesh.normals) > 0, mesh.colors is not None
    return (*parts, look.shading, look.wireframe, look.sides, drawn.opaque)


def _few(meshes: Sequence[DrawnMesh], middle: Any) -> list[DrawnMesh]:
    """A triangle for each, one behind the other."""
    corners = np.array([(-1, 0, -1), (1, 0, -1), (0, 0, 1)], np.float32)
    made = []
    for number, drawn in enumerate(meshes):
        vertices = (middle + corners + (0, 0.1 * number, 0)).astype(np.float32)
        has_faces, has_normals, has_colors = _looks(drawn)[:3]
        faces = np.array([[0, 1, 2], [0, 2, 1]] if has_faces else np.empty((0, 3)), np.uint32)
        normals = np.tile(np.array((0, -1, 0), np.float32), (3 if has_normals else 0, 1))
        opacity = 255 if drawn.opaque else 128
        colors = np.full((3, 4), opacity, np.uint8) if has_colors else None
        mesh = Mesh(vertices, faces, normals, colors=colors)
        made.append(replace(drawn, mesh=mesh, coarse=None))
    return made
