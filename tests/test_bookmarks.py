"""Views kept with a scene: in the scene file, undone, old files without them, wrong ones told."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import volviz
from volviz.app import App
from volviz.errors import InputError, UsageError
from volviz.model import scenefile
from volviz.model.scene import Bookmark
from volviz.ui import bookmarks


@pytest.fixture
def scene():
    volume = volviz.Volume.from_array(np.arange(60, dtype=np.float32).reshape(3, 4, 5))
    return volviz.Scene.of(volume)


def test_there_and_back(scene, tmp_path):
    turned = scene.camera.orbited(30, 10)
    kept = scene.with_bookmarks((Bookmark("vorn ☃", scene.camera), Bookmark("b", turned)))
    kept.save(tmp_path / "s.volviz.json")
    again = volviz.Scene.open(tmp_path / "s.volviz.json", volume=scene.volume)
    assert again.bookmarks == kept.bookmarks
    assert again.bookmarks[1].camera == turned


def test_a_scene_without_any_is_written_as_before(scene, tmp_path):
    document = json.loads(scenefile.encode(scene))
    assert "bookmarks" not in document
    file = tmp_path / "old.volviz.json"
    file.write_text(json.dumps(document))
    assert volviz.Scene.open(file, volume=scene.volume).bookmarks == ()


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"name": ""}, "$.bookmarks[0].name"),
        ({"name": 5}, "$.bookmarks[0].name"),
        ({"name": "x" * 201}, "$.bookmarks[0].name"),
        ({"camera": None}, "$.bookmarks[0].camera"),
        ({"camera": {"position": [0, 0, 0]}}, "$.bookmarks[0].camera"),
        ({"colour": 1}, "$.bookmarks[0]"),
    ],
)
def test_wrong_ones_name_the_place(scene, tmp_path, change, field):
    document = json.loads(scenefile.encode(bookmarks.added(scene)))
    document["bookmarks"][0].update(change)
    file = tmp_path / "s.volviz.json"
    file.write_text(json.dumps(document))
    with pytest.raises(InputError) as told:
        volviz.Scene.open(file, volume=scene.volume)
    assert told.value.field == field


def test_names_are_checked(scene):
    for name in ("", "x" * 201, None):
        with pytest.raises(UsageError, match="letters"):
            Bookmark(name, scene.camera)  # type: ignore[arg-type]


def test_the_schema_tells_of_them():
    import msgspec

    text = json.dumps(msgspec.json.schema(scenefile.document_type()))
    assert '"bookmarks"' in text


def test_added_set_and_removed(scene):
    one = bookmarks.added(scene)
    two = bookmarks.added(one.with_camera(scene.camera.orbited(40)))
    assert [b.name for b in two.bookmarks] == ["View 1", "View 2"]
    gap = bookmarks.added(bookmarks.without(two, 0))
    assert [b.name for b in gap.bookmarks] == ["View 2", "View 1"]
    moved = bookmarks.set_at(two, 0)
    assert moved.bookmarks[0].camera == two.camera
    assert moved.bookmarks[0].name == "View 1"
    assert len(bookmarks.set_at(two, 7).bookmarks) == 3


def test_a_bookmark_is_something_to_save_and_to_undo(scene, tmp_path):
    app = App(folder=tmp_path)
    app.show(scene, "Open")
    app.change(bookmarks.added(scene), "Bookmark")
    assert app.dirty
    app.undo()
    assert not app.dirty
    assert app.scene is scene
    app.close()


def test_the_picture_does_not_depend_on_them(scene):
    from volviz.resolve import resolve

    kept = bookmarks.added(scene)
    assert resolve(kept).table is resolve(scene).table
    assert replace(kept, bookmarks=()) == scene
