"""What the view tells where it would be empty."""

from __future__ import annotations

import numpy as np
import pytest

import volviz
from volviz.model.surface_look import SceneSurface
from volviz.model.transfer import TransferFunction
from volviz.resolve import Memo, known_statistics, resolve
from volviz.ui import view_notes

RAMP = np.linspace(0, 1, 6 * 7 * 8, dtype=np.float32).reshape(6, 7, 8)
CLEAR = TransferFunction(((0, 1, 1, 1),), ((0, 0.0), (2, 0.0), (3, 1.0)))


def told(scene: volviz.Scene) -> str:
    known_statistics(scene.volume)
    badge = view_notes.nothing_seen(scene, resolve(scene, Memo()))
    return "" if badge is None else badge.text


def test_what_can_be_seen_needs_no_words():
    assert told(volviz.Scene.of(volviz.Volume.from_array(RAMP))) == ""


def test_why_nothing_is_seen():
    scene = volviz.Scene.of(volviz.Volume.from_array(RAMP))
    assert told(scene.with_transfer(CLEAR)) == "nothing is opaque"
    assert told(scene.with_raycast(show_volume=False)) == "nothing is shown"
    empty = volviz.Volume.from_array(np.full((4, 4, 4), np.nan, np.float32))
    assert told(volviz.Scene.of(empty)) == "no voxel holds a number"


@pytest.mark.parametrize("scene", [{"show_volume": False}, {}])
def test_a_surface_can_be_seen(scene):
    alone = volviz.Scene.of(volviz.Volume.from_array(RAMP)).with_raycast(**scene)
    assert told(alone.with_transfer(CLEAR).with_surfaces([SceneSurface.at(0.5)])) == ""
