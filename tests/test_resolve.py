"""Scene to frame: what is at hand, what is made once, and that nobody waits for another."""

from __future__ import annotations

import threading
import time
from dataclasses import replace

import numpy as np
import pytest

import volviz
from volviz.app.frames import Frames
from volviz.errors import VolvizError
from volviz.model.transfer import TransferFunction
from volviz.resolve import Memo, TextureLimits, known_statistics, ready, resolve, statistics_at_hand

LIMITS = TextureLimits()


def a_scene(seed: int = 0) -> volviz.Scene:
    data = np.random.default_rng(seed).integers(0, 900, (9, 10, 11)).astype(np.int16)
    return volviz.Scene.of(volviz.Volume.from_array(data, name=f"noise{seed}"))


def test_ready_is_true_when_nothing_slow_is_left(monkeypatch):
    scene, memo = a_scene(), Memo()
    small = replace(LIMITS, max_bytes=600)
    assert not ready(scene, memo, limits=LIMITS)
    assert statistics_at_hand(scene.volume, memo) is None
    known_statistics(scene.volume, memo)
    assert not ready(scene, memo, limits=LIMITS)
    resolve(scene, memo, limits=LIMITS)
    assert ready(scene, memo, limits=LIMITS)
    assert not ready(scene, memo, limits=small)
    resolve(scene, memo, limits=small)
    other = TransferFunction(((0, 1, 1, 1),), ((100, 0), (300, 1)), 1.0)
    for name in ("encode", "bricks", "reduced", "statistics"):
        monkeypatch.setattr(f"volviz.resolve.{name}", lambda *_, **__: pytest.fail("slow work"))
    for limits in (LIMITS, small):
        turned = scene.with_transfer(other).with_camera(scene.camera.orbited(20))
        assert ready(turned, memo, limits=limits)
        resolve(turned, memo, limits=limits)


def test_who_makes_one_answer_does_not_hold_up_another():
    memo, volume = Memo(), a_scene().volume
    go, begun = threading.Event(), threading.Event()

    def slow():
        begun.set()
        assert go.wait(10)
        return 1

    worker = threading.Thread(target=memo.get, args=(volume, "slow", slow))
    worker.start()
    assert begun.wait(10)
    assert memo.get(volume, "quick", lambda: 2) == 2
    assert memo.known(volume, "slow") is None
    go.set()
    worker.join()
    assert memo.known(volume, "slow") == 1
    assert memo.get(volume, "slow", lambda: pytest.fail("made twice")) == 1


def test_an_answer_that_failed_is_made_again():
    memo, volume = Memo(), a_scene().volume
    with pytest.raises(ZeroDivisionError):
        memo.get(volume, "x", lambda: 1 // 0)
    assert memo.known(volume, "x") is None
    assert memo.get(volume, "x", lambda: 3) == 3


def test_the_frame_before_stays_until_the_new_one_is_there(monkeypatch):
    woken = threading.Event()
    frames = Frames(woken.set)
    first = a_scene(1)
    resolve(first, limits=LIMITS)
    shown = frames.follow(first, LIMITS)
    assert shown is not None
    assert frames.job is None
    second = a_scene(2)
    assert frames.follow(second, LIMITS) is shown
    assert frames.scene is first
    assert frames.job is not None
    assert woken.wait(10)
    while frames.scene is not second:
        frames.follow(second, LIMITS)
    assert frames.frame is not shown
    assert frames.job is None


def test_what_goes_wrong_beside_is_raised_once_and_the_frame_stays(monkeypatch):
    frames = Frames(lambda: None)
    first, second = a_scene(1), a_scene(2)
    resolve(first, limits=LIMITS)
    shown = frames.follow(first, LIMITS)

    def broken(*_, **__):
        raise ZeroDivisionError("planted")

    monkeypatch.setattr("volviz.resolve.encode", broken)
    assert frames.follow(second, LIMITS) is shown
    while not frames.job.finished:
        time.sleep(0.001)
    with pytest.raises(VolvizError, match="planted"):
        frames.follow(second, LIMITS)
    assert frames.frame is shown
