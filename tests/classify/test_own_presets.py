"""The user's own presets: saved, found again, renamed, deleted; broken files hurt nobody else."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest

import volviz
from volviz.classify import own_presets
from volviz.classify.preset_file import decoded, encoded, shipped
from volviz.classify.presets import apply, captured, preset, presets, recent
from volviz.classify.suggest import suits
from volviz.cli import run
from volviz.errors import InputError, OutputError, UsageError
from volviz.fields.statistics import statistics
from volviz.model.scene import Light, SceneState
from volviz.model.transfer import TransferFunction
from volviz.model.views import volume_camera
from volviz.ui.looks import named_look


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("VOLVIZ_CONFIG_DIR", str(tmp_path / "config"))
    return tmp_path / "config" / "presets"


@pytest.fixture
def ball() -> volviz.Volume:
    z, y, x = np.mgrid[-9:9, -9:9, -9:9]
    values = np.clip(700 - 60 * np.sqrt(x**2 + y**2 + z**2), 0, None)
    return volviz.Volume.from_array(values.astype(np.float32), spacing=(2, 2, 2), name="ball")


def looking(volume: volviz.Volume, *points: tuple[float, float]) -> SceneState:
    low, high = points[0][0], points[-1][0]
    transfer = TransferFunction(((low, 0, 0, 1), (high, 1, 128 / 255, 0)), points, 3.5, "x")
    scene = SceneState(volume, transfer, volume_camera(volume), light=Light(ambient=0.4))
    return scene.with_knobs(shading="phong")


def kept(title: str, scene: SceneState, **how: bool) -> Path:
    return own_presets.save(captured(title, scene, statistics(scene.volume)), **how)


def test_what_is_saved_comes_back(ball, folder):
    scene = looking(ball, (100, 0.0), (333.25, 0.125), (650, 0.9))
    file = kept("My Bone (2)", scene)
    assert file == folder / "my-bone-2.json"
    transfer, knobs = apply(preset("MY_bone-2"), ball, statistics(ball))
    np.testing.assert_allclose(transfer.opacities, scene.transfer.opacities, rtol=1e-9)
    np.testing.assert_allclose(transfer.colors, scene.transfer.colors, rtol=1e-9)
    assert transfer.unit_distance == pytest.approx(3.5)
    assert knobs["ambient"] == 0.4
    assert knobs["shading"] == "phong"
    assert volviz.Scene.of(ball, preset="my-bone-2").light.ambient == 0.4
    assert list(volviz.presets())[-1] == "my-bone-2"
    found = json.loads(file.read_text())
    assert found["axis"] == "relative"
    assert found["title"] == "My Bone (2)"


def test_hounsfield_units_stay_hounsfield_units(folder):
    values = np.full((8, 8, 8), -1000, np.int16)
    values[2:6, 2:6, 2:6] = 40
    values[3, 3, 3] = 1200
    volume = volviz.Volume.from_array(values, modality="CT", value_unit="HU")
    found = json.loads(kept("Marrow", looking(volume, (-50, 0.0), (210, 0.5))).read_text())
    assert found["axis"] == "hu"
    assert found["group"] == "CT"
    assert found["opacities"] == [[-50.0, 0.0], [210.0, 0.5]]
    assert found["colors"] == [[-50.0, "#0000ff"], [210.0, "#ff8000"]]
    assert found["unit_distance"] == 3.5
    raw = volviz.Volume.from_array((values + 1024).clip(0).astype(np.uint16), modality="CT")
    moved, _ = apply(preset("marrow"), raw, statistics(raw))
    assert moved.opacities[0][0] in (-50 + 1024, -50 + 1000)


def test_nothing_is_overwritten_without_being_asked(ball):
    file = kept("Mine", looking(ball, (0, 0.0), (1, 0.5)))
    before = file.read_bytes()
    assert own_presets.existing("MINE!") == "mine"
    with pytest.raises(OutputError, match="exists already"):
        kept("mine", looking(ball, (0, 0.0), (1, 0.9)))
    assert file.read_bytes() == before
    kept("mine", looking(ball, (0, 0.0), (1, 0.9)), overwrite=True)
    assert preset("mine").opacities[1][1] == 0.9
    assert sorted(p.name for p in file.parent.iterdir()) == ["mine.json"]


@pytest.mark.parametrize(
    "title", ["CT bone", "ct_bone", "CT--Bone!", "suggested", "Labels", "", " ", "¿?", "--"]
)
def test_names_that_cannot_be_used(ball, folder, title):
    with pytest.raises(UsageError) as told:
        kept(title, looking(ball, (0, 0.0), (1, 0.5)))
    assert told.value.fix
    assert told.value.field == "name"
    assert not folder.exists()


@pytest.mark.parametrize(
    "title", ["Knochen (schön)", "骨", "../../evil", "a/b\\c", "x" * 500, "µCT"]
)
def test_any_letters_make_a_file_in_the_folder(ball, folder, title):
    file = kept(title, looking(ball, (0, 0.0), (1, 0.5)))
    assert file.parent == folder
    assert len(file.name.encode()) <= 250
    name = own_presets.name_of(title)
    assert preset(name).title == title
    assert name in presets()


def test_rename_and_delete(ball, folder):
    kept("One", looking(ball, (0, 0.0), (1, 0.5)))
    kept("Two", looking(ball, (0, 0.0), (1, 0.7)))
    with pytest.raises(OutputError, match="exists already"):
        own_presets.rename("one", "Two")
    with pytest.raises(UsageError, match="volviz brings"):
        own_presets.rename("one", "CT-Bone")
    assert own_presets.rename("one", "Three") == "three"
    assert own_presets.rename("two", "TWO") == "two"
    assert {p.name for p in folder.iterdir()} == {"three.json", "two.json"}
    assert preset("two").title == "TWO"
    assert preset("three").opacities[1][1] == 0.5
    own_presets.delete("three")
    assert "three" not in presets()
    for act in (own_presets.delete, lambda n: own_presets.rename(n, "y")):
        with pytest.raises(UsageError, match="none of your own"):
            act("ct-bone")


def test_a_broken_file_is_told_and_the_rest_lives(ball, folder, tmp_path, capsys):
    kept("Good", looking(ball, (0, 0.0), (1, 0.5)))
    good = json.loads((folder / "good.json").read_text())
    (folder / "torn.json").write_text("{")
    (folder / "wrong.json").write_text(json.dumps({**good, "name": "wrong", "axis": "kelvin"}))
    (folder / "copy.json").write_text(json.dumps(good))
    (folder / "ours.json").write_text(json.dumps({**good, "name": "CT_bone"}))
    (folder / "folder.json").mkdir()
    (folder / "notes.txt").write_text("not looked at")
    assert list(presets()) == [*shipped(), "good"]
    told = {n: str(e) for n, e in own_presets.own().broken.items()}
    assert set(told) == {"torn", "wrong", "copy", "ours", "folder"}
    assert "wrong.json" in told["wrong"]
    assert "axis" in told["wrong"]
    assert "name" in told["ours"]
    with pytest.raises(InputError, match=r"wrong\.json"):
        preset("wrong")
    assert run(["presets", "--json"]) == 0
    out, err = capsys.readouterr()
    rows = {r["name"]: r for r in json.loads(out)}
    assert rows["good"]["from"] == "you"
    assert rows["ct-bone"]["from"] == "volviz"
    assert sum("wrong.json" in line for line in err.splitlines()) == 1
    volviz.save_volume(ball, tmp_path / "ball.nrrd")
    command = [
        "render",
        str(tmp_path / "ball.nrrd"),
        "-o",
        str(tmp_path / "a.png"),
        "--size",
        "9x9",
    ]
    assert run([*command, "--preset", "wrong"]) == 3
    assert "axis" in capsys.readouterr().err
    assert run([*command, "--preset", "good", "--samples", "1"]) == 0


def test_files_put_there_are_found_without_a_restart(ball, folder):
    file = kept("Good", looking(ball, (0, 0.0), (1, 0.5)))
    assert presets()["good"].opacities[1][1] == 0.5
    file.write_text(file.read_text().replace("0.5]", "0.25]"))
    assert presets()["good"].opacities[1][1] == 0.25
    file.unlink()
    assert "good" not in presets()


def test_panels_look_into_the_folder_once_a_second(ball, folder, monkeypatch):
    scene = looking(ball, (0, 0.0), (1, 0.5))
    file = kept("Good", scene)
    known = own_presets.recent()
    monkeypatch.setattr(os, "scandir", None)  # who looks now fails
    assert own_presets.recent() is known
    assert list(recent()) == [*shipped(), "good"]
    assert named_look("good", ball, statistics(ball)).transfer.name == "good"
    monkeypatch.undo()
    monkeypatch.setenv("VOLVIZ_CONFIG_DIR", str(folder.parent))
    file.write_text(file.read_text().replace("0.5]", "0.25]"))
    monkeypatch.setattr(own_presets, "LOOK_SECONDS", 0.0)
    assert own_presets.recent().presets["good"].opacities[1][1] == 0.25
    assert own_presets.recent() is own_presets.recent(), "nothing changed"


def test_what_is_saved_here_is_known_at_once(ball, monkeypatch):
    monkeypatch.setattr(own_presets, "LOOK_SECONDS", 1e9)
    assert not own_presets.recent().presets
    kept("One", looking(ball, (0, 0.0), (1, 0.5)))
    assert list(own_presets.recent().presets) == ["one"]
    own_presets.rename("one", "Two")
    assert list(own_presets.recent().presets) == ["two"]
    own_presets.delete("two")
    assert not own_presets.recent().presets
    kept("Three", looking(ball, (0, 0.0), (1, 0.5)))
    monkeypatch.setenv("VOLVIZ_CONFIG_DIR", "elsewhere")
    assert not own_presets.recent().presets, "of another folder"


def test_a_folder_that_cannot_be_written_to(ball, folder):
    folder.parent.mkdir(parents=True)
    folder.write_text("a file where the folder should be")
    with pytest.raises(OutputError):
        kept("Good", looking(ball, (0, 0.0), (1, 0.5)))
    assert folder.read_text().startswith("a file")
    assert list(presets()) == list(shipped())


def test_more_points_than_a_preset_has(ball, folder):
    many = tuple((float(i), 0.5) for i in range(5000))
    with pytest.raises(UsageError, match="4096"):
        kept("Many", looking(ball, *many))
    assert not folder.exists()


@pytest.mark.parametrize("name", list(shipped()))
def test_files_are_written_as_they_are_read(name, tmp_path):
    again = decoded(encoded(shipped()[name]), tmp_path / "x.json")
    assert again == shipped()[name]


@pytest.mark.parametrize(
    ("name", "offset", "modality", "fits"),
    [
        ("ct-bone", 0.0, "CT", True),
        ("ct-bone", 1024.0, "CT", True),
        ("ct-bone", None, "MR", False),
        ("mr-default", None, "MR", True),
        ("mr-default", 0.0, "CT", False),
        ("us-fetal", None, "US", True),
        ("us-fetal", None, "microscopy", False),
        ("viridis", None, "microscopy", True),
        ("uct-skull", None, "CT", True),
        ("uct-skull", 0.0, "CT", False),
        ("hounsfield", None, "unknown", False),
    ],
)
def test_what_suits(name, offset, modality, fits):
    assert suits(shipped()[name], offset, modality) is fits
