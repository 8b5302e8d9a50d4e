"""Mouse to camera: what stays where it is."""

from __future__ import annotations

import numpy as np
import pytest

from volviz.isosurface import extract
from volviz.model.camera import Camera
from volviz.model.surface_look import SceneSurface
from volviz.model.views import volume_camera
from volviz.model.volume import Volume
from volviz.resolve_surfaces import Extracted
from volviz.scene import Scene
from volviz.ui import navigate, overlay, pick

CAMERAS = [
    Camera((10.0, -200.0, 30.0), (1.0, 2.0, 3.0)),
    Camera((10.0, -200.0, 30.0), (1.0, 2.0, 3.0), projection="orthographic", height=80.0),
]


@pytest.mark.parametrize("camera", CAMERAS)
def test_zoom_keeps_what_is_under_the_cursor(camera):
    at, aspect = (0.4, -0.3), 1.6
    size = (1600.0, 1000.0)
    here = np.array([1.0, *at])
    origin, direction = camera.rays(aspect)
    point = origin @ here + direction @ here * camera.distance
    after = navigate.dollied_to(camera, 3, at, aspect)
    (pixel,), _ = overlay.projected(after, point[None], size)
    assert pixel == pytest.approx((1.4 / 2 * 1600, 1.3 / 2 * 1000), abs=1e-6)
    assert after.distance == pytest.approx(camera.distance / 1.1**3)


@pytest.mark.parametrize("camera", CAMERAS)
def test_projections_go_back_and_forth(camera):
    other = "perspective" if camera.projection == "orthographic" else "orthographic"
    back = navigate.projected(navigate.projected(camera, other), camera.projection)
    assert back.axes()[2] == pytest.approx(camera.axes()[2])
    slope = 2 * np.tan(np.radians(camera.fov / 2))
    perspective = camera.projection == "perspective"
    if perspective:
        assert back.position == pytest.approx(camera.position)
    else:
        assert back.height == pytest.approx(camera.height)
        assert navigate.projected(camera, other).distance * slope == pytest.approx(camera.height)
    assert navigate.projected(camera, camera.projection) is camera


def test_a_turntable_stays_upright_and_stops_at_the_poles():
    camera = Camera((0.0, -100.0, 0.0))
    for _ in range(50):
        camera = navigate.turned(camera, 3, 20, (100, 100), (0.0, 0.0, 1.0))
    right, up, _ = camera.axes()
    assert abs(right[2]) < 1e-9
    assert up[2] > 0
    assert camera.position[2] == pytest.approx(100 * np.sin(np.radians(89)))


def test_a_click_hits_the_front_of_a_ball():
    z, y, x = np.mgrid[-20:21, -20:21, -20:21]
    ball = Volume.from_array((x**2 + y**2 + z**2 < 100).astype(np.float32), origin=(-20, -20, -20))
    scene = Scene.of(ball)
    scene = scene.with_transfer(
        scene.transfer.__class__(((0, 1, 1, 1), (1, 1, 1, 1)), ((0, 0), (0.5, 0), (0.5, 1)))
    )
    scene = scene.with_camera(volume_camera(ball, "front"))
    hit = pick.hit(scene, (0.0, 0.0), 1.0)
    assert hit == pytest.approx((0, 0, -10), abs=1.0)
    assert pick.hit(scene, (0.95, 0.95), 1.0) is None


def test_a_click_hits_the_surfaces_of_the_scene():
    """A cube at 12 mm in a ball of 18: where the ray meets it, behind what shines through."""
    z, y, x = np.mgrid[-20:21, -20:21, -20:21]
    reach = 18 - np.sqrt(x**2 + y**2 + z**2)
    volume = Volume.from_array(reach.astype(np.float32), origin=(-20, -20, -20))
    scene = (
        Scene.of(volume).with_camera(volume_camera(volume, "front")).with_knobs(show_volume=False)
    )

    def picked(*looks, **knobs):
        wanted = [SceneSurface.at(18 - r, opacity=o, method=m) for r, o, m in looks]
        made = [Extracted(w.surface, m := extract(volume, w.surface), m, 0.0) for w in wanted]
        shown = scene.with_surfaces(wanted).with_knobs(**knobs)
        return pick.hit(shown, (0.02, 0.03), 1.0, made)

    def length(point):
        return float(np.linalg.norm(point))

    cubes = "marching-cubes"
    assert length(picked((12, 1.0, cubes))) == pytest.approx(12, abs=0.1)
    assert picked((12, 1.0, cubes))[2] < 0, "the side that faces the viewer"
    assert length(picked((15, 0.2, cubes), (12, 1.0, cubes))) == pytest.approx(12, abs=0.1)
    assert length(picked((15, 0.9, cubes), (12, 1.0, cubes))) == pytest.approx(15, abs=0.1)
    assert length(picked((12, 1.0, "dividing-cubes"))) == pytest.approx(12, abs=1.8)
    assert picked((12, 0.0, cubes)) is None
    inner = picked((12, 1.0, cubes), show_volume=True, mode="mip")
    assert length(inner) == pytest.approx(12, abs=0.6), "behind it nothing counts"
    assert length(picked((3, 0.5, cubes), show_volume=True, mode="mip")) < 4
    assert pick.hit(scene, (0.02, 0.03), 1.0, ()) is None
