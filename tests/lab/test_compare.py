"""Variants drawn and measured: known relations, other ways to the same numbers, what is told."""

from __future__ import annotations

import io
import json
import math
import os

import numpy as np
import pytest
from PIL import Image

import volviz
from volviz.cli import run
from volviz.errors import Cancelled, UsageError
from volviz.lab import measure, sheet, vary
from volviz.lab.compare import compare
from volviz.model.camera import Camera
from volviz.progress import Progress
from volviz.resolve import resolve

SIZE = (48, 40)


@pytest.fixture(scope="module")
def ball():
    z, y, x = np.mgrid[-10:10, -10:10, -10:10] + 0.5
    values = np.exp(-(x**2 + y**2 + z**2) / 40).astype(np.float32)
    return volviz.Volume.from_array(values, spacing=(1, 1, 1.5), name="smooth ball")


@pytest.fixture(scope="module")
def scene(ball):
    return volviz.Scene.of(ball, aspect=SIZE[0] / SIZE[1])


@pytest.fixture(scope="module")
def steps(scene):
    """Of the step: one thing varies, one reference."""
    return compare(scene, {"step": [4, 2, 1, 0.5, 0.5]}, size=SIZE, repeat=2)


def distance(one, other):
    """RMSE in the plainest way."""
    apart = one[..., :3].astype(float) - other[..., :3]
    return math.sqrt((apart**2).mean())


# --- known relations -----------------------------------------------------------------------------


def test_halving_the_step_brings_the_picture_nearer_to_its_reference(steps):
    errors = [v.rmse for v in steps.variants]
    assert errors[0] > errors[1] > errors[2] > errors[3] > 0
    assert errors[3] == errors[4], "the same variant twice"
    (reference,) = steps.references
    drawn = volviz.render(reference.scene, SIZE)
    assert measure.rmse(measure.difference(drawn, reference.image)) == 0


def test_errors_are_those_of_the_pictures(steps):
    for found in steps.variants:
        drawn, fine = found.image.pixels, steps.references[found.reference].image.pixels
        assert found.rmse == pytest.approx(distance(drawn, fine))
        assert found.largest == np.abs(drawn[..., :3].astype(int) - fine[..., :3]).max()


def test_pictures_are_those_of_render(steps, scene):
    for found in steps.variants:
        turned = scene.with_raycast(step=found.variant.changed["raycast.step"])
        assert np.array_equal(found.image.pixels, volviz.render(turned, SIZE).pixels)


def test_what_changes_the_meaning_is_measured_against_itself(scene):
    found = compare(scene, {"shading": "all"}, size=SIZE, repeat=0)
    assert [v.reference for v in found.variants] == [0, 1, 2]
    shadings = [r.scene.raycast.shading for r in found.references]
    assert shadings == ["none", "phong", "blinn-phong"]
    assert max(v.rmse for v in found.variants) < 3
    assert distance(*(found.variants[i].image.pixels for i in (0, 2))) > 5
    assert "each against the same with step 0.125" in found.against


def test_what_approximates_one_thing_is_measured_against_the_scene(scene):
    found = compare(scene, {"interpolation": ["linear", "nearest"]}, size=SIZE, repeat=0)
    (reference,) = found.references
    assert reference.scene.raycast.interpolation == "linear"
    linear, nearest = (v.rmse for v in found.variants)
    assert nearest > 2 * linear


def test_transparent_pictures_are_compared_over_black():
    clear = np.zeros((2, 2, 4), np.uint8)
    hidden = clear.copy()
    hidden[..., :3] = 200
    half = np.full((2, 2, 4), (100, 0, 0, 128), np.uint8)
    as_image = [volviz.Image(p) for p in (clear, hidden, half)]
    assert not measure.difference(as_image[0], as_image[1]).any()
    assert measure.difference(as_image[0], as_image[2])[..., 0].tolist() == [[50, 50]] * 2


# --- cost ----------------------------------------------------------------------------------------


def test_times_are_taken_in_turn_and_the_median_counts(steps, scene, monkeypatch):
    for found in steps.variants:
        assert len(found.times) == 2
        assert found.ms == pytest.approx(500 * sum(found.times))
    bench = measure.Bench(SIZE, None)
    order = []

    class Recorder:
        def image(self, frame, size, **_):
            if size == bench.size:
                order.append(frame)

    bench.renderer = Recorder()
    bench.times(["a", "b", "c"], 2, Progress())
    assert order == ["a", "b", "c"] * 2
    assert "median of 2" in steps.setting
    assert steps.renderer in steps.setting


@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
def test_samples_along_the_rays_are_counted_as_a_walk_along_them_does(scene, projection):
    camera = scene.camera.orbited(30)
    frame = resolve(scene.with_camera(camera).with_knobs(projection=projection, samples=3))
    width, height = 12, 9
    origin, direction = frame.camera.rays(width / height)
    inverse = np.linalg.inv(frame.affine)
    walked = 0.0
    stride = 0.02
    for j in range(height):
        for i in range(width):
            at = np.array([1, (2 * i + 1) / width - 1, (2 * j + 1) / height - 1])
            o, d = origin @ at, direction @ at
            d /= np.linalg.norm(d)
            t = np.arange(0 if projection == "perspective" else -200, 400, stride)
            points = (o + t[:, None] * d) @ inverse[:3, :3].T + inverse[:3, 3]
            inside = ((points > -0.5) & (points < np.array(frame.voxels.dims) - 0.5)).all(axis=1)
            walked += inside.sum() * stride
    expected = walked / (frame.raycast.step * 1.0) * 3
    assert measure.lattice(frame, (width, height)) == pytest.approx(expected, rel=0.01)


def test_texture_memory_grows_with_the_volume(steps, scene):
    frame = resolve(scene)
    least = frame.voxels.nbytes + frame.table.entries.nbytes
    for found in steps.variants:
        assert found.facts["texture_bytes"] >= least


# --- the sheet -----------------------------------------------------------------------------------


@pytest.mark.parametrize("stacked", [False, True])
def test_tiles_of_the_sheet_are_the_pictures(steps, stacked):
    made = sheet.draw(steps, difference=stacked)
    pixels, (width, height) = made.image.pixels, SIZE
    assert len(set(made.places)) == len(steps.variants)
    for (x, y), found in zip(made.places, steps.variants, strict=True):
        assert np.array_equal(pixels[y : y + height, x : x + width], found.image.pixels)
    (reference,) = steps.references
    for (x, y), found in zip(made.differences, steps.variants, strict=False):
        apart = found.image.pixels[..., :3].astype(int) - reference.image.pixels[..., :3]
        seen = np.minimum(np.abs(apart) * made.gain, 255)
        assert np.array_equal(pixels[y : y + height, x : x + width, :3], seen)
    assert bool(made.differences) is stacked


def test_tiles_do_not_overlap_and_lie_within(steps, scene):
    for found in (steps, compare(scene, {"jitter": [0, 1], "step": [1, 2, 3]}, size=(30, 200))):
        made = sheet.draw(found, difference=True)
        free = np.zeros(made.image.pixels.shape[:2], int)
        width, height = found.size
        for x, y in (*made.places, *made.differences):
            free[y : y + height, x : x + width] += 1
        assert free.sum() == 2 * len(found.variants) * width * height
        assert free.max() == 1


@pytest.mark.parametrize(
    ("counts", "extra", "columns"),
    [([1], 0, 1), ([3], 1, 4), ([3, 2], 0, 2), ([2, 4], 0, 4), ([12], 0, 4), ([2, 1], 0, 2)],
)
def test_columns(counts, extra, columns):
    assert sheet.columns_of(counts, extra, 0.9) == columns


def test_long_and_strange_names_stay_within_their_place(ball, scene):
    from dataclasses import replace

    odd = replace(ball, info=replace(ball.info, name="Ångström α ½ \x1b[31m " * 30))
    found = compare(replace(scene, volume=odd), {"light_azimuth": [1, 2]}, size=SIZE, repeat=0)
    pixels = sheet.draw(found).image.pixels
    margin = pixels[:, -8:, :3].reshape(-1, 3)
    assert (margin == margin[0]).all(), "something is written over the edge"


# --- Python and the command line -----------------------------------------------------------------


def test_python_gives_a_table_a_document_and_a_picture(steps, tmp_path):
    columns, rows = steps.table()
    assert columns == ("step", "ms", "RMSE", "max", "texture", "samples")
    assert len(rows) == 5
    assert "RMSE" in str(steps)
    json.dumps(steps.document(), allow_nan=False)
    steps.save(tmp_path / "a.png")
    with Image.open(tmp_path / "a.png") as picture:
        assert picture.size == steps.sheet().size
    assert Image.open(io.BytesIO(steps._repr_png_())).size == steps.sheet().size
    with pytest.raises(volviz.VolvizError, match="exists"):
        steps.save(tmp_path / "a.png", overwrite=False)
    assert volviz.compare is compare


def test_python_tells_what_is_wrong(scene, ball):
    with pytest.raises(UsageError, match="did you mean 'step'"):
        compare(scene, {"stepp": [1]})
    with pytest.raises(UsageError, match="nothing varies"):
        compare(scene, {})
    with pytest.raises(UsageError, match="no values"):
        compare(scene, {"step": []})
    with pytest.raises(UsageError, match="did you mean 'fine'"):
        compare(scene, {"step": [1]}, reference="fin")
    with pytest.raises(UsageError, match="0 to 1000"):
        compare(scene, {"step": [1]}, repeat=-1)
    found = compare(ball, {"seed": [1]}, size=(8, 8), repeat=0, reference="none")
    assert found.variants[0].rmse is None
    assert found.variants[0].ms is None


def test_cancel_takes_effect(scene):
    seen = []
    progress = Progress(lambda fraction, _: seen.append(fraction) or progress.cancel())
    with pytest.raises(Cancelled):
        compare(scene, {"step": [1, 2]}, size=SIZE, progress=progress)
    assert len(seen) == 1


def test_progress_rises_to_its_end(scene):
    seen = []
    compare(scene, {"shading": "all"}, size=SIZE, progress=Progress(lambda f, _: seen.append(f)))
    known = [f for f in seen if f is not None]
    assert known == sorted(known)
    assert known[-1] == pytest.approx(1.0)


@pytest.fixture
def file(ball, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    volviz.save_volume(ball, tmp_path / "ball.nrrd")
    return "ball.nrrd"


def test_json_says_what_the_table_says(file, capsys):
    words = ["compare", file, "--vary", "step=0.5,2", "--vary", "shading=none,phong"]
    words += ["--size", "32x24", "--repeat", "1", "-q"]
    assert run([*words, "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["size"] == [32, 24]
    assert document["vary"] == {"raycast.step": [0.5, 2.0], "raycast.shading": ["none", "phong"]}
    assert [v["changed"] for v in document["variants"]] == [
        {"raycast.step": s, "raycast.shading": k} for s in (0.5, 2.0) for k in ("none", "phong")
    ]
    assert run(words) == 0
    header, *rows = capsys.readouterr().out.splitlines()
    assert header.split() == ["step", "shading", "ms", "RMSE", "max", "texture", "samples"]
    for row, told in zip(rows, document["variants"], strict=True):
        step, shading, _, rmse, largest, *_ = row.split()
        assert (float(step), shading) == tuple(told["changed"].values())
        assert float(rmse) == pytest.approx(told["rmse"], abs=0.0051)
        assert int(largest) == told["max"]
        assert told["ms"] == pytest.approx(np.median(told["ms_each"]))


def test_sheet_is_written_once_and_flags_of_the_scene_count(file, tmp_path, capsys):
    words = ["compare", file, "--vary", "shading=none", "--size", "32x32", "--repeat", "0"]
    words += ["--preset", "viridis", "--azimuth", "40", "-o", "s.png"]
    assert run(words) == 0
    assert "s.png: 1 variant " in capsys.readouterr().err
    before = (tmp_path / "s.png").read_bytes()
    assert run(words) == 7
    assert "--force" in capsys.readouterr().err
    assert (tmp_path / "s.png").read_bytes() == before
    assert run([*words, "--force"]) == 0
    scene = volviz.Scene.of(volviz.load(file), preset="viridis", azimuth=40).with_knobs(
        shading="none"
    )
    drawn = volviz.render(scene, (32, 32)).pixels
    with Image.open("s.png") as picture:
        found = np.asarray(picture.convert("RGBA"))
    windows = np.lib.stride_tricks.sliding_window_view(found, (32, 32, 4)).reshape(
        found.shape[0] - 31, found.shape[1] - 31, 32, 32, 4
    )
    assert any(np.array_equal(window, drawn) for row in windows for window in row)


@pytest.mark.parametrize(
    ("words", "code", "told"),
    [
        ([], 2, ["--vary", "nothing varies"]),
        (["--vary", "stepp=1"], 2, ["did you mean 'step'"]),
        (["--vary", "step=1,99"], 2, ["99", "0.01 to 16"]),
        (["--vary", "shading=fong"], 2, ["did you mean 'phong'"]),
        (["--vary", "seed=" + ",".join(map(str, range(500)))], 6, ["500", "64"]),
        (["--vary", "step=1", "--reference", "finer"], 2, ["did you mean 'fine'"]),
        (["--vary", "step=1", "--repeat", "-2"], 2, ["0 to 1000"]),
        (["--vary", "step=1", "--size", "0x4"], 2, ["--size"]),
        (["--vary", "seed=" + "1," * 60 + "1", "--size", "2000"], 6, ["--size", "61 pictures"]),
        (["--vary", "step=1", "--difference"], 2, ["--difference", "-o"]),
        (["--vary", "step=1", "-o", "a.xyz"], 2, [".xyz"]),
        (["--vary", "step=1", "-o", "nowhere/a.png"], 7, ["nowhere"]),
        (["--vary", "step=1", "-o", "-", "--json"], 2, ["standard output"]),
        (["--vary", "step=1", "--backend", "none"], 5, ["OpenGL"]),
    ],
)
def test_mistakes_are_one_line(file, tmp_path, capsys, words, code, told):
    before = set(os.listdir(tmp_path))
    assert run(["compare", file, *words]) == code
    out, err = capsys.readouterr()
    assert not out
    assert err.count("\n") == 1
    for word in told:
        assert word in err
    assert set(os.listdir(tmp_path)) == before


def test_ctrl_c_is_130_and_leaves_nothing(file, tmp_path, monkeypatch, capsys):
    def stopped(*_, **__):
        raise KeyboardInterrupt

    before = set(os.listdir(tmp_path))
    monkeypatch.setattr(measure.Bench, "times", stopped)
    assert run(["compare", file, "--vary", "step=1", "-o", "o.png", "--size", "16"]) == 130
    assert set(os.listdir(tmp_path)) == before
    assert "cancelled" in capsys.readouterr().err


def test_picture_on_standard_output_alone(file, capsysbinary):
    words = ["compare", file, "--vary", "step=1,2", "--size", "16", "--repeat", "0", "-o", "-"]
    assert run(words) == 0
    assert Image.open(io.BytesIO(capsysbinary.readouterr().out)).format == "PNG"


def test_projections_show_the_volume_equally_large(scene):
    axes = [vary.axis("projection=all", scene)]
    for variant in vary.variants(scene, axes):
        assert isinstance(variant.scene.camera, Camera)
        pixels = volviz.render(variant.scene, (40, 40)).pixels
        assert pixels[..., :3].max() > 100


def test_wrong_arguments_are_told(scene):
    for size in (32, (32,), (), (32.5, 32), (32, 32, 3), (0, 0)):
        with pytest.raises(UsageError, match="size"):
            volviz.compare(scene, {"step": [1]}, size=size)
    with pytest.raises(UsageError, match="what to vary"):
        volviz.compare(scene, ["step"])
