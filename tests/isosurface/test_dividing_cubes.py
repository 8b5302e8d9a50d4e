"""Dividing cubes against the true surface, and against marching cubes as a picture."""

from __future__ import annotations

import numpy as np
import pytest

from tests.isosurface.shapes import SHEARED, coordinates, sphere
from volviz.errors import LimitError
from volviz.isosurface.extractors import marching_cubes
from volviz.isosurface.extractors.dividing_cubes import extract, pixel_size
from volviz.model.camera import Camera
from volviz.model.volume import Volume


def test_one_point_per_active_cell():
    volume = sphere(12)
    inside = np.lib.stride_tricks.sliding_window_view(volume.data >= 0, (2, 2, 2))
    some, every = inside.any(axis=(3, 4, 5)), inside.all(axis=(3, 4, 5))
    expected = (np.argwhere(some & ~every)[:, ::-1] + 0.5) @ volume.affine[:3, :3].T
    points = extract(volume, 0.0)
    assert points.faces.shape == (0, 3)
    assert np.allclose(points.vertices, expected + volume.affine[:3, 3], atol=1e-6)


@pytest.mark.parametrize("size", [0.05, 0.02])
def test_points_lie_near_the_sphere_and_close_enough(size):
    volume = sphere(20)
    points = extract(volume, 0.0, size=size)
    radius = np.linalg.norm(points.vertices, axis=1)
    step = volume.spacing[0]
    part = step / np.ceil(step / size)
    bend = step**2 * 3 / 8 / 0.7  # how far trilinear values are from the sphere's
    assert np.abs(radius - 0.7).max() <= part * np.sqrt(3) / 2 + bend
    outward = points.vertices / radius[:, None]
    assert np.abs(points.normals - outward).max() < 0.1
    ways = np.random.default_rng(2).standard_normal((200, 3))
    ways *= 0.7 / np.linalg.norm(ways, axis=1, keepdims=True)
    gaps = np.linalg.norm(ways[:, None] - points.vertices[None], axis=2).min(axis=1)
    assert gaps.max() <= part * np.sqrt(3) / 2 + bend + 1e-6


def test_each_part_that_the_trilinear_function_crosses_has_its_point():
    data = np.random.default_rng(4).standard_normal((3, 3, 3))
    volume, found = Volume.from_array(data), []
    from scipy.ndimage import map_coordinates

    m = 4
    fine = map_coordinates(data, np.indices((9, 9, 9)) / m, order=1) >= 0.1
    block = np.lib.stride_tricks.sliding_window_view(fine, (2, 2, 2))
    found = np.argwhere(block.any(axis=(3, 4, 5)) & ~block.all(axis=(3, 4, 5)))[:, ::-1]
    points = extract(volume, 0.1, size=0.25).vertices
    assert {tuple(p) for p in np.floor(points * m).astype(int)} == {tuple(p) for p in found}
    assert len(points) == len(found)


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
