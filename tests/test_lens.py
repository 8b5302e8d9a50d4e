"""The lens in scenes, pictures, files and commands."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import volviz
from tests.isosurface.shapes import sphere
from volviz import recipe
from volviz.app.frames import RESTED, Frames
from volviz.cli import run
from volviz.errors import UsageError
from volviz.lab import vary
from volviz.lab.surfaces import surface_facts
from volviz.model.surface_look import SceneSurface
from volviz.model.wanted import Wanted
from volviz.resolve import TextureLimits, extractions, resolve
from volviz.resolve_surfaces import wanted_of
from volviz.ui import lens_tool

SIZE = (320, 240)


@pytest.fixture(scope="module")
def volume():
    return sphere(80)


@pytest.fixture
def scene(volume):
    scene = volviz.Scene.of(volume, view="front", samples=2)
    return scene.with_surfaces([SceneSurface.at(0.0)]).with_knobs(show_volume=False)


@pytest.fixture
def lensed(scene):
    knobs = {"lens_z": -0.7, "lens_radius": 0.06, "lens_growth": 0.3, "lens_pixels": 0.5}
    return scene.with_knobs(lens=True, **knobs)


def circle(scene):
    """bool[h, w]: the pixels well within the lens."""
    x, y, radius = lens_tool._circle(scene.camera, scene, SIZE)
    rows, columns = np.indices(SIZE[::-1])
    return np.hypot(columns + 0.5 - x, rows + 0.5 - y) < radius - 2


def test_the_picture_in_the_lens_is_the_full_one_with_fewer_triangles(scene, lensed):
    whole, part = (volviz.render(s, SIZE).pixels.astype(int) for s in (scene, lensed))
    inside = circle(lensed)
    assert inside.sum() > 500
    assert np.abs(whole - part)[inside].max() <= 1
    assert np.abs(whole - part).max() > 1  # elsewhere it is coarser
    counts = [len(resolve(s, size=SIZE).meshes[0].mesh.faces) for s in (scene, lensed)]
    assert counts[1] < 0.3 * counts[0]


def test_a_surface_of_one_camera_is_not_shown_to_another(lensed):
    other = lensed.with_camera(lensed.camera.orbited(90))
    mine, theirs = (resolve(s, size=SIZE).meshes[0].mesh for s in (lensed, other))
    assert mine is not theirs
    (wanted,) = wanted_of(lensed, SIZE)
    assert wanted != wanted_of(other, SIZE)[0]
    assert wanted != wanted_of(lensed, (32, 24))[0]
    plain = lensed.with_knobs(lens=False)
    assert wanted_of(plain, SIZE) == wanted_of(plain.with_camera(other.camera), SIZE)


def test_only_what_nothing_shines_through_hides(lensed):
    (surface,) = lensed.surfaces
    for knobs in ({"opacity": 0.5}, {"wireframe": "only"}, {"sides": "front"}):
        shown = lensed.with_surfaces([replace(surface, look=replace(surface.look, **knobs))])
        assert not wanted_of(shown)[0].surface.viewing.opaque
    assert wanted_of(lensed)[0].surface.viewing.opaque


def test_other_methods_stay_whole(lensed):
    other = lensed.with_surfaces([SceneSurface.at(0.0, method="marching-tetrahedra")])
    assert wanted_of(other) == (Wanted(other.surfaces[0].surface),)


def test_the_window_keeps_the_last_good_surface_and_waits_for_the_camera(lensed):
    frames = Frames(lambda: None)
    frame = follow(frames, lensed, lambda: frames.surfaces and frames.surfaces[0])
    first = frames.surfaces[0]
    assert frame.meshes[0].mesh is first.mesh
    turned = lensed.with_camera(lensed.camera.orbited(40))
    frame = frames.follow(turned, TextureLimits(), SIZE)
    assert frames.extracting is None  # not while it turns
    assert frame.meshes[0].mesh is first.coarse
    follow(frames, turned, lambda: frames.surfaces[0] is not first)
    assert frames.surfaces[0].camera == turned.camera
    moved = turned.with_knobs(lens_x=0.3)
    frame = frames.follow(moved, TextureLimits(), SIZE)
    assert frames.extracting is not None  # a lens is followed at once
    assert frame.meshes[0].mesh is frames.surfaces[0].mesh
    frames.cancel()


def follow(frames, scene, until):
    import time

    end = time.monotonic() + 240
    while not until():
        assert time.monotonic() < end
        time.sleep(RESTED / 10)
        frame = frames.follow(scene, TextureLimits(), SIZE)
    return frame


def test_a_level_by_pixels_is_chosen_anew_when_the_camera_rests(scene):
    """The same level stays what it is, nearer by there is a finer one; never while it turns."""
    (surface,) = scene.surfaces
    knobs = replace(surface.surface, level_pixels=3.0)
    scene = scene.with_surfaces([replace(surface, surface=knobs)])
    frames = Frames(lambda: None)
    follow(frames, scene, lambda: frames.surfaces and frames.surfaces[0])
    first = frames.surfaces[0]
    turned = scene.with_camera(scene.camera.orbited(5))
    follow(frames, turned, lambda: wanted_of(turned, SIZE)[0] in frames_of(turned))
    assert frames.surfaces[0] is first
    near = scene.with_camera(scene.camera.dollied(2.0))
    frames.follow(near, TextureLimits(), SIZE)
    assert frames.extracting is None
    assert frames.surfaces[0] is first
    follow(frames, near, lambda: frames.surfaces[0] is not first)
    assert len(frames.surfaces[0].mesh.faces) > 2 * len(first.mesh.faces)


def frames_of(scene):
    return extractions(scene.volume)._found


def test_scene_files_keep_it_and_older_ones_open(lensed, tmp_path):
    np.save(tmp_path / "ball.npy", lensed.volume.data)
    volume = volviz.load(tmp_path / "ball.npy")
    scene = replace(volviz.Scene.of(volume), lens=lensed.lens)
    scene.save(tmp_path / "a.volviz.json")
    assert volviz.Scene.open(tmp_path / "a.volviz.json").lens == lensed.lens
    volviz.Scene.of(volume).save(tmp_path / "b.volviz.json")
    assert "lens" not in json.loads((tmp_path / "b.volviz.json").read_text())
    words = recipe.arguments(scene, SIZE)
    assert "--lens" in words
    assert "--lens-z=-0.7" in words


def test_commands_draw_it(tmp_path, capsys):
    np.save(tmp_path / "ball.npy", sphere(30).data)
    words = ["render", str(tmp_path / "ball.npy"), "--isosurface=0", "--size=40x30", "-q"]
    out = tmp_path / "a.png"
    code = run([*words, "--lens", "--lens-radius=0.2", "-o", str(out)])
    assert code == 0
    assert out.exists()
    assert run([*words, "--lens", "--lens-growth=2", "-o", str(out), "-f"]) == 2
    assert "lens-growth" in capsys.readouterr().err


def test_levels_on_the_command_line(tmp_path, capsys):
    np.save(tmp_path / "ball.npy", sphere(40).data)
    told = {}
    for level in (0, 1, 2):
        words = ["surface", str(tmp_path / "ball.npy"), "--isovalue=0", f"--level={level}"]
        assert run([*words, "--json", "-q"]) == 0
        told[level] = json.loads(capsys.readouterr().out)
    counts = [told[n]["mesh"]["triangles"] for n in told]
    assert counts[0] > 3 * counts[1] > 9 * counts[2]
    assert told[0]["level_error_mm"] is None
    assert 0 < told[1]["level_error_mm"] <= told[2]["level_error_mm"]
    words = ["surface", str(tmp_path / "ball.npy"), "--isovalue=0", "--level-pixels=1"]
    assert run([*words, "--picture=8x8", "--json", "-q"]) == 0
    chosen = json.loads(capsys.readouterr().out)
    assert chosen["mesh"]["triangles"] < counts[0]


def test_the_lab_varies_levels_and_the_lens(scene):
    level = vary.axis("surface.level=0,1,2", scene)
    facts = surface_facts([v.scene for v in vary.variants(scene, [level])], 1)
    assert facts[0].triangles > 3 * facts[1].triangles > 9 * facts[2].triangles
    assert facts[0].distance < facts[1].distance < facts[2].distance
    lens = vary.axis("lens=on,off", scene)
    facts = surface_facts([v.scene for v in vary.variants(scene, [lens])], 1)
    assert facts[0].triangles < facts[1].triangles


def test_knobs_are_checked(scene):
    with pytest.raises(UsageError, match="lens"):
        scene.with_knobs(lens_radius=7.0)
    with pytest.raises(UsageError, match="level"):
        SceneSurface.at(0.0, level=99)


def test_the_mouse_finds_the_surface(scene):
    point = lens_tool.surface_at(scene, (0.0, 0.0), 4 / 3)
    # the sphere of 0.7 seen from −z; half a voxel, and half of it between the ray's samples
    assert np.abs(np.subtract(point, (0, 0, -0.7))).max() < 0.03
    assert lens_tool.surface_at(scene, (0.99, 0.99), 4 / 3) is None
    on = lens_tool.turned(scene, (0.0, 0.0), 4 / 3)
    assert on.lens.lens
    assert on.lens.focus == pytest.approx(point, abs=1e-6)
    beside = lens_tool.moved(on, (0.99, 0.0), 4 / 3)
    _, _, back = scene.camera.axes()
    assert np.dot(beside.lens.focus, back) == pytest.approx(np.dot(point, back), abs=1e-6)
    assert not lens_tool.turned(on, (0.0, 0.0), 4 / 3).lens.lens
