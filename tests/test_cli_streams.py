"""The command line on closed, full, narrow and plain-ASCII terminals, and what it writes where."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from PIL import Image

import volviz
from volviz.cli import run


@pytest.fixture
def ball(tmp_path):
    folder = tmp_path / "héad ü"
    folder.mkdir()
    z, y, x = np.mgrid[:12, :14, :16]
    data = (900 - 90 * np.sqrt((x - 8) ** 2 + (y - 7) ** 2 + (z - 6) ** 2)).astype(np.int16)
    volviz.save_volume(volviz.Volume.from_array(data, space="LPS"), folder / "bäll.nrrd")
    return folder / "bäll.nrrd"


def size_of(path):
    with Image.open(path) as picture:
        return picture.size


def shell(line, *args, cwd=None, **environment):
    """Run `line` in a shell with `volviz` for ours, and "$1" … for the arguments."""
    command = f'volviz() {{ "{sys.executable}" -m volviz "$@"; }}; {line}'
    return subprocess.run(
        ["bash", "-c", command, "bash", *map(str, args)],
        capture_output=True,
        check=False,
        cwd=cwd,
        env={**os.environ, **environment},
        timeout=120,
    )


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="there is no /dev/full")
@pytest.mark.parametrize(
    "what", ["--version", "--help", "presets", 'info "$1"', 'info "$1" --json', 'render "$1" -o -']
)
@pytest.mark.parametrize(
    ("into", "word"), [(">/dev/full", "No space left"), (">&-", "standard output: is closed")]
)
def test_standard_output_that_takes_nothing_is_an_output_error(ball, what, into, word):
    done = shell(f"volviz {what} {into}", ball)
    assert done.returncode == 7
    told = done.stderr.decode()
    assert word in told
    assert told.count("\n") == 1


def test_who_reads_may_go_away(ball):
    done = shell('volviz render "$1" -q --size 600 -o - | true; echo "${PIPESTATUS[0]}"', ball)
    assert done.stdout == b"0\n"
    assert done.stderr == b""


@pytest.mark.parametrize("into", ["2>&-", "2>/dev/full", "2>&- >&-"])
def test_a_picture_needs_no_standard_error(ball, tmp_path, into):
    line = f'volviz render "$1" -o a.png --size 16 {into}'
    assert shell(line, ball, cwd=tmp_path).returncode == 0
    assert size_of(tmp_path / "a.png") == (16, 16)
    done = shell(f"volviz render nosuch -o b.png {into}", cwd=tmp_path)
    assert done.returncode == 3
    assert done.stdout == b""


def test_ascii_terminals(ball):
    plain = {"LC_ALL": "C", "PYTHONIOENCODING": "ascii"}
    for what in ('info "$1"', "samples", "render --help"):
        done = shell(f"volviz {what}", ball, **plain)
        assert done.returncode == 0
        done.stdout.decode("ascii")
    facts = json.loads(shell('volviz info "$1" --json', ball, **plain).stdout)
    assert facts["file"] == str(ball)


def test_file_names_that_the_locale_cannot_spell(ball, tmp_path):
    posix = {"LC_ALL": "POSIX", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    line = 'volviz render "$1" -q --size 16 -o a.png --save-scene s.volviz.json'
    assert shell(line, ball, cwd=tmp_path, **posix).returncode == 0
    source = json.loads((tmp_path / "s.volviz.json").read_bytes())["source"]
    assert source["path"] == "héad ü/bäll.nrrd"
    again = "volviz render s.volviz.json -q --size 16 -o b.png"
    assert shell(again, cwd=tmp_path, **posix).returncode == 0
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


@pytest.mark.parametrize("columns", ["0", "1", "20"])
def test_help_has_words_in_a_narrow_terminal(columns):
    text = shell("volviz render --help", COLUMNS=columns).stdout.decode()
    assert "WIDTHxHEIGHT in" in text


@pytest.mark.parametrize("name", ["doctor", "presets", "samples", "info"])
def test_debug_stands_anywhere(name, ball, capsys, monkeypatch):
    monkeypatch.setattr("volviz.doctor.report", lambda: {"usable": True})
    monkeypatch.setattr("volviz.doctor.as_text", lambda facts: "fine")
    file = [str(ball)] if name == "info" else []
    assert run([name, *file, "--debug"]) == 0
    assert run(["--debug", name, *file]) == 0
    assert run(["render", "nosuch", "--debug"]) == 3
    assert "Traceback" in capsys.readouterr().err


@pytest.mark.parametrize("moment", [0.35, 0.7, 1.4])
def test_interrupt_is_prompt_and_leaves_nothing(tmp_path, moment):
    command = [sys.executable, "-m", "volviz", "render", "sample:marschner-lobb", "-o", "a.png"]
    command += ["--size", "6000x6000", "--mode", "mip", "--step", "0.02"]
    with subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE) as process:
        time.sleep(moment)
        process.send_signal(signal.SIGINT)
        start = time.perf_counter()
        told = process.communicate(timeout=60)[1]
    assert process.returncode == 130
    assert told == b"volviz: error: cancelled\n"
    assert time.perf_counter() - start < 5  # half a second, and room for a busy machine
    assert os.listdir(tmp_path) == []


def test_links_are_written_through(ball, tmp_path):
    (tmp_path / "link.png").symlink_to("real.png")
    command = ["render", str(ball), "-q", "--size", "16", "-o", str(tmp_path / "link.png")]
    assert run(command) == 0
    assert (tmp_path / "link.png").is_symlink()
    assert size_of(tmp_path / "real.png") == (16, 16)
    assert run(command) == 7
    assert run([*command, "--force"]) == 0
    assert (tmp_path / "link.png").is_symlink()


def test_the_scene_may_go_to_standard_output(ball, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    line = 'volviz render "$1" -q --size 16 -o a.png --save-scene - > s.volviz.json'
    assert shell(line, ball.relative_to(tmp_path)).returncode == 0
    assert run(["render", "s.volviz.json", "-q", "--size", "16", "-o", "b.png"]) == 0
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


@pytest.mark.parametrize(
    ("flags", "code", "words"),
    [
        (["--save-scene", "{ball}", "-o", "a.png"], 2, ["bäll.nrrd", ".volviz.json"]),
        (["--save-scene", "s.json", "-o", "{same}"], 2, ["one file"]),
        (["--save-scene", "-", "-o", "-"], 2, ["standard output"]),
        (["-o", "a.jpg", "--size", "65501x1"], 2, ["JPEG", "65500", ".png"]),
        (["-o", "a.webp", "--size", "1x16384"], 2, ["WEBP", "16383"]),
        (["-o", "a" * 300 + ".png"], 7, ["too long"]),
        (["-o", "a.png", "--azimuth", "inf"], 2, ["--azimuth"]),
        (["-o", "a.png", "--elevation", "nan"], 2, ["--elevation"]),
        (["-o", "a.png", "--roll=-inf"], 2, ["--roll"]),
        (["-o", "a.png", "--zoom", "1e300"], 2, ["--zoom"]),
        (["-o", "a.png", "--zoom", "nan"], 2, ["--zoom"]),
        (["-o", "a.png", "--max-memory", "inf"], 2, ["--max-memory"]),
        (["-o", "a.png", "--spacing", "1e300,1,1"], 2, ["--spacing"]),
        (["-o", "a.png", "--spacing", "1e-30,1,1e30"], 4, ["spacing", "as a voxel"]),
        (["-o", "a.png", "--window=-1e308,1e308"], 2, ["finite"]),
        (["-o", "a.png", "--shift", "inf"], 2, ["finite"]),
        (["-o", "a.png", "--unit-distance", "nan"], 2, ["unit_distance"]),
        (["-o", "a.png", "--background", "nan,0,0"], 2, ["--background"]),
        (["-o", "a.png", "--preset", "/dev/zero"], 3, ["not a regular file"]),
        (["-o", "a.png", "--preset", "{pipe}"], 3, ["not a regular file"]),
    ],
)
def test_wrong_values_are_one_line(ball, tmp_path, monkeypatch, capsys, flags, code, words):
    monkeypatch.chdir(tmp_path)
    os.mkfifo(tmp_path / "pipe.json")
    (tmp_path / "s.json").symlink_to("t.json")
    before = {p: p.lstat().st_size for p in tmp_path.iterdir()}
    names = {"{ball}": str(ball), "{pipe}": "./pipe.json", "{same}": "./t.json.png"}
    (tmp_path / "t.json.png").symlink_to("t.json")
    before[tmp_path / "t.json.png"] = (tmp_path / "t.json.png").lstat().st_size
    assert run(["render", str(ball), "--force", *(names.get(f, f) for f in flags)]) == code
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert "bug" not in told
    for word in words:
        assert word in told
    assert {p: p.lstat().st_size for p in tmp_path.iterdir()} == before


def test_what_is_read_is_never_written_over(tmp_path, capsys):
    slice_file = tmp_path / "slice.png"
    Image.fromarray(np.arange(64, dtype=np.uint8).reshape(8, 8)).save(slice_file)
    before = slice_file.read_bytes()
    assert run(["render", str(slice_file), "-o", str(slice_file), "--force"]) == 2
    assert "the file that is read" in capsys.readouterr().err
    assert slice_file.read_bytes() == before


def test_empty_name_and_pipes_are_no_files(tmp_path, capsys):
    assert run(["render", "", "-o", str(tmp_path / "a.png")]) == 2
    assert run(["info", ""]) == 2
    os.mkfifo(tmp_path / "pipe.json")
    assert run(["render", str(tmp_path / "pipe.json"), "-o", str(tmp_path / "a.png")]) == 3
    assert "not a regular file" in capsys.readouterr().err


def test_samples_have_no_reading_choices(tmp_path, capsys):
    flags = ["--time", "3", "-o", str(tmp_path / "a.png")]
    assert run(["render", "sample:marschner-lobb", *flags]) == 2
    assert "--time" in capsys.readouterr().err


def test_info_of_a_scene_is_that_of_its_volume(ball, tmp_path, capsys):
    volviz.Scene.of(volviz.load(ball)).save(tmp_path / "s.volviz.json")
    assert run(["info", str(tmp_path / "s.volviz.json"), "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["scene"] == str(tmp_path / "s.volviz.json")
    assert facts["dims"] == [16, 14, 12]


def test_transparent_jpeg_is_on_black(ball, tmp_path):
    out = tmp_path / "a.jpg"
    flags = ["--mode", "mip", "--background", "transparent", "--size", "64"]
    assert run(["render", str(ball), "-q", "-o", str(out), *flags]) == 0
    png = tmp_path / "a.png"
    assert run(["render", str(ball), "-q", "-o", str(png), *flags]) == 0
    straight = np.asarray(Image.open(png)).astype(float)
    on_black = straight[..., :3] * straight[..., 3:] / 255
    assert np.abs(np.asarray(Image.open(out)).astype(float) - on_black).mean() < 3


@pytest.mark.parametrize("suffix", ["webp", "tif", "PNG"])
def test_other_formats_lose_nothing(ball, tmp_path, suffix):
    image = volviz.render(volviz.Scene.of(volviz.load(ball)).with_background(0, 0, 0, 0), (32, 24))
    image.save(tmp_path / f"a.{suffix}")
    assert np.array_equal(np.asarray(Image.open(tmp_path / f"a.{suffix}")), image.pixels)
