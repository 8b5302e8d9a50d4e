"""The transfer-function editor: the panel driven by mouse and keys."""

from __future__ import annotations

import numpy as np
import pytest

import volviz
from tests.ui.test_control_points import well_formed
from volviz.model.transfer import TransferFunction
from volviz.resolve import known_statistics
from volviz.ui import control_points as cp
from volviz.ui import looks, transfer_editor
from volviz.ui.facts import Facts
from volviz.ui.im import imgui
from volviz.ui.transfer_state import EditorState


def state(one) -> EditorState:
    return one.local.of(EditorState)


def spot(one, index: int) -> tuple[float, float]:
    """Where an opacity point is on the screen."""
    x, y = one.places[0][index]
    return float(x), float(y)


@pytest.fixture
def editor(stage, body):
    scene = volviz.Scene.of(body).with_transfer(
        TransferFunction(
            ((-1000, 0, 0, 0), (0, 1, 0, 0), (1000, 1, 1, 1)),
            ((-800, 0.1), (-300, 0.5), (200, 0.5), (800, 0.9)),
        )
    )
    return stage(transfer_editor.panel, scene)


def test_dragging_a_point_moves_it_and_undo_restores_equality(editor):
    first = editor.scene
    moved = editor.drag(spot(editor, 1), (30, -40))
    value, opacity = moved.transfer.opacities[1]
    assert value > -300
    assert opacity > 0.5
    assert moved.transfer.opacities[::2] == first.transfer.opacities[::2]
    assert moved.transfer.colors == first.transfer.colors
    np.testing.assert_allclose(spot(editor, 1), editor.mouse, atol=3)
    assert [s.label for s in editor.history.steps] == ["open", "opacity"]
    assert editor.history.undo().state == first


def test_a_drag_and_its_way_back_leave_the_scene_equal(editor):
    first, at = editor.scene, spot(editor, 1)
    editor.mouse = at
    editor.frame()
    editor.press()
    for x, y in ((40, 10), (-200, 80), (3, 3), (0, 0)):
        editor.mouse = (at[0] + x, at[1] + y)
        editor.frame()
    editor.press(down=False)
    assert editor.scene == first


def test_several_points_by_shift_click(editor):
    editor.click(spot(editor, 1))
    editor.hold(imgui.Key.mod_shift)
    editor.click(spot(editor, 2))
    editor.hold(imgui.Key.mod_shift, down=False)
    assert state(editor).opacities == {1, 2}
    moved = editor.drag(spot(editor, 1), (20, 0)).transfer.opacities
    assert moved[1][0] - -300 == pytest.approx(moved[2][0] - 200)
    assert moved[1][0] > -300
    assert state(editor).opacities == {1, 2}
    editor.click(spot(editor, 2))
    assert state(editor).opacities == {2}


def test_several_points_by_a_frame(editor):
    a, b = spot(editor, 1), spot(editor, 2)
    editor.drag((a[0] - 15, a[1] - 15), (b[0] - a[0] + 30, 30))
    assert state(editor).opacities == {1, 2}
    editor.click((a[0] + 20, a[1] - 60))
    assert state(editor).opacities == frozenset()


def test_arrows_move_what_is_selected_and_escape_deselects(editor):
    editor.click(spot(editor, 1))
    (value, opacity), steps = editor.scene.transfer.opacities[1], len(editor.history.past)
    per_pixel = state(editor).axis.per_pixel
    moved = editor.key(imgui.Key.right_arrow).transfer.opacities[1]
    assert moved[0] - value == pytest.approx(per_pixel, rel=0.1)
    editor.hold(imgui.Key.mod_shift)
    raised = editor.key(imgui.Key.up_arrow).transfer.opacities[1]
    editor.hold(imgui.Key.mod_shift, down=False)
    assert raised == (moved[0], pytest.approx(opacity + 0.1))
    assert editor.scene.transfer.opacities[2] == (200, 0.5)
    assert len(editor.history.past) > steps
    editor.key(imgui.Key.escape)
    assert state(editor).opacities == frozenset()
    left = editor.scene
    assert editor.key(imgui.Key.left_arrow) is left


def test_double_click_adds_and_delete_removes(editor):
    first = editor.scene
    left, top, right, bottom = editor.seen.where["transfer.plot"]
    editor.click((left + 0.5 * (right - left), top + 0.2 * (bottom - top)), times=2)
    assert len(editor.scene.transfer.opacities) == 5
    assert len(state(editor).opacities) == 1
    assert editor.key(imgui.Key.delete).transfer == first.transfer


def test_what_undo_brings_back_can_be_seen(editor):
    """Numbers of a wholly other size, and back: the axis goes with them, but not with a drag."""
    first = editor.scene
    near = spot(editor, 1)
    for low, high in ((-1e300, 1e300), (0, 1e-9), (5e4, 6e4)):
        editor.scene = first.with_transfer(cp.stretched(first.transfer, low, high))
        editor.frame(4)
        assert editor.places[0][:, 0].min() < editor.places[0][:, 0].max()
        editor.scene = first
        editor.frame(4)
        np.testing.assert_allclose(spot(editor, 1), near, atol=3)
    before = state(editor).axis
    editor.drag(spot(editor, 0), (30, 0))
    editor.scene = editor.history.undo().state
    editor.frame(4)
    assert state(editor).axis == before


def test_right_click_removes(editor):
    editor.click(spot(editor, 1), button=1)
    assert [p[0] for p in editor.scene.transfer.opacities] == [-800, 200, 800]


def test_ctrl_drag_shifts_everything(editor):
    first = editor.scene.transfer
    at = spot(editor, 1)
    editor.hold(imgui.Key.mod_ctrl)
    moved = editor.drag((at[0] + 25, at[1] - 50), (30, 0)).transfer
    editor.hold(imgui.Key.mod_ctrl, down=False)
    delta = moved.opacities[0][0] - first.opacities[0][0]
    assert delta > 50
    assert moved == cp.shifted(first, delta)


def test_right_drag_is_window_and_level(editor):
    first = editor.scene.transfer
    at = spot(editor, 1)
    wide = editor.drag((at[0] + 25, at[1] - 50), (100, 0), button=1).transfer.domain
    assert wide[1] - wide[0] > 1.2 * (first.domain[1] - first.domain[0])
    assert sum(wide) == pytest.approx(sum(first.domain))
    up = editor.drag((at[0] + 25, at[1] - 50), (0, -60), button=1).transfer.domain
    assert up[1] - up[0] == pytest.approx(wide[1] - wide[0])
    assert sum(up) > sum(wide)


def test_wheel_zooms_and_middle_button_pans_the_value_axis(editor):
    first = editor.scene
    wide = spot(editor, 2)[0] - spot(editor, 1)[0]
    editor.mouse = spot(editor, 1)
    editor.frame()
    imgui.get_io().add_mouse_wheel_event(0.0, 3.0)
    editor.frame(2)
    assert spot(editor, 2)[0] - spot(editor, 1)[0] > 1.05 * wide
    x, y = spot(editor, 1)
    editor.drag((x, y), (-40, 0), button=2)
    assert spot(editor, 1)[0] == pytest.approx(x - 40, abs=3)
    editor.click((x, y), button=2, times=2)
    editor.click("transfer.fit")
    assert spot(editor, 2)[0] - spot(editor, 1)[0] == pytest.approx(wide, abs=1)
    assert editor.scene is first


def test_the_log_axis_reaches_a_thousandth(editor):
    editor.click("transfer.logopacity")
    assert state(editor).log_opacity
    _, top, _, bottom = editor.seen.where["transfer.plot"]
    at = spot(editor, 0)
    editor.drag(at, (0, 0.35 * (bottom - top)))
    assert 2e-4 < editor.scene.transfer.opacities[0][1] < 0.01
    editor.drag(spot(editor, 0), (0, 500))
    assert editor.scene.transfer.opacities[0][1] == 0


def test_colors_are_added_moved_and_removed(editor):
    first = editor.scene.transfer
    places = editor.places[1]
    middle = (float(places[0][0] + places[1][0]) / 2, float(places[0][1]))
    editor.click(middle, times=2)
    assert len(editor.scene.transfer.colors) == 4
    editor.click((230, 890))  # beside the picker, which closes it
    editor.frame(3)
    x, y = (float(v) for v in editor.places[1][1])
    moved = editor.drag((x, y), (15, 30)).transfer
    assert moved.colors[1][0] > -500
    assert moved.opacities == first.opacities
    x, y = (float(v) for v in editor.places[1][1])
    assert editor.click((x, y), button=1).transfer == first


def test_exact_numbers_are_typed(editor):
    editor.click(spot(editor, 1))
    editor.type_in("transfer.opacity.opacity", "0.00123")
    assert editor.scene.transfer.opacities[1] == (-300, 0.00123)
    editor.type_in("transfer.opacity.value", "543.21")
    assert editor.scene.transfer.opacities[2] == (543.21, 0.00123)
    assert state(editor).opacities == {2}
    editor.type_in("transfer.unit", "2.5")
    assert editor.scene.transfer.unit_distance == 2.5


def test_a_preset_is_picked_edited_and_reset(editor, body):
    editor.click("transfer.preset")
    editor.frame(3)
    editor.click("transfer.preset.ct-aaa")
    expected = volviz.Scene.of(body, preset="ct-aaa")
    assert editor.scene.transfer == expected.transfer
    assert editor.scene.light == expected.light
    editor.frame(3)
    assert "transfer.preset.reset" not in editor.seen.where
    editor.click(spot(editor, 1), button=1)
    assert editor.scene.transfer != expected.transfer
    editor.click("transfer.preset.reset")
    assert editor.scene.transfer == expected.transfer


def test_range_by_percentiles(editor, body):
    editor.click("transfer.range")
    editor.frame(3)
    editor.click("transfer.percent98")
    found = known_statistics(body)
    low, high = editor.scene.transfer.domain
    assert low == pytest.approx(found.percentile(2))
    assert high == pytest.approx(found.percentile(98))


def test_a_range_is_typed_end_by_end(editor):
    low, high = editor.scene.transfer.domain
    editor.click("transfer.range")
    editor.frame(3)
    editor.type_in("transfer.low", f"{high + 100:g}")  # waits for the other end
    assert editor.scene.transfer.domain == (low, high)
    editor.type_in("transfer.high", f"{high + 500:g}")
    assert editor.scene.transfer.domain == pytest.approx((high + 100, high + 500))
    assert len(editor.history.past) == 1


def test_a_range_is_typed_as_window_and_level(editor):
    editor.click("transfer.range")
    editor.frame(3)
    editor.type_in("transfer.width", "400")
    editor.type_in("transfer.level", "40")
    assert editor.scene.transfer.domain == pytest.approx((-160, 240))
    before = editor.scene.transfer
    editor.type_in("transfer.width", "-5")
    assert editor.scene.transfer is before


def test_color_map_and_reverse(editor):
    editor.click("transfer.colormap")
    editor.frame(3)
    editor.click("transfer.colormap.viridis")
    assert looks.color_map_of(editor.scene.transfer) == "viridis"
    editor.click("transfer.reverse")
    assert editor.scene.transfer.colors[0][1] > 0.9


def test_the_ruler_is_there_for_ct_only(editor, stage):
    assert "transfer.ruler" in editor.seen.where
    other = volviz.Scene.of(volviz.Volume.from_array(np.arange(64.0).reshape(4, 4, 4)))
    assert "transfer.ruler" not in stage(transfer_editor.panel, other).seen.where


@pytest.mark.parametrize(
    "array",
    [
        np.zeros((3, 3, 3)),
        np.full((2, 2, 2), np.nan),
        np.full((2, 2, 2), -1e30, np.float32),
        np.linspace(-3e38, 3e38, 64, dtype=np.float32).reshape(4, 4, 4),
        (np.linspace(-1, 1, 64) * 1e299).reshape(4, 4, 4),
        np.linspace(0, 1e-30, 64).reshape(4, 4, 4),
        np.arange(27, dtype=np.uint64).reshape(3, 3, 3) + (1 << 62),
        np.ones((1, 1, 1), np.uint8),
        np.arange(4096).reshape(16, 16, 16),
    ],
    ids=["zeros", "nan", "one", "float32", "float64", "tiny", "uint64", "voxel", "many"],
)
def test_odd_volumes_can_be_edited(stage, array):
    one = stage(transfer_editor.panel, volviz.Scene.of(volviz.Volume.from_array(array)))
    left, top, right, bottom = one.seen.where["transfer.plot"]
    one.click(((left + right) / 2, (top + bottom) / 2), times=2)
    one.drag(((left + right) / 2, (top + bottom) / 2), (30, 20))
    one.drag(((left + right) / 2 + 50, (top + bottom) / 2), (30, 20), button=1)
    for id_ in ("transfer.fit", "transfer.all", "transfer.reverse"):
        one.click(id_)
    well_formed(one.scene.transfer)


def test_a_label_volume_with_many_points(stage):
    labels = np.arange(8**3).reshape(8, 8, 8).astype(np.uint16)
    scene = volviz.Scene.of(volviz.Volume.from_array(labels, kind="labels"))
    assert len(scene.transfer.opacities) > 500
    well_formed(stage(transfer_editor.panel, scene).scene.transfer)


def test_while_values_are_counted(stage, scene):
    one = stage(transfer_editor.panel, scene, Facts())
    assert one.scene is scene
    one.click(spot(one, 1), button=1)
    assert len(one.scene.transfer.opacities) == len(scene.transfer.opacities) - 1


def test_another_volume_begins_anew(editor, scene):
    editor.click(spot(editor, 1))
    other = volviz.Scene.of(volviz.Volume.from_array(np.arange(64.0).reshape(4, 4, 4)))
    editor.scene = other
    editor.facts = Facts(statistics=known_statistics(other.volume), local=editor.local)
    editor.frame(2)
    assert state(editor).opacities == frozenset()
    assert 0 < spot(editor, 0)[0] < 460


def test_any_sequence_of_events_keeps_points_in_order_and_can_be_undone(editor, rng):
    first = editor.scene
    left, top, right, bottom = editor.seen.where["transfer.plot"]
    io = imgui.get_io()
    for _ in range(300):
        editor.mouse = (
            float(rng.uniform(left - 10, right + 10)),
            float(rng.uniform(top - 10, bottom + 90)),
        )
        what = rng.integers(0, 10)
        if what < 6:
            io.add_mouse_button_event(int(what % 2), bool(rng.integers(0, 2)))
        elif what == 6:
            io.add_key_event(imgui.Key.mod_shift, bool(rng.integers(0, 2)))
        elif what == 7:
            io.add_key_event(imgui.Key.mod_ctrl, bool(rng.integers(0, 2)))
        elif what == 8:
            io.add_mouse_wheel_event(0.0, float(rng.integers(-1, 2)))
        elif len(editor.scene.transfer.opacities) > 6:
            io.add_key_event(imgui.Key.delete, bool(rng.integers(0, 2)))
        editor.frame()
        well_formed(editor.scene.transfer)
    assert editor.scene.transfer != first.transfer
    history = editor.history
    while history.past:
        history = history.undo()
    assert history.state == first
