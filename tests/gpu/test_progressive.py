"""The picture that gets better: the same as the still one in the end, in any framebuffer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.gpu import oracles
from tests.gpu import surface_oracles as so
from tests.gpu.oracles import Setup, looking, noise_volume
from volviz.gpu import progressive
from volviz.gpu.progressive import Progressive
from volviz.gpu.renderer import Renderer
from volviz.model.scene import Background

SIZE = (40, 30)


@pytest.fixture(scope="module")
def renderer(gpu):
    made = Renderer(gpu)
    yield made
    made.release()


@pytest.fixture
def picture(renderer):
    made = renderer.progressive()
    yield made
    made.release()


def a_frame(samples: int = 3, seed: int = 0):
    volume = noise_volume(seed=seed)
    setup = Setup(volume, oracles.smooth_transfer(), looking(volume))
    return setup.with_raycast(jitter=1.0, samples=samples).frame()


def drawn_into(gpu, picture, size) -> np.ndarray:
    target = gpu.framebuffer(size, "f1")
    try:
        target.clear(0.1, 0.9, 0.1, 0.5)
        picture.show(target)
        raw = np.frombuffer(target.read(components=4, alignment=1), np.uint8)
    finally:
        gpu.release_framebuffer(target)
    return raw.reshape(size[1], size[0], 4)[::-1]


def test_every_whole_sample_is_the_still_picture_of_so_many(renderer, picture, gpu):
    frame = a_frame()
    seen = []
    while not picture.state.done:  # a budget of nothing: one band at a time
        before = picture.state.samples
        state = picture.refine(frame, SIZE, 0.0)
        if state.samples > before:
            seen.append(state.samples)
        if state.samples:  # in the middle of the next sample too
            still = renderer.image(frame, SIZE, samples=state.samples)
            assert np.array_equal(picture.pixels(), still)
            assert np.array_equal(drawn_into(gpu, picture, SIZE), still)
    assert seen == [1, 2, 3]
    assert picture.refine(frame, SIZE, 1.0) is picture.state  # nothing is drawn any more


@pytest.mark.parametrize("change", ["background", "size", "coarse"])
def test_anything_else_begins_anew(picture, renderer, change):
    frame, size = a_frame(), SIZE
    picture.refine(frame, size, 60.0)
    assert picture.state.done
    if change == "background":
        frame = replace(frame, background=Background.plain((1, 1, 1)))
    elif change == "size":
        size = (31, 44)
    else:
        assert picture.coarse(frame, size, 0.02).samples == 0
    assert picture.refine(frame, size, 0.0).samples == 0
    picture.refine(frame, size, 60.0)
    assert np.array_equal(picture.pixels(), renderer.image(frame, size))


def test_coarse_is_a_cheaper_picture_of_the_same_in_any_framebuffer(picture, renderer, gpu):
    frame = a_frame()
    picture.coarse(frame, SIZE, 0.02)
    assert 0 < picture.state.rays < 0.5
    drawn = drawn_into(gpu, picture, SIZE).astype(int)
    still = renderer.image(frame, SIZE).astype(int)
    empty = renderer.image(replace(frame, camera=frame.camera.dollied(1e-3)), SIZE).astype(int)
    off, nothing = np.abs(drawn - still).mean(), np.abs(empty - still).mean()
    assert 0 < off < 0.4 * nothing


def test_a_picture_owns_what_it_makes_and_frees_it(renderer, gpu):
    renderer.release()
    before = gpu.live
    made = renderer.progressive()
    made.coarse(a_frame(), SIZE, 0.02)
    made.refine(a_frame(), SIZE, 60.0)
    assert gpu.live["framebuffers"] == before["framebuffers"] + 4
    made.release()
    renderer.release()
    assert {**gpu.live, "programs": 0} == {**before, "programs": 0}


@pytest.mark.parametrize("size", [(40, 30), (41, 27), (64, 33), (1, 5), (2, 1)])
@pytest.mark.parametrize("samples", [1, 3])
def test_a_slow_picture_gets_one_in_between_that_is_a_part_of_it(renderer, gpu, size, samples):
    frame = a_frame(samples=samples)
    picture = Progressive(gpu, renderer.resident, between=0.0)
    picture.rays = 0.2
    assert picture.coarse(frame, size, 1.0).rays == 0.2
    rays, cast = set(), 0
    while not picture.state.done:
        state = picture.refine(frame, size, 0.0)
        rays.add(state.rays)
        if state.rays == progressive.BETWEEN and size == SIZE:
            half = renderer.image(frame, (size[0] // 2, size[1] // 2), samples=1)
            large = drawn_into(gpu, picture, size).astype(int)
            assert abs(large[1::2, 1::2].mean() - half.mean()) < 2
        if state.samples:
            still = renderer.image(frame, size, samples=state.samples)
            assert np.array_equal(picture.pixels(), still)
        cast += 1
    assert rays >= {progressive.BETWEEN, 1.0}
    assert cast >= 4
    picture.release()


def test_surfaces_in_between_are_drawn_anew(renderer, gpu):
    frame = replace(a_frame(samples=2), meshes=(so.drawn(so.sphere(6.0), opacity=0.5),))
    picture = Progressive(gpu, renderer.resident, between=0.0)
    picture.rays = 0.2
    picture.coarse(frame, SIZE, 1.0)
    rays = set()
    while not picture.state.done:
        rays.add(picture.refine(frame, SIZE, 0.0).rays)
    assert rays >= {progressive.BETWEEN, 1.0}
    assert np.array_equal(picture.pixels(), renderer.image(frame, SIZE, samples=2))
    picture.release()


def test_the_step_while_things_move_does_not_swing_with_the_rays(picture):
    """Fewer rays, larger steps; but each step is another table, so small changes change nothing."""
    steps = [picture._coarse_step(rays) for rays in (1.0, 0.5, 0.3, 0.2, 0.1)]
    assert steps == sorted(steps)
    assert (steps[0], steps[-1]) == (1.0, 3.0)
    for middle in np.linspace(0.15, 0.9, 40):
        near = [picture._coarse_step(middle + d) for d in (0.0, 0.02, -0.02, 0.02, -0.02, 0.0)]
        assert len(set(near[2:])) == 1, middle
    frame = replace(a_frame())
    picture.rays = 0.2
    assert picture.coarse(frame, SIZE, 0.01).step == picture._step == 2.5
