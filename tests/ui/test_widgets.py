"""What widgets do with text, numbers along an axis, and mistakes inside of them."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from volviz.ui import value_axis, widgets
from volviz.ui.im import imgui


@given(st.floats(-1e3, 1e3), st.floats(1e-6, 1e7), st.integers(1, 20))
def test_values_along_an_axis_are_round_and_not_too_many(start, width, count):
    low = start * width
    found = value_axis.ticks(low, low + width, count)
    assert len(found) <= count + 1
    slack = 1e-6 * max(width, abs(low))
    assert all(low - slack <= v <= low + width + slack for v in found)
    if len(found) < 2:
        return
    step = (found[-1] - found[0]) / (len(found) - 1)
    power = math.log10(step)
    assert any(abs(power - math.log10(m) - round(power - math.log10(m))) < 1e-6 for m in (1, 2, 5))


def test_ticks_of_a_ct():
    assert value_axis.ticks(-1100, 3600, 6) == [-1000, 0, 1000, 2000, 3000]


def test_a_path_is_broken_after_its_slashes_and_loses_nothing(stage, scene):
    seen = {}

    def panel(scene, facts):
        path = "/a-folder/another-folder/yet-another-one/file.nrrd"
        for width in (60.0, 150.0, 2000.0):
            seen[width] = widgets.folded(path, width)
        seen["text"] = widgets.folded("several words that are long enough", 30.0)
        return scene

    stage(panel, scene)
    assert "\n" not in seen["text"]
    assert "\n" not in seen[2000.0]
    assert seen[60.0].count("\n") > seen[150.0].count("\n") > 0
    for width in (60.0, 150.0):
        lines = seen[width].split("\n")
        assert "".join(lines) == seen[2000.0]
        assert all(line.endswith("/") for line in lines[:-1])


@pytest.mark.parametrize("kind", [widgets.form, widgets.facts])
def test_a_form_is_closed_after_an_exception(stage, scene, kind):
    def panel(scene, facts):
        with pytest.raises(ZeroDivisionError), kind("rows", ("name",)):
            raise ZeroDivisionError
        assert imgui.table_get_column_count() == 0, "a table is still open"
        widgets.button("after", "After", "Stands below, in no table.")
        return scene

    one = stage(panel, scene)  # ImGui raises at the end of a frame for what is left open
    assert "after" in one.seen.where
