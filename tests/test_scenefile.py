from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import volviz
from volviz.errors import InputError, OutputError, UnsupportedError
from volviz.io.options import ReadOptions
from volviz.model import scenefile
from volviz.model.scene import Background
from volviz.sources import fingerprint


@pytest.fixture
def volume_file(tmp_path, rng):
    volume = volviz.Volume.from_array(rng.integers(0, 900, (6, 7, 8), np.int16), spacing=(1, 2, 3))
    path = tmp_path / "data" / "v.nrrd"
    path.parent.mkdir()
    volviz.save_volume(volume, path)
    return path


@pytest.fixture
def scene(volume_file):
    made = volviz.Scene.of(volviz.load(volume_file), azimuth=20, step=0.7, mode="mip")
    return replace(made, background=Background.plain((0.1, 0.2, 0.3)))


def test_there_and_back(scene, tmp_path):
    path = tmp_path / "s.volviz.json"
    scene.save(path)
    again = volviz.Scene.open(path)
    for part in ("transfer", "camera", "raycast", "light", "background"):
        assert getattr(again, part) == getattr(scene, part)
    assert np.array_equal(again.volume.data, scene.volume.data)
    again.save(tmp_path / "t.volviz.json")
    assert (tmp_path / "t.volviz.json").read_bytes() == path.read_bytes()


def test_source_is_relative_and_fingerprinted(scene, tmp_path):
    scene.save(tmp_path / "s.volviz.json")
    source = json.loads((tmp_path / "s.volviz.json").read_text())["source"]
    assert source["path"] == "data/v.nrrd"
    assert source["sha256"] == fingerprint(scene.volume)
    moved = tmp_path / "elsewhere"
    moved.mkdir()
    (tmp_path / "data").rename(moved / "data")
    (tmp_path / "s.volviz.json").rename(moved / "s.volviz.json")
    assert not volviz.Scene.open(moved / "s.volviz.json").volume.info.warnings


def test_changed_volume_is_told(scene, tmp_path, volume_file):
    scene.save(tmp_path / "s.volviz.json")
    other = volviz.Volume.from_array(np.zeros((6, 7, 8), np.int16))
    volviz.save_volume(other, volume_file, overwrite=True)
    warnings = volviz.Scene.open(tmp_path / "s.volviz.json").volume.info.warnings
    assert any("changed since" in w for w in warnings)


def test_choices_of_the_reader_are_kept(tmp_path, rng):
    data = rng.integers(0, 99, (3, 4, 5, 6), np.uint8)
    data.tofile(tmp_path / "x.raw")
    volume = volviz.load(tmp_path / "x.raw", shape=(6, 5, 12), dtype="uint8")
    volviz.Scene.of(volume).save(tmp_path / "s.volviz.json")
    again = volviz.Scene.open(tmp_path / "s.volviz.json")
    assert again.volume.dims == (6, 5, 12)
    assert again.volume.info.choices == volume.info.choices


def test_sample_scene(tmp_path):
    from volviz.sources import open_volume

    volviz.Scene.of(open_volume("sample:marschner-lobb")).save(tmp_path / "s.volviz.json")
    assert volviz.Scene.open(tmp_path / "s.volviz.json").volume.dims


def test_array_scene_says_that_it_names_no_volume(tmp_path):
    volume = volviz.Volume.from_array(np.ones((2, 3, 4)))
    volviz.Scene.of(volume).save(tmp_path / "s.volviz.json")
    with pytest.raises(InputError, match="names no volume"):
        volviz.Scene.open(tmp_path / "s.volviz.json")
    assert volviz.Scene.open(tmp_path / "s.volviz.json", volume=volume).volume is volume


def edited(scene, change):
    document = json.loads(scenefile.encode(scene))
    change(document)
    return json.dumps(document).encode()


def put(*path_and_value):
    *path, value = path_and_value

    def change(document):
        for key in path[:-1]:
            document = document[key]
        document[path[-1]] = value

    return change


@pytest.mark.parametrize(
    ("change", "field"),
    [
        (put("raycast", "step", 99), "$.raycast.step"),
        (put("raycast", "step", "half"), "$.raycast.step"),
        (put("raycast", "mode", "mipp"), "$.raycast.mode"),
        (put("raycast", "stepp", 1), "$.raycast"),
        (put("camera", "position", [0, 1]), "$.camera.position"),
        (put("camera", "fov", None), "$.camera.fov"),
        (put("transfer", "colors", []), "$.transfer.colors"),
        (put("transfer", "opacities", [[1, 0.5], [0, 0.5]]), "opacities"),
        (put("transfer", "unit_distance", -1), "$.transfer.unit_distance"),
        (put("background", "top", [0, 0, 0, 7]), "background.top"),
        (put("source", {"path": ""}), "$.source.path"),
        (put("light", {"__class__": "os.system"}), "$.light"),
        (put("extra", 1), "$"),
        (lambda d: d.pop("camera"), "$"),
        (put("volviz-scene", "one"), "volviz-scene"),
    ],
)
def test_wrong_documents_name_the_place(scene, tmp_path, change, field):
    file = tmp_path / "bad.volviz.json"
    file.write_bytes(edited(scene, change))
    with pytest.raises(InputError) as caught:
        volviz.Scene.open(file, volume=scene.volume)
    assert "bad.volviz.json" in str(caught.value)
    assert field in str(caught.value)


@pytest.mark.parametrize(
    "text", [b"", b"{", b"[]", b"null", b'{"a": NaN}', b"\xff\xfe", b"[" * 100_000, b"{}"]
)
def test_garbage_is_refused(tmp_path, text):
    file = tmp_path / "bad.volviz.json"
    file.write_bytes(text)
    with pytest.raises(InputError, match=r"bad\.volviz\.json"):
        volviz.Scene.open(file)


def test_newer_and_missing(scene, tmp_path):
    file = tmp_path / "s.volviz.json"
    file.write_bytes(edited(scene, put("volviz-scene", 99)))
    with pytest.raises(UnsupportedError, match="update volviz"):
        volviz.Scene.open(file)
    file.write_bytes(edited(scene, put("source", {"path": "gone.nrrd"})))
    with pytest.raises(InputError, match=r"gone\.nrrd.*no such file"):
        volviz.Scene.open(file)


def test_unwritable_place_keeps_what_is_there(scene, tmp_path):
    with pytest.raises(OutputError, match="does not exist"):
        scene.save(tmp_path / "no" / "s.volviz.json")
    file = tmp_path / "s.volviz.json"
    file.write_text("mine")
    with pytest.raises(OutputError, match="exists already"):
        scene.save(file, overwrite=False)
    assert file.read_text() == "mine"


def test_schema_can_be_published():
    import msgspec

    schema = msgspec.json.schema(scenefile.document_type())
    text = json.dumps(schema)
    assert '"volviz-scene"' in text
    assert "smallest voxel" in text or "distance between samples" in text


@pytest.mark.parametrize(
    ("choices", "where"),
    [
        ({"time": "x"}, "source.choices.time"),
        ({"time": 5}, "source.choices"),
        ({"spacing": "abc"}, "source.choices.spacing"),
        ({"spacing": [0, 0, 0]}, "source.choices.spacing"),
        ({"shape": [1, 2]}, "source.choices.shape"),
        ({"limits": 5}, "source.choices"),
        ({"progress": 5}, "source.choices"),
        ({"allow_outside": "/"}, "source.choices"),
    ],
)
def test_a_scene_file_cannot_tell_the_reader_anything_else(scene, tmp_path, choices, where):
    scene.save(tmp_path / "s.volviz.json")
    document = json.loads((tmp_path / "s.volviz.json").read_text())
    document["source"]["choices"] = choices
    (tmp_path / "s.volviz.json").write_text(json.dumps(document))
    with pytest.raises(InputError, match=where.replace(".", r"\.")):
        volviz.Scene.open(tmp_path / "s.volviz.json")


def test_choices_are_those_of_the_readers():
    from volviz.io.options import CHOICES

    assert scenefile._Choices.__struct_fields__ == CHOICES


def test_what_the_user_asks_for_goes_before_what_the_scene_says(tmp_path, rng):
    data = rng.integers(0, 99, (5, 6, 7), np.uint8)
    data.tofile(tmp_path / "x.raw")
    volume = volviz.load(tmp_path / "x.raw", shape=(7, 6, 5), dtype="uint8", spacing=(1, 1, 2))
    volviz.Scene.of(volume).save(tmp_path / "s.volviz.json")
    options = ReadOptions(spacing=(1, 1, 3))
    again = volviz.Scene.open(tmp_path / "s.volviz.json", options=options)
    assert again.volume.spacing == (1, 1, 3)
    assert not any("changed" in w for w in again.volume.info.warnings)


def test_a_linked_scene_finds_its_volume(scene, tmp_path):
    scene.save(tmp_path / "s.volviz.json")
    (tmp_path / "deep").mkdir()
    (tmp_path / "deep" / "l.volviz.json").symlink_to("../s.volviz.json")
    assert volviz.Scene.open(tmp_path / "deep" / "l.volviz.json").volume.dims == (8, 7, 6)
