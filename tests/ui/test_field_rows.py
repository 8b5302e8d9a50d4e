"""The second field of a surface in the Surfaces panel."""

from __future__ import annotations

import numpy as np
import pytest

import volviz
from volviz.model.surface_look import SceneSurface
from volviz.ui.panels import PANELS


@pytest.fixture
def unfolded(stage, scene, monkeypatch):
    monkeypatch.setattr("tests.ui.conftest.SIZE", (460, 1400))
    wanted = SceneSurface.at(300.0, coloring="field")
    one = stage(PANELS["surfaces"].function, scene.with_surfaces([wanted]))
    one.click("surfaces.0.more")
    one.frame(2)
    return one


def test_rows_are_there_for_a_second_field_only(unfolded):
    assert "surfaces.0.look.color_field" in unfolded.seen.where
    assert "surfaces.0.look.map.color_low" in unfolded.seen.where
    unfolded.scene = unfolded.scene.with_surfaces([SceneSurface.at(300.0)])
    unfolded.frame(2)
    assert "surfaces.0.look.color_field" not in unfolded.seen.where


def test_a_field_and_a_map_are_chosen(unfolded):
    unfolded.click("surfaces.0.look.color_field")
    unfolded.frame(2)
    after = unfolded.click("surfaces.0.look.color_field.z")
    assert after.surfaces[0].look.color_field == "z"
    unfolded.click("surfaces.0.look.map.colormap")
    unfolded.frame(2)
    after = unfolded.click("surfaces.0.look.map.colormap.transfer")
    assert after.surfaces[0].look.colormap == "transfer"
    assert "surfaces.0.look.map.color_low" not in unfolded.seen.where
    assert unfolded.history.at(0).state.surfaces[0].look.color_field == "gradient-magnitude"


def test_another_volume_is_taken_where_it_is_there(unfolded, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    volviz.save_volume(volviz.Volume.from_array(np.zeros((3, 3, 3), np.uint8)), "b.nrrd")
    unfolded.click("surfaces.0.look.color_field")
    unfolded.frame(2)
    unfolded.click("surfaces.0.look.color_field.other")
    for text, taken in (("a.nrrd", None), ("b.nrrd?time=0", f"{tmp_path}/b.nrrd?time=0")):
        unfolded.type_in("surfaces.0.look.file", text)
        after = unfolded.click("surfaces.0.look.use")
        assert after.surfaces[0].look.color_field == (taken or "gradient-magnitude")
    names = [name for _, name in unfolded.seen.ids]
    assert len(set(names)) == len(names)
