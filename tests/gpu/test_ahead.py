"""Shaders compiled by a process beside the window: the same ones, in the driver's cache, once."""

from __future__ import annotations

import json
import os
import pickle
import subprocess
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import volviz
from volviz.gpu import ahead, ahead_child
from volviz.gpu.ahead import Ahead
from volviz.gpu.tiny import key_of, tiny
from volviz.model.frame import Frame
from volviz.model.surface_look import SceneSurface
from volviz.resolve import TextureLimits, resolve
from volviz.scene import Scene

ROOT = Path(__file__).resolve().parents[2]


def frame(dtype=np.int16, dims=(9, 16, 11), nan=False, surfaces=(), **knobs) -> Frame:
    """Of a small volume; dims as an array has them."""
    z, y, x = np.mgrid[tuple(slice(-1, 1, n * 1j) for n in dims)]
    data = (1000 * np.exp(-3 * (x * x + y * y + z * z))).astype(dtype)
    if nan:
        data[0, 0, 0] = np.nan
    scene = Scene.of(volviz.Volume.from_array(data)).with_knobs(samples=2, **knobs)
    return resolve(scene.with_surfaces(surfaces), limits=TextureLimits())


KINDS = {
    "plain": {},
    "power of two": {"dims": (8, 8, 8)},
    "float with NaN": {"dtype": np.float32, "nan": True},
    "phong": {"shading": "phong"},
    "unlit": {"shading": "none"},
    "mip": {"mode": "mip"},
    "nearest": {"interpolation": "nearest"},
    "opaque": {"surfaces": (SceneSurface.at(500.0),)},
    "translucent": {"surfaces": (SceneSurface.at(500.0, opacity=0.5, shading="flat"),)},
    "wires": {"surfaces": (SceneSurface.at(500.0, wireframe="overlay", sides="front"),)},
}


@pytest.mark.parametrize("kind", ["plain", "float with NaN", "mip", "translucent", "wires"])
def test_the_smallest_frame_takes_the_same_programs(gpu, kind):
    whole = frame(**KINDS[kind])
    small = pickle.loads(pickle.dumps(tiny(whole)))
    made = []
    for one in (whole, small):
        gpu.owned.programs.clear()
        ahead_child.draw(gpu, one)
        made.append(set(gpu.owned.programs))
    assert made[0] <= made[1]
    assert key_of(small) == key_of(whole)
    assert len(pickle.dumps(small)) < 3 * small.table.entries.nbytes + 20_000


def test_kinds_are_told_apart_and_numbers_are_not():
    keys = {kind: key_of(frame(**knobs)) for kind, knobs in KINDS.items()}
    assert len(set(keys.values())) == len(KINDS)
    plain = frame()
    assert key_of(replace(plain, camera=replace(plain.camera, fov=50.0))) == keys["plain"]
    cast = replace(plain.raycast, step=0.25, samples=9, jitter=0.0)
    assert key_of(replace(plain, raycast=cast)) == keys["plain"]


def test_neighbours_are_what_one_click_changes():
    one = frame()
    found = list(ahead.neighbours(one))
    assert {f.raycast.shading for f in found} == {"none", "phong", "blinn-phong"}
    assert {f.raycast.mode for f in found} == {"dvr", "mip"}
    assert len({key_of(f) for f in found}) < 12


class Child:
    """Answers as it is told to."""

    def __init__(self, answers: list[bytes]) -> None:
        self.answers, self.asked, self.killed = answers, [], False
        self.stdin = self.stdout = self
        self.go = threading.Event()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def write(self, content):
        self.asked.append(content)

    def flush(self):
        pass

    def close(self):
        pass

    def kill(self):
        self.killed = True

    def readline(self):
        self.go.wait(20)
        return self.answers.pop(0) if self.answers else b""


@pytest.fixture
def one(monkeypatch, tmp_path):
    """An `Ahead` with a child of ours; who calls `wake` sets `woken`."""
    monkeypatch.setattr(ahead, "LINGER", 0.05)
    monkeypatch.delenv(ahead.DISABLED[0], raising=False)
    woken = threading.Event()
    made = Ahead("renderer", woken.set, tmp_path)
    made.woken = woken
    made.child = Child([b"done\n"] * 99)
    monkeypatch.setattr(ahead, "_child", lambda: made.child)
    yield made
    made.child.go.set()
    made.close()


def until(what) -> None:
    end = time.monotonic() + 20
    while not what():
        assert time.monotonic() < end
        time.sleep(0.005)


def test_what_is_asked_for_is_ready_later_and_noted(one, tmp_path):
    plain = frame()
    assert not one.ready(plain)
    assert not one.ready(plain), "asked for once"
    assert not one.woken.is_set()
    one.child.go.set()
    until(lambda: one.ready(plain))
    assert one.woken.wait(20)
    assert len(one.child.asked) == 1
    until(lambda: one._worker is None)  # nothing to do: it ends
    assert Ahead("renderer", lambda: None, tmp_path).ready(plain)
    assert not Ahead("another", lambda: None, tmp_path)._done
    assert not one.ready(frame(mode="mip")), "another one is begun"
    until(lambda: len(one.child.asked) == 2)


def test_what_is_urgent_comes_first(one):
    one.look_ahead(frame())
    urgent = frame(dtype=np.float32)
    until(lambda: len(one.child.asked) == 1)
    one.ready(urgent)
    one.child.go.set()
    until(lambda: one.ready(urgent))
    until(lambda: one._worker is None)
    assert one.child.asked[1][0] == 0
    assert {content[0] for content in one.child.asked[2:]} == {1}
    assert pickle.loads(one.child.asked[1][9:]).voxels.array.dtype == np.float32


def test_without_help_the_window_compiles_by_itself(one):
    one.child.answers = []  # it died
    assert not one.ready(frame())
    one.child.go.set()
    until(lambda: one.ready(frame()))
    assert one.woken.wait(20)
    assert one.ready(frame(mode="mip"))


def test_patience_has_an_end(one, monkeypatch):
    monkeypatch.setattr(ahead, "PATIENCE", -1.0)
    assert one.ready(frame())


def test_no_child_can_be_started(one, monkeypatch):
    def none():
        raise FileNotFoundError("no Python")

    monkeypatch.setattr(ahead, "_child", none)
    assert not one.ready(frame())
    until(lambda: one.ready(frame()))


def test_a_driver_without_a_cache_is_left_alone(monkeypatch, tmp_path):
    monkeypatch.setenv(ahead.DISABLED[0], "true")
    assert Ahead("renderer", lambda: None, tmp_path).ready(frame())


def test_what_is_compiled_is_written_before_that_is_told(tmp_path, monkeypatch):
    """Mesa's writers have low priority: on a busy machine they come much later."""
    for number, name in ((1, "python"), (2, "a) b:disk$0")):
        (tmp_path / str(number)).mkdir()
        (tmp_path / str(number) / "stat").write_text(f"{number} ({name}) R 1 2 3")
    waiter = threading.Thread(target=ahead_child.wait_for_writers, args=(tmp_path,))
    waiter.start()
    waiter.join(0.1)
    assert waiter.is_alive(), "it did not wait"
    (tmp_path / "2" / "stat").write_text("2 (a) b:disk$0) S 1 2 3")
    waiter.join(4)
    assert not waiter.is_alive()
    (tmp_path / "2" / "stat").write_text("2 (a) b:disk$0) D 1 2 3")
    monkeypatch.setattr(ahead_child, "WRITING_SECONDS", 0.05)
    ahead_child.wait_for_writers(tmp_path)  # patience has an end
    ahead_child.wait_for_writers(tmp_path / "no such system")


SCRIPT = """
import json, os, sys, time
from pathlib import Path
from tests.gpu.test_ahead import KINDS, frame
from volviz.gpu import ahead_child, contexts
from volviz.gpu.ahead import Ahead

def made():
    return sum(p.is_file() for p in Path(os.environ["MESA_SHADER_CACHE_DIR"]).rglob("*"))

with contexts.open_gpu("egl") as gpu:
    frames = [frame(**KINDS[kind]) for kind in sys.argv[2:]]
    waited = Ahead("x", lambda: None, Path(sys.argv[1]))
    for one in frames:
        while not waited.ready(one):
            time.sleep(0.01)
    before = made()
    for one in frames:
        ahead_child.draw(gpu, one)
    ahead_child.wait_for_writers()
    ready = made()
    ahead_child.draw(gpu, frame(mode="mip"))
    print(json.dumps([gpu.software and "llvmpipe" in gpu.renderer, before, ready, made()]))
"""


def test_the_driver_finds_it_in_its_cache(tmp_path):
    """Mesa writes a file for all that it compiles: after the child, drawing adds none.

    Not for frames either that take the programs of those before in other states: rays to a layer,
    textures whose sides are powers of two.
    """
    kinds = ["plain", "translucent", "power of two"]
    environment = {
        **os.environ,
        "MESA_SHADER_CACHE_DIR": str(tmp_path / "mesa"),
        "PYTHONPATH": str(ROOT),
    }
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, str(tmp_path / "notes"), *kinds],
        capture_output=True, text=True, env=environment, cwd=ROOT, timeout=120, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    llvmpipe, before, ready, other = json.loads(done.stdout)
    if not llvmpipe or not before:
        pytest.skip("no llvmpipe with a cache in files")
    assert ready == before
    assert other > before, "nothing is ever written"
