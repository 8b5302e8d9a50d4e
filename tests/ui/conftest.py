"""Panels without a display and without OpenGL: an ImGui context, and events put into it by hand."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import pytest

import volviz
from volviz.model.history import History
from volviz.model.scene import SceneState
from volviz.resolve import known_statistics
from volviz.ui import edit, painting, widgets
from volviz.ui.facts import Facts, Local, Panel
from volviz.ui.im import ImVec2, imgui, implot

SIZE = (460, 900)


class Stage:
    """One panel in one window, with mouse and keys, and a history that keeps its changes."""

    def __init__(self, panel: Panel, scene: SceneState, facts: Facts) -> None:
        self.panel, self.scene = panel, scene
        self.local = Local()
        self.facts = replace(facts, local=self.local)
        self.history = History.of(scene)
        self.mouse = (-100.0, -100.0)
        self.seen = widgets.Watch()
        self.places: list[np.ndarray] = []

    def frame(self, count: int = 1) -> SceneState:
        for _ in range(count):
            imgui.get_io().add_mouse_pos_event(*self.mouse)
            imgui.new_frame()
            imgui.set_next_window_pos(ImVec2(0, 0))
            imgui.set_next_window_size(ImVec2(*SIZE))
            imgui.begin("panel")
            self.places.clear()
            facts = replace(self.facts, history=self.history.steps, present=len(self.history.past))
            with widgets.watch() as self.seen:
                new = self.panel(self.scene, facts)
            imgui.end()
            imgui.render()
            if new is not self.scene:
                label = edit.difference(self.scene, new)
                self.history = self.history.push(new, label, label)
                self.scene = new
        return self.scene

    def pause(self) -> None:
        """Long enough that clicks from before make no double click."""
        io = imgui.get_io()
        io.delta_time = 0.5
        self.frame()
        io.delta_time = 1 / 60

    def press(self, button: int = 0, down: bool = True) -> None:
        imgui.get_io().add_mouse_button_event(button, down)
        self.frame()

    def click(self, at: str | tuple[float, float], button: int = 0, times: int = 1) -> SceneState:
        self.mouse = self.middle(at) if isinstance(at, str) else at
        self.frame()
        for _ in range(times):
            self.press(button)
            self.press(button, down=False)
        return self.frame(2)

    def drag(self, at: tuple[float, float], by: tuple[float, float], button: int = 0) -> SceneState:
        self.mouse = at
        self.frame()
        self.press(button)
        for part in (0.3, 0.7, 1.0):
            self.mouse = (at[0] + part * by[0], at[1] + part * by[1])
            self.frame()
        self.press(button, down=False)
        self.history = self.history.settled()
        return self.frame()

    def key(self, *keys: imgui.Key) -> SceneState:
        for down in (True, False):
            for key in keys:
                imgui.get_io().add_key_event(key, down)
            self.frame()
        return self.scene

    def hold(self, modifier: imgui.Key, down: bool = True) -> None:
        imgui.get_io().add_key_event(modifier, down)
        self.frame()

    def type_in(self, id_: str, text: str) -> SceneState:
        """Double click a field and type a number."""
        self.pause()
        self.click(id_, times=2)
        self.key(imgui.Key.mod_ctrl, imgui.Key.a)
        imgui.get_io().add_input_characters_utf8(text)
        self.frame()
        self.key(imgui.Key.enter)
        return self.frame(2)

    def middle(self, id_: str) -> tuple[float, float]:
        left, top, right, bottom = self.seen.where[id_]
        return (left + right) / 2, (top + bottom) / 2

    def shape(self) -> tuple[tuple[str, str], ...]:
        return tuple((i, self.seen.tips[i]) for _, i in self.seen.ids)


@pytest.fixture
def stage(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Stage]]:
    """Makes a stage for a panel; its control points' pixels are in `places` (plot, then bar)."""
    context = imgui.create_context()
    plots = implot.create_context()
    io = imgui.get_io()
    io.backend_flags |= imgui.BackendFlags_.renderer_has_textures
    io.display_size = ImVec2(*SIZE)
    io.delta_time = 1 / 60
    io.set_ini_filename("")
    io.config_input_trickle_event_queue = False
    made: list[Stage] = []
    draw_points = painting.points

    def points(draw, places, *rest):
        for one in made:
            one.places.append(np.array(places))
        draw_points(draw, places, *rest)

    monkeypatch.setattr(painting, "points", points)

    def make(panel: Panel, scene: SceneState, facts: Facts | None = None) -> Stage:
        facts = facts or Facts(statistics=known_statistics(scene.volume))
        one = Stage(panel, scene, facts)
        made.append(one)
        one.frame(4)
        return one

    yield make
    implot.destroy_context(plots)
    imgui.destroy_context(context)


@pytest.fixture(scope="session")
def body() -> volviz.Volume:
    """A ball of soft tissue with a core of bone in air, in Hounsfield units."""
    z, y, x = np.mgrid[-12:12, -12:12, -12:12]
    radius = np.sqrt(x**2 + y**2 + z**2)
    noise = np.random.default_rng(7).normal(0, 12, radius.shape)
    hu = np.where(radius < 4, 900, np.where(radius < 10, 40, -1000)) + noise
    return volviz.Volume.from_array(
        hu.astype(np.int16),
        (1, 1, 2),
        space="LPS",
        modality="CT",
        value_unit="HU",
        name="ball",
        fields={"Patient": "none", "Gantry%s%n": "tilt\x1b[31m 0\u202e", "Slices": "24"},
        times=3,
    )


@pytest.fixture(scope="session")
def scene(body: volviz.Volume) -> volviz.Scene:
    return volviz.Scene.of(body)
