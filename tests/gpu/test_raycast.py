from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.gpu import oracles
from tests.gpu.oracles import GRIDS, PROJECTIONS, Setup, light_of, looking, noise_volume
from volviz.fields.bricks import bricks, emptiness
from volviz.gpu.passes.raycast import GRADIENTS, MODES, SHADINGS
from volviz.gpu.renderer import SAMPLES_PER_DRAW, Renderer
from volviz.model import scene as model_scene
from volviz.model.scene import Background, box_corners
from volviz.model.transfer import TransferFunction
from volviz.model.volume import Volume
from volviz.resolve import resolve
from volviz.scene import Scene

GRID_AND_PROJECTION = [(g, p) for g in GRIDS for p in PROJECTIONS]


@pytest.fixture(scope="module")
def renderer(gpu):
    made = Renderer(gpu)
    yield made
    made.release()


@pytest.mark.parametrize(("grid", "projection"), GRID_AND_PROJECTION)
@pytest.mark.parametrize(
    "check",
    [
        oracles.check_integral,
        oracles.check_constant_medium,
        oracles.check_linear_ramp,
        oracles.check_sphere_chords,
        oracles.check_single_voxel,
    ],
)
def test_closed_forms(renderer, check, grid, projection):
    check(renderer, grid, projection)


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("interpolation", ["nearest", "linear"])
def test_mip_is_max(renderer, axis, interpolation):
    oracles.check_mip_is_max(renderer, axis, interpolation)


@pytest.mark.parametrize("grid", GRIDS)
@pytest.mark.parametrize("shading", ["phong", "blinn-phong"])
@pytest.mark.parametrize("gradient", GRADIENTS)
def test_shaded_sphere(renderer, grid, shading, gradient):
    oracles.check_shaded_sphere(renderer, grid, shading, gradient)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("shading", SHADINGS)
def test_every_mode_and_shading_draws_something(renderer, mode, shading):
    volume = noise_volume()
    setup = Setup(volume, oracles.smooth_transfer(), looking(volume))
    drawn = light_of(renderer, setup.with_raycast(mode=mode, shading=shading))
    assert np.isfinite(drawn).all()
    assert 0 < drawn[..., 3].max() <= 1 + 1e-6
    assert drawn.std() > 0.01


def test_registries_agree_with_the_model():
    assert tuple(MODES) == model_scene.MODES
    assert tuple(SHADINGS) == model_scene.SHADINGS


def test_halved_step_is_the_same_picture(renderer):
    volume, radius, _ = oracles.sphere_volume("anisotropic")
    transfer = TransferFunction(
        ((0, 1, 0.5, 0.2), (radius, 0.2, 0.5, 1)), ((0, 0.0), (radius, 0.3))
    )
    setup = Setup(volume, transfer, looking(volume))
    coarse, fine, finest = (
        light_of(renderer, setup.with_raycast(step=s)) for s in (0.5, 0.25, 0.125)
    )
    assert np.abs(coarse - fine).max() < 2e-3
    assert np.abs(fine - finest).max() < np.abs(coarse - fine).max()


def test_spacing_scaled_with_unit_distance_is_the_same_picture(renderer):
    pictures = []
    for scale in (1.0, 1e-4, 1e6):
        affine = GRIDS["oblique"].copy()
        affine[:3] *= scale
        volume = noise_volume(affine=affine)
        transfer = oracles.smooth_transfer(unit=2.0 * scale)
        pictures.append(light_of(renderer, Setup(volume, transfer, looking(volume))))
    assert np.abs(pictures[0] - pictures[1]).max() < 1e-3
    assert np.abs(pictures[0] - pictures[2]).max() < 1e-3


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_flipped_axis_is_the_same_picture(renderer, axis):
    """Stored the other way round, with the affine that says so: the same picture."""
    volume = noise_volume(affine=GRIDS["oblique"])
    affine = volume.affine.copy()
    affine[:3, 3] += affine[:3, axis] * (volume.dims[axis] - 1)
    affine[:3, axis] *= -1
    flipped = Volume.from_array(np.flip(volume.data, 2 - axis), affine=affine)
    setup = Setup(volume, oracles.smooth_transfer(), looking(volume)).with_raycast(
        shading="blinn-phong"
    )
    difference = light_of(renderer, setup) - light_of(renderer, replace(setup, volume=flipped))
    assert np.abs(difference).max() < 1e-3


def test_mirrored_volume_and_camera_mirror_the_picture(renderer):
    volume = noise_volume()
    mirrored = Volume.from_array(volume.data[:, :, ::-1])
    transfer = oracles.smooth_transfer()
    here = light_of(renderer, Setup(volume, transfer, looking(volume, azimuth=30)))
    there = light_of(renderer, Setup(mirrored, transfer, looking(mirrored, azimuth=-30)))
    assert np.abs(here - there[:, ::-1]).max() < 1e-3


def test_camera_inside_the_volume(renderer):
    volume = Volume.from_array(np.ones((20, 20, 20), np.float32))
    transfer = TransferFunction(((0, 1, 1, 1),), ((0, 0.1), (1, 0.1)), 1.0)
    camera = replace(
        looking(volume, azimuth=0, elevation=0), position=(9.5, 9.5, 9.5), target=(9.5, 19.5, 9.5)
    )
    drawn = light_of(renderer, Setup(volume, transfer, camera), (9, 9))
    assert drawn[4, 4, 3] == pytest.approx(1 - 0.9**10, abs=1e-4)  # from the middle to the wall


def test_jitter_is_seeded_and_repeatable(renderer):
    volume = noise_volume()
    setup = Setup(volume, oracles.smooth_transfer(), looking(volume)).with_raycast(jitter=1.0)
    first, again = light_of(renderer, setup), light_of(renderer, setup)
    other = light_of(renderer, setup.with_raycast(seed=7))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


def test_accumulated_jitter_converges_to_the_fine_picture(renderer):
    volume = noise_volume()
    setup = Setup(volume, oracles.smooth_transfer(), looking(volume))
    fine = light_of(renderer, setup.with_raycast(step=0.02))
    coarse = setup.with_raycast(step=1.0, jitter=1.0).frame()
    one, many = (renderer.light(coarse, (24, 24), samples=n, antialias=False) for n in (1, 64))
    assert np.abs(many - fine).mean() < 0.35 * np.abs(one - fine).mean()


def test_early_termination_costs_less_than_a_grey_level(renderer):
    volume, radius, _ = oracles.sphere_volume()
    transfer = TransferFunction(
        ((0, 1, 0.5, 0.2), (radius, 0.2, 0.5, 1)), ((0, 0.0), (radius, 0.9))
    )
    setup = Setup(volume, transfer, looking(volume))
    ended = light_of(renderer, setup.with_raycast(termination=1 - 1 / 255))
    assert np.abs(ended - light_of(renderer, setup)).max() < 1 / 255


def test_tiles_do_not_show(renderer, monkeypatch):
    volume = noise_volume()
    frame = (
        Setup(volume, oracles.smooth_transfer(), looking(volume)).with_raycast(jitter=1.0).frame()
    )
    whole = renderer.image(frame, (70, 50), samples=2)
    monkeypatch.setattr("volviz.gpu.renderer.TILE", 32)
    assert np.array_equal(whole, renderer.image(frame, (70, 50), samples=2))


def test_empty_transfer_function_shows_the_background_alone(renderer):
    volume = noise_volume()
    clear = TransferFunction(((0, 1, 1, 1),), ((0, 0.0), (1, 0.0)))
    frame = Setup(volume, clear, looking(volume)).frame()
    for color in ((0.2, 0.4, 0.6, 1.0), (0.0, 0.0, 0.0, 0.0), (1.0, 0.5, 0.25, 0.5)):
        shown = renderer.image(
            replace(frame, background=Background.plain(color)), (8, 8), samples=1
        )
        expected = np.round(np.array(color) * 255).astype(np.uint8)
        if color[3] == 0:
            assert (shown == 0).all()
        else:
            assert np.abs(shown.astype(int) - expected).max() <= 1


def test_nothing_leaks(gpu):
    before = gpu.live
    for seed in range(5):
        volume = noise_volume(seed=seed)
        made = Renderer(gpu)
        made.image(Setup(volume, oracles.smooth_transfer(), looking(volume)).frame(), (20, 20))
        made.release()
    after = gpu.live
    assert {k: after[k] for k in ("textures", "framebuffers")} == {
        k: before[k] for k in ("textures", "framebuffers")
    }


def test_whole_box_is_in_the_picture():
    for grid in GRIDS.values():
        volume = noise_volume(affine=grid)
        for projection in PROJECTIONS:
            camera = looking(volume, projection)
            seen = np.array([oracles.pixel_of(camera, c, (100, 100)) for c in box_corners(volume)])
            assert seen.min() > -0.5
            assert seen.max() < 99.5
            assert np.ptp(seen, axis=0).max() > 90


@pytest.mark.parametrize(("grid", "projection"), GRID_AND_PROJECTION)
def test_leaping_over_empty_bricks_changes_nothing(renderer, grid, projection):
    rng = np.random.default_rng(5)
    data = np.zeros((21, 30, 26), np.float32)
    for z, y, x in rng.integers(0, 20, (12, 3)):
        data[z, y, x] = rng.random()
    volume = Volume.from_array(data, affine=GRIDS[grid])
    transfer = TransferFunction(((0, 1, 1, 1),), ((0.1, 0), (0.4, 0.5), (1, 1)), 1.0)
    setup = Setup(volume, transfer, looking(volume, projection)).with_raycast(jitter=1.0, step=0.31)
    frame = setup.frame()
    empty = emptiness(bricks(frame.voxels), frame.voxels, frame.table)
    assert 0 < empty.shown < 0.5
    for zoom in (1.0, 2.0, 6.0):  # from outside to within
        camera = frame.camera.dollied(zoom)
        every, leapt = (
            renderer.light(replace(frame, camera=camera, emptiness=e), (40, 40), antialias=False)
            for e in (None, empty)
        )
        assert every[..., 3].max() > 0.05 or zoom > 1
        assert np.array_equal(every, leapt)


@pytest.mark.parametrize(("step", "mode"), [(0.01, "mip"), (0.5, "dvr"), (16.0, "dvr")])
def test_no_draw_takes_longer_than_a_cancel_can_wait(renderer, gpu, step, mode):
    frame = resolve(Scene.of(Volume.from_array(np.zeros((64, 64, 2048), np.uint8)), mode=mode))
    frame = replace(frame, raycast=replace(frame.raycast, step=step))
    tiles = [view.tile for view, _ in renderer._tiles(frame, (1000, 700))]
    most = SAMPLES_PER_DRAW * (1 if gpu.software else 64)
    covered = np.zeros((700, 1000), int)
    for x, y, w, h in tiles:
        covered[y : y + h, x : x + w] += 1
        assert w * h <= 16 * 16 or w * h * 2048 / step <= most
    assert np.all(covered == 1)
