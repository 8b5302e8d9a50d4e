"""The 3D view under mouse and keys; cameras are checked by where points land on the screen."""

from __future__ import annotations

import numpy as np

from tests.ui.driver import CTRL, LEFT, MIDDLE, RIGHT, SHIFT, Driver, Key, Script
from tests.ui.scenarios.things import ball
from volviz.ui import overlay


def where(d: Driver, *points) -> np.ndarray:
    """float64[n, 2]: where world points are on the screen."""
    x, y, w, h = d.shell.place
    placed, _ = overlay.projected(d.scene.camera, np.array(points, float), (w, h))
    return placed + np.array([x, y])


def trackball(d: Driver) -> Script:
    """Rotate, roll, pan in two ways, dolly; each one step of undo, and back bit for bit."""
    yield from ball(d)
    first, camera = d.view(), d.scene.camera
    target = camera.target
    yield from d.drag(d.middle, (70, 45))
    turned = d.scene.camera
    assert d.step == "Turn"
    np.testing.assert_allclose(turned.target, target)
    np.testing.assert_allclose(turned.distance, camera.distance)
    assert np.dot(turned.axes()[2], camera.axes()[2]) < 0.99
    yield from d.drag(d.middle, (70, 0), LEFT, CTRL)
    assert d.step == "Roll"
    np.testing.assert_allclose(d.scene.camera.position, turned.position)
    assert np.dot(d.scene.camera.axes()[1], turned.axes()[1]) < 0.99
    for button, mods in ((LEFT, (SHIFT,)), (MIDDLE, ())):
        (before,) = where(d, target)
        yield from d.drag(d.middle, (44, -32), button, *mods)
        assert d.step == "Pan"
        np.testing.assert_allclose(where(d, target)[0] - before, (44, -32), atol=1.5)
    panned = d.scene.camera
    yield from d.drag(d.middle, (0, -40), RIGHT)
    assert d.step == "Zoom"
    assert d.scene.camera.distance < panned.distance * 0.95
    np.testing.assert_allclose(d.scene.camera.target, panned.target)
    yield from d.rest()
    last = d.view()
    assert np.abs(last.astype(int) - first).mean() > 2
    yield from d.undo(5)
    assert d.scene.camera == camera
    yield from d.rest()
    assert np.array_equal(d.view(), first), "undo does not bring the pixels back"
    yield from d.redo(5)
    yield from d.rest()
    assert np.array_equal(d.view(), last), "redo does not bring the pixels back"


def wheel(d: Driver) -> Script:
    """What is under the cursor at the target's distance stays there."""
    yield from ball(d)
    right, up, _ = d.scene.camera.axes()
    target, distance = np.array(d.scene.camera.target), d.scene.camera.distance
    point = target + 6 * right - 5 * up
    (before,) = where(d, point)
    yield from d.wheel(before[0], before[1], 3)
    assert d.step == "Zoom"
    np.testing.assert_allclose(where(d, point)[0], before, atol=1.5)
    np.testing.assert_allclose(d.scene.camera.distance, distance / 1.1**3, rtol=1e-6)
    yield from d.undo()
    np.testing.assert_allclose(d.scene.camera.distance, distance)


def leveling(d: Driver) -> Script:
    """Shift and right drag over the picture: window sideways, level upwards, one step each."""
    yield from ball(d)
    first, seen = d.scene, d.view()
    low, high = first.transfer.domain
    yield from d.drag(d.middle, (150, 0), RIGHT, SHIFT)
    wide_low, wide_high = d.scene.transfer.domain
    assert wide_high - wide_low > 1.5 * (high - low)
    assert abs((wide_low + wide_high) - (low + high)) < 0.01 * (high - low)
    assert d.scene.camera == first.camera
    assert d.step == "Window and level"
    yield from d.undo()
    assert d.scene == first
    yield from d.drag(d.middle, (0, -60), RIGHT, SHIFT)
    raised = d.scene.transfer.domain
    assert raised[0] - low > 0.05 * (high - low)
    assert abs((raised[1] - raised[0]) - (high - low)) < 0.01 * (high - low)
    yield from d.silence()
    assert not np.array_equal(d.view(), seen)
    yield from d.undo()
    yield from d.silence()
    assert np.array_equal(d.view(), seen)


def turntable(d: Driver) -> Script:
    """The vertical stays upright, and no farther than the poles."""
    yield from ball(d)
    yield from d.key(Key._1)
    yield from d.key(Key.t)
    assert d.app.settings.turntable
    upright = d.scene.camera.axes()[1]
    for move in ((90, 40), (-30, 200), (15, 250)):
        yield from d.drag(d.middle, move)
        assert abs(np.dot(d.scene.camera.axes()[0], upright)) < 1e-6
        assert np.dot(d.scene.camera.axes()[1], upright) > 0
    yield from d.key(Key.t)
    assert not d.app.settings.turntable


def cube(d: Driver) -> Script:
    """Every side of the cube that is in sight looks from there."""
    yield from ball(d)
    clicked = 0
    for direction, *_ in overlay.SIDES:
        yield from d.drag(d.middle, (60, 35))
        right, up, back = d.scene.camera.axes()
        if np.dot(direction, back) < 0.3:
            continue
        center, scale = d.cube
        size = overlay.CUBE * scale
        x = center[0] + size * np.dot(direction, right)
        y = center[1] - size * np.dot(direction, up)
        yield from d.press(float(x), float(y))
        np.testing.assert_allclose(d.scene.camera.axes()[2], direction, atol=1e-6)
        assert d.step.startswith("View: ")
        clicked += 1
    assert clicked >= 2


def keys(d: Driver) -> Script:
    """Standard views, their opposites, projection, reset, box and cube."""
    yield from ball(d)
    yield from d.key(Key.r)
    start, backs = d.scene.camera, []
    for mods in ((), (CTRL,)):
        for key in (Key._1, Key._3, Key._7):
            yield from d.key(key, *mods)
            backs.append(d.scene.camera.axes()[2])
    seen = np.array(backs)
    np.testing.assert_allclose(seen[:3], -seen[3:], atol=1e-9)
    np.testing.assert_allclose(np.abs(seen[:3] @ seen[:3].T), np.eye(3), atol=1e-9)
    yield from d.key(Key._5)
    assert d.scene.camera.projection == "orthographic"
    yield from d.key(Key._5)
    yield from d.key(Key.r)
    np.testing.assert_allclose(d.scene.camera.position, start.position)
    yield from d.key(Key.x)
    assert not d.app.settings.axes
    yield from d.silence()
    plain = d.view()
    yield from d.key(Key.b)
    yield from d.rest()
    assert not np.array_equal(d.view(), plain)
    wide = d.shell.viewport.size[0]
    yield from d.key(Key.f9)
    assert d.shell.viewport.size[0] == d.shell.window.size[0] > wide
    yield from d.key(Key.f9)
    yield
    assert d.shell.viewport.size[0] == wide


def focus(d: Driver) -> Script:
    """A double click turns about what was hit: inside the volume, under the mouse."""
    yield from ball(d)
    back = d.scene.camera.axes()[2]
    x, y = d.middle
    yield from d.press(x, y, times=2)
    assert d.step == "Focus"
    target = np.array(d.scene.camera.target)
    corners = np.array(overlay.box_corners(d.scene.volume))
    assert (target > corners.min(axis=0)).all()
    assert (target < corners.max(axis=0)).all()
    np.testing.assert_allclose(d.scene.camera.axes()[2], back, atol=1e-9)
    yield from d.undo()
    np.testing.assert_allclose(where(d, target)[0], (x, y), atol=1.5)
