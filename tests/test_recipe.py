"""The command line and the Python code of a scene draw that scene, to the byte."""

from __future__ import annotations

import dataclasses
import json
import os
import shlex
import stat
import subprocess
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, assume, given, seed, settings
from hypothesis import strategies as st
from PIL import Image

import volviz
from volviz import recipe
from volviz.cli import run
from volviz.errors import InputError, UsageError
from volviz.model.knobs import knobs_of
from volviz.model.refining import Refining
from volviz.model.scene import Background, Light, Raycast
from volviz.model.scenefile import transfer_text
from volviz.model.surface import Surface
from volviz.model.surface_look import FIELDS, SurfaceLook
from volviz.model.transfer import TransferFunction

SIZE = (40, 30)
PRESETS = (None, "ct-bone", "ct-muscle", "dti-fa-brain")
cli_render = import_module("volviz.cli.render")


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """One small volume as a patient's file with an odd name, and as bare bytes."""
    folder = tmp_path_factory.mktemp("recipes")
    z, y, x = np.mgrid[:14, :16, :18]
    hu = 1200 - 180 * np.sqrt((x - 9) ** 2 + (y - 8) ** 2 + 2 * (z - 7) ** 2)
    data = np.maximum(hu, -1000).astype(np.int16)
    patient = folder / 'it\'s a "head" $(ls) `x`;*ü.nrrd'
    volume = volviz.Volume.from_array(data, (1, 1, 2), space="LPS", modality="CT", value_unit="HU")
    volviz.save_volume(volume, patient)
    raw = folder / "voxels 18.bin"
    raw.write_bytes(b"\0" * 16 + data.astype(">i2").tobytes())
    several = folder / "several.npz"
    np.savez(several, first=data[:8], second=data)
    return {"patient": patient, "raw": raw, "npz": several}


def volumes(files: dict[str, Path]) -> dict[str, volviz.Volume]:
    raw: dict[str, Any] = {"shape": (18, 16, 14), "dtype": "int16", "endian": "big", "offset": 16}
    return {
        "patient": volviz.load(files["patient"]),
        "raw": volviz.load(files["raw"], **raw, spacing=(1.0, 0.75, 2.0)),
        "npz": volviz.load(files["npz"], series="second"),
    }


unit = st.floats(0, 1)
place = st.floats(-60, 60)
values = st.floats(-2000, 3000)


def knobs_strategy(owner: type) -> st.SearchStrategy[dict[str, Any]]:
    def of(k: Any) -> st.SearchStrategy[Any]:
        if k.choices:
            return st.sampled_from(k.choices)
        if k.type is bool:
            return st.booleans()
        if k.type is str:
            return st.sampled_from((k.default, "x", "a, b/c=1 %2C µ.nrrd?channel=1", "sample:mri"))
        if k.type is int:
            most = 3 if k.name in ("samples", "smooth") else 10**6
            return st.integers(int(k.low), most if k.high is None else min(int(k.high), most))
        low = 0.3 if k.name == "step" else -100.0 if k.low is None else k.low
        return st.floats(low, 100.0 if k.high is None else min(k.high, 100.0))

    return st.fixed_dictionaries({}, optional={k.name: of(k) for k in knobs_of(owner)})


@st.composite
def transfers(draw: Any) -> TransferFunction:
    colors = draw(st.lists(st.tuples(values, unit, unit, unit), min_size=1, max_size=6))
    opacities = draw(st.lists(st.tuples(values, unit), min_size=1, max_size=6))
    name = draw(st.sampled_from(("", "ct-bone", 'mine, "it\'s" µ')))
    distance = draw(st.floats(0.01, 50))
    return TransferFunction(tuple(sorted(colors)), tuple(sorted(opacities)), distance, name)


@st.composite
def surfaces(draw: Any) -> volviz.SceneSurface:
    """Isovalues that a volume may have; knobs of three dataclasses and a colour."""
    knobs = {**draw(knobs_strategy(SurfaceLook)), "color": draw(st.tuples(unit, unit, unit))}
    chosen = knobs_of(Surface) if draw(st.booleans()) else ()
    made = {k.name: draw(st.sampled_from(k.choices)) for k in chosen if k.choices}
    steps = draw(knobs_strategy(Refining)) if draw(st.booleans()) else {}
    return volviz.SceneSurface.at(draw(values), **knobs, **made, **steps)


@st.composite
def cameras(draw: Any, scene: volviz.Scene) -> volviz.Camera:
    camera = scene.camera
    kind = draw(st.sampled_from(("same", "view", "moved", "free")))
    if kind == "view":
        from volviz.model.views import view_names, volume_camera

        name = draw(st.sampled_from(view_names(scene.volume)))
        return volume_camera(scene.volume, name, aspect=SIZE[0] / SIZE[1])
    if kind == "moved":
        return camera.orbited(draw(place), draw(place)).dollied(1.3).rolled(draw(place))
    if kind == "free":
        near = draw(st.tuples(place, place, place))
        up = draw(st.tuples(place, place, place))
        far = (near[0] + 70.0, near[1], near[2])
        return dataclasses.replace(camera, position=far, target=near, up=up, height=50.5)
    return camera


@st.composite
def scenes(draw: Any, volume: volviz.Volume) -> volviz.Scene:
    scene = volviz.Scene.of(volume, preset=draw(st.sampled_from(PRESETS)), aspect=SIZE[0] / SIZE[1])
    scene = scene.with_camera(draw(cameras(scene)))
    for owner in (Raycast, Light, volviz.Camera):
        scene = scene.with_knobs(**draw(knobs_strategy(owner)))
    if draw(st.booleans()):
        scene = scene.with_transfer(draw(transfers()))
    if draw(st.booleans()):
        ends = draw(st.tuples(*[st.tuples(unit, unit, unit, unit)] * 2))
        scene = dataclasses.replace(
            scene, background=Background(ends[0], draw(st.sampled_from(ends)))
        )
    return scene.with_surfaces(draw(st.lists(surfaces(), max_size=2)))


def drawn_by_command(scene: volviz.Scene, out: Path) -> np.ndarray:
    code = run([*recipe.arguments(scene, SIZE, str(out)), "-q", "--force"])
    assert code == 0
    return np.asarray(Image.open(out).convert("RGBA"))


def drawn_by_python(scene: volviz.Scene, out: Path) -> np.ndarray:
    text = recipe.python(scene, SIZE, str(out))
    exec(compile(text, "copied", "exec"), {})
    return np.asarray(Image.open(out).convert("RGBA"))


@pytest.mark.parametrize("kind", ["patient", "raw", "npz"])
def test_command_and_code_draw_the_same_bytes(kind, files, tmp_path):
    volume = volumes(files)[kind]

    @seed(20261122)
    @settings(
        max_examples=12,
        database=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(scene=scenes(volume))
    def check(scene: volviz.Scene) -> None:
        fields = {s.look.color_field for s in scene.surfaces if s.look.coloring == "field"}
        assume(fields <= set(FIELDS))  # names of files that there are not cannot be drawn
        wanted = volviz.render(scene, SIZE).pixels
        assert np.array_equal(drawn_by_command(scene, tmp_path / "a.png"), wanted)
        assert np.array_equal(drawn_by_python(scene, tmp_path / "b.png"), wanted)

    check()


class Taken(Exception):
    """Carries the scene that was about to be drawn."""


def told(action: Any, monkeypatch: pytest.MonkeyPatch) -> volviz.Scene:
    """The scene that reaches `render`."""
    found: list[volviz.Scene] = []

    def draw(scene: Any, size: Any, **_: Any) -> volviz.Image:
        assert tuple(size) == SIZE
        found.append(scene)
        return volviz.Image(np.zeros((1, 1, 4), np.uint8))

    with monkeypatch.context() as patch:
        patch.setattr(cli_render, "draw", draw)
        patch.setattr(volviz, "render", draw)
        action()
    return found[-1]


def parts(scene: volviz.Scene) -> dict[str, Any]:
    """All that decides the picture, by field."""
    names = [f.name for f in dataclasses.fields(scene) if f.name not in ("volume", "source")]
    return {n: getattr(scene, n) for n in names}


@pytest.mark.parametrize("kind", ["patient", "raw", "npz"])
def test_command_and_code_make_the_same_scene(kind, files, tmp_path, monkeypatch):
    volume = volumes(files)[kind]

    @seed(1122)
    @settings(
        max_examples=40,
        database=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(scene=scenes(volume))
    def check(scene: volviz.Scene) -> None:
        out = tmp_path / "a.png"
        words = [*recipe.arguments(scene, SIZE, str(out)), "-q", "--force"]
        by_command = told(lambda: run(words), monkeypatch)
        code = compile(recipe.python(scene, SIZE, str(out)), "copied", "exec")
        by_code = told(lambda: exec(code, {}), monkeypatch)
        assert parts(by_command) == parts(by_code) == parts(scene)
        for other in (by_command, by_code):
            assert np.array_equal(other.volume.data, volume.data)
            assert np.array_equal(other.volume.affine, volume.affine)

    check()


def test_only_what_differs_is_said(files):
    volume = volviz.load(files["patient"])
    path = str(files["patient"])
    aspect = SIZE[0] / SIZE[1]
    plain = volviz.Scene.of(volume, aspect=aspect)
    assert recipe.arguments(plain, SIZE) == ["render", path, "--size=40x30"]
    turned = plain.with_knobs(light_azimuth=-40, samples=2, projection="orthographic")
    words = recipe.arguments(turned, SIZE)
    wanted = {"--samples=2", "--light-azimuth=-40", "--projection=orthographic"}
    assert wanted <= set(words)
    assert not any(w.startswith(("--transfer", "--step", "--fov", "--background")) for w in words)
    assert not any("camera-position" in w for w in recipe.arguments(plain, SIZE))
    bone = volviz.Scene.of(volume, preset="ct-bone", view="left", aspect=aspect)
    assert recipe.arguments(bone, SIZE)[2:] == ["--preset=ct-bone", "--view=left", "--size=40x30"]
    faded = bone.with_transfer(bone.transfer.faded(0.5))
    assert any(w.startswith("--transfer={") for w in recipe.arguments(faded, SIZE))
    assert "preset" not in recipe.python(faded, SIZE, "a.png")


def test_samples_are_named(tmp_path):
    scene = volviz.Scene.of(volviz.sample("marschner-lobb"), aspect=SIZE[0] / SIZE[1])
    scene = scene.with_knobs(samples=1, seed=5)
    wanted = volviz.render(scene, SIZE).pixels
    assert recipe.arguments(scene, SIZE)[1] == "sample:marschner-lobb"
    assert "volviz.sample('marschner-lobb')" in recipe.python(scene, SIZE, "x.png")
    assert np.array_equal(drawn_by_command(scene, tmp_path / "a.png"), wanted)
    assert np.array_equal(drawn_by_python(scene, tmp_path / "b.png"), wanted)


@pytest.mark.parametrize("make", [recipe.arguments, recipe.command])
def test_an_array_has_no_command(make):
    scene = volviz.Scene.of(volviz.Volume.from_array(np.arange(27.0).reshape(3, 3, 3)))
    with pytest.raises(UsageError, match="save the array first"):
        make(scene, SIZE)
    with pytest.raises(UsageError, match="save the array first"):
        recipe.python(scene, SIZE, "a.png")


def test_what_no_flag_can_say_is_refused(files):
    scene = volviz.Scene.of(volviz.load(files["patient"]))
    points = tuple((float(i), 0.123456789012, 0.5, 0.5) for i in range(6000))
    with pytest.raises(UsageError, match="save the scene"):
        recipe.arguments(scene.with_transfer(TransferFunction(points, ((0.0, 1.0),))), SIZE)

    @dataclasses.dataclass(frozen=True)
    class Odd(Light):
        lamp: str = "sun"

    with pytest.raises(UsageError, match="no flag says what the scene's light is"):
        recipe.arguments(dataclasses.replace(scene, light=Odd(lamp="moon")), SIZE)


def test_every_field_of_a_scene_is_said_or_is_made_of_knobs(files):
    """A field that is neither would get lost between the window and the command line."""
    scene = volviz.Scene.of(volviz.load(files["patient"]))
    for field in dataclasses.fields(scene):
        if field.name not in recipe.SAID:
            part = getattr(scene, field.name)
            assert {f.name for f in dataclasses.fields(part)} == {
                k.name for k in knobs_of(type(part))
            }


@pytest.mark.skipif(os.name == "nt", reason="quoted for a POSIX shell")
@pytest.mark.parametrize(
    "name",
    [
        "plain.npy",
        "two words.npy",
        'it\'s $HOME `id` "q";\n*?[a].npy',
        "-o.npy",
        "~.npy",
        "ü µ.npy",
    ],
)
def test_a_shell_takes_odd_names_apart_as_they_were(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    np.save(tmp_path / "x", np.arange(60.0).reshape(3, 4, 5))
    os.replace("x.npy", name)
    volume = volviz.load(name)
    scene = volviz.Scene.of(volume, aspect=SIZE[0] / SIZE[1]).with_knobs(samples=1)
    scene = scene.with_transfer(scene.transfer.faded(0.5))
    tool = tmp_path / "bin" / "volviz"
    tool.parent.mkdir()
    echo = "import json, sys; print(json.dumps(sys.argv[1:]))"
    tool.write_text(f'#!/bin/sh\nexec {shlex.quote(sys.executable)} -c "{echo}" "$@"\n')
    tool.chmod(tool.stat().st_mode | stat.S_IEXEC)
    line = recipe.command(scene, SIZE, name.replace(".npy", ".png"))
    env = {**os.environ, "PATH": f"{tool.parent}{os.pathsep}{os.environ['PATH']}"}
    done = subprocess.run(["sh", "-c", line], capture_output=True, env=env, check=True)
    words = json.loads(done.stdout)
    assert Path(words[1]) == Path(name)
    assert run([*words, "-q"]) == 0
    written = np.asarray(Image.open(name.replace(".npy", ".png")))
    assert np.array_equal(written, volviz.render(scene, SIZE).pixels)
    assert np.array_equal(drawn_by_python(scene, tmp_path / "b.png"), written)


@pytest.mark.skipif(sys.platform != "linux", reason="file names are bytes there alone")
def test_a_name_that_is_not_utf8_is_refused(tmp_path):
    path = Path(os.fsdecode(os.fsencode(tmp_path / "x") + b"\xff.npy"))
    np.save(path, np.arange(60.0).reshape(3, 4, 5))
    scene = volviz.Scene.of(volviz.load(path))
    with pytest.raises(UsageError, match="rename it"):
        recipe.command(scene, SIZE)


class TestFlags:
    def scene(self, file: Path, monkeypatch: pytest.MonkeyPatch, *flags: str) -> volviz.Scene:
        words = ["render", str(file), "--size=40x30", "-q", *flags, "-o", os.devnull + ".png"]
        monkeypatch.setattr(cli_render, "_check_outputs", lambda *a, **k: None)
        monkeypatch.setattr(cli_render, "_write", lambda *a: None)
        return told(lambda: run(words), monkeypatch)

    def test_transfer_from_a_file_and_from_a_scene(self, files, tmp_path, monkeypatch):
        scene = volviz.Scene.of(volviz.load(files["patient"]), preset="ct-muscle")
        plain = tmp_path / "own.json"
        plain.write_text(transfer_text(scene.transfer))
        scene.save(tmp_path / "s.volviz.json")
        for file in (plain, tmp_path / "s.volviz.json"):
            got = self.scene(files["patient"], monkeypatch, f"--transfer={file}")
            assert got.transfer == scene.transfer
        got = self.scene(files["patient"], monkeypatch, f"--transfer={plain}", "--opacity=0.5")
        assert got.transfer == scene.transfer.faded(0.5)

    def test_exact_cameras_of_a_saved_scene(self, files, tmp_path, monkeypatch):
        scene = volviz.Scene.of(volviz.load(files["patient"]))
        scene.save(tmp_path / "s.volviz.json")
        flags = ["--camera-target=1,2,3", "--camera-height=7.5", "--camera-up", "-1,0,0.5"]
        camera = self.scene(tmp_path / "s.volviz.json", monkeypatch, *flags).camera
        assert camera == dataclasses.replace(
            scene.camera, target=(1, 2, 3), height=7.5, up=(-1, 0, 0.5)
        )

    def test_two_background_colours(self, files, monkeypatch):
        got = self.scene(files["patient"], monkeypatch, "--background=#ff0000/0,0,1,0.5")
        assert got.background == Background((1, 0, 0, 1), (0, 0, 1, 0.5))

    @pytest.mark.parametrize(
        ("flags", "code", "words"),
        [
            (["--transfer={"], 3, ["--transfer"]),
            (["--transfer={}"], 3, ["--transfer", "colors"]),
            (["--transfer=none.json"], 3, ["none.json"]),
            (['--transfer={"colors":[[0,2,0,0]],"opacities":[[0,1]]}'], 3, ["between 0 and 1"]),
            (["--camera-position=1,2"], 2, ["--camera-position", "X,Y,Z"]),
            (["--camera-up=a,b,c"], 2, ["--camera-up"]),
            (["--camera-height=0"], 2, ["camera.height"]),
            (["--camera-position=0,0,0", "--camera-target=0,0,0"], 2, ["same point"]),
            (["--background=red/"], 2, ["red/"]),
            (["--background=red/nocolour"], 2, ["nocolour"]),
        ],
    )
    def test_bad_ones_are_one_line(self, files, tmp_path, capsys, flags, code, words):
        out = ["-o", str(tmp_path / "a.png"), "--size=8", "--samples=1", "-q"]
        assert run(["render", str(files["patient"]), *out, *flags]) == code
        said = capsys.readouterr().err
        assert all(w in said for w in words)
        assert said.count("\n") == 1


def test_transfer_text_errors_name_the_place():
    from volviz.model.scenefile import decode_transfer

    with pytest.raises(InputError, match="colors"):
        decode_transfer(b'{"colors": "red", "opacities": [[0, 1]]}', "x.json")
