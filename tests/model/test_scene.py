from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from volviz.errors import UsageError
from volviz.model.camera import Camera
from volviz.model.history import MAX_STEPS, History
from volviz.model.knobs import knobs_of
from volviz.model.scene import Background, Light, Raycast, SceneState
from volviz.model.transfer import ramp
from volviz.model.volume import Volume, affine_of, orientation_letters

OWNERS = (Raycast, Light, Camera)


def scene() -> SceneState:
    volume = Volume.from_array(np.zeros((3, 4, 5)))
    return SceneState(volume, ramp(0, 1), Camera((0, -10, 0)))


def test_knob_names_are_unique_and_told():
    knobs = [k for owner in OWNERS for k in knobs_of(owner)]
    assert len({k.name for k in knobs}) == len(knobs) > 15
    for spec in knobs:
        assert spec.help
        assert spec.choices or spec.low is not None or spec.type is bool


def test_with_raycast_turns_knobs_and_leaves_the_rest():
    before = scene()
    after = before.with_raycast(mode="mip", step=0.25, specular=0.0, fov=50)
    assert (after.raycast.mode, after.raycast.step, after.light.specular) == ("mip", 0.25, 0.0)
    assert after.camera.fov == 50
    assert before.raycast == Raycast()
    assert after.volume is before.volume


@pytest.mark.parametrize(
    ("knobs", "words"),
    [
        ({"mod": "mip"}, "unknown knob 'mod'.*did you mean 'mode'"),
        ({"mode": "mipp"}, "unknown mode 'mipp'.*did you mean 'mip'"),
        ({"step": 0.0}, "--step: 0.0 is not a number from 0.01 to 16"),
        ({"step": float("nan")}, "not a number"),
        ({"samples": 2.5}, "not a whole number"),
        ({"step": "half"}, "not a number"),
        ({"classification": "preintegrated"}, "unknown classification"),
    ],
)
def test_wrong_knobs_are_refused_with_help(knobs, words):
    with pytest.raises(UsageError, match=words):
        scene().with_raycast(**knobs)


def test_background():
    assert Background.plain((1, 0, 0)).top == (1, 0, 0, 1)
    with pytest.raises(UsageError, match="from 0 to 1"):
        Background.plain((1, 0, 0, 2))


def test_history_goes_back_and_forth():
    first = scene()
    history = History.of(first)
    states = [first] + [first.with_raycast(seed=i) for i in range(1, 6)]
    for state in states[1:]:
        history = history.push(state, "seed")
    for state in reversed(states):
        assert history.state == state
        history = history.undo()
    assert history.undo() is history
    for state in states[1:]:
        history = history.redo()
        assert history.state == state
    assert history.at(2).state == states[2]
    assert [s.state for s in history.steps] == states


def test_a_drag_is_one_step():
    history = History.of(0)
    for value in (1, 2, 3):
        history = history.push(value, "drag", "drag")
    assert history.undo().state == 0
    history = history.settled().push(9, "drag", "drag")
    assert history.undo().state == 3
    assert history.push(9, "same").steps == history.steps


@given(st.lists(st.integers(0, 3), max_size=60))
def test_any_sequence_undone_restores_the_first(actions):
    history = History.of(100)
    for i, action in enumerate(actions):
        if action == 0:
            history = history.undo()
        elif action == 1:
            history = history.redo()
        else:
            history = history.push(i, "x")
    for _ in range(MAX_STEPS + 1):
        history = history.undo()
    assert history.state == 100


def test_history_is_bounded():
    history = History.of(0)
    for i in range(1, 3 * MAX_STEPS):
        history = history.push(i, "x")
    assert len(history.past) == MAX_STEPS


# --- volume ---------------------------------------------------------------------------------------


def test_volume_is_read_only_and_leaves_the_array_alone():
    array = np.zeros((2, 3, 4), np.int16)
    volume = Volume.from_array(array, spacing=(1, 2, 3))
    with pytest.raises(ValueError, match="read-only"):
        volume.data[0, 0, 0] = 1
    array[0, 0, 0] = 1
    assert volume.dims == (4, 3, 2)
    assert volume.spacing == (1, 2, 3)


@pytest.mark.parametrize("kind", [">i2", ">f4", "f2", "?", "f8", "u8"])
def test_any_number_becomes_native(kind):
    data = Volume.from_array(np.ones((2, 2, 2), kind)).data
    assert data.dtype.isnative
    assert data.dtype.kind in "iuf"
    assert (data == 1).all()


@pytest.mark.parametrize("order", ["fortran", "strided", "reversed"])
def test_any_layout_becomes_c_order(order):
    base = np.arange(24).reshape(2, 3, 4)
    given_array = {
        "fortran": np.asfortranarray(base),
        "strided": np.repeat(base, 2, axis=2)[:, :, ::2],
        "reversed": base[::-1][::-1],
    }[order]
    volume = Volume.from_array(given_array)
    assert volume.data.flags.c_contiguous
    assert np.array_equal(volume.data, base)


@pytest.mark.parametrize(
    "array", [np.zeros((2, 2)), np.zeros((0, 2, 2)), np.zeros((2, 2, 2), complex), np.array("x")]
)
def test_no_scalar_field_is_refused(array):
    with pytest.raises(UsageError):
        Volume.from_array(array)


@pytest.mark.parametrize("spacing", [(0, 1, 1), (1, -1, 1), (1, 1), (1, 1, float("inf"))])
def test_bad_spacing_is_refused(spacing):
    with pytest.raises(UsageError, match="spacing"):
        Volume.from_array(np.zeros((2, 2, 2)), spacing=spacing)


def test_orientation_letters():
    assert orientation_letters(np.eye(4)) == "LPS"
    assert orientation_letters(np.diag([-1, -1, 1, 1])) == "RAS"
    turned = affine_of((1, 1, 1), direction=[[0, 0, 1], [1, 0, 0], [0, -1, 0]])
    assert orientation_letters(turned) == "PIL"
    assert not replace(Volume.from_array(np.zeros((1, 1, 1))).info, affine=turned).oblique
