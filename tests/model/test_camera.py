from __future__ import annotations

import numpy as np
import pytest

from volviz.errors import UsageError
from volviz.model.camera import PROJECTIONS, Camera, standard_view
from volviz.model.scene import box_corners
from volviz.model.views import default_view, volume_camera
from volviz.model.volume import Volume


def test_azimuth_moves_the_camera_to_its_right_and_elevation_up():
    camera = standard_view("anterior")
    right, up, _ = camera.axes()
    turned, raised = camera.orbited(30), camera.orbited(0, 30)
    assert np.dot(turned.position, right) == pytest.approx(0.5)
    assert np.dot(raised.position, up) == pytest.approx(0.5)
    assert camera.orbited(360).position == pytest.approx(camera.position)


def test_standard_views_of_a_patient():
    """Radiological: seen from the front, the patient's left is on the right of the picture."""
    right, up, _ = standard_view("anterior").axes()
    assert np.allclose(right, (1, 0, 0))
    assert np.allclose(up, (0, 0, 1))
    right, up, _ = standard_view("inferior").axes()
    assert np.allclose(right, (1, 0, 0))
    assert np.allclose(up, (0, -1, 0))
    right, up, _ = standard_view("front", patient=False).axes()
    assert np.allclose(right, (1, 0, 0))
    assert np.allclose(up, (0, -1, 0))


@pytest.mark.parametrize("projection", PROJECTIONS)
def test_matrices_agree_with_rays(projection):
    camera = Camera((3, -40, 8), (1, 2, 3), (0, 0, 1), projection, 35.0, 20.0)
    aspect = 1.6
    clip = camera.projection_matrix(aspect, 1.0, 100.0) @ camera.view_matrix()
    origin, direction = camera.rays(aspect)
    for x, y in ((0, 0), (0.7, -0.4), (-1, 1)):
        at = origin @ (1, x, y) + 30 * (direction @ (1, x, y))
        seen = clip @ (*at, 1)
        assert seen[:2] / seen[3] == pytest.approx((x, y), abs=1e-9)
        assert -1 < seen[2] / seen[3] < 1


@pytest.mark.parametrize("projection", PROJECTIONS)
@pytest.mark.parametrize("aspect", [0.4, 1.0, 2.5])
def test_fitted_shows_everything_and_no_less(projection, aspect):
    volume = Volume.from_array(np.zeros((10, 20, 40)), spacing=(1, 2, 0.5))
    camera = volume_camera(
        volume, "front", azimuth=20, elevation=30, aspect=aspect, projection=projection
    )
    clip = camera.projection_matrix(aspect, 1e-3, 1e4) @ camera.view_matrix()
    seen = np.c_[box_corners(volume), np.ones(8)] @ clip.T
    seen = seen[:, :2] / seen[:, 3:]
    assert np.abs(seen).max() < 1.0
    assert np.abs(seen).max() > 0.93


def test_roll_turns_the_picture_clockwise():
    right, _, _ = standard_view("anterior").rolled(90).axes()
    assert np.allclose(right, (0, 0, 1), atol=1e-9)  # what was up is now to the right


def test_pan_and_dolly():
    camera = Camera((0, -10, 0))
    assert camera.panned(2, 3).target == pytest.approx((2, 0, 3))
    assert camera.dollied(2).distance == pytest.approx(5)


def test_views_suit_the_volume():
    flat = np.zeros((3, 200, 200))
    cube = np.zeros((50, 60, 70))
    assert default_view(Volume.from_array(cube, space="LPS"))[0] == "anterior"
    assert default_view(Volume.from_array(flat, space="LPS"))[0] == "inferior"
    assert default_view(Volume.from_array(flat))[0] == "front"
    assert default_view(Volume.from_array(cube))[1:] != (0.0, 0.0)


@pytest.mark.parametrize("space", ["LPS", None])
@pytest.mark.parametrize(("axis", "side"), [(0, (1, 0, 0)), (1, (0, 1, 0)), (2, (0, 0, 1))])
def test_a_single_slice_is_looked_at_face_on(space, axis, side):
    """However it lies: an oblique slice as viewers of slices show it, not foreshortened."""
    shape = [40, 40, 40]
    shape[2 - axis] = 1
    a, b = np.radians(30), np.radians(20)
    about_z = np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]])
    about_x = np.array([[1, 0, 0], [0, np.cos(b), -np.sin(b)], [0, np.sin(b), np.cos(b)]])
    for turn in (np.eye(3), about_z @ about_x):
        affine = np.eye(4)
        affine[:3, :3] = turn
        volume = Volume.from_array(np.zeros(shape), affine=affine, space=space)
        _, up, back = volume_camera(volume).axes()
        assert abs(back @ turn @ side) == pytest.approx(1)
        assert np.abs(turn.T @ up).max() == pytest.approx(1)  # a row or a column is upright


@pytest.mark.parametrize(
    ("choice", "word"),
    [
        ({"position": (0, 0, 0)}, "same point"),
        ({"position": (0, float("nan"), 1)}, "finite"),
        ({"position": (0, 1, 1), "fov": 0.0}, "from 1 to 150"),
        ({"position": (0, 1, 1), "projection": "perspektive"}, "perspektive"),
    ],
)
def test_bad_cameras_are_refused(choice, word):
    with pytest.raises(UsageError, match=word):
        Camera(**choice)


def test_unknown_view_gets_a_suggestion():
    with pytest.raises(UsageError, match="did you mean 'anterior'"):
        standard_view("anteror")


def test_up_along_the_view_is_survived():
    axes = Camera((0, 0, 5), up=(0, 0, 1)).axes()
    assert np.allclose(np.linalg.norm(axes, axis=1), 1)
