"""Surfaces of a scene: what is extracted when, in files and words, in the window's frames."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest

import volviz
from volviz.app.frames import Frames
from volviz.classify.isovalues import suggested_isovalue, suggested_surface
from volviz.cli.render import surface_color
from volviz.errors import InputError, UsageError
from volviz.fields.statistics import statistics
from volviz.model import scenefile
from volviz.model.surface_look import COLORS, MAX_SURFACES, SceneSurface, SurfaceLook
from volviz.model.surface_words import parse, spell
from volviz.model.wanted import Wanted
from volviz.resolve import Memo, TextureLimits, extractions, resolve
from volviz.resolve_surfaces import KEPT, Extractions
from volviz.samples import sample
from volviz.ui import edit

LIMITS = TextureLimits()


def ball(n=24, radius=8.0) -> volviz.Volume:
    z, y, x = np.mgrid[:n, :n, :n] - (n - 1) / 2
    return volviz.Volume.from_array((radius - np.sqrt(x * x + y * y + z * z)).astype(np.float32))


def scene_of(volume, *isovalues) -> volviz.Scene:
    return volviz.Scene.of(volume).with_surfaces(SceneSurface.at(v) for v in isovalues)


def radii(mesh) -> np.ndarray:
    return np.linalg.norm(mesh.vertices - 11.5, axis=1)


# --- resolve ----------------------------------------------------------------------------------


def test_headless_waits_for_all_surfaces():
    scene = scene_of(ball(), 0.0, 4.0)
    frame = resolve(scene, Memo())
    for drawn, radius in zip(frame.meshes, (8.0, 4.0), strict=True):
        assert np.abs(radii(drawn.mesh) - radius).max() < 0.1
        assert drawn.color == drawn.look.color


def test_what_is_hidden_is_not_extracted_and_what_is_empty_is_told():
    scene = scene_of(ball(), 0.0, 100.0)
    hidden = replace(scene.surfaces[0], look=SurfaceLook(visible=False))
    memo = Memo()
    frame = resolve(scene.with_surfaces((hidden, scene.surfaces[1])), memo)
    assert [d.mesh.empty for d in frame.meshes] == [True]
    assert any("at 100 is empty" in n for n in frame.notes)
    assert extractions(scene.volume, memo).get(Wanted(hidden.surface)) is None


def test_a_surface_is_extracted_once_and_the_oldest_are_dropped():
    volume, made = ball(), Extractions()
    memo = Memo()
    first = resolve(scene_of(volume, 1.0), memo).meshes[0].mesh
    assert resolve(scene_of(volume, 1.0), memo).meshes[0].mesh is first
    made = extractions(volume, memo)
    for i in range(KEPT + 3):
        resolve(scene_of(volume, 2.0 + 0.1 * i), memo)
    assert made.get(Wanted(SceneSurface.at(1.0).surface)) is None
    assert made.get(Wanted(SceneSurface.at(2.0 + 0.1 * (KEPT + 2)).surface)) is not None


def test_the_colour_of_the_transfer_function():
    scene = scene_of(ball(), 2.0)
    dyed = replace(scene.surfaces[0], look=SurfaceLook(coloring="transfer"))
    frame = resolve(scene.with_surfaces([dyed]), Memo())
    assert frame.meshes[0].color == pytest.approx(scene.transfer.color_at(2.0))


def test_large_meshes_have_a_light_one():
    volume = ball(160, 70.0)
    drawn = resolve(scene_of(volume, 0.0), Memo()).meshes[0]
    assert drawn.coarse is not None
    assert len(drawn.coarse.faces) < 0.5 * len(drawn.mesh.faces)
    middle = 79.5
    off = np.linalg.norm(drawn.coarse.vertices - middle, axis=1) - 70
    assert np.abs(off).max() < 1.5
    corners = drawn.mesh.vertices[drawn.mesh.faces].astype(float)
    sides = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = 0.5 * np.linalg.norm(sides, axis=1).sum()
    assert area == pytest.approx(4 * np.pi * 70**2, rel=0.01), "no triangle is lost or doubled"


# --- the window's frames ----------------------------------------------------------------------


def follow(frames: Frames, scene, seconds=200.0):
    """Until the surfaces are those of the scene, and a frame draws them."""
    end, before = time.monotonic() + seconds, None
    while True:
        frame = frames.follow(scene, LIMITS)
        wanted = [s.surface for s in scene.surfaces]
        there = [f and f.surface for f in frames.surfaces] == wanted
        if there and frame is not None and frame is before:
            return frame
        before = frame
        assert time.monotonic() < end
        time.sleep(0.002)


def test_the_last_good_mesh_stays_until_the_newest_is_there():
    frames, volume = Frames(lambda: None), ball()
    first = follow(frames, scene_of(volume, 0.0))
    passed = 0
    for value in np.linspace(0.1, 5.0, 60):
        scene = scene_of(volume, float(value))
        frame = frames.follow(scene, LIMITS)
        assert len(frame.meshes) == 1
        passed += frame.meshes[0].mesh is not first.meshes[0].mesh
    last = follow(frames, scene)
    assert np.abs(radii(last.meshes[0].mesh) - 3.0).max() < 0.1
    assert frames.follow(scene, LIMITS) is last
    assert frames.extracting is None


def test_values_passed_on_the_way_are_left_out(monkeypatch):
    """The worker is slow: of sixty values it makes a few, the last one among them."""
    asked = []
    real = Extractions.make

    def slow(self, volume, surface, progress, fields):
        asked.append(surface.isovalue)
        time.sleep(0.05)
        return real(self, volume, surface, progress, fields)

    monkeypatch.setattr(Extractions, "make", slow)
    frames, volume = Frames(lambda: None), ball()
    for value in np.linspace(0.0, 5.0, 60):
        scene = scene_of(volume, float(value))
        start = time.perf_counter()
        frames.follow(scene, LIMITS)
        assert time.perf_counter() - start < 5
        time.sleep(0.004)
    follow(frames, scene)
    assert asked[-1] == 5.0
    assert 2 <= len(asked) < 40


def test_another_look_needs_no_other_mesh():
    frames, volume = Frames(lambda: None), ball()
    scene = scene_of(volume, 0.0)
    mesh = follow(frames, scene).meshes[0].mesh
    clear = replace(scene.surfaces[0], look=SurfaceLook(opacity=0.3))
    frame = frames.follow(scene.with_surfaces([clear]), LIMITS)
    assert frame.meshes[0].mesh is mesh
    assert frame.meshes[0].look.opacity == 0.3
    assert frames.follow(scene.with_surfaces([]), LIMITS).meshes == ()


def test_what_fails_is_told_once_and_not_tried_again(monkeypatch):
    frames, volume = Frames(lambda: None), ball()
    scene = scene_of(volume, 0.0)
    calls = []

    def bad(self, volume, surface, progress, fields):
        calls.append(surface)
        raise UsageError("no such surface")

    monkeypatch.setattr(Extractions, "make", bad)
    told = 0
    for _ in range(200):
        try:
            frames.follow(scene, LIMITS)
        except UsageError:
            told += 1
        time.sleep(0.002)
    assert (told, len(calls)) == (1, 1)


# --- files and words --------------------------------------------------------------------------


def test_scene_files_keep_surfaces(tmp_path):
    volume = sample("marschner-lobb", size=20)
    look = SurfaceLook((0.1, 0.2, 0.3), 0.4, "flat", "front", "overlay", "transfer")
    scene = scene_of(volume, 0.25, 0.5).with_raycast(show_volume=False)
    scene = scene.with_surfaces([replace(scene.surfaces[0], look=look), scene.surfaces[1]])
    scene.save(tmp_path / "a.volviz.json")
    again = volviz.Scene.open(tmp_path / "a.volviz.json", volume=volume)
    assert again.surfaces == scene.surfaces
    assert not again.raycast.show_volume


def test_a_scene_without_surfaces_is_written_as_before():
    text = scenefile.encode(volviz.Scene.of(ball()))
    assert b"surfaces" not in text
    assert b"show_volume" not in text


@pytest.mark.parametrize(
    ("key", "value"), [("opacity", 2), ("method", "magic"), ("color", [0, 0]), ("isovalue", None)]
)
def test_bad_surfaces_in_files_are_named(key, value):
    document = scenefile.to_document(scene_of(ball(), 1.0))
    document["surfaces"][0][key] = value
    import msgspec

    with pytest.raises(InputError) as caught:
        scenefile.decode(msgspec.json.encode(document), "a.json")
    assert f"surfaces[0].{key}" in str(caught.value.field)


@pytest.mark.parametrize(
    "surface",
    [
        SceneSurface.at(300.0),
        SceneSurface.at(-1e-7, opacity=0.25),
        SceneSurface.at(1.5, color=(0.1, 1 / 3, 1.0), shading="flat", visible=False),
        SceneSurface.at(3e5, ambiguity="asymptotic", normals="sobel", gloss=7.25, highlight=0),
    ],
)
@pytest.mark.parametrize("number", [0, 3])
def test_words_lead_back(surface, number):
    assert parse(spell(surface, number), number, surface_color) == surface


@pytest.mark.parametrize(
    ("word", "told"),
    [
        ("bone", "is not VALUE"),
        ("300,red,0.5,7", "is not VALUE"),
        ("300,nocolour", "no colour"),
        ("300,red,2", "not a number from 0 to 1"),
        ("300,shadin=flat", "has no 'shadin'"),
        ("300,shading=flad", "unknown shading"),
        ("nan", "not a number"),
        ("300,visible=maybe", "true or false"),
    ],
)
def test_bad_words_are_told(word, told):
    with pytest.raises(UsageError, match=told) as error:
        parse(word, 0, surface_color)
    assert error.value.field == "--isosurface"
    assert "give VALUE" not in str(error.value)  # that is what was told already


def test_a_number_for_a_colour_is_told_as_it_can_be_written():
    with pytest.raises(UsageError, match=r"'0\.5' is no colour .* red/green/blue"):
        parse("300,0.5", 0, surface_color)


def test_what_is_no_surface_is_told():
    scene = volviz.Scene.of(ball(8, 3.0))
    for wrong in ([300], 300, [SceneSurface.at(1), None], SceneSurface.at(1)):
        with pytest.raises(UsageError, match=r"SceneSurface\.at\(300\)"):
            scene.with_surfaces(wrong)
    with pytest.raises(UsageError, match="did you mean 'color'"):
        SceneSurface.at(300, colour=(1, 0, 0))
    with pytest.raises(UsageError, match="did you mean 'method'"):
        SceneSurface.at(300, metod="cuberille")


def test_colours_by_name_and_by_default():
    assert parse("1,red", 0, surface_color).look.color == (1.0, 0.0, 0.0)
    assert parse("1,#ff0000", 0, surface_color).look.color == (1.0, 0.0, 0.0)
    assert parse("1", 1, surface_color).look.color == COLORS[1]


# --- suggestions, steps -----------------------------------------------------------------------


def test_bone_then_skin_is_suggested_for_a_head():
    volume = sample("ct-head", size=48)
    facts = statistics(volume)
    first = suggested_surface(volume, facts, ())
    second = suggested_surface(volume, facts, (first,))
    assert (first.surface.isovalue, second.surface.isovalue) == (300.0, -300.0)
    assert first.look.opacity == 1.0
    assert second.look.opacity < 1.0


@pytest.mark.parametrize("stretch", [1.0, 0.4])
@pytest.mark.parametrize("sign", [1, -1])
def test_of_distances_the_surface_is_where_they_are_none(sign, stretch):
    """Also where voxels are long; not of values that rise otherwise."""
    z, y, x = np.mgrid[-2:9:12j, -11:11:23j, -9:13:30j]
    away = (sign * (4 - np.sqrt(x * x + y * y + z * z))).astype(np.float32)
    steps = (22 / 29, 1.0, 1.0 * stretch)
    volume = volviz.Volume.from_array(away, spacing=steps)
    found = suggested_isovalue(volume, statistics(volume))
    assert (found == 0) == (stretch == 1.0)


@pytest.mark.parametrize(
    "data",
    [
        np.zeros((4, 4, 4), np.uint8),
        np.full((4, 4, 4), np.nan, np.float32),
        np.arange(64).reshape(4, 4, 4),
        np.random.default_rng(0).random((6, 6, 6), dtype=np.float32) * 1e30,
    ],
)
def test_any_volume_gets_a_value(data):
    volume = volviz.Volume.from_array(data)
    facts, taken = statistics(volume), []
    for _ in range(12):
        taken.append(suggested_isovalue(volume, facts, tuple(taken)))
    assert np.isfinite(taken).all()
    resolve(scene_of(volume, taken[0]), Memo())


def test_steps_have_names():
    before = scene_of(ball(), 1.0)
    one = before.surfaces[0]
    assert edit.difference(before, before.with_surfaces([])) == "remove surface"
    assert edit.difference(before, before.with_surfaces([one, one])) == "add surface"
    assert edit.difference(before, scene_of(ball(), 1.0).with_surfaces([one])).startswith("open")
    moved = before.with_surfaces([one.with_isovalue(2.0)])
    assert edit.difference(before, moved) == "isovalue"
    two = before.with_surfaces([one, one])
    clear = replace(one, look=SurfaceLook(opacity=0.5))
    assert edit.difference(two, two.with_surfaces([one, clear])) == "opacity of surface 2"
    assert MAX_SURFACES >= 8
