"""Volumes on their way to the GPU: a slab at a time, resumed, replaced, cancelled."""

from __future__ import annotations

import numpy as np
import pytest

from volviz.errors import Cancelled, LimitError
from volviz.gpu import checked, formats
from volviz.gpu.residency import Residency
from volviz.model.frame import Voxels
from volviz.progress import Progress


def voxels(seed: int = 0) -> Voxels:
    array = np.random.default_rng(seed).integers(0, 65536, (12, 5, 7)).astype(np.uint16)
    return Voxels(array, 65535.0, 0.0)


@pytest.fixture
def resident(gpu, monkeypatch):
    monkeypatch.setattr(formats, "SLAB_BYTES", 5 * 7 * 2)  # a slice
    made = Residency(gpu)
    before = gpu.live["textures"]
    yield made
    made.release()
    assert gpu.live["textures"] == before


def test_a_budget_of_nothing_is_a_slab_at_a_time(resident, gpu):
    one = voxels()
    assert resident.upload(one, 0.0) == 0.0  # room was made
    parts = [resident.upload(one, 0.0) for _ in range(12)]
    assert parts == pytest.approx([(i + 1) / 12 for i in range(12)])
    count = gpu.live["textures"]
    assert resident.upload(one, 0.0) == 1.0
    texture = resident.volume(one, linear=True)
    assert np.array_equal(np.frombuffer(texture.read(), np.uint16).reshape(12, 5, 7), one.array)
    assert gpu.live["textures"] == count


def test_another_volume_takes_the_place_of_one_on_its_way(resident, gpu):
    one, two = voxels(1), voxels(2)
    before = gpu.live["textures"]
    for volume in (one, one, two, two, one):
        resident.upload(volume, 0.0)
        assert gpu.live["textures"] == before + 1
    texture = resident.volume(two, linear=False)
    assert np.array_equal(np.frombuffer(texture.read(), np.uint16).reshape(12, 5, 7), two.array)
    assert gpu.live["textures"] == before + 1


def test_what_is_asked_for_now_comes_with_progress_and_can_be_cancelled(resident, gpu, monkeypatch):
    monkeypatch.setattr("volviz.gpu.residency.SECONDS", 0.0)
    before = gpu.live["textures"]
    seen = []

    def report(fraction, message):
        seen.append(fraction)
        if len(seen) == 5:
            progress.cancel()

    progress = Progress(report)
    with pytest.raises(Cancelled):
        resident.volume(voxels(), linear=True, progress=progress)
    assert seen == sorted(seen)
    assert gpu.live["textures"] == before


def test_a_slab_that_fails_frees_the_texture(resident, gpu, monkeypatch):
    one = voxels()
    before = gpu.live["textures"]
    resident.upload(one, 0.0)
    resident.upload(one, 0.0)

    def full(self, errors, what):
        raise LimitError(f"{what}: full")

    with monkeypatch.context() as patched:
        patched.setattr(checked.Gpu, "_raise_for", full)
        with pytest.raises(LimitError):
            resident.upload(one, 0.0)
    assert gpu.live["textures"] == before
    assert resident.upload(one, 60.0) == 1.0


def test_two_owners_do_not_fight_for_the_place(resident, gpu):
    view, picture = Owner(), Owner()
    one, two = voxels(1), voxels(2)
    before = gpu.live["textures"]
    parts = []
    for _ in range(14):  # in turns, as a view and a picture for a file are drawn
        parts.append((resident.upload(one, 0.0, view), resident.upload(two, 0.0, picture)))
    assert parts[-1] == (1.0, 1.0)
    assert gpu.live["textures"] == before + 2
    resident.forget(picture)
    assert gpu.live["textures"] == before + 1
    assert resident.upload(one, 0.0, view) == 1.0
    resident.upload(two, 60.0, view)  # the view gives up the one before
    assert gpu.live["textures"] == before + 1


class Owner:
    """Whoever draws."""
