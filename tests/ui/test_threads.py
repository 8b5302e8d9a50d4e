"""No surface is made on the window's thread, whoever wants its picture."""

from __future__ import annotations

import threading
import time

import numpy as np
import pytest

import volviz
from tests.ui.display import check_played, needs_display, play
from volviz import isosurface
from volviz.app.resolving import Resolving
from volviz.model.surface_look import SceneSurface
from volviz.resolve import TextureLimits, ready, resolve


def until(happened, seconds: float = 200.0) -> None:
    end = time.monotonic() + seconds
    while not happened():
        assert time.monotonic() < end
        time.sleep(0.01)


def ball(isovalue: float) -> volviz.Scene:
    z, y, x = np.mgrid[-1:1:16j, -1:1:17j, -1:1:18j]
    volume = volviz.Volume.from_array((1 - x * x - y * y - z * z).astype(np.float32))
    return volviz.Scene.of(volume).with_surfaces([SceneSurface.at(isovalue)])


def test_a_scene_whose_surfaces_are_to_be_made_is_not_ready():
    scene, limits = ball(0.5), TextureLimits()
    resolve(scene, limits=limits, surfaces=(None,))
    assert ready(scene, limits=limits, surfaces=(None,))
    assert not ready(scene, limits=limits)
    resolve(scene, limits=limits)
    assert ready(scene, limits=limits)
    dyed = scene.with_surfaces([SceneSurface.at(0.5, coloring="field", color_field="gradient")])
    assert not ready(dyed, limits=limits), "its second field is not sampled"


def test_the_last_good_frame_stays_and_only_the_latest_is_next(monkeypatch):
    plain, made, gate = isosurface.extract, [], threading.Event()

    def extract(volume, surface, progress=None):
        if max(volume.dims) > 3:
            made.append((surface.isovalue, threading.current_thread()))
            assert gate.wait(30)
        return plain(volume, surface, progress)

    monkeypatch.setattr(isosurface, "extract", extract)
    first, limits = ball(0.5), TextureLimits()
    passed = [first.with_surfaces([SceneSurface.at(v)]) for v in (0.4, 0.3, 0.2)]
    one = Resolving("test", lambda: None)
    gate.set()
    until(lambda: one.follow(first, limits))
    kept = one.frame
    gate.clear()
    for scene in passed:
        assert not one.follow(scene, limits)
        assert one.frame is kept
        until(lambda: len(made) == 2)
    gate.set()
    until(lambda: one.follow(passed[-1], limits))
    assert [value for value, _ in made] == [0.5, 0.4, 0.2]
    assert threading.current_thread() not in [thread for _, thread in made]
    assert one.scene is passed[-1]
    assert one.frame.meshes[0].mesh.vertices.shape[0] > kept.meshes[0].mesh.vertices.shape[0]


def test_what_goes_wrong_is_raised_once(monkeypatch):
    def extract(volume, surface, progress=None):
        raise volviz.VolvizError("no surface today")

    monkeypatch.setattr(isosurface, "extract", extract)
    one, scene = Resolving("test", lambda: None), ball(0.5)
    assert not one.follow(scene, TextureLimits())
    until(lambda: one.job.finished)
    with pytest.raises(volviz.VolvizError, match="no surface today"):
        one.follow(scene, TextureLimits())
    assert one.job is None


@needs_display
@pytest.mark.parametrize("name", ["compare", "compare_under_lens", "wipe", "thumbnails", "export"])
def test_window(name, tmp_path):
    check_played(play("scripts_threads", name, tmp_path))
