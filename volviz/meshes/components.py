"""The connected parts of a mesh: numbered, and the small ones dropped."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from volviz.meshes.adjacency import joined
from volviz.meshes.attributes import faces_kept
from volviz.meshes.normals import face_areas
from volviz.model.mesh import Mesh
from volviz.progress import Progress


def components(mesh: Mesh) -> tuple[NDArray[np.int32], int]:
    """int32[m]: the component of each face, from 0, and how many there are.

    Faces that share a vertex are connected. The components are numbered in the order of their
    first vertices.
    """
    faces = mesh.faces.astype(np.int32)
    roots = joined(np.concatenate([faces[:, :2], faces[:, 1:]]), len(mesh.vertices))
    of_face = roots[faces[:, 0]] if len(faces) else np.empty(0, np.int32)
    first = np.zeros(len(mesh.vertices), bool)
    first[of_face] = True
    number = np.cumsum(first, dtype=np.int32) - np.int32(1)
    return number[of_face], int(first.sum())


def largest_component(mesh: Mesh, progress: Progress | None = None) -> Mesh:
    """Only the component with the greatest area. Raises Cancelled."""
    labels, count = components(mesh)
    if count < 2:
        return mesh
    areas = np.bincount(labels, face_areas(mesh, progress), count)
    return faces_kept(mesh, labels == int(np.argmax(areas)))


def without_islands(
    mesh: Mesh,
    min_triangles: int = 0,
    min_area: float = 0.0,
    progress: Progress | None = None,
) -> Mesh:
    """Without the components of fewer triangles, or of less area in mm². Raises Cancelled."""
    labels, count = components(mesh)
    keep = np.bincount(labels, minlength=count) >= min_triangles
    if min_area > 0:
        keep &= np.bincount(labels, face_areas(mesh, progress), count) >= min_area
    return mesh if keep.all() else faces_kept(mesh, keep[labels])
