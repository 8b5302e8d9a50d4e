from __future__ import annotations

import io
import json
import os
import resource
import subprocess
import sys
import time

import numpy as np
import pytest
from PIL import Image

import volviz
from volviz.cli import COMMANDS, run
from volviz.model.camera import Camera
from volviz.model.knobs import knobs_of
from volviz.model.scene import Light, Raycast


@pytest.fixture
def head(tmp_path, rng):
    """A small ball in noise, as a file."""
    z, y, x = np.mgrid[:20, :24, :28]
    ball = 900 - 90 * np.sqrt((x - 14) ** 2 + (y - 12) ** 2 + (z - 10) ** 2)
    data = (ball + rng.normal(0, 10, ball.shape)).astype(np.int16)
    path = tmp_path / "ball.nrrd"
    volviz.save_volume(volviz.Volume.from_array(data, spacing=(1, 1, 2), space="LPS"), path)
    return path


def pixels(path):
    return np.asarray(Image.open(path).convert("RGBA"))


def test_render_draws_what_python_draws(head, tmp_path, capsys):
    out = tmp_path / "a.png"
    assert run(["render", str(head), "-o", str(out), "--size", "64x48"]) == 0
    assert "a.png: 64×48" in capsys.readouterr().err
    scene = volviz.Scene.of(volviz.load(head), aspect=64 / 48)
    assert np.array_equal(pixels(out), volviz.render(scene, (64, 48)).pixels)


def test_same_scene_same_bytes(head, tmp_path):
    for name in ("a.png", "b.png"):
        assert run(["render", str(head), "-q", "-o", str(tmp_path / name), "--size", "40"]) == 0
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


def test_saved_scene_draws_the_same(head, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    look = ["--mode", "dvr", "--azimuth", "30", "--opacity", "0.5", "--background", "#102030"]
    first = ["render", str(head), "--save-scene", "s.volviz.json", "-o", "a.png", "--size", "50x40"]
    assert run([*first, *look]) == 0
    assert run(["render", "s.volviz.json", "-o", "b.png", "--size", "50x40"]) == 0
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


def test_every_knob_is_a_flag_that_changes_the_scene(head):
    from volviz.cli.flags import read_options
    from volviz.cli.render import scene_from

    for owner, part in ((Raycast, "raycast"), (Light, "light"), (Camera, "camera")):
        for spec in knobs_of(owner):
            plain = scene_from(str(head), read_options({}), {}, 1.0)
            now = getattr(getattr(plain, part), spec.name)
            others = [c for c in spec.choices if c != now] or [
                v for v in (spec.low, spec.high) if v not in (None, now)
            ]
            if spec.type is bool:
                others = [not now]
            if not spec.choices or len(spec.choices) > 1:
                value = spec.type(others[0])
                turned = scene_from(str(head), read_options({}), {spec.name: value}, 1.0)
                assert getattr(getattr(turned, part), spec.name) == value


def test_surfaces_stand_alone_or_in_the_volume(head, tmp_path):
    def drawn(*flags):
        out = tmp_path / "a.png"
        words = ["render", str(head), "-o", str(out), "-f", "-q", "--size", "48"]
        assert run([*words, "--samples", "1", "--background", "transparent", *flags]) == 0
        return np.asarray(Image.open(out).convert("RGBA")).astype(int)

    nothing = drawn("--no-volume")
    alone = drawn("--no-volume", "--isosurface", "300,#00ff00")
    clear = drawn("--no-volume", "--isosurface", "300,#00ff00,0.5")
    both = drawn("--isosurface", "300,#00ff00", "--isosurface=-300,red,0.2,shading=flat")
    assert not nothing.any()
    seen = alone[..., 3] == 255
    assert 0.1 < seen.mean() < 0.9
    assert (alone[seen][:, 1] >= alone[seen][:, 0]).all()
    assert 0 < clear[seen][:, 3].min() < 255
    assert (both[..., 3] > 0).sum() > seen.sum()
    assert run(["render", str(head), "--isosurface", "bone", "-q", "-f"]) == 2


def test_standard_output_is_the_picture_alone(head):
    command = [sys.executable, "-m", "volviz", "render", str(head), "-o", "-", "--size", "32"]
    done = subprocess.run(command, capture_output=True, check=True)
    assert Image.open(io.BytesIO(done.stdout)).size == (32, 32)
    assert b"standard output: 32" in done.stderr


def test_transparent_background(head, tmp_path):
    out = tmp_path / "a.png"
    flags = ["--mode", "mip", "--background", "0,0,0,0", "--size", "48"]
    assert run(["render", str(head), "-q", "-o", str(out), *flags]) == 0
    drawn = pixels(out)
    assert drawn[0, 0, 3] == 0
    assert drawn[..., 3].max() > 100


@pytest.mark.parametrize(
    ("flags", "code", "words"),
    [
        (["--preset", "ct-bonee"], 2, ["ct-bonee", "did you mean 'ct-bone'"]),
        (["--mode", "mipp"], 2, ["--mode", "did you mean 'mip'"]),
        (["--view", "anteriour"], 2, ["did you mean 'anterior'"]),
        (["--step", "0"], 2, ["--step", "0.01 to 16"]),
        (["--step", "x"], 2, ["step"]),
        (["--size", "0x9"], 2, ["--size"]),
        (["--size", "axb"], 2, ["--size", "WIDTHxHEIGHT"]),
        (["--background", "bluu"], 2, ["bluu", "#rrggbb"]),
        (["--background", "1,2,3"], 2, ["0 to 1"]),
        (["--window", "5,1"], 2, ["LOW"]),
        (["--zoom", "0"], 2, ["--zoom"]),
        (["--presett", "x"], 2, ["--presett", "--preset"]),
        (["--time", "7"], 2, ["time"]),
        (["--backend", "egll"], 2, ["egll", "did you mean 'egl'"]),
        (["--backend", "none"], 5, ["OpenGL"]),
        (["--max-memory", "1e-9"], 6, ["limit", "ball.nrrd"]),
        (["--output", "/nowhere/x.png"], 7, ["/nowhere", "make it first"]),
        (["--output", "x.xyz"], 2, [".xyz", ".png"]),
    ],
)
def test_wrong_flags_are_one_helpful_line(head, tmp_path, monkeypatch, capsys, flags, code, words):
    monkeypatch.chdir(tmp_path)
    before = set(os.listdir(tmp_path))
    base = [] if "--output" in flags else ["-o", "out.png"]
    assert run(["render", str(head), *base, *flags]) == code
    told = capsys.readouterr()
    assert told.out == ""
    assert told.err.startswith("volviz: error: ")
    assert told.err.count("\n") == 1
    for word in words:
        assert word in told.err
    assert set(os.listdir(tmp_path)) == before


@pytest.mark.parametrize(
    ("name", "make", "code", "words"),
    [
        ("gone.nrrd", None, 3, ["gone.nrrd", "no such file"]),
        ("ball.nrd", None, 3, ["did you mean 'ball.nrrd'"]),
        ("empty.nrrd", b"", 3, ["empty"]),
        ("text.txt", b"hello, world\n" * 40, 4, ["no known format"]),
        ("model.stl", b"solid x\n", 4, ["no known format"]),
        ("x.vti", b"<VTKFile>", 4, ["VTK"]),
        ("scene.volviz.json", b"{", 3, ["not valid JSON"]),
        ("other.volviz.json", b"{}", 3, ["no volviz scene"]),
        ("sample:ct-heat", None, 2, ["did you mean 'ct-head'"]),
    ],
)
def test_wrong_files_are_one_helpful_line(head, tmp_path, capsys, name, make, code, words):
    path = name if name.startswith("sample:") else str(tmp_path / name)
    if make is not None:
        (tmp_path / name).write_bytes(make)
    assert run(["render", path, "-o", str(tmp_path / "out.png")]) == code
    told = capsys.readouterr()
    assert told.err.count("\n") == 1
    for word in words:
        assert word in told.err
    assert not (tmp_path / "out.png").exists()


def test_folder_without_images(tmp_path, capsys):
    (tmp_path / "notes.md").write_text("x")
    assert run(["render", str(tmp_path), "-o", str(tmp_path / "o.png")]) == 3
    assert "1 × .md" in capsys.readouterr().err


def test_nothing_is_overwritten_without_being_asked(head, tmp_path, capsys):
    out = tmp_path / "a.png"
    out.write_bytes(b"mine")
    assert run(["render", str(head), "-o", str(out), "--size", "16"]) == 7
    assert "--force" in capsys.readouterr().err
    assert out.read_bytes() == b"mine"
    assert run(["render", str(head), "-o", str(out), "--size", "16", "--force"]) == 0
    assert pixels(out).shape == (16, 16, 4)


def test_failed_write_keeps_the_old_file(head, tmp_path, monkeypatch, capsys):
    out = tmp_path / "a.png"
    out.write_bytes(b"mine")

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    assert run(["render", str(head), "-o", str(out), "--size", "16", "--force"]) == 7
    assert "No space left" in capsys.readouterr().err
    assert out.read_bytes() == b"mine"
    assert sorted(os.listdir(tmp_path)) == ["a.png", "ball.nrrd"]


def test_info(head, capsys):
    assert run(["info", str(head)]) == 0
    text = capsys.readouterr().out
    for words in ("NRRD", "28 × 24 × 20", "int16", "1 × 1 × 2 mm", "LPS", "not read"):
        assert words in text
    assert run(["info", str(head), "--json", "--scan"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["dims"] == [28, 24, 20]
    assert facts["values"]["nan"] == 0
    assert facts["values"]["low"] == float(volviz.load(head).data.min())
    assert facts["header"]["space"] == "left-posterior-superior"
    assert facts["reduced_by"] is None


def test_info_does_not_read_the_voxels(tmp_path, capsys):
    """A header that promises 64 GiB is described at once, from its 200 bytes."""
    path = tmp_path / "huge.nhdr"
    path.write_text(
        "NRRD0004\ntype: short\ndimension: 3\nsizes: 4096 4096 2048\nendian: little\n"
        "encoding: raw\nspacings: 1 1 1\ndata file: huge.raw\n"
    )
    (tmp_path / "huge.raw").write_bytes(b"")
    os.truncate(tmp_path / "huge.raw", 4096 * 4096 * 2048 * 2)
    start = time.perf_counter()
    assert run(["info", str(path), "--json"]) == 0
    assert time.perf_counter() - start < 5
    facts = json.loads(capsys.readouterr().out)
    assert facts["memory_bytes"] == 1 << 36
    assert facts["reduced_by"] is not None


def test_lists(capsys):
    assert run(["presets", "--json"]) == 0
    names = {row["name"] for row in json.loads(capsys.readouterr().out)}
    assert {"ct-bone", "ct-lung", "mr-default", "mr-t2-brain", "hounsfield"} <= names
    assert run(["presets"]) == 0
    assert "ct-bone" in capsys.readouterr().out
    assert run(["samples"]) == 0
    assert "sample:ct-head" in capsys.readouterr().out


def test_doctor(capsys):
    assert run(["doctor", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["usable"]


def test_help_is_quick_and_tells_all_commands():
    best = float("inf")
    for _ in range(5):
        start = sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2])
        done = subprocess.run(
            [sys.executable, "-m", "volviz", "--help"], capture_output=True, check=True, text=True
        )
        best = min(best, sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2]) - start)
    for name in COMMANDS:
        assert name in done.stdout
    assert best < 0.3  # seconds of processor, which a busy machine does not change


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_has_help(name, capsys):
    assert run([name, "--help"]) == 0
    assert COMMANDS[name][1].split()[0] in capsys.readouterr().out


def test_unknown_command_and_no_command(capsys):
    assert run(["rendr"]) == 2
    assert "did you mean 'render'" in capsys.readouterr().err
    assert run([]) == 2
    assert "render" in capsys.readouterr().out
    assert run(["--version"]) == 0
    assert volviz.__version__ in capsys.readouterr().out


def test_ctrl_c_is_130_and_leaves_nothing(head, tmp_path, monkeypatch, capsys):
    def interrupt(*_args, **_more):
        raise KeyboardInterrupt

    monkeypatch.setattr("volviz.gpu.passes.raycast.draw", interrupt)
    assert run(["render", str(head), "-o", str(tmp_path / "o.png")]) == 130
    assert capsys.readouterr().err == "volviz: error: cancelled\n"
    assert not (tmp_path / "o.png").exists()


def test_bugs_are_told_as_bugs(head, tmp_path, monkeypatch, capsys):
    def broken(*_args, **_more):
        raise RuntimeError("oh")

    monkeypatch.setattr("volviz.gpu.passes.raycast.draw", broken)
    assert run(["render", str(head), "-o", str(tmp_path / "o.png")]) == 1
    assert "bug in volviz: RuntimeError: oh" in capsys.readouterr().err


def test_info_lists_the_series_of_a_folder(data, capsys):
    folder = str(data / "dicom" / "single_syntaxes")
    assert run(["info", folder]) == 0
    assert "FLAIR" in capsys.readouterr().out
    assert run(["info", folder, "--json"]) == 0
    series = json.loads(capsys.readouterr().out)["series"]
    assert [s["number"] for s in series] == list(range(1, 8))
    assert run(["info", folder, "--series", "FLAIR", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["modality"] == "MR"
    assert run(["render", folder, "-o", "never.png"]) == 2
    assert "--series" in capsys.readouterr().err
