"""Property: whatever panels are made to do, undo leads back to the first scene, redo to the last.

The panels are those of the window, drawn in an ImGui context; hypothesis presses, drags and types
where their widgets are drawn. What comes out goes through the window's own panel host and history.
"""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import volviz
from tests.ui.conftest import SIZE
from volviz.app import App
from volviz.model.scene import SceneState
from volviz.model.surface_look import SceneSurface
from volviz.resolve import known_statistics
from volviz.ui import navigate
from volviz.ui.facts import Facts, Local
from volviz.ui.im import imgui
from volviz.ui.panel_host import PanelHost
from volviz.ui.panels import PANELS

NAMES = ("transfer", "rendering", "view", "surfaces", "history")
spots = st.tuples(st.floats(0.02, 0.98), st.floats(0.02, 0.98))
moves = st.tuples(st.integers(-60, 60), st.integers(-60, 60))
numbers = st.sampled_from(["0.3", "7", "-2", "1e9", "0", "45", "x", "0.001"])
widget = st.integers(0, 200)
actions = st.one_of(
    st.tuples(st.just("click"), st.sampled_from(NAMES), widget, spots),
    st.tuples(st.just("double"), st.sampled_from(NAMES), widget, spots),
    st.tuples(st.just("drag"), st.sampled_from(NAMES), widget, moves),
    st.tuples(st.just("drag"), st.just("transfer"), widget, moves),
    st.tuples(st.just("point"), st.just("transfer"), widget, moves),
    st.tuples(st.just("type"), st.sampled_from(NAMES), widget, numbers),
    st.tuples(st.just("key"), st.just("transfer"), widget, st.just(0)),
    st.tuples(st.just("camera"), st.just("view"), widget, moves),
    st.tuples(st.just("open"), st.just("view"), widget, st.just(0)),
    st.tuples(st.just("undo"), st.just("view"), widget, st.just(0)),
)


def volume(seed: int) -> volviz.Volume:
    """One of three small volumes: soft tissue in air, another, and plain floats."""
    rng = np.random.default_rng(seed)
    if seed == 2:
        return volviz.Volume.from_array(rng.random((9, 8, 7), dtype=np.float32), name="floats")
    hu = rng.normal(40, 300, (8, 9, 10)).astype(np.int16)
    return volviz.Volume.from_array(hu, modality="CT", value_unit="HU", name=f"ct{seed}")


SCENES = [
    volviz.Scene.of(volume(seed)).with_surfaces([SceneSurface.at(v) for v in (0.5, 40.0)[:seed]])
    for seed in range(3)
]


class Desk:
    """The app with its panels on a stage, one at a time."""

    def __init__(self, stage, app: App) -> None:
        self.app, self.local, self.name = app, Local(), "transfer"
        shell = SimpleNamespace(app=app)
        self.host = PanelHost(shell)  # type: ignore[arg-type]
        self.stage = stage(self._panel, app.scene)

    def _panel(self, scene: SceneState, facts: Facts) -> SceneState:
        app = self.app
        facts = Facts(
            statistics=known_statistics(app.scene.volume),
            history=app.history.steps,
            present=len(app.history.past),
            local=self.local,
        )
        self.host._call(self.name, PANELS[self.name], app.scene, facts)
        assert not self.host.broken, self.host.broken
        return scene  # the stage keeps no history of its own

    def act(self, kind: str, name: str, index: int, how) -> None:
        self.name = name
        stage = self.stage
        stage.frame(2)
        if kind in ("camera", "open", "undo"):
            getattr(self, f"_{kind}")(index, how)
        elif kind == "key":
            stage.key(imgui.Key.delete)
        else:
            self._touch(kind, index, how)
        stage.frame(2)
        self.app.settle()

    def _touch(self, kind: str, index: int, how) -> None:
        stage = self.stage
        seen = {i: w for i, w in stage.seen.where.items() if w[3] < SIZE[1] and w[2] > w[0]}
        if kind == "point":
            marks = [tuple(p) for place in stage.places for p in place]
            if marks:
                stage.drag(marks[index % len(marks)], how)
            return
        id_ = list(seen)[index % len(seen)]
        left, top, right, bottom = seen[id_]
        part = how if kind in ("click", "double") else (0.5, 0.5)
        at = (left + (right - left) * part[0], top + (bottom - top) * part[1])
        if kind == "drag":
            stage.drag(at, how)
        elif kind == "type":
            stage.type_in(id_, how)
        else:
            stage.pause()
            stage.click(at, times=2 if kind == "double" else 1)

    def _camera(self, index: int, how: tuple[int, int]) -> None:
        turned = navigate.rotated(self.app.scene.camera, *how, (300, 300))
        self.app.change(self.app.scene.with_camera(turned), "Turn", "turn")

    def _open(self, index: int, how: int) -> None:
        self.app.show(SCENES[index % 3], f"Open {index % 3}")

    def _undo(self, index: int, how: int) -> None:
        for _ in range(index % 3 + 1):
            self.app.undo()


@pytest.fixture
def app(tmp_path):
    app = App(folder=tmp_path)
    yield app
    app.close()


@settings(
    max_examples=40,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
@given(st.lists(actions, min_size=3, max_size=14))
def test_any_sequence_of_panel_actions_is_undone_and_redone(stage, app, sequence):
    app.history = None
    app.show(SCENES[0], "Open 0")
    desk = Desk(stage, app)
    assert app.scene is SCENES[0], "drawing the panels changes nothing"
    for action in sequence:
        desk.act(*action)
        imgui.get_io().clear_input_keys()
        imgui.get_io().clear_input_mouse()
        desk.stage.key(imgui.Key.escape)
        desk.stage.click((SIZE[0] - 2.0, SIZE[1] - 2.0))  # closes what is open
        app.settle()
    last, steps = app.scene, len(app.history.past)
    future = len(app.history.future)
    states = [step.state for step in app.history.steps]
    for _ in range(steps):
        app.undo()
        desk.stage.frame()
    assert app.scene is SCENES[0]
    for expected in states[1 : steps + 1]:
        app.redo()
        desk.stage.frame()
        assert app.scene is expected
    assert app.scene is last
    assert len(app.history.future) == future, "looking at a scene makes no step"


def test_the_actions_reach_the_scene(stage, app):
    """The property would hold of actions that do nothing: these do something."""
    app.show(SCENES[0], "Open 0")
    desk = Desk(stage, app)
    changed = set()
    rng = np.random.default_rng(1)
    for index in range(40):
        kind = ("click", "drag", "point", "type")[index // 4 % 4]
        name = NAMES[index % 4]
        how = {"click": (0.5, 0.5), "type": "0.3"}.get(kind, (20, -20))
        before = app.scene
        desk.act(kind, name, int(rng.integers(200)), how)
        desk.stage.click((SIZE[0] - 2.0, SIZE[1] - 2.0))
        if app.scene is not before:
            changed.add((kind, name))
    assert {kind for kind, _ in changed} >= {"click", "drag", "type"}, changed
    assert {name for _, name in changed} == set(NAMES[:4]), changed
