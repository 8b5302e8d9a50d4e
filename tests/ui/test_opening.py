"""Bad, odd and many things to open: told in one line, the open scene untouched, nothing lost."""

from __future__ import annotations

import errno
import gc
import os
import threading
import time
import weakref
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import volviz
from tests.io import dicom_maker
from tests.ui.test_app import ramp, settle
from volviz.app import App, opening, settings, viewer
from volviz.errors import Cancelled
from volviz.image import Image as Picture
from volviz.io.parts import Part
from volviz.scene import Scene
from volviz.ui.browser import Browser


@pytest.fixture
def app(tmp_path):
    app = App(folder=tmp_path / "config")
    app.open(array(tmp_path, "open.npy"))
    settle(app)
    yield app
    app.close()


def array(folder: Path, name: str) -> str:
    np.save(folder / name, ramp().data)
    return str(folder / name)


def errors(app: App) -> list[str]:
    return [m.text for m in app.messages.all if m.level == "error"]


# --- what is no volume -----------------------------------------------------------------------


def test_what_cannot_be_opened_is_one_message_and_changes_nothing(app, tmp_path):
    (tmp_path / "unknown.xyz").write_bytes(bytes(range(256)) * 9)
    (tmp_path / "notes.txt").write_text("shopping list")
    (tmp_path / "empty.nrrd").write_bytes(b"")
    (tmp_path / "broken.nii.gz").write_bytes(b"\x1f\x8b\x08\x00garbage")
    (tmp_path / "nothing").mkdir()
    (tmp_path / "junk").mkdir()
    (tmp_path / "junk" / "a.pdf").write_bytes(b"%PDF-1.4")
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    for odd in ("x" * 5000, "zero\0byte.json", "", " "):
        app.open(odd)
        settle(app)
        assert "bug in volviz" not in app.messages.all[-1].text
        app.messages.all = ()
    kept, steps = app.scene, app.history.steps
    names = ["unknown.xyz", "notes.txt", "empty.nrrd", "broken.nii.gz"]
    for count, name in enumerate((*names, "nothing", "junk", "pipe", "loop", "gone.mha"), 1):
        app.open(str(tmp_path / name))
        settle(app)
        assert len(errors(app)) == count
        assert name in errors(app)[-1]
        assert "bug in volviz" not in errors(app)[-1]
    assert app.scene is kept
    assert app.history.steps == steps
    assert app.settings.recent == (str(tmp_path / "open.npy"),)


def test_a_folder_of_images_and_junk_is_read(app, tmp_path):
    folder = tmp_path / "mixed"
    stored = dicom_maker.series(folder, 4)
    (folder / "report.pdf").write_bytes(b"%PDF-1.4")
    (folder / "Thumbs.db").write_bytes(b"\xd0\xcf\x11\xe0")
    (folder / "cut.dcm").write_bytes((folder / "slice000.dcm").read_bytes()[:200])
    app.open(str(folder))
    settle(app)
    np.testing.assert_array_equal(app.scene.volume.data, stored.astype(int) - 1024)
    assert not errors(app)


# --- many at once ----------------------------------------------------------------------------


@pytest.mark.parametrize("suffix", ["png", "tif", "bmp"])
def test_slices_of_one_stack_are_the_stack(app, tmp_path, suffix):
    folder = tmp_path / "stack"
    folder.mkdir()
    values = np.random.default_rng(5).integers(0, 255, (10, 9, 8), dtype=np.uint8)
    names = [str(folder / f"s{k:02d}.{suffix}") for k in range(10)]
    for name, plane in zip(names, values, strict=True):
        Image.fromarray(plane).save(name)
    app.open(names[::-1])
    settle(app)
    np.testing.assert_array_equal(app.scene.volume.data, values)
    (told,) = [m for m in app.messages.all if m.level == "info"]
    assert "10 slices" in told.text


def test_dicom_without_suffix_is_a_stack_too(app, tmp_path):
    names = [f"IM{k}" for k in range(6)]
    stored = dicom_maker.series(tmp_path / "cd", 6, names=names)
    app.open([str(tmp_path / "cd" / n) for n in names])
    settle(app)
    np.testing.assert_array_equal(app.scene.volume.data, stored.astype(int) - 1024)


def test_volumes_dropped_together_are_not_a_stack(app, tmp_path):
    import tifffile

    names = []
    for k in range(4):
        names.append(str(tmp_path / f"v{k}.tif"))
        tifffile.imwrite(names[-1], np.arange(k, k + 210, dtype=np.uint8).reshape(5, 6, 7))
    names.insert(2, str(tmp_path / "readme.txt"))
    (tmp_path / "readme.txt").write_text("not a volume")
    app.open(names)
    settle(app)
    assert app.scene.source.path == names[0]
    assert names[2] not in app.settings.recent
    assert {n for n in names if n.endswith(".tif")} <= set(app.settings.recent)
    (told,) = [m for m in app.messages.all if m.level == "info"]
    assert "5 files" in told.text
    assert "Open Recent" in told.text
    assert not errors(app)


# --- while it is read ------------------------------------------------------------------------


def test_a_file_that_vanishes_while_it_is_read(app, tmp_path, monkeypatch):
    name = array(tmp_path, "later.npy")
    app.remember(name)
    kept = app.scene
    read = opening.open_volume

    def vanishing(*given):
        Path(name).unlink()
        return read(*given)

    monkeypatch.setattr(opening, "open_volume", vanishing)
    app.open(name)
    settle(app)
    assert app.scene is kept
    (told,) = errors(app)
    assert "no such file" in told
    assert name not in app.settings.recent
    assert str(tmp_path / "open.npy") in app.settings.recent


def test_a_load_is_cancelled_within_half_a_second(app, tmp_path):
    folder = tmp_path / "large"
    dicom_maker.series(folder, 250, data=np.zeros((250, 64, 64), np.uint16))
    kept = app.scene
    for wait in (0.0, 0.05, 0.2):
        threads = {t for t in threading.enumerate() if t.name.startswith("volviz")}
        app.open(str(folder))
        time.sleep(wait)
        (worker,) = {t for t in threading.enumerate() if t.name.startswith("volviz")} - threads
        asked = time.monotonic()
        app.cancel()
        worker.join(5)
        assert time.monotonic() - asked < 0.5
        app.poll()
        assert app.scene is kept
    assert not errors(app)


def test_the_window_closes_while_something_is_read(tmp_path):
    app = App(folder=tmp_path / "config")
    ended = threading.Event()

    def slow(progress):
        try:
            while True:
                progress(0.5, "reading")
                time.sleep(0.01)
        except Cancelled:
            ended.set()
            raise

    app.load("slow", slow)
    app.close()
    assert ended.wait(0.5)
    assert app.job is None


# --- where nothing can be written ------------------------------------------------------------


@pytest.fixture
def full_disk(monkeypatch):
    """Every write of a file ends as on a full disk."""

    def no_space(_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", no_space)


def test_a_full_disk_keeps_the_old_scene_file(app, tmp_path, full_disk):
    file = tmp_path / "kept.volviz.json"
    file.write_bytes(b"the old one")
    app.change(app.scene.with_raycast(step=0.8), "Rendering")
    app.save(file)
    settle(app)
    (told,) = errors(app)
    assert "No space" in told
    assert app.dirty, "what was not saved is still to be saved"
    assert file.read_bytes() == b"the old one"
    assert not list(tmp_path.glob(".*.part"))


def test_a_full_disk_keeps_the_old_picture_and_settings(app, tmp_path, full_disk):
    file = tmp_path / "old.png"
    file.write_bytes(b"the old one")
    picture = Picture(np.zeros((4, 4, 4), np.uint8), "renderer", ())
    app.run("Writing old.png", lambda _: picture.save(file), lambda _: None)
    settle(app)
    assert "No space" in errors(app)[0]
    assert file.read_bytes() == b"the old one"
    old = (app.folder / settings.FILE).read_bytes()
    for k in range(3):
        app.remember(f"sample:{k}")
    assert (app.folder / settings.FILE).read_bytes() == old
    assert sum("settings" in m.text for m in app.messages.all) == 1
    assert app.settings.recent[0] == "sample:2", "it goes on with them in memory"


def test_settings_that_are_a_folder(tmp_path):
    (tmp_path / settings.FILE).mkdir()
    app = App(folder=tmp_path)
    assert app.settings == settings.Settings()
    assert len(app.messages.all) == 1
    app.remember("sample:plume")
    assert App(folder=tmp_path).settings.recent == ("sample:plume",)


# --- names -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "meant"),
    [
        ("~/a b.nrrd", "HOME/a b.nrrd"),
        ("  /data/a.nrrd \n", "/data/a.nrrd"),
        ("'/data/my file.nrrd'", "/data/my file.nrrd"),
        ('"~/a.nrrd"', "HOME/a.nrrd"),
        ("file:///data/a%20b.nrrd", "/data/a b.nrrd"),
        ("file://localhost/data/%C3%A4.nrrd", "/data/ä.nrrd"),
        ("file:///data/a#1?.nrrd", "/data/a#1?.nrrd"),
        ("$VOLVIZ_TEST/a.nrrd", "/x/y/a.nrrd"),
        ("'", "'"),
    ],
)
def test_typed_paths_are_understood(text, meant, monkeypatch):
    monkeypatch.setenv("HOME", "/home/somebody")
    monkeypatch.setenv("VOLVIZ_TEST", "/x/y")
    wanted = Path(meant.replace("HOME", "/home/somebody"))
    assert opening.typed(text) == wanted
    browser = Browser("")
    browser.text = text
    assert browser.path == wanted


@pytest.mark.parametrize("name", [" spaced .npy", "'quoted'.npy", "$HOME.npy", "~x.npy"])
def test_what_is_there_as_it_stands_is_taken_as_it_stands(app, tmp_path, name, monkeypatch):
    monkeypatch.chdir(tmp_path)
    array(tmp_path, name)
    app.open(name)
    settle(app)
    assert app.scene.source.path == str(tmp_path / name)


ODD = [
    "日本語.npy",
    "e\u0301.npy",
    "a##b###c.npy",
    "100%s%n.npy",
    "x" * 240 + ".npy",
    "a\tb\x1b.npy",
]


@pytest.mark.parametrize("name", [*ODD, os.fsdecode(b"caf\xe9.npy")])
def test_odd_names_are_opened_saved_and_fit_for_the_screen(app, tmp_path, name):
    path = array(tmp_path, name)
    app.open(path)
    settle(app)
    assert app.scene.source.path == path
    assert App(folder=app.folder).settings.recent[0] == path
    title = opening.title_of(path)
    assert len(title) <= 62
    title.encode()  # the screen takes UTF-8 only
    assert title.isprintable()
    shown = Browser(path)
    shown.text.encode()
    assert shown.path == Path(path)
    shown.text += "x"
    assert shown.path == Path(path + "x")


def test_recent_files_that_are_gone_are_told_and_taken_off(app, tmp_path):
    for name in ("gone.nrrd", "also/gone.nrrd"):
        app.remember(str(tmp_path / name))
        app.open(str(tmp_path / name))
        settle(app)
    assert app.settings.recent == (str(tmp_path / "open.npy"),)
    assert len(errors(app)) == 2


# --- memory ----------------------------------------------------------------------------------


def test_fifty_volumes_leave_only_what_undo_may_keep(tmp_path, monkeypatch):
    app = App(folder=tmp_path / "config")
    each = 40**3
    monkeypatch.setattr(viewer, "KEPT_BYTES", 10 * each)
    alive: list[weakref.ref[volviz.Volume]] = []
    for k in range(50):
        values = np.random.default_rng(k).integers(0, 255, (40 + k % 3, 40, 40), np.uint8)
        np.save(tmp_path / f"{k}.npy", values)
        app.open(str(tmp_path / f"{k}.npy"))
        settle(app)
        volviz.resolve.resolve(app.scene)
        alive.append(weakref.ref(app.scene.volume))
    gc.collect()
    left = [ref for ref in alive if ref() is not None]
    assert len(left) == 10, "9 old ones, of 40 to 42 layers, and the open one"
    assert left == alive[-10:]
    app.history = None
    app.saved = None
    gc.collect()
    assert not [ref for ref in alive if ref() is not None]


def test_of_volumes_that_only_undo_reaches_the_voxels_alone_stay(app):
    first, second = ramp(1), ramp(2)
    app.show(Scene.of(first), "Open 1")
    before = volviz.resolve.resolve(app.scene)
    texture = weakref.ref(before.voxels)
    bits, facts = before.voxels.array.copy(), volviz.resolve.statistics_at_hand(first)
    del before
    app.show(Scene.of(second), "Open 2")
    gc.collect()
    assert texture() is None, "the texture is gone"
    assert volviz.resolve.statistics_at_hand(first) is facts
    kept = weakref.ref(volviz.resolve.resolve(app.scene).voxels)
    app.undo()
    gc.collect()
    assert kept() is None
    assert app.scene.volume is first
    assert np.array_equal(volviz.resolve.resolve(app.scene).voxels.array, bits)


def test_the_answer_is_opened_as_it_was_asked_for(app):
    """`volviz FOLDER --preset NAME`: which series is asked, and the flags hold for the answer."""
    part = Part("series", "one", (("series", "2"),), read=lambda _: None)
    told = []

    def again(choices):
        told.append(choices)
        return lambda _: Scene.of(ramp(4))

    app.load("folder", lambda _: opening.Offer("folder", (part,), again=again))
    settle(app)
    before = app.scene
    assert app.choosing.offer is not None
    app.choosing.take(part)
    settle(app)
    assert told == [{"series": "2"}]
    assert app.scene is not before
