"""What the camera decides: the depth of dividing cubes, the size and the front of cuberille."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

import volviz
from tests.isosurface import oracles
from tests.isosurface.shapes import SHEARED, sphere
from volviz.errors import UsageError
from volviz.isosurface import extract
from volviz.model.camera import Camera
from volviz.model.lens import SeenSurface, Viewing, seen
from volviz.model.surface import Surface

BALL = volviz.Volume.from_array(sphere(14).data, affine=SHEARED)
MIDDLE = SHEARED[:3, :3] @ [6.5, 6.5, 6.5] + SHEARED[:3, 3]
EYE = np.add(MIDDLE, (60, -80, 30))
CLOSE = np.add(MIDDLE, (14, -9, 4))
NEAR = Camera(tuple(EYE), tuple(MIDDLE), (0, 0, 1), fov=20)
FLAT = replace(NEAR, projection="orthographic", height=20.0)


def made(camera, size=(400, 300), **knobs):
    return extract(BALL, seen(Surface(0.0, **knobs), Viewing(camera, size)))


def pixels_across(camera, points, height):
    """mm of a pixel at points, from the definition of a pinhole."""
    if camera.projection == "orthographic":
        return np.full(len(points), camera.height / height)
    way = (np.array(camera.target) - camera.position) / np.linalg.norm(
        np.array(camera.target) - camera.position
    )
    depth = (points - camera.position) @ way
    return 2 * depth * np.tan(np.radians(camera.fov / 2)) / height


@pytest.mark.parametrize("camera", [NEAR, FLAT], ids=["perspective", "orthographic"])
def test_points_are_as_dense_as_pixels(camera):
    """Twice as many pixels, or half as many in one point: a point has its neighbour within that."""
    for size, wanted in (((400, 300), 8.0), ((800, 600), 16.0), ((400, 300), 4.0)):
        mesh = made(camera, size, method="dividing-cubes", size_pixels=wanted)
        wide = pixels_across(camera, mesh.vertices, min(size)) * wanted
        near = cKDTree(mesh.vertices).query(mesh.vertices, k=2)[0][:, 1]
        assert np.quantile(near / wide, 0.95) < 1.8
        assert len(mesh.faces) == 0
    counts = [len(made(camera, method="dividing-cubes", size_pixels=p).vertices) for p in (8, 4, 2)]
    assert np.all(np.diff(np.log(counts)) > 0.7)
    one = made(camera, (400, 300), method="dividing-cubes", size_pixels=4)
    two = made(camera, (800, 600), method="dividing-cubes", size_pixels=8)
    assert np.array_equal(one.vertices, two.vertices)


def test_points_are_denser_where_the_camera_is_near():
    close = Camera(tuple(CLOSE), tuple(MIDDLE), (0, 0, 1), fov=60)
    mesh = made(close, method="dividing-cubes", size_pixels=8)
    depth = np.linalg.norm(mesh.vertices - close.position, axis=1)
    apart = cKDTree(mesh.vertices).query(mesh.vertices, k=2)[0][:, 1]
    front = depth < np.median(depth)
    assert np.median(apart[front]) < 0.8 * np.median(apart[~front])


@pytest.mark.parametrize("camera", [NEAR, FLAT], ids=["perspective", "orthographic"])
def test_faces_of_cuberille_are_no_larger_than_pixels(camera):
    for wanted in (16.0, 8.0):
        mesh = made(camera, method="cuberille", size_pixels=wanted)
        wide = pixels_across(camera, mesh.vertices, 300) * wanted
        corners = oracles.corners(mesh)
        sides = np.sort(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2), axis=1)
        assert sides[:, :2].max() <= wide.max() * 1.01
    whole = extract(BALL, Surface(0.0, method="cuberille"))
    assert len(mesh.faces) > len(whole.faces)
    far = replace(camera, position=tuple(MIDDLE + 1e4 * (EYE - MIDDLE)), height=1e5)
    same = made(far, method="cuberille", size_pixels=1.0)
    assert np.array_equal(same.faces, whole.faces)


@pytest.mark.parametrize("eye", [EYE, CLOSE, MIDDLE], ids=["far", "close", "within"])
@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
def test_only_the_faces_that_turn_to_the_camera(projection, eye):
    """Each triangle by its own line of sight, or by the one of all."""
    camera = Camera(
        tuple(eye), tuple(np.add(MIDDLE, (0.1, 0.2, 0))), (0, 0, 1), projection=projection
    )
    whole = extract(BALL, Surface(0.0, method="cuberille"))
    front = made(camera, method="cuberille", front_faces=True)

    def turned(mesh):
        a, b, c = np.moveaxis(oracles.corners(mesh), 1, 0)
        sight = np.array(camera.target) - eye if projection == "orthographic" else a - eye
        return (np.cross(b - a, c - a) * sight).sum(axis=1)

    seen_there = np.count_nonzero(turned(whole) < -1e-5)
    assert len(front.faces) == seen_there
    assert np.all(turned(front) < 0)
    assert seen_there < len(whole.faces)


def test_who_depends_on_the_camera_and_who_does_not():
    viewing = Viewing(NEAR)
    for knobs, depends in (
        ({"method": "dividing-cubes", "size_pixels": 1.0}, True),
        ({"method": "cuberille", "size_pixels": 1.0}, True),
        ({"method": "cuberille", "front_faces": True}, True),
        ({"method": "dividing-cubes", "front_faces": True}, False),
        ({"method": "marching-cubes", "size_pixels": 1.0, "front_faces": True}, False),
        ({"method": "cuberille"}, False),
    ):
        assert isinstance(seen(Surface(0.0, **knobs), viewing), SeenSurface) == depends
    for knobs in ({"size_pixels": 1.0}, {"front_faces": True}):
        with pytest.raises(UsageError, match="needs a camera"):
            volviz.extract_surface(BALL, 0.0, method="cuberille", **knobs)
    plain = volviz.extract_surface(BALL, 0.0, size_pixels=1.0)
    assert np.array_equal(plain.faces, volviz.extract_surface(BALL, 0.0).faces)
