"""The pure parts of the transfer-function editor: points, gestures, histogram, ready-made looks."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import volviz
from volviz.model.transfer import TransferFunction, ramp
from volviz.resolve import known_statistics
from volviz.ui import control_points as cp
from volviz.ui import looks, value_axis
from volviz.ui.transfer_state import Drag
from volviz.ui.value_axis import Axis

WHOLE = st.floats(allow_nan=True, allow_infinity=True)
START = TransferFunction(
    ((0, 1, 0, 0), (50, 0, 1, 0), (100, 0, 0, 1)), ((0, 0), (40, 0.2), (60, 0.2), (100, 1)), 2.0
)


def well_formed(transfer: TransferFunction) -> None:
    for points in (transfer.colors, transfer.opacities):
        values = [p[0] for p in points]
        assert values == sorted(values)
        assert all(math.isfinite(x) for p in points for x in p)
        assert all(0 <= x <= 1 for p in points for x in p[1:])


def test_added_goes_where_it_belongs():
    assert cp.added(((0, 1), (2, 1)), (1, 0.5)) == (((0, 1), (1, 0.5), (2, 1)), 1)
    assert cp.added(((0, 1), (2, 1)), (2, 0.5)) == (((0, 1), (2, 1), (2, 0.5)), 2)
    assert cp.added(((0, 1),), (math.inf, 0.5)) == (((0, 1), (cp.HUGE, 0.5)), 1)


def test_removed_keeps_one():
    assert cp.removed(START.opacities, {0, 2}) == ((40, 0.2), (100, 1))
    assert cp.removed(START.opacities, range(9)) == ((0, 0),)


def test_moved_stops_at_the_neighbours_and_keeps_distances():
    def values(points):
        return [p[0] for p in points]

    assert values(cp.moved(START.opacities, {1}, 10)) == [0, 50, 60, 100]
    assert values(cp.moved(START.opacities, {1}, 500)) == [0, 60, 60, 100]
    assert values(cp.moved(START.opacities, {1, 2}, 500)) == [0, 80, 100, 100]
    assert values(cp.moved(START.opacities, {1, 2}, -500)) == [0, 0, 20, 100]
    assert values(cp.moved(START.opacities, {0, 3}, 500)) == [40, 40, 60, 140]
    assert cp.moved(START.opacities, {1}, math.nan) is START.opacities
    assert cp.moved(START.opacities, {77}, 1) is START.opacities


def test_put_sorts_again():
    points, at = cp.put(START.opacities, 1, (80, 0.7))
    assert points == ((0, 0), (60, 0.2), (80, 0.7), (100, 1))
    assert at == 2
    assert cp.put(START.opacities, 1, (60, 0.7))[1] == 1


@given(st.floats(1.01e-4, 1))
def test_log_heights_go_there_and_back(opacity):
    height = float(cp.height_of(opacity, log=True))
    assert 0 <= height <= 1
    assert cp.opacity_of(height, log=True) == pytest.approx(opacity, rel=6e-3)


def test_heights_of_round_opacities():
    heights = cp.height_of([0, 1e-9, 1e-3, 1e-2, 1e-1, 1], log=True)
    np.testing.assert_allclose(heights, [0, 0, 0.25, 0.5, 0.75, 1])
    assert cp.opacity_of(0.25, log=True) == 0.001
    assert cp.opacity_of(-1, log=True) == cp.opacity_of(-1, log=False) == 0
    assert cp.opacity_of(7, log=True) == cp.opacity_of(7, log=False) == 1


def test_window_and_level():
    wide = cp.windowed(START, 2, 10)
    assert wide.domain == (-40, 160)
    assert [p[1] for p in wide.opacities] == [p[1] for p in START.opacities]
    assert cp.windowed(START, math.nan, 0) is START
    assert cp.stretched(START, 5, 3) is START
    assert cp.stretched(START, -1, 1).domain == (-1, 1)
    assert cp.shifted(START, -7).domain == (-7, 93)


def test_reversed_colors_twice_is_the_same():
    once = cp.reversed_colors(START)
    assert once.colors[0][1:] == (0, 0, 1)
    assert cp.reversed_colors(once).colors == START.colors


EDITS = st.one_of(
    st.tuples(st.just("add"), WHOLE, st.floats(0, 1)),
    st.tuples(st.just("color"), WHOLE),
    st.tuples(st.just("move"), st.frozensets(st.integers(0, 9)), WHOLE),
    st.tuples(st.just("raise"), st.frozensets(st.integers(0, 9)), WHOLE, st.booleans()),
    st.tuples(st.just("remove"), st.frozensets(st.integers(0, 9))),
    st.tuples(st.just("put"), st.integers(0, 9), WHOLE),
    st.tuples(st.just("window"), WHOLE, WHOLE),
    st.tuples(st.just("shift"), WHOLE),
    st.tuples(st.just("stretch"), WHOLE, WHOLE),
    st.tuples(st.just("reverse")),
)


def edited(transfer: TransferFunction, edit: tuple) -> TransferFunction:
    kind, *rest = edit
    points = transfer.opacities
    if kind == "add":
        return cp.add_opacity(transfer, *rest)[0]
    if kind == "color":
        return cp.add_color(transfer, *rest)[0]
    if kind == "move":
        moved = cp.with_opacities(transfer, cp.moved(points, *rest))
        return cp.with_colors(moved, cp.moved(transfer.colors, *rest))
    if kind == "raise":
        return cp.with_opacities(transfer, cp.raised(points, *rest[:2], log=rest[2]))
    if kind == "remove":
        return cp.with_opacities(transfer, cp.removed(points, *rest))
    if kind == "put":
        at = rest[0] % len(points)
        return cp.with_opacities(transfer, cp.put(points, at, (rest[1], 0.5))[0])
    if kind == "window":
        return cp.windowed(transfer, *rest)
    if kind == "shift":
        return cp.shifted(transfer, *rest)
    if kind == "stretch":
        return cp.stretched(transfer, *rest)
    return cp.reversed_colors(transfer)


@settings(max_examples=300, deadline=None)
@given(st.lists(EDITS, max_size=20))
def test_points_stay_sorted_and_finite(edits):
    transfer = START
    for edit in edits:
        transfer = edited(transfer, edit)
        well_formed(transfer)


def test_a_drag_back_to_where_it_began_changes_nothing():
    axis = Axis(10, 200, -3.7, 11.3)
    drag = Drag("opacities", START, (50, 50), 0, axis, 100, frozenset({1}))
    assert drag.result((50, 50), log=False, scale=1) == START
    assert drag.result((60, 40), log=False, scale=1) != START
    for kind in ("shift", "window"):
        gesture = Drag(kind, START, (50, 50), 0, axis, 100)
        assert gesture.result((50, 50), log=False, scale=1) is START
        well_formed(gesture.result((5000, -5000), log=False, scale=1))


def test_bars_count_every_voxel(body):
    found = known_statistics(body)
    span = (found.low - 0.5, found.high + 0.5)
    bars = value_axis.bars(found, span, 77)
    assert bars.sum() == pytest.approx(body.data.size)
    some = value_axis.bars(found, (-100.5, 149.5), 10)
    expected, _ = np.histogram(body.data, 10, (-100.5, 149.5))
    np.testing.assert_allclose(some, expected)
    assert value_axis.share_between(found, 500, math.inf) == pytest.approx(
        (body.data > 500).mean(), abs=1e-3
    )


def test_bars_of_squeezed_floats_use_the_fine_histogram(rng):
    values = np.append(rng.normal(0, 1, 64**3 - 1), 1e9).reshape(64, 64, 64).astype(np.float32)
    found = known_statistics(volviz.Volume.from_array(values))
    bars = value_axis.bars(found, (-2, 2), 40)
    expected, _ = np.histogram(values, 40, (-2, 2))
    np.testing.assert_allclose(bars, expected, rtol=0.05, atol=60)


def test_presets_are_applied_as_the_scene_does(body, scene):
    for name in ("ct-bone", "ct-mip", "viridis"):
        look = looks.preset_look(name, body, known_statistics(body))
        turned = looks.dressed(scene.with_raycast(step=0.3), look)
        expected = volviz.Scene.of(body, preset=name, step=0.3)
        assert turned.transfer == expected.transfer
        assert turned.raycast == expected.raycast
        assert turned.light == expected.light


def test_color_maps_are_recognised():
    for name in ("viridis", "gray"):
        assert looks.color_map_of(looks.with_color_map(START, name)) == name
    assert looks.color_map_of(START) is None


def test_a_ramp_of_no_width_survives_the_gestures():
    flat = ramp(5, 5)
    well_formed(cp.windowed(flat, 1e-300, 0))
    well_formed(cp.windowed(flat, 1e300, 1e300))
    well_formed(cp.stretched(TransferFunction(((5, 0, 0, 0),), ((5, 1),)), 0, 1))
