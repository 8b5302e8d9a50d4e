"""Surfaces in the colours of a second field: values by SciPy, colours by hand, any other grid."""

from __future__ import annotations

import json
import os
from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

import volviz
from volviz import surface_colors
from volviz.app.autosave import Autosave
from volviz.classify.colormaps import RAMPS, ramp_points
from volviz.errors import InputError, UsageError
from volviz.model import scenefile
from volviz.model.mesh import Mesh
from volviz.model.surface_look import BY_TRANSFER, COLORMAPS, SceneSurface, SurfaceLook
from volviz.model.surface_words import parse, spell
from volviz.model.wanted import Wanted
from volviz.progress import silent
from volviz.resolve_surfaces import Extractions, drawn, known, missing
from volviz.surface_colors import MISSING, field_values, painted, sampled, span_of


@pytest.fixture
def ball() -> volviz.Volume:
    """Distance from the middle, so that the surface at 5 is a sphere."""
    z, y, x = np.mgrid[-9:10, -9:10, -9:10].astype(np.float32)
    return volviz.Volume.from_array(np.sqrt(x * x + y * y + z * z), origin=(-9, -9, -9))


@pytest.fixture
def other(tmp_path, rng) -> tuple[str, volviz.Volume]:
    """Another volume in a file: its own grid, of which the ball sees a part."""
    affine = np.diag([0.8, 1.3, 2.0, 1.0])
    affine[:3, 3] = (-3.0, -8.0, -6.0)
    volume = volviz.Volume.from_array(
        rng.normal(0, 1, (8, 14, 20)).astype(np.float32), affine=affine, space="LPS"
    )
    path = tmp_path / "other, 100%=new.nii.gz"
    volviz.save_volume(volume, path)
    return str(path), volume


def test_every_ramp_is_a_colour_map():
    assert set(COLORMAPS) == {*RAMPS, BY_TRANSFER}


def test_another_volume_is_looked_up_in_the_world(ball, other):
    path, volume = other
    mesh = volviz.extract_surface(ball, 5.0)
    found = field_values(ball, path, mesh)
    index = (mesh.vertices - volume.affine[:3, 3]) / np.diag(volume.affine)[:3]
    expected = map_coordinates(volume.data.astype(float), index[:, ::-1].T, order=1)
    inside = ((index > 0.001) & (index < np.array(volume.dims) - 1.001)).all(axis=1)
    outside = ((index < -0.001) | (index > np.array(volume.dims) - 0.999)).any(axis=1)
    assert inside.sum() > 100
    assert outside.sum() > 50
    np.testing.assert_allclose(found[inside], expected[inside], atol=1e-4)
    assert np.isnan(found[outside]).all()


def test_fields_of_every_volume(ball):
    mesh = volviz.extract_surface(ball, 5.0)
    for axis, name in enumerate("xyz"):
        np.testing.assert_array_equal(field_values(ball, name, mesh), mesh.vertices[:, axis])
    slopes = field_values(ball, "gradient-magnitude", mesh)
    assert np.abs(slopes - 1).max() < 0.05  # of a distance


@pytest.mark.parametrize("name", ["viridis", "gray"])
def test_colours_are_the_ramps(name):
    mesh = Mesh(np.zeros((6, 3), np.float32))
    values = np.array([-1, 0, 2.5, 5, 99, np.nan], np.float32)
    look = SurfaceLook(coloring="field", colormap=name)
    transfer = volviz.TransferFunction(((0, 0, 0, 0), (1, 1, 1, 1)), ((0, 0), (1, 1)))
    made = painted(mesh, values, look, (0.0, 5.0), transfer)
    points = np.array(ramp_points(name, 0, 1))
    at = np.clip(values[:5] / 5, 0, 1)
    for k in range(3):
        expected = 255 * np.interp(at, points[:, 0], points[:, k + 1])
        np.testing.assert_allclose(made.colors[:5, k], expected, atol=1.0)
    np.testing.assert_allclose(made.colors[5, :3], 255 * np.array(MISSING), atol=0.51)
    assert (made.colors[:, 3] == 255).all()
    np.testing.assert_array_equal(made.values, values)
    narrow = replace(look, color_low=2.0, color_high=3.0)
    again = painted(mesh, values, narrow, (0.0, 5.0), transfer)
    np.testing.assert_array_equal(again.colors[0], again.colors[1])
    np.testing.assert_array_equal(again.colors[3], again.colors[4])


def test_colours_are_the_transfer_functions():
    transfer = volviz.TransferFunction(((0, 1, 0, 0), (10, 0, 1, 0)), ((0, 0), (10, 1)))
    mesh, values = Mesh(np.zeros((3, 3), np.float32)), np.array([0, 5, 10], np.float32)
    look = SurfaceLook(coloring="field", colormap=BY_TRANSFER)
    made = painted(mesh, values, look, (0.0, 1.0), transfer)
    np.testing.assert_allclose(made.colors[:, :3] / 255, transfer.color_at(values), atol=0.005)


def test_the_span_leaves_out_the_ends():
    values = np.append(np.arange(101, dtype=np.float32), np.nan)
    assert span_of(values) == (2.0, 98.0)
    low, high = span_of(np.full(9, 3.0, np.float32))
    assert low == 3.0 < high
    assert span_of(np.array([np.nan], np.float32)) == (0.0, 1.0)


def test_a_scene_draws_the_colours_and_keeps_the_mesh(ball):
    plain = volviz.Scene.of(ball).with_surfaces([SceneSurface.at(5.0)])
    made = Extractions()
    for surface, fields in missing(plain, made).items():
        made.make(ball, surface, silent(), fields)
    mesh = made.get(Wanted(plain.surfaces[0].surface)).mesh
    dyed = plain.with_surfaces([SceneSurface.at(5.0, coloring="field", color_field="z")])
    assert drawn(dyed, known(dyed, made))[0][0].color == dyed.surfaces[0].look.color
    for surface, fields in missing(dyed, made).items():
        made.make(ball, surface, silent(), fields)
    assert missing(dyed, made) == {}
    found = known(dyed, made)
    assert found[0].mesh is mesh
    (one,), notes = drawn(dyed, found)
    assert (one.color, notes) == (None, ())
    np.testing.assert_array_equal(one.mesh.values, mesh.vertices[:, 2])
    assert one.opaque
    assert drawn(dyed, known(dyed, made))[0][0].mesh is one.mesh
    assert missing(plain, made) == {}


def test_a_picture_has_the_colours(ball):
    surface = SceneSurface.at(5.0, coloring="field", color_field="x", colormap="gray", highlight=0)
    scene = volviz.Scene.of(ball).with_surfaces([surface])
    scene = scene.with_knobs(show_volume=False, samples=1, ambient=1.0, diffuse=0.0)
    front = replace(scene.camera, position=(0, -60, 0), target=(0, 0, 0), up=(0, 0, 1))
    scene = scene.with_camera(front)
    picture = volviz.render(scene, size=(64, 64)).pixels[..., 0].astype(int)
    right = scene.camera.axes()[0][0]
    row = picture[32, 27:38]
    assert (np.diff(row) * np.sign(right) > 0).all()


def test_a_missing_file_is_an_error_for_a_picture_and_a_note_in_the_window(ball, tmp_path):
    gone = str(tmp_path / "gone.nrrd")
    scene = volviz.Scene.of(ball).with_surfaces(
        [SceneSurface.at(5.0, coloring="field", color_field=gone)]
    )
    with pytest.raises(InputError, match=r"gone\.nrrd"):
        volviz.render(scene, size=(16, 16))
    made = Extractions()
    for surface, fields in missing(scene, made).items():
        made.make(ball, surface, silent(), fields)
    (one,), notes = drawn(scene, known(scene, made))
    assert "gone.nrrd" in notes[0]
    np.testing.assert_allclose(one.mesh.colors[0, :3], 255 * np.array(MISSING), atol=0.51)


def test_parts_of_a_file(ball, other, monkeypatch):
    seen = []
    monkeypatch.setattr("volviz.sources.open_volume", lambda p, o: seen.append((p, o)) or ball)
    mesh = volviz.extract_surface(ball, 5.0)
    surface_colors._others.clear()
    field_values(ball, "a.tif?channel=1&time=2", mesh)
    assert seen[0][0] == "a.tif"
    assert (seen[0][1].channel, seen[0][1].time) == (1, 2)
    assert sampled(ball, "a.tif?chanel=1", mesh, mesh).error.exit_code == UsageError.exit_code
    surface_colors._others.clear()


def test_other_volumes_are_read_once(ball, other):
    path, _ = other
    mesh = volviz.extract_surface(ball, 5.0)
    surface_colors._others.clear()
    field_values(ball, path, mesh)
    kept = surface_colors._others[path]
    field_values(ball, path, mesh)
    assert surface_colors._others[path] is kept


def test_words_scenes_and_bad_names(ball, other):
    path, _ = other
    one = SceneSurface.at(5.0, coloring="field", color_field=path, color_low=-1.5, color_high=2.0)
    word = spell(one, 0)
    assert "," not in word.split("color_field=")[1].split(",color_low")[0]
    assert parse(word, 0, lambda t: (0, 0, 0)) == one
    typed = parse("5,coloring=field,color_field=a b/c.nii.gz?channel=1", 0, lambda t: (0, 0, 0))
    assert typed.look.color_field == "a b/c.nii.gz?channel=1"
    scene = volviz.Scene.of(ball).with_surfaces([one])
    text = json.loads(scenefile.encode(scene))
    assert text["surfaces"][0]["color_field"] == path
    with pytest.raises(UsageError, match="no name"):
        SurfaceLook(color_field=" ")


def dyed(volume, field):
    return volviz.Scene.of(volume).with_surfaces(
        [SceneSurface.at(5.0, coloring="field", color_field=field)]
    )


def field_of_file(path):
    return json.loads(path.read_text())["surfaces"][0]["color_field"]


@pytest.mark.parametrize("more", ["", "?channel=1", "?series=a b&time=2"])
@pytest.mark.parametrize("name", ["pet.nii.gz", "more/pet.nii.gz", "../pet é.nii.gz", "x", "a?b"])
def test_a_scene_file_names_the_field_from_where_it_lies(tmp_path, monkeypatch, ball, name, more):
    """So that a folder with a scene and its volumes can be moved, and said from elsewhere."""
    here, there = tmp_path / "here", tmp_path / "there"
    here.mkdir()
    monkeypatch.chdir(here)
    volviz.save_volume(ball, "ball.nrrd")
    volume = volviz.load("ball.nrrd")
    given = name if name != "x" else "./x"  # x alone is the place in the world
    dyed(volume, given + more).save("a.volviz.json")
    assert field_of_file(here / "a.volviz.json") == given + more
    whole = str(here / name) + more
    dyed(volume, whole).save("b.volviz.json")
    expected = os.path.normpath(name) if name != "x" else "./x"
    assert field_of_file(here / "b.volviz.json") == expected + more
    here.rename(there)
    monkeypatch.chdir(tmp_path)
    for file in ("a.volviz.json", "b.volviz.json"):
        opened = volviz.Scene.open(there / file)
        assert opened.surfaces[0].look.color_field == os.path.normpath(there / name) + more


@pytest.mark.parametrize("field", ["x", "gradient-magnitude", "sample:sphere"])
def test_what_is_no_file_keeps_its_name_in_a_scene_file(tmp_path, ball, field):
    dyed(ball, field).save(tmp_path / "a.volviz.json")
    assert field_of_file(tmp_path / "a.volviz.json") == field
    opened = volviz.Scene.open(tmp_path / "a.volviz.json", volume=ball)
    assert opened.surfaces[0].look.color_field == field


def test_a_scene_saved_by_itself_names_the_field_wholly(tmp_path, monkeypatch, ball):
    """It lies in a folder of its own, from where nobody sees where volviz was started."""
    monkeypatch.chdir(tmp_path)
    volviz.save_volume(ball, "ball.nrrd")
    scene = dyed(volviz.load("ball.nrrd"), "pet.nii.gz?channel=1")
    kept = Autosave(tmp_path / "kept")
    kept.folder.mkdir()
    assert kept.tick(scene, dirty=True, now=True) is None
    opened = volviz.Scene.open(kept.file)
    assert opened.surfaces[0].look.color_field == str(tmp_path / "pet.nii.gz") + "?channel=1"
