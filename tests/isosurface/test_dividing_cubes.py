"""Dividing cubes against the true surface, and against marching cubes as a picture."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from tests.isosurface.shapes import SHEARED, coordinates, sphere
from volviz.errors import LimitError
from volviz.isosurface.extractors import marching_cubes
from volviz.isosurface.extractors.dividing_cubes import extract, pixel_size
from volviz.model.camera import Camera
from volviz.model.volume import Volume


def active_parts(data, isovalue, parts=1):
    """int64[n, 3], x, y, z: parts of cells with corners on both sides, resampled by scipy."""
    shape = [(n - 1) * parts + 1 for n in data.shape]
    fine = map_coordinates(np.asarray(data, float), np.indices(shape) / parts, order=1)
    block = np.lib.stride_tricks.sliding_window_view(fine >= isovalue, (2, 2, 2))
    return np.argwhere(block.any(axis=(3, 4, 5)) & ~block.all(axis=(3, 4, 5)))[:, ::-1]


def in_samples(volume, points):
    inverse = np.linalg.inv(volume.affine)
    return points.astype(float) @ inverse[:3, :3].T + inverse[:3, 3]


@pytest.mark.parametrize("parts", [1, 4])
@pytest.mark.parametrize("kind", ["ball", "noise", "ties", "sheared"])
def test_each_active_part_has_one_point_in_it_and_on_the_trilinear_surface(kind, parts):
    rng = np.random.default_rng(4)
    data, isovalue, affine = {
        "ball": (sphere(12).data, 0.0, np.eye(4)),
        "noise": (rng.standard_normal((5, 6, 7)), 0.1, np.eye(4)),
        "ties": (rng.integers(0, 4, (5, 6, 7)).astype(float), 2.0, np.eye(4)),
        "sheared": (rng.standard_normal((5, 6, 7)), 0.1, SHEARED),
    }[kind]
    volume = Volume.from_array(data, affine=affine)
    size = max(volume.spacing) / parts if affine is not SHEARED else 0
    points = extract(volume, isovalue, size=size)
    index = in_samples(volume, points.vertices)
    cells = active_parts(data, isovalue, parts if size else 1)
    assert points.faces.shape == (0, 3)
    assert len(points.vertices) == len(cells)
    scaled = index * (parts if size else 1)
    low = {tuple(c) for c in cells}
    near = np.floor(np.stack([scaled - 1e-4, scaled + 1e-4])).astype(int)
    own = [
        {(x, y, z) for x in xs for y in ys for z in zs} & low
        for xs, ys, zs in zip(*(near[:, :, k].T for k in range(3)), strict=True)
    ]
    assert all(own)
    assert len(set().union(*own)) == len(low)
    value = map_coordinates(np.asarray(data, float), index.T[::-1], order=1, mode="nearest")
    assert np.abs(value - isovalue).max() < 2e-5 * np.ptp(data)


def test_points_come_to_the_sphere_with_the_square_of_the_spacing():
    """A trilinear function is about h² / 8 times the second derivatives from what it was taken of:
    1 / 0.7 along two ways."""
    for n in (11, 21, 41):
        volume = sphere(n)
        radius = np.linalg.norm(extract(volume, 0.0).vertices.astype(float), axis=1)
        assert np.abs(radius - 0.7).max() < 1.1 * volume.spacing[0] ** 2 * 2 / 8 / 0.7


def test_points_on_a_plane_are_the_feet_of_the_middles():
    """The nearest points of the surface, in the world: also where voxels are long or aslant."""
    z, y, x = np.indices((6, 7, 8)).astype(float)
    for affine in (np.eye(4), np.diag([1, 1, 3, 1.0]), SHEARED):
        volume = Volume.from_array(x + 2 * y - z, affine=affine)
        points = extract(volume, 4.2)
        cells = active_parts(volume.data, 4.2)
        slope = np.linalg.inv(affine[:3, :3]).T @ [1, 2, -1]
        middle = cells + 0.5
        off = (middle @ [1, 2, -1] - 4.2) / (slope @ slope)
        feet = middle @ affine[:3, :3].T + affine[:3, 3] - off[:, None] * slope
        index = in_samples(volume, feet)
        within = np.all((index >= cells) & (index <= cells + 1), axis=1)
        assert within.mean() > 0.4
        assert np.allclose(points.vertices[within], feet[within], atol=1e-5)


@pytest.mark.parametrize("size", [0.05, 0.02])
def test_points_lie_on_the_sphere_and_close_enough(size):
    volume = sphere(20)
    points = extract(volume, 0.0, size=size)
    radius = np.linalg.norm(points.vertices, axis=1)
    step = volume.spacing[0]
    part = step / np.ceil(step / size)
    assert np.abs(radius - 0.7).max() <= 1.1 * step**2 * 2 / 8 / 0.7
    outward = points.vertices / radius[:, None]
    assert np.abs(points.normals - outward).max() < 0.1
    ways = np.random.default_rng(2).standard_normal((200, 3))
    ways *= 0.7 / np.linalg.norm(ways, axis=1, keepdims=True)
    gaps = np.linalg.norm(ways[:, None] - points.vertices[None], axis=2).min(axis=1)
    assert gaps.max() <= part * np.sqrt(3) / 2 + step**2 / 4


def test_the_depth_follows_the_pixels_of_a_camera():
    volume = Volume.from_array(sphere(16).data)
    middle = (7.5, 7.5, 7.5)
    near = Camera(position=(7.5, -30, 7.5), target=middle)
    counts = [len(extract(volume, 0.0, camera=near, pixels=n).vertices) for n in (16, 64, 256)]
    assert counts[0] < counts[1] < counts[2] / 8
    flat = Camera(position=near.position, target=middle, projection="orthographic", height=32)
    points = extract(volume, 0.0, camera=flat, pixels=64)
    assert np.array_equal(points.vertices, extract(volume, 0.0, size=0.5).vertices)
    at = np.array([[7.5, -20.0, 7.5], [7.5, -31.0, 7.5]])
    width = pixel_size(near, 100, at)
    assert width[0] == pytest.approx(2 * np.tan(np.radians(15)) * 10 / 100)
    assert np.isinf(width[1])


def picture(points, side, box):
    """Depth seen along y: least y per pixel."""
    out = np.full((side, side), np.inf)
    at = np.floor((points[:, [0, 2]] - box[0]) / (box[1] - box[0]) * side).astype(int)
    np.minimum.at(out, (at[:, 0], at[:, 1]), points[:, 1])
    return out


def test_a_picture_is_that_of_marching_cubes():
    volume = sphere(24)
    mesh = marching_cubes.extract(volume, 0.0)
    weights = np.random.default_rng(1).dirichlet([1, 1, 1], (len(mesh.faces), 40))
    dense = np.einsum("ftk,fkd->ftd", weights, mesh.vertices[mesh.faces]).reshape(-1, 3)
    ours = picture(extract(volume, 0.0, size=2 / 64).vertices, 32, (-1, 1))
    theirs = picture(dense, 32, (-1, 1))
    seen = np.isfinite(ours) & np.isfinite(theirs)
    assert np.mean(np.isfinite(ours) == np.isfinite(theirs)) > 0.96
    assert np.median(np.abs(ours[seen] - theirs[seen])) < 2 / 64


@pytest.mark.parametrize("operator", ["central", "sobel", "forward", "backward", "none"])
def test_normals_of_a_linear_function(operator):
    z, y, x = np.indices((5, 6, 7)).astype(float)
    volume = Volume.from_array(x + 2 * y - z, affine=SHEARED)
    points = extract(volume, 4.2, size=0.5, normals=operator)
    slope = np.linalg.inv(SHEARED[:3, :3]).T @ [1, 2, -1]
    expected = np.empty((0, 3)) if operator == "none" else -slope / np.linalg.norm(slope)
    assert np.allclose(points.normals, expected, atol=1e-6)


def test_too_many_points_are_refused():
    x, _, _, _ = coordinates(180)
    with pytest.raises(LimitError, match="greater distance"):
        extract(Volume.from_array(x.astype(np.float32)), 0.5, size=0.001)
