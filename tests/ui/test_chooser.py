"""Several series, arrays, times or channels: the question, its small pictures, and the change."""

from __future__ import annotations

import threading
import time
from dataclasses import replace
from pathlib import Path

import nibabel
import numpy as np
import pytest

import volviz
from tests.io import dicom_maker
from tests.ui.test_app import settle
from volviz.app import App, choosing, opening
from volviz.app.previews import Previews, picture_of
from volviz.io.options import ReadOptions
from volviz.io.parts import Slice, parts
from volviz.ui.facts import Facts
from volviz.ui.panels import data

TIMES = 5


@pytest.fixture
def app(tmp_path):
    app = App(folder=tmp_path / "config")
    yield app
    app.close()


@pytest.fixture
def folder(tmp_path) -> Path:
    """Two series: 6 slices of 5 × 7 with a window, 3 slices of 8 × 8 without."""

    def first(ds, k):
        ds.SeriesNumber, ds.SeriesDescription, ds.AcquisitionDate = 1, "bone", "20190305"
        ds.WindowCenter, ds.WindowWidth = 300, 600

    def second(ds, k):
        ds.SeriesNumber, ds.SeriesDescription, ds.Modality = 2, "None", "MR"

    place = tmp_path / "study"
    dicom_maker.series(place / "a", 6, change=first, uid="1.2.3")
    dicom_maker.series(place / "b", 3, change=second, uid="1.2.4", data=dicom_maker.voxels(3, 8, 8))
    return place


def film(path: Path, channels: int = 1) -> np.ndarray:
    """A 4D (5D with channels) NIfTI; float32[x, y, z, t(, c)]."""
    shape = (8, 7, 6, TIMES, *([channels] if channels > 1 else []))
    values = np.random.default_rng(3).random(shape, dtype=np.float32)
    nibabel.save(nibabel.Nifti1Image(values, np.diag([1, 2, 3, 1])), path)
    return values


def run(app: App, seconds: float = 120.0) -> None:
    """Until nothing is read and nothing is wanted."""
    end = time.monotonic() + seconds
    while app.job is not None or app.choosing.wanted is not None:
        app.poll()
        time.sleep(0.003)
        assert time.monotonic() < end


def opened(app: App, path: Path | str) -> None:
    app.open(str(path))
    settle(app)


# --- the question ----------------------------------------------------------------------------


def test_a_folder_with_several_series_asks(app, folder):
    opened(app, folder)
    assert app.scene is None
    offer = app.choosing.offer
    one, two = offer.parts
    assert (one.title, one.modality, one.date, one.files) == ("bone", "CT", "2019-03-05", 6)
    assert one.dims == (7, 5, 6)
    assert one.spacing == pytest.approx((0.75, 0.5, 2.5))
    assert (two.title, two.modality, two.dims) == ("no description", "MR", (8, 8, 3))
    assert not app.messages.all
    app.choosing.take(two)
    settle(app)
    assert app.choosing.offer is None
    assert app.scene.volume.dims == (8, 8, 3)
    assert app.scene.source.choices == (("series", "2"),)
    assert app.settings.recent == (str(folder),)


def test_nothing_is_opened_without_an_answer(app, folder, tmp_path):
    np.save(tmp_path / "a.npy", np.random.default_rng(0).random((4, 5, 6)))
    opened(app, tmp_path / "a.npy")
    kept = app.scene
    opened(app, folder)
    assert app.choosing.offer is not None
    app.choosing.decline()
    assert app.scene is kept
    assert app.history.present.state is kept


def test_another_series_is_asked_for_later_and_known_to_the_panel(app, folder):
    opened(app, folder)
    app.choosing.take(app.choosing.offer.parts[0])
    settle(app)
    assert [p.title for p in app.choosing.listed] == ["bone", "no description"]
    app.choosing.list_parts()
    settle(app)
    assert app.choosing.offer.present == (("series", "1"),)
    app.choosing.take(app.choosing.offer.parts[0])
    assert app.job is None, "what is open is not read again"
    app.change(choosing.asking(app.scene, series="2"), "Data")
    settle(app)
    assert app.scene.volume.dims == (8, 8, 3)
    app.undo()
    assert app.scene.volume.dims == (7, 5, 6)


def test_arrays_of_an_archive(app, tmp_path):
    rng = np.random.default_rng(1)
    given = {"density": rng.random((4, 5, 6)), "speed": rng.random((3, 4, 5)), "label": np.ones(3)}
    np.savez(tmp_path / "several.npz", **given)
    opened(app, tmp_path / "several.npz")
    assert {p.title: p.dims for p in app.choosing.offer.parts} == {
        "density": (6, 5, 4),
        "speed": (5, 4, 3),
    }
    app.choosing.take(next(p for p in app.choosing.offer.parts if p.title == "speed"))
    settle(app)
    np.testing.assert_array_equal(app.scene.volume.data, given["speed"])


def test_one_thing_is_no_question(app, tmp_path):
    np.savez(tmp_path / "one.npz", a=np.random.default_rng(1).random((4, 5, 6)))
    opened(app, tmp_path / "one.npz")
    app.choosing.list_parts()
    settle(app)
    assert app.choosing.offer is None
    assert "nothing else" in app.messages.all[-1].text
    assert not choosing.may_have_parts(None)
    opened(app, "sample:marschner-lobb")
    assert not choosing.may_have_parts(app.scene)
    app.choosing.list_parts()
    assert app.job is None


def test_times_and_channels_are_listed(tmp_path):
    film(tmp_path / "film.nii", channels=2)
    found = parts(tmp_path / "film.nii")
    assert [p.choices for p in found[:2]] == [(), (("time", 1),)]
    assert len(found) == TIMES * 2
    assert found[-1].title == "time 5 of 5, channel 2 of 2"


def test_channels_are_called_as_the_file_calls_them(app, tmp_path, stage):
    import tifffile

    values = np.random.default_rng(2).integers(0, 200, (3, 4, 6, 5), np.uint8)
    tifffile.imwrite(
        tmp_path / "cells.ome.tif",
        values,
        ome=True,
        photometric="minisblack",
        metadata={"axes": "CZYX", "Channel": {"Name": ["DAPI", "", "GFP"]}},
    )
    found = parts(tmp_path / "cells.ome.tif")
    assert [p.title for p in found] == [
        "channel 1 of 3 (DAPI)",
        "channel 2 of 3",
        "channel 3 of 3 (GFP)",
    ]
    opened(app, tmp_path / "cells.ome.tif")
    titles = choosing.channel_titles(app.scene.volume.info)
    assert titles == ("1: DAPI", "2 of 3", "3: GFP")
    one = stage(data.panel, app.scene, Facts())
    one.click("part.channel")
    one.frame(2)
    assert "GFP" in one.seen.tips["part.channel.2"]


# --- small pictures --------------------------------------------------------------------------


def test_the_picture_is_the_middle_slice_in_its_window_and_aspect(folder):
    one = parts(folder)[0].middle_slice(ReadOptions())
    stored = dicom_maker.voxels(6)[3].astype(float)  # pydicom wrote these
    np.testing.assert_array_equal(one.values, stored - 1024)
    assert one.window == (300, 600)
    picture = picture_of(one, 210)
    assert picture.shape == (100, 210), "7 × 0.75 mm wide, 5 × 0.5 mm high"
    middle = picture[10::20, 15::30].astype(float)  # the middles of the pixels
    np.testing.assert_allclose(middle, (stored - 1024) / 600 * 255, atol=2)


def test_pictures_of_odd_slices():
    flat = picture_of(Slice(np.full((4, 4), 7.0), (1, 1)))
    assert flat.max() == 0
    lost = picture_of(Slice(np.array([[np.nan, 0.0], [1.0, np.inf]]), (1, 1)))
    assert lost[0, 0] == 0
    assert lost[-1, 0] == 255
    wrong = picture_of(Slice(np.arange(16.0).reshape(4, 4), (1, 1), window=(9000, 5)))
    assert wrong.min() < 50, "a window that shows nothing is not used"
    assert wrong.max() > 200
    assert picture_of(Slice(np.zeros((1, 5000)), (1, 1))).shape == (1, 160)


def test_pictures_come_one_by_one_and_a_damaged_series_spoils_nothing(folder):
    for file in (folder / "a").iterdir():
        file.write_bytes(file.read_bytes()[:-60])
    found = parts(folder)
    woken = threading.Event()
    previews = Previews(found, woken.set)
    previews.get(0)
    previews.get(1)
    end = time.monotonic() + 200
    while len(previews.made) < 2 and time.monotonic() < end:
        woken.wait(0.1)
    assert isinstance(previews.get(0), str)
    assert previews.get(1).shape == (107, 160)
    previews.close()


def test_pictures_are_given_up_at_once(folder):
    started = threading.Event()

    def slow(options: ReadOptions) -> Slice:
        started.set()
        while True:
            options.progress(None, "reading")
            time.sleep(0.01)

    previews = Previews([replace(parts(folder)[0], read=slow)], lambda: None)
    previews.get(0)
    assert started.wait(10)
    previews.close()
    asked = time.monotonic()
    while previews.running and time.monotonic() < asked + 5:
        time.sleep(0.005)
    assert time.monotonic() - asked < 0.5
    assert not previews.made
    assert previews.get(0) is None
    assert not previews.running


# --- times and channels ----------------------------------------------------------------------


def test_another_time_keeps_camera_and_transfer_function(app, tmp_path):
    values = film(tmp_path / "film.nii.gz")
    opened(app, tmp_path / "film.nii.gz")
    assert not [m for m in app.messages.all if "--time" in m.text]
    app.change(app.scene.with_camera(app.scene.camera.orbited(30)), "Turn")
    app.change(app.scene.with_transfer(app.scene.transfer.shifted(0.1)), "Shift")
    before = app.scene
    app.change(choosing.asking(before, time=3), "Data", "data")
    assert app.scene is before, "the old one is shown until the new one is there"
    assert app.choosing.wanted == (("time", 3),)
    run(app)
    np.testing.assert_array_equal(app.scene.volume.data, values[..., 3].T)
    assert app.scene == replace(before, volume=app.scene.volume, source=app.scene.source)
    assert app.history.present.label == "Time 4"
    app.undo()
    assert app.scene is before
    app.redo()
    assert app.scene.volume.info.time == 3
    assert app.dirty, "the transfer function was changed"


def test_what_is_turned_while_another_time_is_read_is_kept(app, tmp_path):
    film(tmp_path / "film.nii")
    opened(app, tmp_path / "film.nii")
    app.choosing.want({"time": 2})
    turned = app.scene.camera.orbited(40)
    app.change(app.scene.with_camera(turned), "Turn")
    run(app)
    assert app.scene.camera == turned
    assert app.scene.volume.info.time == 2


def test_looking_at_another_time_is_nothing_to_save_but_is_saved(app, tmp_path):
    values = film(tmp_path / "film.nii", channels=2)
    opened(app, tmp_path / "film.nii")
    app.choosing.want({"time": 4, "channel": 1})
    run(app)
    assert not app.dirty
    app.save(tmp_path / "kept")
    settle(app)
    again = volviz.Scene.open(tmp_path / "kept.volviz.json")
    np.testing.assert_array_equal(again.volume.data, values[..., 4, 1].T)
    assert dict(again.source.choices) == {"time": 4, "channel": 1}
    opened(app, tmp_path / "kept.volviz.json")
    app.choosing.want({"time": 0})
    run(app)
    np.testing.assert_array_equal(app.scene.volume.data, values[..., 0, 1].T)


def test_only_the_last_wish_counts_and_one_thread_reads(app, tmp_path, monkeypatch):
    film(tmp_path / "film.nii")
    opened(app, tmp_path / "film.nii")
    reading, most = [], []
    read = choosing.open_volume

    def slow(name, options):
        reading.append(options.time)
        most.append(len(reading))
        try:
            for _ in range(5):
                time.sleep(0.01)
                options.progress(None, "reading")
            return read(name, options)
        finally:
            reading.remove(options.time)

    monkeypatch.setattr(choosing, "open_volume", slow)
    for wish in (1, 2, 3, 4, 2, 3):
        app.choosing.want({"time": wish})
        time.sleep(0.01)
        app.poll()
    run(app)
    assert app.scene.volume.info.time == 3
    assert max(most) == 1
    assert [s.label for s in app.history.steps] == ["Open film.nii", "Time 4"]


@pytest.mark.parametrize("back", [0, 1], ids=["to the open one", "to one shown before"])
def test_a_wish_taken_back_is_not_granted_later(app, tmp_path, monkeypatch, back):
    film(tmp_path / "film.nii")
    opened(app, tmp_path / "film.nii")
    for t in (1, 0):
        app.choosing.want({"time": t})
        run(app)
    go = threading.Event()
    read = choosing.open_volume

    def slow(name, options):
        assert go.wait(5)
        return read(name, options)

    monkeypatch.setattr(choosing, "open_volume", slow)
    app.choosing.want({"time": 3})
    app.poll()
    app.choosing.want({"time": back})
    assert app.choosing.wanted is None
    go.set()
    run(app)
    assert app.scene.volume.info.time == back


def test_a_film_plays_around_as_one_step(app, tmp_path, monkeypatch):
    monkeypatch.setattr(choosing, "INTERVAL", 0.01)
    film(tmp_path / "film.nii")
    opened(app, tmp_path / "film.nii")
    app.choosing.play(True)
    seen, end = [0], time.monotonic() + 200
    while len(seen) < TIMES + 3 and time.monotonic() < end:
        app.poll()
        app.settle()
        if app.scene.volume.info.time != seen[-1]:
            seen.append(app.scene.volume.info.time)
        time.sleep(0.002)
    assert seen == [0, 1, 2, 3, 4, 0, 1, 2]
    app.choosing.play(False)
    run(app)
    assert len(app.history.steps) == 2
    app.undo()
    assert app.scene.volume.info.time == 0


def test_what_cannot_be_read_stops_the_film_and_leaves_the_picture(app, tmp_path, monkeypatch):
    monkeypatch.setattr(choosing, "INTERVAL", 0.01)
    film(tmp_path / "film.nii")
    opened(app, tmp_path / "film.nii")
    kept = app.scene
    (tmp_path / "film.nii").unlink()
    app.choosing.play(True)
    end = time.monotonic() + 200
    while app.choosing.playing and time.monotonic() < end:
        app.poll()
        time.sleep(0.005)
    assert app.scene is kept
    assert app.choosing.wanted is None
    (told,) = [m for m in app.messages.all if m.level == "error"]
    assert (told.count, "film.nii" in told.text) == (1, True)


def test_cancel_gives_the_wish_up(app, tmp_path, monkeypatch):
    film(tmp_path / "film.nii")
    opened(app, tmp_path / "film.nii")

    def slow(name, options):
        while True:
            time.sleep(0.01)
            options.progress(0.1, "reading")

    monkeypatch.setattr(choosing, "open_volume", slow)
    app.choosing.want({"time": 2})
    app.cancel()
    run(app)
    assert app.scene.volume.info.time == 0
    assert not app.messages.all


def test_shown_times_are_kept_within_a_bound(app, tmp_path, monkeypatch):
    film(tmp_path / "film.nii")
    opened(app, tmp_path / "film.nii")
    each = choosing.held_bytes(app.scene.volume)
    monkeypatch.setattr(choosing, "KEPT_BYTES", 3 * each)
    for t in (1, 2, 3, 4):
        app.choosing.want({"time": t})
        run(app)
    kept = app.choosing._kept
    assert len(kept) == 3
    again = kept[("time", 3),]
    app.choosing.want({"time": 3})
    assert app.scene.volume is again, "not read a second time"
    np.save(tmp_path / "a.npy", np.zeros((3, 3, 3)))
    opened(app, tmp_path / "a.npy")
    assert not kept


# --- the panel -------------------------------------------------------------------------------


def test_the_panel_asks_for_another_time_and_channel(stage, app, tmp_path):
    film(tmp_path / "film.nii", channels=3)
    opened(app, tmp_path / "film.nii")
    one = stage(data.panel, app.scene, Facts())
    _, top, right, bottom = one.seen.where["part.time"]
    wish = one.click((right - 4, (top + bottom) / 2))
    assert wish.source.choices == (("time", TIMES - 1),)
    assert choosing.is_wish(app.scene, wish)
    one.scene = app.scene
    one.click("part.channel")
    one.frame(2)
    wish = one.click("part.channel.2")
    assert dict(wish.source.choices)["channel"] == 2


def test_the_panel_shows_what_is_wanted_and_the_series(stage, app, folder):
    opened(app, folder)
    listed = app.choosing.offer.parts
    app.choosing.take(listed[0])
    settle(app)
    one = stage(data.panel, app.scene, Facts(parts=listed))
    one.click("part.series")
    one.frame(2)
    wish = one.click("part.series.2")
    assert wish.source.choices == (("series", "2"),)


def test_volumes_without_a_source_have_no_such_rows(stage, scene):
    one = stage(data.panel, scene, Facts())
    assert scene.volume.info.times == 3
    assert "part.time" not in one.seen.where


def test_an_offer_is_made_only_where_nothing_was_chosen(folder):
    make = opening.maker(str(folder), lambda: 1.0, volviz.resolve.TextureLimits, series="9")
    with pytest.raises(volviz.VolvizError, match="no series matches"):
        make(volviz.progress.Progress())
