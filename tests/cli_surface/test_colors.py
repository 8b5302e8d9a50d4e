"""`volviz surface --color-by`, and the ambiguous cells of its report."""

from __future__ import annotations

import json

import numpy as np
import pytest
import trimesh

import volviz
from volviz.classify.colormaps import ramp_points
from volviz.cli import run
from volviz.isosurface.ambiguous import ambiguous_cells


@pytest.fixture
def ball(tmp_path):
    """Distance from (9, 9, 9) mm."""
    z, y, x = np.mgrid[:19, :19, :19].astype(np.float32)
    data = np.sqrt((x - 9) ** 2 + (y - 9) ** 2 + (z - 9) ** 2)
    path = tmp_path / "ball.nrrd"
    volviz.save_volume(volviz.Volume.from_array(data, space="LPS"), path)
    return path


def facts(capsys, *args):
    assert run(["surface", *map(str, args), "--json"]) == 0
    return json.loads(capsys.readouterr().out)


@pytest.mark.parametrize("suffix", ["ply", "glb", "obj"])
def test_colours_reach_the_file(ball, tmp_path, capsys, suffix):
    out = tmp_path / f"a.{suffix}"
    paint = ["--color-by", "x", "--colormap", "gray", "--color-range", "5,13"]
    said = facts(capsys, ball, "--isovalue", "5", *paint, "-o", out)
    assert said["color"] == {
        "field": "x", "colormap": "gray", "low": 5.0, "high": 13.0, "vertices_without_value": 0,
    }  # fmt: skip
    mesh = trimesh.load(out, process=False, force="mesh")
    colors = np.asarray(mesh.visual.vertex_colors)[:, :3].astype(float)
    if suffix == "glb":  # glTF's colours are linear, its node turns and scales the vertices
        assert colors.std() > 20
        return
    wanted = 255 * np.clip((mesh.vertices[:, 0] - 5) / 8, 0, 1)
    np.testing.assert_allclose(colors, np.repeat(wanted[:, None], 3, 1), atol=1.6)


def test_another_volume_colours_it(ball, tmp_path, capsys):
    """A coarse volume of x + y, in a place and on a grid of its own."""
    _, y, x = np.mgrid[:6, :6, :6].astype(np.float32)
    other = volviz.Volume.from_array(4 * x + 4 * y, (4, 4, 4), space="LPS")
    volviz.save_volume(other, tmp_path / "sum.nrrd")
    out = tmp_path / "a.ply"
    paint = ["--color-by", tmp_path / "sum.nrrd", "--color-range", "0,40"]
    facts(capsys, ball, "--isovalue", "5", *paint, "-o", out)
    mesh = trimesh.load(out, process=False)
    points = np.array(ramp_points("viridis", 0, 40))
    at = mesh.vertices[:, :2].sum(axis=1)
    wanted = [255 * np.interp(at, points[:, 0], points[:, k]) for k in (1, 2, 3)]
    np.testing.assert_allclose(mesh.visual.vertex_colors[:, :3], np.stack(wanted, 1), atol=1.6)


@pytest.mark.parametrize(
    ("args", "code", "said"),
    [
        (["--color-by", "x", "-o", "a.stl"], 2, "no colours"),
        (["--colormap", "gray"], 2, "--color-by"),
        (["--color-by", "x", "--colormap", "jet"], 2, "unknown colormap"),
        (["--color-by", "x", "--color-range", "3,1"], 2, "not below"),
        (["--color-by", "none.nrrd"], 3, "none.nrrd"),
        (["--preset", "ct-bone"], 2, "--preset: there is no field to colour by"),
        (["--color-by", "x", "--preset", "ct-bonee"], 2, "did you mean 'ct-bone'"),
        (["--color-by", "x", "--preset", "ct-bone", "--colormap", "gray"], 2, "of gray"),
        (["--color-by", "x", "--transfer", "{"], 3, "--transfer"),
        (["--color-by", "x", "--colormap", "transfer", "--color-range", "1,2"], 2, "its own range"),
        (["--color-by", "x", "--preset", "ct-bone", "--transfer", "{}"], 2, "one of the two"),
        (["--color-by", "ball.nrrd?chanel=1"], 2, "does not choose"),
    ],
)
def test_mistakes(ball, capsys, monkeypatch, args, code, said):
    monkeypatch.chdir(ball.parent)
    assert run(["surface", "ball.nrrd", "--isovalue", "5", *args]) == code
    assert said in capsys.readouterr().err
    assert not (ball.parent / "a.stl").exists()


def test_ambiguous_cells_are_reported(tmp_path, capsys, rng):
    volume = volviz.Volume.from_array(rng.standard_normal((12, 12, 12)).astype(np.float32))
    volviz.save_volume(volume, tmp_path / "noise.nrrd")
    said = facts(capsys, tmp_path / "noise.nrrd", "--isovalue", "0.2")
    assert said["ambiguous_cells"] == ambiguous_cells(volume, 0.2).as_dict()
    assert said["ambiguous_cells"]["differ_from_trilinear"]["table15"] > 0
    assert run(["surface", str(tmp_path / "noise.nrrd"), "--isovalue", "0.2"]) == 0
    assert "other than trilinear" in capsys.readouterr().out
    cubes = facts(capsys, tmp_path / "noise.nrrd", "--isovalue", "0.2", "--method", "cuberille")
    assert cubes["ambiguous_cells"] is None


def test_a_picture_of_the_command_line_has_the_colours(ball, tmp_path):
    out = tmp_path / "a.png"
    word = "5,coloring=field,color_field=x,colormap=viridis,highlight=0"
    look = ["--size", "64x48", "--samples", "1", "--no-volume", "--isosurface", word]
    assert run(["render", str(ball), "-o", str(out), *look]) == 0
    from PIL import Image

    with Image.open(out) as picture:
        pixels = np.asarray(picture.convert("RGB")).astype(float)
    seen = pixels[24, 22:42]
    assert np.ptp(seen[:, 0] - seen[:, 2]) > 60  # from blue to yellow


RED_TO_BLUE = {"colors": [[4, 1, 0, 0], [14, 0, 0, 1]], "opacities": [[4, 1], [14, 1]]}


def vertex_colors(path):
    mesh = trimesh.load(path, process=False)
    return mesh.vertices, np.asarray(mesh.visual.vertex_colors)[:, :3].astype(float)


def check_red_to_blue(out):
    """Light is linear between the points of a transfer function, sRGB at them and in the file."""
    at, colors = vertex_colors(out)
    share = np.clip((at[:, 0] - 4) / 10, 0, 1)
    plain = np.stack([1 - share, 0 * share, share], axis=1)
    assert np.all(np.diff(colors[np.argsort(at[:, 0]), 0]) <= 3)
    assert np.all(np.diff(colors[np.argsort(at[:, 0]), 2]) >= -3)
    assert np.all(colors[:, 1] == 0)
    ends = (share < 0.02) | (share > 0.98)
    assert ends.sum() > 1
    np.testing.assert_allclose(colors[ends] / 255, plain[ends], atol=0.03)


def test_a_transfer_function_of_ones_own_colours_it(ball, tmp_path, capsys):
    out = tmp_path / "a.ply"
    paint = ["--color-by", "x", "--transfer", json.dumps(RED_TO_BLUE)]
    said = facts(capsys, ball, "--isovalue", "4.9", *paint, "-o", out)
    assert (said["color"]["colormap"], said["color"]["low"], said["color"]["high"]) == (
        "transfer", 4.0, 14.0,
    )  # fmt: skip
    check_red_to_blue(out)


def test_a_scene_brings_its_own_transfer_function(ball, tmp_path, capsys):
    scene = volviz.Scene.of(volviz.load(ball))
    own = volviz.TransferFunction(**{k: tuple(map(tuple, v)) for k, v in RED_TO_BLUE.items()})
    scene.with_transfer(own).save(tmp_path / "a.volviz.json")
    out = tmp_path / "a.ply"
    paint = ["--color-by", "x", "--colormap", "transfer", "-o", out]
    facts(capsys, tmp_path / "a.volviz.json", "--isovalue", "4.9", *paint)
    check_red_to_blue(out)


def test_a_preset_colours_it(ball, tmp_path, capsys):
    out = tmp_path / "a.ply"
    paint = ["--color-by", ball, "--preset", "ct-bone", "-o", out]
    said = facts(capsys, ball, "--isovalue", "5", *paint)
    wanted = volviz.Scene.of(volviz.load(ball), preset="ct-bone").transfer
    assert (said["color"]["low"], said["color"]["high"]) == wanted.domain
    colors = vertex_colors(out)[1]
    np.testing.assert_allclose(
        colors, np.tile(255 * wanted.color_at(np.array([5.0])), (len(colors), 1)), atol=2
    )
