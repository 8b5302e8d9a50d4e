"""The running viewer without its window: opening, undo, cancel, settings, autosave."""

from __future__ import annotations

import json
import os
import threading
import time

import numpy as np
import pytest

from volviz.app import App, autosave, jobs, opening, settings, viewer
from volviz.app.messages import Messages
from volviz.errors import Cancelled, InputError
from volviz.model.volume import Volume
from volviz.scene import Scene


@pytest.fixture
def app(tmp_path):
    app = App(folder=tmp_path / "config")
    yield app
    app.close()


def settle(app: App, seconds: float = 120.0) -> None:
    end = time.monotonic() + seconds
    while app.job is not None:
        app.poll()
        time.sleep(0.005)
        assert time.monotonic() < end


def ramp(seed: int = 0) -> Volume:
    rng = np.random.default_rng(seed)
    return Volume.from_array(rng.random((6, 7, 8), dtype=np.float32), name=f"ramp{seed}")


def saved(tmp_path, name="a.npy"):
    np.save(tmp_path / name, ramp().data)
    return str(tmp_path / name)


def test_a_file_is_opened_on_a_worker_and_remembered(app, tmp_path):
    woken = threading.Event()
    app.wake = woken.set
    app.open(saved(tmp_path))
    assert app.scene is None
    assert woken.wait(10)
    settle(app)
    assert app.scene.volume.dims == (8, 7, 6)
    assert app.settings.recent == (str(tmp_path / "a.npy"),)
    assert not app.dirty
    again = App(folder=app.folder)
    assert again.settings.recent == app.settings.recent


def test_opening_is_undone_and_redone(app, tmp_path):
    app.open(saved(tmp_path, "a.npy"))
    settle(app)
    first = app.scene
    app.open(saved(tmp_path, "b.npy"))
    settle(app)
    second = app.scene
    assert [s.label for s in app.history.steps] == ["Open a.npy", "Open b.npy"]
    app.undo()
    assert app.scene is first
    app.redo()
    assert app.scene is second
    app.go(0)
    assert app.scene is first


def test_a_bad_file_leaves_the_open_scene(app, tmp_path):
    app.open(saved(tmp_path))
    settle(app)
    kept = app.scene
    (tmp_path / "bad.nrrd").write_bytes(b"NRRD0004\n")
    for _ in range(3):
        app.open(str(tmp_path / "bad.nrrd"))
        settle(app)
    assert app.scene is kept
    (told,) = [m for m in app.messages.all if m.level == "error"]
    assert told.count == 3
    assert "bad.nrrd" in told.text


def test_a_bug_in_a_reader_is_a_message(app):
    def broken(_):
        raise ZeroDivisionError("planted")

    app.load("x", broken)
    settle(app)
    assert "planted" in app.messages.all[-1].text


def test_cancel_takes_effect_quickly_and_shows_nothing(app):
    ended = threading.Event()

    def slow(progress):
        try:
            while True:
                progress(None, "reading")
                time.sleep(0.01)
        except Cancelled:
            ended.set()
            raise

    app.load("slow", slow)
    time.sleep(0.05)
    app.cancel()
    assert ended.wait(0.5)
    app.poll()
    assert app.scene is None
    assert app.job is None
    assert not app.messages.all


def test_a_new_load_replaces_the_running_one(app):
    release = threading.Event()
    scene = Scene.of(ramp(1))

    def first(_):
        release.wait(5)
        return Scene.of(ramp(2))

    app.load("first", first)
    app.load("second", lambda _: scene)
    settle(app)
    release.set()
    time.sleep(0.05)
    app.poll()
    assert app.scene.volume is scene.volume


def test_a_drag_is_one_step(app):
    app.show(Scene.of(ramp()), "Open")
    for step in (0.6, 0.7, 0.8):
        app.change(app.scene.with_raycast(step=step), "Rendering", "rendering")
    assert len(app.history.past) == 1
    app.settle()
    app.change(app.scene.with_raycast(step=0.9), "Rendering", "rendering")
    assert len(app.history.past) == 2
    app.undo()
    assert app.scene.raycast.step == 0.8
    app.undo()
    assert app.scene.raycast.step == 0.5


def test_any_sequence_undone_is_the_first_scene(app):
    rng = np.random.default_rng(5)
    app.show(Scene.of(ramp()), "Open")
    first = app.scene
    for _ in range(60):
        kind = rng.integers(4)
        if kind == 0:
            app.change(app.scene.with_raycast(step=float(rng.uniform(0.1, 2))), "Step", "step")
        elif kind == 1:
            app.change(app.scene.with_camera(app.scene.camera.orbited(5)), "Turn", "turn")
        elif kind == 2:
            app.settle()
        else:
            app.show(Scene.of(ramp(int(rng.integers(100)))), "Open")
    while app.history.past:
        app.undo()
    assert app.scene is first


def test_undo_keeps_only_so_many_bytes_of_volumes(app, monkeypatch):
    monkeypatch.setattr(viewer, "KEPT_BYTES", 3 * ramp().data.nbytes)
    for seed in range(50):
        app.show(Scene.of(ramp(seed)), f"Open {seed}")
    volumes = {id(s.state.volume) for s in app.history.steps}
    assert 2 <= len(volumes) <= 4
    assert app.history.present.label == "Open 49"


def test_the_scene_is_saved_and_opened_again(app, tmp_path):
    app.open(saved(tmp_path))
    settle(app)
    app.change(app.scene.with_raycast(step=0.8), "Rendering")
    assert app.dirty
    app.save(tmp_path / "kept")
    settle(app)
    assert not app.dirty
    app.open(str(tmp_path / "kept.volviz.json"))
    settle(app)
    assert app.scene.raycast.step == 0.8
    assert app.file == tmp_path / "kept.volviz.json"


def test_saving_where_nothing_can_be_is_a_message(app, tmp_path):
    app.open(saved(tmp_path))
    settle(app)
    app.change(app.scene.with_raycast(step=0.8), "Rendering")
    app.save(tmp_path / "no" / "folder" / "x.volviz.json")
    settle(app)
    assert app.messages.all[-1].level == "error"
    assert app.dirty


def test_turning_the_camera_is_nothing_to_save(app):
    app.show(Scene.of(ramp()), "Open")
    app.change(app.scene.with_camera(app.scene.camera.orbited(20)), "Turn")
    assert not app.dirty


def test_many_files_at_once(app, tmp_path):
    names = [saved(tmp_path, f"{i}.npy") for i in range(10)]
    app.open(names)
    settle(app)
    assert app.scene.source.path == names[0]
    assert set(app.settings.recent) == set(names)
    assert "10 files" in app.messages.all[0].text


def test_of_many_files_the_first_that_is_known_is_opened(app, tmp_path):
    (tmp_path / "what.xyz").write_bytes(b"hello" * 100)
    (tmp_path / "empty").mkdir()
    names = [str(tmp_path / n) for n in ("what.xyz", "empty", "lost.nrrd")] + [saved(tmp_path)]
    assert opening.chosen(names)[0] == names[3]
    assert opening.chosen(names[:3])[0] == names[0], "it says what is wrong with it"
    app.open(names)
    settle(app)
    assert app.scene.source.path == names[3]
    assert app.settings.recent == (names[3],), "what cannot be read is not offered again"


def test_of_many_files_none_is_known(app, tmp_path):
    names = [str(tmp_path / f"{i}.xyz") for i in range(10)]
    for name in names:
        (tmp_path / name).write_bytes(b"hello" * 100)
    app.open(names)
    settle(app)
    assert app.scene is None
    assert app.settings.recent == ()
    note, error = (m.text for m in app.messages.all)
    assert "10 files were given, none" in note
    assert "0.xyz" in error


def test_dropped_slices_are_their_folder():
    names = [f"/d/{i}.dcm" for i in range(5)]
    assert opening.chosen(names)[0] == "/d"
    assert opening.chosen(names[:1]) == (names[0], None)


@pytest.mark.parametrize(
    "content", [b"{", b"[]", b'{"theme": 3}', b'{"scale": 99}', b'{"recent": "x"}', b"\xff\x00"]
)
def test_broken_settings_are_put_aside(tmp_path, content):
    (tmp_path / "settings.json").write_bytes(content)
    app = App(folder=tmp_path)
    assert app.settings == settings.Settings()
    assert app.messages.all[0].level == "warning"
    assert (tmp_path / "settings.json.bad").read_bytes() == content


def test_settings_of_a_newer_volviz_survive(tmp_path):
    (tmp_path / "settings.json").write_text('{"theme": "light", "later": [1, 2]}')
    app = App(folder=tmp_path)
    assert app.settings.theme == "light"
    app.remember("sample:plume")
    assert json.loads((tmp_path / "settings.json").read_text())["later"] == [1, 2]


def test_settings_that_cannot_be_written_are_told_once(tmp_path):
    (tmp_path / "config").write_text("a file where the folder should be")
    app = App(folder=tmp_path / "config")
    for name in "abc":
        app.remember(name)
    assert app.settings.recent == ("c", "b", "a")
    assert sum("settings" in m.text for m in app.messages.all) == 1


def test_autosave_recovers_what_a_crash_left(app, tmp_path):
    app.open(saved(tmp_path))
    settle(app)
    app.change(app.scene.with_raycast(step=0.77), "Rendering")
    assert app.autosave.tick(app.scene, dirty=True, now=True) is None
    assert app.autosave.file.exists()
    assert app.autosave.orphans() == []
    gone = 4_000_000  # beyond the largest process id
    os.rename(app.autosave.file, app.autosave.folder / f"{gone}{autosave.SUFFIX}")
    (orphan,) = app.autosave.orphans()
    app.open(str(orphan))
    settle(app)
    assert app.scene.raycast.step == 0.77


def test_a_clean_end_leaves_no_autosave(app, tmp_path):
    app.open(saved(tmp_path))
    settle(app)
    app.autosave.tick(app.scene, dirty=True, now=True)
    app.close()
    assert not app.autosave.file.exists()


def test_messages_are_told_once_and_fade():
    told = Messages()
    told.once("a")
    told.once("a")
    assert [m.count for m in told.all] == [1]
    told.add("b", "error")
    told.add("b", "error")
    assert told.all[-1].count == 2
    said = told.all[-1].when
    told.hide(told.all[-1])
    assert [m.text for m in told.recent(5)] == ["a"]
    assert told.all[-1].when == said > 0  # the log tells still when it was
    told.add("b", "error")
    assert [m.text for m in told.recent(5)] == ["a", "b"]  # it happened again
    told.add("x\x1b[31m\n")
    assert "\x1b" not in told.all[-1].text


def test_a_job_estimates_what_is_left(monkeypatch):
    monkeypatch.setattr(jobs, "ESTIMATE_AFTER", 0.0)
    go = threading.Event()

    def work(progress):
        progress(0.5, "half")
        go.wait(5)

    job = jobs.Job("x", work, lambda _: None, lambda: None)
    while job.fraction is None:
        time.sleep(0.005)
    time.sleep(0.1)
    assert 0.5 < job.remaining / job.elapsed < 1.5
    assert job.message == "half"
    go.set()


def test_errors_of_a_job_are_raised_where_they_are_taken():
    def work(_):
        raise InputError("bad", file="x")

    job = jobs.Job("x", work, lambda _: None, lambda: None)
    while not job.finished:
        time.sleep(0.005)
    with pytest.raises(InputError):
        job.deliver()
