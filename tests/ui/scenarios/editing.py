"""The panels: points, presets, numbers, lists."""

from __future__ import annotations

import numpy as np

from tests.ui.driver import Driver, Key, Script
from tests.ui.scenarios.things import ball
from volviz.ui.im import imgui


def control_point(d: Driver) -> Script:
    """A dragged point changes the pixels; undo brings them back bit for bit; redo the others."""
    yield from ball(d)
    first, scene = d.view(), d.scene
    place = min(d.points[0], key=lambda p: p[1])
    yield from d.drag((place[0], place[1]), (-25, 30))
    assert d.step.startswith("Opacity")
    assert d.app.history is not None
    assert len(d.app.history.past) == 1, "a drag is one step"
    yield from d.rest()
    dragged = d.view()
    assert (dragged != first).any(axis=2).mean() > 0.005
    yield from d.undo()
    assert d.scene == scene
    yield from d.rest()
    assert np.array_equal(d.view(), first)
    yield from d.redo()
    yield from d.rest()
    assert np.array_equal(d.view(), dragged)


def preset(d: Driver) -> Script:
    """From the list; the picture follows, undo leads back."""
    yield from ball(d)
    first, before = d.view(), d.scene
    yield from d.choose("transfer.preset", "ct-bone")
    assert d.scene.transfer.name == "ct-bone"
    yield from d.rest()
    assert not np.array_equal(d.view(), first)
    yield from d.undo()
    assert d.scene == before
    yield from d.rest()
    assert np.array_equal(d.view(), first)


def typed_value(d: Driver) -> Script:
    """Into a number's field; what is no number changes nothing; the arrow resets."""
    yield from ball(d)
    first = d.scene.raycast.step
    yield from d.type_in("raycast.step", 0.25)
    assert d.scene.raycast.step == 0.25
    assert d.step == "Step"
    yield from d.type_in("raycast.step", "nonsense")
    assert d.scene.raycast.step == 0.25
    yield from d.click("raycast.step.reset")
    assert d.scene.raycast.step == first
    yield from d.panel("view")
    yield from d.type_in("camera.fov", 45)
    assert d.scene.camera.fov == 45
    assert d.step == "Camera"
    yield from d.menu("Edit", "Undo")
    assert d.scene.camera.fov != 45
    yield from d.panel("history")
    yield from d.click("history.0")
    assert d.app.history is not None
    assert not d.app.history.past


def popups() -> int:
    """How many menus, lists, pickers and dialogs are open."""
    return int(imgui.get_current_context().open_popup_stack.size())


def escape(d: Driver) -> Script:
    """Closes one thing that is in front, and no more."""
    yield from ball(d)
    yield from d.click("raycast.shading")
    assert popups() == 1
    yield from d.key(Key.escape)
    assert popups() == 0
    yield from d.do(lambda t: t.mouse_move(d.ref("transfer.colors")))  # scrolls there
    _, top, _, bottom = d.where("transfer.colors")
    yield from d.press(float(d.points[1][1][0]), (top + bottom) / 2, times=2)
    yield
    assert popups() == 1, "the picker is open"
    d.screen("picker")
    yield from d.key(Key.escape)
    assert popups() == 0
    yield from d.do(lambda t: t.item_click("##MainMenuBar/##MenuBar/View"))
    assert popups() == 1
    yield from d.key(Key.escape)
    assert popups() == 0
    for _ in range(2):
        yield from d.key(Key.h)
        assert d.shell.dialogs.active == "Keys and Mouse"
        yield from d.key(Key.escape)
        assert d.shell.dialogs.active == ""
