"""The gallery and the bookmarks without a window: what a click, a star, a name, a menu do."""

from __future__ import annotations

import threading
from collections import Counter
from types import SimpleNamespace

import numpy as np
import pytest

import volviz
from volviz.classify import own_presets
from volviz.classify.preset_file import shipped
from volviz.resolve import known_statistics
from volviz.ui import looks, transfer_editor
from volviz.ui.im import imgui
from volviz.ui.panels import presets, view
from volviz.ui.shelf import Shelf


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("VOLVIZ_CONFIG_DIR", str(tmp_path))
    monkeypatch.setattr("tests.ui.conftest.SIZE", (900, 1200))
    return tmp_path / "presets"


@pytest.fixture
def gallery(stage, scene):
    return stage(presets.panel, scene)


def type_text(one, text: str) -> None:
    imgui.get_io().add_input_characters_utf8(text)
    one.frame(2)


def save_as(one, text: str) -> None:
    one.click("presets.save")
    one.key(imgui.Key.mod_ctrl, imgui.Key.a)
    type_text(one, text)
    one.click("presets.do")


def test_one_click_is_one_step(gallery, body):
    gallery.click("presets.ct-bone")
    expected = volviz.Scene.of(body, preset="ct-bone")
    assert gallery.scene.transfer == expected.transfer
    assert gallery.scene.raycast == expected.raycast
    assert gallery.scene.light == expected.light
    assert len(gallery.history.past) == 1
    gallery.click("presets.ct-bone")
    assert len(gallery.history.past) == 1
    assert gallery.history.undo().state is gallery.history.past[0].state


def test_what_is_worn_is_marked_until_it_is_changed(scene, body):
    found = known_statistics(body)
    worn = [c.name for c in looks.catalogue(body, found) if looks.worn(scene, c.name, found)]
    assert worn == ["ct-head"]
    bone = looks.dressed(scene, looks.named_look("ct-bone", body, found))
    assert looks.worn(bone, "ct-bone", found)
    assert looks.worn(bone.with_camera(bone.camera.orbited(9)), "ct-bone", found)
    for changed in (
        bone.with_transfer(bone.transfer.shifted(1)),
        bone.with_knobs(ambient=0.9),
        bone.with_knobs(mode="mip"),
    ):
        assert not looks.worn(changed, "ct-bone", found)


def volumes():
    rng = np.random.default_rng(3)
    noise = rng.normal(100, 30, (9, 9, 9)).astype(np.float32)
    yield volviz.Volume.from_array(noise)
    yield volviz.Volume.from_array(noise, modality="MR", space="LPS")
    yield volviz.Volume.from_array(np.zeros((3, 3, 3), np.uint8))
    yield volviz.Volume.from_array(np.full((3, 3, 3), np.nan, np.float32))
    yield volviz.Volume.from_array(rng.integers(0, 4, (6, 6, 6)).astype(np.uint8), kind="labels")


@pytest.mark.parametrize("volume", list(volumes()), ids=["any", "mr", "zero", "nan", "labels"])
def test_every_look_is_offered_once_and_can_be_worn(stage, volume):
    found = known_statistics(volume)
    names = Counter(c.name for c in looks.catalogue(volume, found, ["viridis", "ct-bone"]))
    assert set(names) == {*shipped(), "suggested"}
    assert set(names.values()) == {1}
    scene = volviz.Scene.of(volume)
    assert looks.worn(scene, "suggested", found)
    for choice in looks.catalogue(volume, found):
        look = looks.named_look(choice.name, volume, found)
        assert looks.worn(looks.dressed(scene, look), choice.name, found)
        assert choice.suits or choice.section == looks.OTHERS
    one = stage(presets.panel, scene)
    one.frame(3)
    assert one.scene is scene


def test_what_suits_comes_first(body):
    rest = looks.catalogue(body, known_statistics(body), ["mr-mip"])
    assert [c.section for c in rest][:3] == ["Suggested", "Favourites", "CT"]
    assert rest[0].name == "ct-head"
    assert rest[1].name == "mr-mip"
    assert {c.section for c in rest if c.name.startswith("mr-")} == {"Favourites", looks.OTHERS}


def test_the_filter_finds_words_in_any_order(gallery):
    gallery.click("presets.filter")
    type_text(gallery, "tree CHEST")
    shown = {i for i in gallery.seen.where if i.count(".") == 1}
    assert shown - {"presets.filter", "presets.save"} == {"presets.ct-chest-vessels"}
    type_text(gallery, " nothing")
    assert "presets.ct-chest-vessels" not in gallery.seen.where


def test_those_for_other_data_unfold(gallery):
    assert "presets.mr-default" not in gallery.seen.where
    gallery.click("presets.others")
    assert "presets.mr-default" in gallery.seen.where


def test_favourites_move_to_the_top_and_back(gallery):
    shelf = gallery.local.of(Shelf)
    gallery.click("presets.viridis.star")
    assert shelf.favourites == ("viridis",)
    assert gallery.scene is gallery.history.steps[0].state, "a star puts nothing on"
    top = gallery.seen.where["presets.ct-aaa"][1]
    assert gallery.seen.where["presets.viridis"][1] < top
    gallery.click("presets.viridis.star")
    assert shelf.favourites == ()
    assert gallery.seen.where["presets.viridis"][1] > gallery.seen.where["presets.ct-aaa"][1]


def test_save_replace_rename_delete(gallery, folder):
    gallery.scene = gallery.scene.with_transfer(gallery.scene.transfer.shifted(33))
    gallery.frame(2)
    save_as(gallery, "My look")
    file = folder / "my-look.json"
    assert file.exists()
    assert gallery.scene.transfer.name == "my-look", "what was saved is worn"
    first = file.read_bytes()
    gallery.scene = gallery.scene.with_transfer(gallery.scene.transfer.shifted(7))
    gallery.frame(2)
    save_as(gallery, "my LOOK")
    assert file.read_bytes() == first, "it asks before it overwrites"
    gallery.click("presets.do")
    assert file.read_bytes() != first
    gallery.click("presets.my-look", button=1)
    gallery.click("presets.menu.star")
    gallery.click("presets.my-look", button=1)
    gallery.click("presets.menu.rename")
    gallery.key(imgui.Key.mod_ctrl, imgui.Key.a)
    type_text(gallery, "Other")
    gallery.key(imgui.Key.enter)
    gallery.frame(3)
    assert list(own_presets.own().presets) == ["other"]
    assert gallery.local.of(Shelf).favourites == ("other",)
    gallery.click("presets.other", button=1)
    gallery.click("presets.menu.delete")
    assert list(own_presets.own().presets) == ["other"], "it asks before it deletes"
    gallery.click("presets.do")
    assert not list(folder.iterdir())
    assert gallery.local.of(Shelf).favourites == ()


def test_a_name_that_volviz_has_is_refused_with_what_to_do(gallery, folder):
    save_as(gallery, "CT Bone")
    assert "presets.do" in gallery.seen.where, "the question stays"
    assert not folder.exists()
    gallery.key(imgui.Key.escape)
    gallery.frame(2)
    assert "presets.do" not in gallery.seen.where


def test_own_presets_are_in_the_combo(stage, scene, gallery):
    save_as(gallery, "Mine")
    editor = stage(transfer_editor.panel, scene)
    editor.click("transfer.preset")
    editor.frame(3)
    editor.click("transfer.preset.mine")
    assert editor.scene.transfer.name == "mine"


@pytest.fixture
def views(stage, scene):
    return stage(view.panel, scene)


def test_bookmarks_are_added_gone_to_set_renamed_and_deleted(views, scene):
    views.click("bookmarks.add")
    assert [b.name for b in views.scene.bookmarks] == ["View 1"]
    turned = scene.camera.orbited(50)
    views.scene = views.scene.with_camera(turned)
    views.click("bookmarks.0")
    assert views.scene.camera == scene.camera
    views.scene = views.scene.with_camera(turned)
    views.click("bookmarks.0", button=1)
    views.click("bookmarks.menu.set")
    assert views.scene.bookmarks[0].camera == turned
    views.click("bookmarks.0", button=1)
    views.click("bookmarks.menu.rename")
    views.key(imgui.Key.mod_ctrl, imgui.Key.a)
    type_text(views, "left side")
    views.key(imgui.Key.enter)
    views.frame(2)
    assert views.scene.bookmarks[0].name == "left side"
    views.click("bookmarks.0", button=1)
    views.click("bookmarks.menu.delete")
    assert views.scene.bookmarks == ()
    for _ in range(len(views.history.past)):
        views.history = views.history.undo()
    assert views.history.state is scene


def test_a_preset_that_fits_no_numbers_breaks_nothing(gallery, folder, scene):
    save_as(gallery, "Far")
    file = folder / "far.json"
    wild = '"axis": "relative", "opacities": [[-1e308, 0], [1.7e308, 1]]'
    parts = '"name": "far", "title": "Far", "group": "Any", "description": "Far."'
    file.write_text(f'{{{parts}, {wild}, "colors": [[0, "#000000"]]}}')
    assert "too far apart" in str(own_presets.own().broken["far"])
    file.write_text(file.read_text().replace("-1e308", "0"))
    assert "far" in own_presets.own().presets
    gallery.scene = scene
    gallery.click("presets.far")
    assert gallery.scene is scene
    gallery.frame(60)
    gallery.click("presets.ct-bone")
    assert gallery.scene.transfer.name == "ct-bone"


def test_the_files_are_read_before_the_window_asks(tmp_path, monkeypatch):
    """On a thread of their own: the window's finds them read, and says what is wrong with one."""
    monkeypatch.setenv("VOLVIZ_CONFIG_DIR", str(tmp_path))
    (tmp_path / "presets").mkdir()
    (tmp_path / "presets" / "torn.json").write_text("{")
    go, read, told = threading.Event(), [], []

    def slow():
        go.wait(20)
        read.append(threading.current_thread())
        own_presets.own()

    monkeypatch.setattr("volviz.classify.presets.presets", slow)
    messages = SimpleNamespace(once=lambda error, level: told.append(error))
    app = SimpleNamespace(wake=None, messages=messages, scene=None, limits=None)
    shelf = Shelf().connect(app, None)
    shelf.thumbnails = SimpleNamespace(advance=lambda *_, **__: False)
    shelf.advance(free=True)
    assert not told, "it would wait for the disk"
    go.set()
    shelf._reader.join(20)
    monkeypatch.setattr(own_presets, "_read", None)  # who reads now fails
    monkeypatch.setattr(own_presets, "LOOK_SECONDS", 1e9)
    shelf.advance(free=True)
    shelf.advance(free=True)
    assert ["torn.json" in str(error) for error in told] == [True], "once"
    assert read[0] is not threading.current_thread()
