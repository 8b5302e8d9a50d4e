"""A still drawn in bands is the picture drawn in tiles, and it can be given up."""

from __future__ import annotations

import time

import numpy as np
import pytest

from volviz import Scene
from volviz.errors import UsageError
from volviz.gpu import still
from volviz.gpu.renderer import Renderer
from volviz.gpu.still import Still
from volviz.resolve import resolve
from volviz.samples import sample


@pytest.fixture(scope="module")
def frame():
    scene = Scene.of(sample("marschner-lobb", size=24)).with_raycast(samples=3)
    return resolve(scene)


@pytest.mark.parametrize("size", [(97, 61), (1, 1), (1, 300), (400, 3)])
def test_bands_do_not_show(gpu, frame, size, monkeypatch):
    monkeypatch.setattr(still, "WIDEST", 64)
    renderer = Renderer(gpu)
    wanted = renderer.image(frame, size)
    one = Still(gpu, renderer.resident, frame, size)
    calls, before = 0, 0.0
    while not one.advance(1e-4):
        calls += 1
        assert one.fraction >= before
        before = one.fraction
    assert one.fraction == 1.0
    assert np.array_equal(one.pixels, wanted)
    renderer.release()
    assert calls > 3 or size == (1, 1)


def test_it_is_given_up_at_once_and_leaves_nothing(gpu, frame):
    renderer = Renderer(gpu)
    before = gpu.live["framebuffers"]
    one = Still(gpu, renderer.resident, frame, (3000, 2000))
    one.advance(0.0)  # one sample of three: in the middle of a band
    start = time.perf_counter()
    one.release()
    assert time.perf_counter() - start < 0.5
    assert 0 < one.fraction < 1
    assert gpu.live["framebuffers"] == before
    renderer.release()


def test_sizes_are_checked(gpu, frame):
    with pytest.raises(UsageError, match="cannot be drawn"):
        Still(gpu, Renderer(gpu).resident, frame, (1 << 15, 1 << 15))
