"""What is done to a surface after extraction: drawn, kept apart from the extraction, saved, varied.

The oracle of what is drawn is the library: `refine(extract(volume, surface), steps)`.
"""

from __future__ import annotations

import json
import threading
import time
from dataclasses import replace

import numpy as np
import pytest

import volviz
from volviz.app.frames import Frames
from volviz.cli import run
from volviz.cli.render import surface_color
from volviz.errors import Cancelled, InputError, UsageError
from volviz.isosurface import extract
from volviz.lab.surfaces import surface_facts
from volviz.meshes.components import components
from volviz.meshes.distance import two_sided
from volviz.meshes.refine import refine
from volviz.model import scenefile
from volviz.model.lens import Viewing
from volviz.model.refining import Refining
from volviz.model.surface_look import SceneSurface, SurfaceLook
from volviz.model.surface_words import parse, spell
from volviz.model.wanted import Wanted, wanted
from volviz.progress import Progress, silent
from volviz.resolve import Memo, TextureLimits, extractions, resolve
from volviz.resolve_surfaces import KEPT, Extractions, wanted_of
from volviz.ui import edit

LIMITS = TextureLimits()
STEPS = [
    {"smooth": 4},
    {"keep_largest": True},
    {"min_triangles": 200, "flip": True},
    {"min_area": 100.0, "weld": 0.3},
    {"decimate": 0.7, "boundary": "simplified"},
    {"keep_largest": True, "smooth": 3, "decimate": 0.6, "max_error": 0.5},
]


@pytest.fixture(scope="module")
def volume() -> volviz.Volume:
    """Two balls of radii 8 and 3 and a sheet that ends at the border, roughened a little."""
    z, y, x = np.mgrid[:24, :24, :40].astype(float)
    large = 8 - np.sqrt((x - 12) ** 2 + (y - 12) ** 2 + (z - 13) ** 2)
    small = 3 - np.sqrt((x - 32) ** 2 + (y - 12) ** 2 + (z - 13) ** 2)
    values = np.maximum(np.maximum(large, small), 1.5 - z)
    values += np.random.default_rng(5).normal(0, 0.15, values.shape)
    return volviz.Volume.from_array(values.astype(np.float32), name="balls")


def scene_of(volume: volviz.Volume, *surfaces: SceneSurface) -> volviz.Scene:
    return volviz.Scene.of(volume).with_surfaces(surfaces)


def triangles(mesh) -> list[bytes]:
    """Of places, in an order of their own: where the mesh keeps them does not matter."""
    return sorted(t.tobytes() for t in mesh.vertices[mesh.faces])


# --- what is drawn ----------------------------------------------------------------------------


@pytest.mark.parametrize("steps", STEPS)
def test_what_is_drawn_is_what_the_library_makes(volume, steps):
    surface = SceneSurface.at(0.0, **steps)
    drawn = resolve(scene_of(volume, surface), Memo()).meshes[0].mesh
    oracle = refine(extract(volume, surface.surface), Refining(**steps))
    assert 0 < len(oracle.faces) == len(drawn.faces)
    np.testing.assert_array_equal(drawn.vertices, oracle.vertices)
    np.testing.assert_array_equal(drawn.normals, oracle.normals)
    assert triangles(drawn) == triangles(oracle)
    assert triangles(drawn) != triangles(extract(volume, surface.surface))


def test_turning_a_step_extracts_nothing(volume, monkeypatch):
    calls = []

    def counted(volume, surface, progress=None):
        if min(volume.dims) > 3:  # not what is made so that kernels are compiled
            calls.append(surface)
        return extract(volume, surface, progress)

    monkeypatch.setattr("volviz.isosurface.extract", counted)
    memo, meshes = Memo(), []
    for steps in ({}, {"smooth": 2}, {"smooth": 3}, {"keep_largest": True}, {"flip": True}, {}):
        frame = resolve(scene_of(volume, SceneSurface.at(0.25, **steps)), memo)
        meshes.append(frame.meshes[0].mesh)
    assert len(calls) == 1
    assert meshes[0] is meshes[-1]
    assert len({id(mesh) for mesh in meshes}) == 5
    for k in range(KEPT + 3):  # another surface moves, and all that is made for it
        other = SceneSurface.at(0.5 + 0.01 * k)
        resolve(scene_of(volume, SceneSurface.at(0.25, smooth=3), other), memo)
    assert len(calls) == 1 + KEPT + 3
    resolve(scene_of(volume, SceneSurface.at(0.25, smooth=4)), memo)
    assert len(calls) == 1 + KEPT + 3, "what is refined was kept"


def test_what_changes_nothing_is_not_made_again(volume):
    """A rim that nothing moves, and the steps that a look has nothing to do with."""
    memo = Memo()
    plain = SceneSurface.at(0.0)
    first = resolve(scene_of(volume, plain), memo).meshes[0].mesh
    rim = SceneSurface.at(0.0, boundary="simplified")
    assert resolve(scene_of(volume, rim), memo).meshes[0].mesh is first
    smooth = SceneSurface.at(0.0, smooth=2)
    once = resolve(scene_of(volume, smooth), memo).meshes[0].mesh
    clear = replace(smooth, look=SurfaceLook(opacity=0.5))
    assert resolve(scene_of(volume, clear), memo).meshes[0].mesh is once
    info = extractions(volume, memo).get(Wanted(smooth.surface, smooth.refining))
    assert info.before.mesh is first


def test_a_large_mesh_is_stood_in_for_by_one_that_went_through_about_the_same(volume, monkeypatch):
    monkeypatch.setattr("volviz.resolve_surfaces.FEW", 600)
    steps = {"keep_largest": True, "flip": True, "smooth": 4}
    drawn = resolve(scene_of(volume, SceneSurface.at(0.0, **steps)), Memo()).meshes[0]
    plain = resolve(scene_of(volume, SceneSurface.at(0.0)), Memo()).meshes[0]
    assert components(plain.mesh)[1] >= components(plain.coarse)[1] > 1
    assert components(drawn.coarse)[1] == components(drawn.mesh)[1] == 1
    assert 0 < len(drawn.coarse.faces) < 0.6 * len(drawn.mesh.faces)
    for mesh in (drawn.coarse, drawn.mesh):  # inside out
        p = mesh.vertices[mesh.faces].astype(float)
        assert np.einsum("ij,ij->i", p[:, 0], np.cross(p[:, 1], p[:, 2])).sum() < 0
    few = resolve(scene_of(volume, SceneSurface.at(0.0, decimate=0.95)), Memo()).meshes[0]
    assert few.coarse is None, "light enough as it is"


def test_nothing_left_is_told_and_draws_nothing(volume):
    for steps in ({"min_triangles": 10**6}, {"weld": 1e4}):
        frame = resolve(scene_of(volume, SceneSurface.at(0.0, **steps)), Memo())
        assert frame.meshes[0].mesh.empty
        count = len(extract(volume, SceneSurface.at(0.0).surface).faces)
        assert any(f"nothing is left of its {count} triangles" in n for n in frame.notes)


def test_fields_are_sampled_where_the_surface_is_then(volume):
    steps = {"smooth": 6, "coloring": "field", "color_field": "z"}
    (drawn,) = resolve(scene_of(volume, SceneSurface.at(0.0, **steps)), Memo()).meshes
    np.testing.assert_array_equal(drawn.mesh.values, drawn.mesh.vertices[:, 2])


# --- where not everything can be done ---------------------------------------------------------


@pytest.mark.parametrize(
    ("knobs", "lens", "told"),
    [
        ({"method": "dividing-cubes"}, False, "points have no triangles"),
        ({}, True, "under the lens only a part of it is there"),
        ({"method": "cuberille", "front_faces": True}, False, "only its front faces are there"),
    ],
)
def test_parts_and_points_are_only_turned_and_that_is_said(volume, knobs, lens, told):
    surface = SceneSurface.at(0.0, smooth=5, keep_largest=True, **knobs)
    scene = scene_of(volume, surface).with_knobs(lens=lens, lens_x=12.0, lens_y=12.0, lens_z=13.0)
    frame = resolve(scene, Memo())
    assert any(f"(keep largest, smooth 5): {told}" in n for n in frame.notes)
    plain = resolve(scene.with_surfaces([SceneSurface.at(0.0, **knobs)]), Memo())
    np.testing.assert_array_equal(frame.meshes[0].mesh.vertices, plain.meshes[0].mesh.vertices)
    assert not any(told in n for n in plain.notes)
    turned = SceneSurface.at(0.0, flip=True, **knobs)
    frame = resolve(scene.with_surfaces([turned]), Memo())
    np.testing.assert_array_equal(frame.meshes[0].mesh.normals, -plain.meshes[0].mesh.normals)
    assert not any(told in n for n in frame.notes)


def test_other_methods_under_the_lens_are_done_whole(volume):
    surface = SceneSurface.at(0.0, smooth=2, method="marching-tetrahedra")
    scene = scene_of(volume, surface).with_knobs(lens=True)
    assert wanted_of(scene)[0].refining == surface.refining


def test_the_same_level_for_another_camera_is_not_refined_again(volume):
    surface = SceneSurface.at(0.0, smooth=2, level_pixels=3.0)
    scene, made = scene_of(volume, surface), Extractions()
    found = []
    for camera in (scene.camera, scene.camera.orbited(5)):
        one = wanted(surface, Viewing(camera, (64, 64)))
        assert one.by_camera
        found.append(made.make(volume, one, silent()))
    assert found[0].mesh is found[1].mesh
    assert found[0].before is found[1].before


# --- the window's frames ----------------------------------------------------------------------


def follow(frames: Frames, scene, seconds=200.0):
    """Until the surfaces are those of the scene, with their steps."""
    end = time.monotonic() + seconds
    made = [(s.surface, s.refining) for s in scene.surfaces]
    while True:
        frame = frames.follow(scene, LIMITS)
        if frame and [f and (f.surface, f.refining) for f in frames.surfaces] == made:
            return frame
        assert time.monotonic() < end
        time.sleep(0.002)


def test_the_last_good_mesh_stays_while_steps_and_isovalue_move(volume):
    frames = Frames(lambda: None)
    shown = follow(frames, scene_of(volume, SceneSurface.at(0.0, smooth=2)))
    for k in range(20):
        scene = scene_of(volume, SceneSurface.at(0.01 * k, smooth=2 + k // 4))
        frame = frames.follow(scene, LIMITS)
        assert len(frame.meshes) == 1
        assert not frame.meshes[0].mesh.empty
    last = follow(frames, scene)
    assert last.meshes[0].mesh is not shown.meshes[0].mesh
    assert len(frames.surfaces) == 1
    oracle = refine(extract(volume, scene.surfaces[0].surface), scene.surfaces[0].refining)
    np.testing.assert_array_equal(last.meshes[0].mesh.vertices, oracle.vertices)


def test_undoing_a_step_stops_it_at_once_and_shows_what_was_there(volume, monkeypatch):
    """The worker smooths until it is told to stop."""
    started, stopped = threading.Event(), threading.Event()

    def endless(mesh, steps, progress=None):
        if not steps.smooth or len(mesh.faces) < 100:
            return refine(mesh, steps, progress)
        started.set()
        try:
            while True:
                progress(None, "smoothing")
                time.sleep(0.001)
        finally:
            stopped.set()

    frames = Frames(lambda: None)
    plain = scene_of(volume, SceneSurface.at(0.125))
    first = follow(frames, plain).meshes[0].mesh
    monkeypatch.setattr("volviz.meshes.refine.refine", endless)
    rough = scene_of(volume, SceneSurface.at(0.125, smooth=3))
    frames.follow(rough, LIMITS)
    assert started.wait(60)
    assert frames.follow(rough, LIMITS).meshes[0].mesh is first
    assert frames.follow(plain, LIMITS).meshes[0].mesh is first
    assert frames.extracting is None
    assert stopped.wait(60)
    monkeypatch.undo()
    assert follow(frames, rough).meshes[0].mesh is not first


@pytest.mark.parametrize(
    ("steps", "word"),
    [
        ({"weld": 0.1}, "welding"),
        ({"keep_largest": True}, "normals"),
        ({"smooth": 4}, "smoothing"),
        ({"decimate": 0.8}, "decimating"),
    ],
)
def test_a_cancel_within_a_step_leaves_what_was_extracted(volume, steps, word):
    made, surface = Extractions(), SceneSurface.at(0.0, **steps)
    one = Wanted(surface.surface, surface.refining)

    def stop(fraction, what):
        if what == word:
            progress.cancel()

    progress = Progress(stop)
    with pytest.raises(Cancelled):
        made.make(volume, one, progress)
    assert made.get(one) is None
    assert made.get(one.extracted) is not None
    assert not made.make(volume, one, silent()).mesh.empty


# --- files, words, steps ----------------------------------------------------------------------


@pytest.mark.parametrize("steps", STEPS)
def test_scenes_and_words_lead_back(volume, steps, tmp_path):
    surface = SceneSurface.at(-0.25, opacity=0.5, **steps)
    scene = scene_of(volume, surface, SceneSurface.at(1.0))
    scene.save(tmp_path / "a.volviz.json")
    again = volviz.Scene.open(tmp_path / "a.volviz.json", volume=volume)
    assert again.surfaces == scene.surfaces
    for number in (0, 3):
        assert parse(spell(surface, number), number, surface_color) == surface


def test_a_scene_without_steps_is_written_and_read_as_before(volume):
    text = scenefile.encode(scene_of(volume, SceneSurface.at(1.0)))
    document = json.loads(text)
    assert not {"smooth", "weld", "decimate", "boundary", "flip"} & set(document["surfaces"][0])
    read = scenefile.to_scene(scenefile.decode(text, "a"), volume, volviz.Scene, "a")
    assert read.surfaces[0].refining == Refining()


@pytest.mark.parametrize(
    ("key", "value"),
    [("smooth", -1), ("smooth", 2.5), ("decimate", 1.5), ("boundary", "loose"), ("flip", 1)],
)
def test_bad_steps_in_files_are_named(volume, key, value):
    document = scenefile.to_document(scene_of(volume, SceneSurface.at(1.0)))
    document["surfaces"][0][key] = value
    with pytest.raises(InputError) as caught:
        scenefile.decode(json.dumps(document).encode(), "a.json")
    assert caught.value.field == f"$.surfaces[0].{key}"


@pytest.mark.parametrize(
    ("word", "told"),
    [
        ("300,smooth=-1", "-1.0 is not a whole number from 0 to 1000"),
        ("300,smooth=2.5", "not a whole number"),
        ("300,decimate=2", "not a number from 0 to 1"),
        ("300,weld=inf", "inf is not a finite number"),
        ("300,max_error=nan", "not a number of at least 0"),
        ("300,boundary=loose", "unknown boundary 'loose'"),
        ("300,keep-largest=perhaps", "not true or false"),
        ("300,smoth=3", "has no 'smoth'"),
    ],
)
def test_bad_steps_are_refused_in_one_line(volume, word, told, capsys, tmp_path):
    with pytest.raises(UsageError, match=told) as error:
        parse(word, 0, surface_color)
    assert error.value.field == "--isosurface"
    out = tmp_path / "a.png"
    words = ["render", "sample:marschner-lobb", f"--isosurface={word}", "-o", str(out)]
    assert run(words) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert len([line for line in lines if "error" in line]) == 1
    assert told in " ".join(lines)
    assert not out.exists()


def test_refused_by_name_in_python():
    for knobs, field in (({"smooth": -1}, "--smooth"), ({"weld": float("inf")}, "--weld")):
        with pytest.raises(UsageError) as error:
            SceneSurface.at(300, **knobs)
        assert error.value.field == field
    with pytest.raises(UsageError, match="did you mean 'keep_largest'"):
        SceneSurface.at(300, keep_larges=True)


def test_steps_have_names_and_are_told_in_few_words(volume):
    one = SceneSurface.at(1.0)
    before, after = (scene_of(volume, s) for s in (one, replace(one, refining=Refining(smooth=2))))
    assert edit.difference(before, after) == "smooth"
    two = before.with_surfaces([one, one])
    largest = replace(one, refining=Refining(keep_largest=True))
    assert edit.difference(two, two.with_surfaces([one, largest])) == "keep largest of surface 2"
    told = Refining(keep_largest=True, min_triangles=10**7, weld=0.5, boundary="simplified")
    assert told.text == "weld 0.5 mm, keep largest, min triangles 10000000"
    assert Refining().text == ""


# --- compared ---------------------------------------------------------------------------------


def test_steps_are_varied_as_of_the_surface(volume):
    scene = scene_of(volume, SceneSurface.at(0.0)).with_knobs(show_volume=False, samples=1)
    axes = {"surface.decimate": [0.0, 0.5], "surface.keep_largest": ["off", "on"]}
    found = volviz.compare(scene, axes, size=(16, 16), repeat=1, reference="none")
    entries = found.document()["variants"]
    whole, largest, half, few = entries
    mesh = extract(volume, scene.surfaces[0].surface)
    for entry, steps in (
        (whole, {}),
        (largest, {"keep_largest": True}),
        (half, {"decimate": 0.5}),
        (few, {"decimate": 0.5, "keep_largest": True}),
    ):
        made = refine(mesh, Refining(**steps))
        assert entry["triangles"] == len(made.faces)
        chosen = refine(mesh, Refining(**steps).choosing)
        assert entry["distance"] == pytest.approx(two_sided(made, chosen).hausdorff)
        assert ("refine_ms" in entry) == bool(steps)
    assert whole["distance"] == largest["distance"] == 0
    assert whole["triangles"] > largest["triangles"] > few["triangles"]
    columns, rows = found.table()
    assert list(columns[:2]) == ["decimate", "keep-largest"]
    assert [row[columns.index("refine ms")] == "–" for row in rows] == [True, False, False, False]
    assert len({v.image.pixels.tobytes() for v in found.variants}) > 1


def test_facts_of_hidden_and_of_refined_surfaces(volume):
    scene = scene_of(volume, SceneSurface.at(0.0, min_triangles=10**6))
    (facts,) = surface_facts([scene], 0)
    assert (facts.triangles, facts.distance, facts.refine_ms) == (0, None, None)
