"""The Python surface: what people pass by mistake, copies, threads, and what is remembered."""

from __future__ import annotations

import copy
import gc
import pickle
import threading
import weakref
from dataclasses import replace

import numpy as np
import pytest

import volviz
from volviz import scene as scene_module
from volviz.errors import UnsupportedError, UsageError
from volviz.model.frame import MAX_STEPS
from volviz.resolve import MEMO, TextureLimits, resolve

INF, NAN = float("inf"), float("nan")


@pytest.fixture
def volume(rng):
    return volviz.Volume.from_array(rng.integers(0, 900, (9, 10, 11), np.int16))


@pytest.fixture
def scene(volume):
    return volviz.Scene.of(volume)


@pytest.mark.parametrize("size", [[24, 16], np.array([24, 16]), (np.int64(24), np.uint8(16))])
def test_sizes_of_any_whole_numbers(scene, size):
    assert volviz.render(scene, size, samples=np.int32(1)).pixels.shape == (16, 24, 4)


@pytest.mark.parametrize("size", [24, None, "24x16", (24.0, 16), (24,), (1, 2, 3), (0, 5), (-1, 5)])
def test_wrong_sizes_are_refused(scene, size):
    with pytest.raises(UsageError, match="size"):
        volviz.render(scene, size)


@pytest.mark.parametrize("samples", [0, -1, 2.5, "3", 5000])
def test_wrong_samples_are_refused(scene, samples):
    with pytest.raises(UsageError, match="--samples"):
        volviz.render(scene, (8, 8), samples=samples)


@pytest.mark.parametrize("thing", [np.zeros((2, 2, 2)), "head.nrrd", None])
def test_what_is_no_volume_says_how_to_get_one(thing):
    for call in (volviz.Scene.of, volviz.render):
        with pytest.raises(UsageError, match=r"volviz\.load"):
            call(thing)


def test_a_volume_draws_as_suggested(volume):
    drawn = volviz.render(volume, (40, 20), samples=1)
    scene = volviz.Scene.of(volume, aspect=2)
    assert np.array_equal(drawn.pixels, volviz.render(scene, (40, 20), samples=1).pixels)


@pytest.mark.parametrize(
    ("given", "word"),
    [
        ({"azimuth": INF}, "--azimuth"),
        ({"elevation": NAN}, "--elevation"),
        ({"azimuth": "left"}, "--azimuth"),
        ({"aspect": 0}, "aspect"),
        ({"aspect": NAN}, "aspect"),
        ({"view": 3}, "unknown view"),
        ({"preset": 3}, "preset"),
    ],
)
def test_wrong_wishes_are_refused(volume, given, word):
    with pytest.raises(UsageError, match=word):
        volviz.Scene.of(volume, **given)


@pytest.mark.parametrize("color", [(), (1, 2), ("red",), ((1, 0, 0),), (NAN, 0, 0)])
def test_wrong_backgrounds_are_refused(scene, color):
    with pytest.raises(UsageError, match="background"):
        scene.with_background(*color)


@pytest.mark.parametrize(
    "again", [copy.copy, copy.deepcopy, lambda s: pickle.loads(pickle.dumps(s))]
)
def test_copies_draw_the_same(scene, again):
    other = again(scene)
    assert not other.volume.data.flags.writeable
    assert not other.volume.affine.flags.writeable
    drawn = [volviz.render(s, (16, 16), samples=1).pixels for s in (scene, other)]
    assert np.array_equal(*drawn)


def test_scenes_are_equal_and_hash_by_what_they_show(scene, volume):
    assert scene == replace(scene) == volviz.Scene.of(volume)
    assert len({scene, replace(scene), scene.with_raycast(step=0.25)}) == 2


def test_image_tells_itself_in_one_line(scene):
    assert repr(volviz.render(scene, (8, 4), samples=1)).startswith("<Image 8×4 ")


def test_resolving_again_makes_nothing_again(scene):
    first = resolve(scene)
    again = resolve(replace(scene))
    turned = resolve(scene.with_camera(scene.camera.orbited(20)))
    for other in (again, turned):
        assert other.voxels is first.voxels
        assert other.table is first.table
        assert other.emptiness is first.emptiness
    dressed = resolve(scene.with_transfer(scene.transfer.faded(0.5)))
    assert dressed.voxels is first.voxels
    assert dressed.table is not first.table


def test_a_preset_that_warns_shares_what_is_known(volume):
    plain = volviz.Scene.of(volume)
    warned = volviz.Scene.of(volume, preset="ct-bone")
    assert any("Hounsfield" in w for w in warned.volume.info.warnings)
    assert resolve(warned).voxels is resolve(plain).voxels


def test_a_volume_that_is_reduced_is_not_encoded_whole(rng, monkeypatch):
    encoded = []
    true = scene_module.resolve.__globals__["encode"]
    monkeypatch.setitem(
        scene_module.resolve.__globals__,
        "encode",
        lambda volume, *a, **k: encoded.append(volume.dims) or true(volume, *a, **k),
    )
    volume = volviz.Volume.from_array(rng.integers(0, 900, (40, 40, 40), np.int16))
    frame = resolve(volviz.Scene.of(volume), limits=TextureLimits(max_bytes=2 * 20**3))
    assert encoded == [(20, 20, 20)]
    assert "resolution" in frame.notes[0]


def test_volumes_are_freed(rng):
    volume = volviz.Volume.from_array(rng.integers(0, 900, (16, 16, 16), np.int16))
    volviz.render(volviz.Scene.of(volume, preset="ct-bone"), (8, 8), samples=1)
    watched = weakref.ref(volume)
    del volume
    gc.collect()
    assert watched() is None
    assert all(v is not None for v in MEMO._answers)


def test_threads_draw_the_same_and_leave_no_renderer(scene):
    pictures = [volviz.render(scene, (24, 16), samples=2).pixels]
    before = len(scene_module._renderers)

    def work():
        pictures.append(volviz.render(scene, (24, 16), samples=2).pixels)

    for together in (1, 1, 3):
        threads = [threading.Thread(target=work) for _ in range(together)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    assert len(pictures) == 6
    assert all(np.array_equal(p, pictures[0]) for p in pictures)
    gc.collect()
    assert len(scene_module._renderers) == before


@pytest.mark.parametrize(
    "geometry",
    [
        {"spacing": 2.0},
        {"spacing": "abc"},
        {"spacing": (1e200, 1, 1)},
        {"origin": (0, 0)},
        {"origin": (INF, 0, 0)},
        {"direction": [1, 0, 0]},
        {"direction": np.ones((3, 3))},
        {"affine": np.eye(3)},
        {"affine": np.zeros((4, 4))},
        {"affine": np.full((4, 4), NAN)},
        {"affine": np.diag([1, 1, 1, 2])},
        {"space": "RAS"},
        {"kind": "label"},
    ],
)
def test_no_geometry_is_refused(geometry):
    with pytest.raises(UsageError):
        volviz.Volume.from_array(np.zeros((2, 3, 4)), **geometry)


@pytest.mark.parametrize(
    "geometry",
    [{"spacing": (1e-80, 1, 1e80)}, {"spacing": (1e99,) * 3}, {"origin": (1e30, 0, 0)}],
)
def test_grids_without_digits_left_are_refused(geometry):
    volume = volviz.Volume.from_array(np.zeros((12, 12, 12)), **geometry)
    with pytest.raises(UnsupportedError, match="cannot be drawn"):
        volviz.Scene.of(volume)
    scene = volviz.Scene.of(volviz.Volume.from_array(np.zeros((2, 2, 2))))
    with pytest.raises(UnsupportedError, match="cannot be drawn"):
        volviz.render(replace(scene, volume=volume))


@pytest.mark.parametrize("spacing", [1e-90, 1e-9, 1e6, 1e90])
def test_the_unit_of_length_does_not_show(rng, spacing):
    data = rng.integers(0, 900, (8, 8, 8), np.int16)
    drawn = [
        volviz.render(volviz.Volume.from_array(data, (s,) * 3), (32, 32), samples=2).pixels
        for s in (1.0, spacing)
    ]
    assert np.abs(drawn[0].astype(int) - drawn[1]).max() <= 1


def test_grids_far_longer_than_a_voxel_take_larger_steps_and_say_so(rng):
    data = rng.integers(0, 900, (20, 8, 8), np.int16)
    scene = volviz.Scene.of(volviz.Volume.from_array(data, (1, 1, 1e6)), view="left")
    frame = resolve(scene)
    assert frame.step == pytest.approx(20e6 / MAX_STEPS)
    assert any("step" in note for note in frame.notes)
    assert resolve(volviz.Scene.of(volviz.Volume.from_array(data))).step == 0.5


def test_masked_samples_are_not_measured(rng):
    data = rng.integers(0, 900, (4, 5, 6), np.int16)
    masked = volviz.Volume.from_array(np.ma.masked_less(data, 300))
    assert np.array_equal(np.isnan(masked.data), data < 300)
    assert volviz.Volume.from_array(np.ma.masked_less(data, 0)).data.dtype == np.int16


def test_ragged_rows_are_refused():
    with pytest.raises(UsageError, match="equally long"):
        volviz.Volume.from_array([[1], [1, 2]])


def test_tables_without_extent_and_beyond_floats(scene):
    dark, white = (0, 0, 0), (1, 1, 1)
    with pytest.raises(UsageError, match="too far apart"):
        volviz.TransferFunction([(-1e308, *dark), (1e308, *white)], [(0, 1)])
    thin = volviz.TransferFunction([(0, *dark), (5e-324, *white)], [(0, 0), (5e-324, 1)])
    assert volviz.render(scene.with_transfer(thin), (8, 8), samples=1).pixels.any()


def test_cameras_out_of_reach_draw_the_background(scene):
    away = replace(scene.camera, position=(1e300, 0, 0))
    drawn = volviz.render(scene.with_camera(away).with_background(0, 0, 0), (8, 8), samples=1)
    assert not drawn.pixels[..., :3].any()


def test_every_seed_is_another_one(scene):
    drawn = [
        volviz.render(scene.with_raycast(seed=s, step=2), (24, 24), samples=1).pixels.tobytes()
        for s in (0, 1, 1023, 1024, 2048, 1_000_000)
    ]
    assert len(set(drawn)) == len(drawn)
