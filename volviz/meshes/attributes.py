"""Parts of meshes, and what goes with their vertices."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volviz.model.mesh import Mesh


def packed(mesh: Mesh) -> NDArray[np.float32]:
    """float32[n, k]: normals, value and colour of each vertex side by side, as far as there are."""
    count = len(mesh.vertices)
    columns: list[NDArray[Any]] = [mesh.normals] if len(mesh.normals) else []
    if mesh.values is not None:
        columns.append(mesh.values[:, None])
    if mesh.colors is not None:
        columns.append(mesh.colors)
    return np.concatenate([np.empty((count, 0)), *columns], axis=1).astype(np.float32)


def unpacked(mesh: Mesh, packs: NDArray[np.float32]) -> dict[str, Any]:
    """The fields of a mesh like `mesh` from what `packed` made, normals at unit length again."""
    fields: dict[str, Any] = {"normals": np.empty((0, 3), np.float32)}
    if len(mesh.normals):
        fields["normals"], packs = unit(packs[:, :3]), packs[:, 3:]
    if mesh.values is not None:
        fields["values"], packs = packs[:, 0], packs[:, 1:]
    if mesh.colors is not None:
        fields["colors"] = np.rint(packs).clip(0, 255).astype(np.uint8)
    return fields


def unit(vectors: NDArray[Any]) -> NDArray[np.float32]:
    """float32[n, 3]: the vectors at length 1; those without a length stay 0."""
    wide = vectors.astype(np.float64)
    length = np.linalg.norm(wide, axis=1, keepdims=True)
    return (wide / np.where(length > 0, length, 1.0)).astype(np.float32)


def taken(mesh: Mesh, vertices: NDArray[np.intp]) -> Mesh:
    """Some vertices of a mesh with what goes with them, by index; no faces."""
    return replace(
        mesh,
        vertices=mesh.vertices[vertices],
        faces=np.empty((0, 3), np.uint32),
        normals=mesh.normals[vertices] if len(mesh.normals) else mesh.normals,
        values=None if mesh.values is None else mesh.values[vertices],
        colors=None if mesh.colors is None else mesh.colors[vertices],
    )


def faces_kept(mesh: Mesh, keep: NDArray[np.bool_]) -> Mesh:
    """The mesh of the faces where `keep`, bool[m], is true; vertices without a face go."""
    faces = mesh.faces[keep]
    used = np.zeros(len(mesh.vertices), bool)
    used[faces] = True
    number = np.cumsum(used, dtype=np.uint32) - np.uint32(1)
    return replace(taken(mesh, np.flatnonzero(used)), faces=number[faces])
