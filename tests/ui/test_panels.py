"""Every panel: its widgets, what it shows, and that it changes nothing but the scene."""

from __future__ import annotations

import ast
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

import volviz
from volviz.model.history import History, Step
from volviz.model.knobs import check_knobs, knob, knobs_of
from volviz.model.scene import Background, Light, Raycast
from volviz.model.views import view_names, volume_camera
from volviz.resolve import known_statistics
from volviz.text import binary_size
from volviz.ui import edit, transfer_editor, widgets
from volviz.ui import panels as panels_module
from volviz.ui.facts import Busy, Facts, Local, Message
from volviz.ui.im import imgui
from volviz.ui.panels import PANELS, data, log, performance
from volviz.ui.transfer_state import EditorState

DRAWS = {"button", "checkbox", "selectable", "begin_combo", "color_edit3", "color_edit4",
         "input_text", "input_double", "drag_float", "drag_int", "slider_float", "combo",
         "radio_button", "small_button", "image_button", "input_text_with_hint"}  # fmt: skip


@pytest.fixture
def facts(scene) -> Facts:
    step = Step(scene.with_raycast(step=0.2), "step")
    return Facts(
        statistics=known_statistics(scene.volume),
        renderer="a renderer %s%n",
        frame_ms=12.5,
        frame_times=(0.01, 0.02),
        samples=3,
        cpu_bytes=1 << 30,
        gpu_bytes=1 << 20,
        texture=(24, 24, 24),
        notes=("reduced by 2 × 2 × 2 %n",),
        messages=(Message("info", "opened"), Message("error", "no \x07 %s%n", 60.0)),
        history=(Step(scene, "open"), step),
        busy=Busy(None, "counting %n"),
    )


@pytest.mark.parametrize("name", PANELS)
def test_a_panel_left_alone_changes_nothing(stage, scene, facts, name):
    one = stage(PANELS[name].function, scene, facts)
    one.frame(5)
    assert one.scene is scene
    assert PANELS[name].area in ("left", "right", "bottom")


@pytest.mark.parametrize("name", PANELS)
@pytest.mark.parametrize("width", [90, 180, 1400])
def test_panels_can_be_narrow_and_wide(stage, scene, facts, name, width, monkeypatch):
    monkeypatch.setattr("tests.ui.conftest.SIZE", (width, 500))
    one = stage(PANELS[name].function, scene, facts)
    one.frame(5)
    assert one.scene is scene
    if name == "rendering" and width > 100:
        left, _, right, _ = one.seen.where["raycast.step"]
        assert right - left > 60
    if name == "transfer" and width > 100:
        left, _, right, _ = one.seen.where["transfer.plot"]
        assert left < right <= width


@pytest.mark.parametrize("name", PANELS)
def test_every_widget_has_an_id_of_its_own_and_a_tooltip(stage, scene, facts, name):
    one = stage(PANELS[name].function, scene, facts)
    if name == "transfer":
        state = one.local.of(EditorState)
        state.opacities, state.colors = frozenset({0, 1}), frozenset({1})
        one.scene = one.scene.with_transfer(one.scene.transfer.shifted(3))
        one.frame(2)
        assert {"transfer.opacity.value", "transfer.color.color"} <= set(one.seen.where)
    numbers = [number for number, _ in one.seen.ids]
    names = [text for _, text in one.seen.ids]
    assert len(set(names)) == len(names)
    drawn = [n for n in numbers if n]  # plain text has none
    assert len(set(drawn)) == len(drawn)
    for _, text in one.shape():
        assert len(text) > 3


@pytest.mark.parametrize(
    "path",
    [*Path(panels_module.__path__[0]).glob("*.py"), Path(transfer_editor.__file__)],
    ids=lambda p: p.stem,
)
def test_panels_draw_widgets_only_through_those_with_tooltips(path):
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            assert not (node.value.id == "imgui" and node.attr in DRAWS), f"{path}: {node.attr}"


@dataclass(frozen=True)
class Invented:
    """Knobs that no panel has heard of."""

    shape: str = knob("round", "its form", choices=("round", "square"))
    count: int = knob(3, "how many", low=0, high=50)
    length: float = knob(2.0, "how long", low=0, high=10, unit="mm")
    gain: float = knob(1.0, "how strong", low=0.001, high=1000)
    bright: bool = knob(False, "light or dark")
    free: float = knob(0.0, "without bounds")

    def __post_init__(self) -> None:
        check_knobs(self)


def test_new_knobs_need_no_new_code(stage, scene):
    now = [Invented()]

    def panel(scene, facts):
        now[0] = edit.knob_rows(now[0], "new")
        return scene

    one = stage(panel, scene)
    assert {f"new.{k.name}" for k in knobs_of(Invented)} <= set(one.seen.where)
    tip = one.seen.tips["new.length"]
    for part in ("How long", "0 to 10 mm", "Default: 2 mm"):
        assert part in tip
    one.click("new.bright")
    assert now[0].bright
    one.type_in("new.count", "44")
    assert now[0].count == 44
    one.type_in("new.length", "77")
    assert now[0].length == 10
    one.type_in("new.free", "0.1")
    assert now[0].free == 0.1
    one.click("new.shape")
    one.frame(2)
    one.click("new.shape.square")
    assert now[0].shape == "square"
    one.click("new.length.reset")
    assert now[0].length == 2.0
    assert "new.length.reset" not in one.seen.where


def test_every_knob_of_rays_and_light_is_there(stage, scene):
    one = stage(PANELS["rendering"].function, scene)
    wanted = {f"raycast.{k.name}" for k in knobs_of(Raycast)}
    wanted |= {f"light.{k.name}" for k in knobs_of(Light)}
    assert wanted <= set(one.seen.where)


def test_a_knob_is_dragged_typed_and_reset(stage, scene):
    one = stage(PANELS["rendering"].function, scene)
    x, y = one.middle("raycast.jitter")
    assert one.drag((x, y), (-60, 0)).raycast.jitter < 1
    assert one.type_in("raycast.step", "0.25").raycast.step == 0.25
    assert one.type_in("raycast.step", "nonsense").raycast.step == 0.25
    assert one.type_in("raycast.step", "1e9").raycast.step == 16
    assert one.click("raycast.step.reset").raycast.step == Raycast().step
    assert one.click("raycast.jitter.reset").raycast == scene.raycast
    assert one.history.at(0).state == scene


def test_light_is_off_where_it_does_nothing(stage, scene):
    one = stage(PANELS["rendering"].function, scene.with_raycast(shading="none"))
    one.type_in("light.ambient", "1.5")
    assert one.scene.light == scene.light


def test_standard_views(stage, scene):
    one = stage(PANELS["view"].function, scene)
    for name in view_names(scene.volume):
        assert one.click(f"view.{name}").camera == volume_camera(scene.volume, name)
    turned = one.scene.with_camera(one.scene.camera.orbited(20).dollied(9))
    one.scene = turned
    fitted = one.click("view.fit").camera
    np.testing.assert_allclose(fitted.axes()[2], turned.camera.axes()[2], atol=1e-9)
    assert fitted.distance > turned.camera.distance
    assert one.click("view.reset").camera == scene.camera


def test_camera_numbers(stage, scene):
    one = stage(PANELS["view"].function, scene)
    assert one.type_in("camera.fov", "45").camera.fov == 45
    assert one.type_in("camera.height", "80").camera.height == 80
    before = one.scene.camera
    after = one.type_in("camera.distance", "200").camera
    assert after.distance == pytest.approx(200)
    assert after.target == before.target
    left, top, _, bottom = one.seen.where["camera.target"]
    one.drag((left + 10, (top + bottom) / 2), (25, 0))
    target = one.scene.camera.target
    assert target[0] != before.target[0]
    assert target[1:] == before.target[1:]


def test_projection_and_backgrounds(stage, scene):
    one = stage(PANELS["rendering"].function, scene)
    one.click("camera.projection")
    one.frame(2)
    assert one.click("camera.projection.orthographic").camera.projection == "orthographic"
    assert one.click("background.white").background == Background.plain((1, 1, 1))
    assert one.click("background.clear").background.top[3] == 0
    assert one.click("background.dark").background == Background()


def test_history_goes_to_the_step_that_is_clicked(stage, scene):
    steps = History.of(scene).push(scene.with_raycast(step=0.2), "step")
    steps = steps.push(scene.with_raycast(step=0.1), "step again")
    one = stage(PANELS["history"].function, steps.state)
    one.history = steps
    one.frame(2)
    one.mouse = one.middle("history.0")
    one.frame()
    given = []
    panel = one.panel
    one.panel = lambda s, f: (given.append(panel(s, f)), s)[1]
    one.press()
    one.press(down=False)
    assert any(g is scene for g in given)
    assert all(g is scene or g is steps.state for g in given)


def test_data_says_what_info_says(body, facts):
    found = dict(data.rows(body, facts))
    assert found["Samples"] == "24 × 24 × 24, time 1 of 3"
    assert found["Spacing"] == "1 × 1 × 2 mm"
    assert found["Type"] == "int16 HU"
    assert found["Orientation"] == "LPS"
    assert found["Values"].startswith(f"{body.data.min()} … {body.data.max()}")
    assert found["Memory"] == "27 KiB"
    masked = np.array([[[np.nan, 1.0, np.inf, -5.0]]])
    odd = volviz.Volume.from_array(masked, padding=-5.0, length_unit=None)
    found = dict(data.rows(odd, Facts(statistics=known_statistics(odd))))
    assert found["NaN"] == found["Infinite"] == found["Padding"] == "1 voxels"
    assert found["Orientation"] == "unknown"
    assert "unit unknown" in found["Spacing"]
    assert dict(data.rows(body, Facts()))["Values"] == "being counted …"


def test_the_header_is_searched_and_shown_harmless(stage, scene, facts):
    assert [n for n, _ in data.matching(scene.volume, "SLICE")] == ["Slices"]
    assert [n for n, _ in data.matching(scene.volume, "24")] == ["Slices"]
    ((_, value),) = data.matching(scene.volume, "gantry")
    assert "\x1b" not in value
    assert "\u202e" not in value
    one = stage(data.panel, scene, facts)
    assert "data.field2" in one.seen.where
    one.click("data.search")
    imgui.get_io().add_input_characters_utf8("patient")
    one.frame(3)
    assert "data.field1" not in one.seen.where
    one.click("data.field0")
    assert imgui.get_clipboard_text() == "Patient: none"


def test_ten_thousand_header_fields_are_quick(stage, body):
    fields = {f"field {i}": "x" * 50 for i in range(10_000)}
    volume = replace(body, info=replace(body.info, fields=fields))
    one = stage(data.panel, volviz.Scene.of(volume))
    start = time.process_time()
    one.frame()
    assert len(one.seen.where) < 100
    assert time.process_time() - start < 1


def test_the_log_is_copied(stage, scene, facts):
    one = stage(log.panel, scene, facts)
    one.click("log.copy")
    first, second = imgui.get_clipboard_text().splitlines()
    assert first.endswith("opened")
    assert "error: no � %s%n" in second


def test_performance_tells_numbers(scene, facts):
    found = dict(performance.rows(scene, facts))
    assert found["Frame time"] == "12.5 ms"
    assert found["Memory"] == "1 GiB"
    assert found["Renderer"] == "a renderer %s%n"
    assert "Memory" not in dict(performance.rows(scene, Facts()))


def test_changes_have_names(scene):
    cases = {
        "": scene,
        "camera": scene.with_camera(scene.camera.orbited(3)),
        "step": scene.with_raycast(step=0.1),
        "light azimuth": scene.with_knobs(light_azimuth=3),
        "settings": scene.with_knobs(step=0.1, ambient=0.9),
        "background": scene.with_background(1, 0, 0),
        "opacity distance": scene.with_transfer(
            replace(scene.transfer, unit_distance=scene.transfer.unit_distance * 2)
        ),
        "transfer function": scene.with_transfer(scene.transfer.shifted(1)),
        "preset ct-aaa": volviz.Scene.of(scene.volume, preset="ct-aaa"),
    }
    for name, after in cases.items():
        assert edit.difference(scene, after) == name


def test_local_keeps_one_object_per_type():
    local = Local()
    assert local.of(EditorState) is local.of(EditorState)
    assert Local().of(EditorState) is not local.of(EditorState)


def test_rounding_of_what_went_through_32_bits():
    assert widgets.rounded(float(np.float32(0.1))) == 0.1
    assert binary_size(1536) == "1.5 KiB"
    assert binary_size(12) == "12 B"
