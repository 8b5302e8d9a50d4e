"""Meshes in closed form, with what is known of them."""

from __future__ import annotations

import numpy as np

from volviz.model.mesh import Mesh


def mesh_of(vertices, faces, **more) -> Mesh:
    return Mesh(np.asarray(vertices, np.float32), np.asarray(faces, np.uint32), **more)


def torus(major=3.0, minor=1.0, along=48, around=24) -> Mesh:
    """χ = 0, genus 1, area 4π²Rr, volume 2π²Rr²."""
    u = np.arange(along) * 2 * np.pi / along
    v = np.arange(around) * 2 * np.pi / around
    u, v = np.meshgrid(u, v, indexing="ij")
    ring = major + minor * np.cos(v)
    points = np.stack([ring * np.cos(u), ring * np.sin(u), minor * np.sin(v)], axis=-1)
    i, j = np.meshgrid(np.arange(along), np.arange(around), indexing="ij")
    return mesh_of(points.reshape(-1, 3), grid_faces(i, j, along, around, wrap=True))


def grid_faces(i, j, rows, columns, wrap=False) -> np.ndarray:
    at = lambda a, b: (a % rows if wrap else a) * columns + (b % columns if wrap else b)  # noqa: E731
    a, b, c, d = at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)
    quads = [np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)]
    return np.concatenate(quads)


def plane(n=21, height=None) -> Mesh:
    """A square of side 1 with (n − 1)² cells in the plane z = 0, or z = height(x, y)."""
    x, y = np.meshgrid(np.linspace(0, 1, n), np.linspace(0, 1, n), indexing="ij")
    z = np.zeros_like(x) if height is None else height(x, y)
    i, j = np.meshgrid(np.arange(n - 1), np.arange(n - 1), indexing="ij")
    return mesh_of(np.stack([x, y, z], -1).reshape(-1, 3), grid_faces(i, j, n, n))


def sphere(radius=1.0, subdivisions=3) -> Mesh:
    import trimesh

    made = trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius)
    return mesh_of(made.vertices, made.faces)


def joined(*meshes: Mesh) -> Mesh:
    """Several meshes as one."""
    starts = np.cumsum([0, *(len(m.vertices) for m in meshes)])
    return mesh_of(
        np.concatenate([m.vertices for m in meshes]),
        np.concatenate([m.faces + s for m, s in zip(meshes, starts, strict=False)]),
    )


def voxels(solid) -> Mesh:
    """The faces between 1 and 0 of a boolean array, a vertex per lattice point: closed."""
    solid = np.pad(solid, 1)
    faces = []
    number = np.arange(np.prod([n + 1 for n in solid.shape])).reshape([n + 1 for n in solid.shape])
    for axis in range(3):
        turned = np.moveaxis(solid, axis, 0).astype(np.int8)
        lattice = np.moveaxis(number, axis, 0)
        step = np.diff(turned, axis=0)
        for sign in (1, -1):
            k, i, j = np.nonzero(step == sign)
            quad = [lattice[k + 1, i + a, j + b] for a, b in ((0, 0), (1, 0), (1, 1), (0, 1))]
            flip = (sign == 1) != (axis == 1)
            quad = quad[::-1] if flip else quad
            faces += [np.stack([quad[0], quad[1], quad[2]], -1)]
            faces += [np.stack([quad[0], quad[2], quad[3]], -1)]
    faces = np.concatenate(faces)
    used, faces = np.unique(faces, return_inverse=True)
    places = np.stack(np.unravel_index(used, number.shape), -1)
    return mesh_of(places, faces.reshape(-1, 3))


def double_torus() -> Mesh:
    """A plate of 5 × 3 with two holes: χ = −2, genus 2, volume 13, area 2 · 13 + 16 + 2 · 4."""
    solid = np.ones((5, 3, 1), bool)
    solid[1, 1], solid[3, 1] = False, False
    return voxels(solid)
