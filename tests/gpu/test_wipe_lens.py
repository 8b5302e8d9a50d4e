"""The lens under the wipe: whole surfaces while the camera moves, the lens's once it rests."""

from __future__ import annotations

import time

import numpy as np
import pytest

import volviz
from volviz.gpu.residency import Residency
from volviz.isosurface import adaptive
from volviz.model.surface_look import SceneSurface
from volviz.resolve import TextureLimits
from volviz.ui import lens_tool, wipe
from volviz.ui.wipe import Wipe

SIZE = (80, 60)
ENDS = (("phong", {"look.shading": "phong"}), ("flat", {"look.shading": "flat"}))


@pytest.fixture
def head():
    scene = volviz.Scene.of(volviz.sample("ct-head", size=48)).with_knobs(show_volume=False)
    scene = scene.with_surfaces([SceneSurface.at(300.0)])
    return lens_tool.turned(scene, (0.0, 0.0), SIZE[0] / SIZE[1])


@pytest.fixture
def wiped(gpu):
    resident = Residency(gpu)
    made = Wipe(gpu, resident, ENDS, lambda: None)
    yield made
    made.release()
    resident.release()


def cast(wiped, scene):
    return wiped.cast(scene, SIZE, TextureLimits(), (0.05, 0.5))


def until(wiped, scene, there, seconds=120.0):
    end = time.monotonic() + seconds
    while not there():
        cast(wiped, scene)
        assert time.monotonic() < end
        time.sleep(0.005)


def triangles(wiped):
    frames = [side.frame for side in wiped.sides]
    return [1 << 62 if f is None else len(f.meshes[0].mesh.faces) for f in frames]


def test_the_lens_is_there_at_rest_and_whole_surfaces_while_turning(wiped, head, monkeypatch):
    monkeypatch.setattr(wipe, "RESTED", 0.0)
    whole = len(volviz.extract_surface(head.volume, 300.0).faces)
    until(wiped, head, lambda: max(triangles(wiped)) < 0.8 * whole)
    looks = [side.frame.meshes[0].look.shading for side in wiped.sides]
    assert looks == ["phong", "flat"]
    assert wiped.sides[0].frame.camera == head.camera
    monkeypatch.setattr(wipe, "RESTED", 1e6)
    away = head.with_camera(head.camera.orbited(60, 10))
    until(wiped, away, lambda: wiped.sides[0].frame.camera == away.camera)
    assert triangles(wiped) == [whole] * 2, "what the other camera saw has holes from here"
    monkeypatch.setattr(wipe, "RESTED", 0.0)
    until(wiped, away, lambda: max(triangles(wiped)) < 0.8 * whole)
    until(wiped, away, lambda: all(side.state.done for side in wiped.sides))
    wanted = volviz.render(away, SIZE).pixels.astype(int)
    assert np.abs(wiped.sides[0].picture.pixels().astype(int) - wanted).max() <= 1
    off = away.with_knobs(lens=False)
    until(wiped, off, lambda: triangles(wiped) == [whole] * 2)


def test_what_is_taken_over_is_told(head):
    from volviz.resolve_surfaces import Extracted, wanted_of

    surface = wanted_of(head, SIZE)[0].surface
    adaptive.forget(head.volume)
    told = []
    for _ in range(2):
        made = adaptive.extract(head.volume, surface)
        found = Extracted(surface, made.mesh, made.mesh, 0.0, culled=made.culled)
        told.append(lens_tool.spared(found))
    assert "taken over" not in told[0]
    count = f"({made.culled.made:,} taken over from the last picture)"
    assert count in told[1]
