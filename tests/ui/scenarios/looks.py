"""What is on the screen: the picture of the command line, themes, sizes."""

from __future__ import annotations

import numpy as np

import volviz
from tests.ui.driver import CTRL, Driver, Key, Script
from tests.ui.scenarios.things import ball
from volviz.ui import theme
from volviz.ui.im import imgui, internal
from volviz.ui.layout import VIEW_SHARE


def same(d: Driver) -> None:
    """The picture in the window is that of `volviz render`, within the golden tolerance."""
    seen, scene = d.view(), d.scene
    headless = volviz.render(scene, d.shell.viewport.size).pixels[..., :3]
    assert seen.shape == headless.shape, (seen.shape, headless.shape)
    off = np.abs(seen.astype(int) - headless)
    assert off.mean() < 0.3, off.mean()
    assert (off > 16).mean() < 0.01


def same_as_render(d: Driver) -> Script:
    """Of a sample, with all its samples per pixel."""
    yield from d.open("sample:marschner-lobb")
    yield from d.silence()
    same(d)


def themes(d: Driver) -> Script:
    """Dark and light; the picture stays as it is."""
    yield from ball(d)
    yield from d.silence()
    seen, whole = d.view(), d.screen()
    dark = whole[-4, whole.shape[1] // 2]
    yield from d.key(Key.l, CTRL)
    yield from d.rest()
    light = d.screen("light")[-4, whole.shape[1] // 2]
    assert int(dark.max()) < 60
    assert int(light.min()) > 200
    assert theme.name() == "light"
    assert np.array_equal(d.view(), seen)
    yield from d.key(Key.h)
    yield
    d.screen("light-help")
    yield from d.key(Key.h)
    yield from d.menu("Window", "Light Theme")
    yield
    assert theme.name() == "dark"


def _inside(d: Driver, id_: str, corner: tuple[float, float]) -> None:
    """The whole of a widget can be seen. corner: the lower right one of what it is in."""
    _, _, right, bottom = d.where(id_)
    assert right < corner[0], id_
    assert bottom < corner[1], id_


def large_text(d: Driver) -> Script:
    """A small window with text of twice the size can still be worked with."""
    yield from ball(d)
    assert imgui.get_style().font_scale_dpi == 2.0
    assert d.shell.place[2] / d.shell.window.size[0] >= VIEW_SHARE
    yield from d.panel("rendering")
    yield from d.type_in("raycast.step", 0.4)
    assert d.scene.raycast.step == 0.4
    left, _, right, _ = d.where("raycast.step")
    assert right - left > 10 * theme.FONT_SIZE
    d.screen("large-text")
    yield from d.key(Key.o, CTRL)
    yield from d.until(lambda: "dialog.do" in d.seen.where)
    yield
    _inside(d, "dialog.do", d.shell.window.size)
    yield from d.key(Key.escape)
    d.shell.dialogs.show_panel("surfaces", "Surfaces###surfaces")
    for _ in range(6):
        yield
    node = internal.find_window_by_name("Surfaces###surfaces").dock_node
    assert node.tab_bar.scrolling_target > 0  # its tab is far to the right
    yield from d.click("surfaces.add")
    yield from d.until(lambda: "surfaces.0.delete" in d.seen.where)
    yield
    _inside(d, "surfaces.0.delete", (node.pos.x + node.size.x, node.pos.y + node.size.y))
    d.screen("large-text-surfaces")
    yield from d.key(Key.minus, CTRL)
    assert d.app.settings.scale < 2


def dense_screen(d: Driver) -> Script:
    """A screen of twice the density: everything twice as large, the picture as sharp as it is."""
    assert d.shell.window.scale == 2.0
    yield from ball(d)
    yield from d.silence()
    assert d.shell.window.size == (1280, 960)
    assert imgui.get_style().font_scale_dpi == 2.0
    same(d)
    yield from d.menu("View", "Bounding Box")
    assert d.app.settings.box
    d.screen("dense")
