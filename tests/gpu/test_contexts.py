"""Opening OpenGL: what was asked for, contexts side by side, the shared ones."""

from __future__ import annotations

import os
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from volviz.errors import GraphicsError, UsageError
from volviz.gpu import contexts, contexts_egl
from volviz.gpu.checked import Gpu
from volviz.gpu.contexts import close_shared, open_gpu, parse_backend, shared_gpu


@pytest.fixture(autouse=True)
def _no_backend_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(contexts.BACKEND_VARIABLE, raising=False)


def test_egl_device_is_open_probed_and_described() -> None:
    with open_gpu("egl") as gpu:
        assert gpu.rung == "egl"
        assert gpu.code >= 330
        assert gpu.limits.max_texture_3d >= 256
        assert gpu.renderer in [a.renderer for a in gpu.attempts if a.ok]
        assert gpu.because == "asked for"
        target = gpu.framebuffer((2, 2))
        target.clear(1.0, 0.0, 0.0, 1.0)
        assert target.read(components=4)[:4] == b"\xff\x00\x00\xff"
    assert gpu.released


def test_auto_says_why() -> None:
    with open_gpu() as gpu:
        assert gpu.because not in ("", "asked for")


def test_open_and_close_twenty_times_neither_leaks_nor_crashes() -> None:
    def resident() -> int:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
        return pages * os.sysconf("SC_PAGE_SIZE")

    def once() -> None:
        gpu = open_gpu("egl")
        texture = gpu.texture3d((128, 128, 128), 1, "nu2", linear=True)
        gpu.upload3d(texture, np.ones((128, 128, 128), np.uint16))
        gpu.release()

    for _ in range(3):
        once()
    before = resident()
    for _ in range(20):
        once()
    for _ in range(20):  # a thread that ends must not take its context with it
        worker = threading.Thread(target=once)
        worker.start()
        worker.join()
    assert resident() - before < 40 << 20


def test_contexts_side_by_side_keep_their_textures() -> None:
    gpus = [open_gpu("egl") for _ in range(3)]
    textures = [gpu.texture3d((2, 2, 2), 1, "f4", linear=False) for gpu in gpus]
    for value, (gpu, texture) in enumerate(zip(gpus, textures, strict=True)):
        gpu.upload3d(texture, np.full((2, 2, 2), value, np.float32))
    gpus[1].release()
    for value, (gpu, texture) in enumerate(zip(gpus, textures, strict=True)):
        if not gpu.released:
            gpu.activate()
            assert np.frombuffer(texture.read(), np.float32).tolist() == [value] * 8
    for gpu in gpus:
        gpu.release()
        gpu.release()


def test_dropped_texture_of_one_context_does_not_delete_another_ones() -> None:
    with open_gpu("egl") as a, open_gpu("egl") as b:
        lost = a.texture3d((2, 2, 2), 1, "nu1", linear=True)
        kept = b.texture3d((2, 2, 2), 1, "nu1", linear=True)
        b.upload3d(kept, np.full((2, 2, 2), 7, np.uint8))
        assert lost.glo == kept.glo  # the same name in two contexts
        del lost
        b.activate()
        assert kept.read() == b"\x07" * 8
        assert a.live["textures"] == 0
        a.activate()


@pytest.mark.parametrize(
    ("backend", "device", "rungs", "chosen"),
    [
        (None, None, contexts.RUNGS, None),
        ("auto", None, contexts.RUNGS, None),
        ("EGL", None, ("egl",), None),
        ("egl:1", None, ("egl",), 1),
        ("egl:NVIDIA RTX", None, ("egl",), "NVIDIA RTX"),
        ("auto", "2", ("egl",), 2),
        ("glfw-osmesa", None, ("glfw-osmesa",), None),
        ("none", None, (), None),
    ],
)
def test_parse_backend(
    backend: str | None, device: str | None, rungs: tuple[str, ...], chosen: Any
) -> None:
    request = parse_backend(backend, device)
    assert (request.rungs, request.device) == (rungs, chosen)


@pytest.mark.parametrize(
    ("backend", "words"),
    [
        ("elg", "did you mean 'egl'"),
        ("glfw-os", "did you mean 'glfw-osmesa'"),
        ("vulkan", "choose one of"),
        ("glfw-egl:1", "no devices"),
    ],
)
def test_wrong_backend_is_a_usage_error(backend: str, words: str) -> None:
    with pytest.raises(UsageError, match=words):
        open_gpu(backend)


def test_wrong_backend_in_the_environment_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("VOLVIZ_BACKEND", "elg")
    with pytest.raises(UsageError, match=r"VOLVIZ_BACKEND.*did you mean 'egl'"):
        open_gpu()


def test_unknown_device_is_a_usage_error() -> None:
    with pytest.raises(UsageError, match="no EGL device 99"):
        open_gpu("egl:99")
    with pytest.raises(UsageError, match="called 'voodoo 2'"):
        open_gpu("egl", device="voodoo 2")


def test_device_by_part_of_its_name() -> None:
    with open_gpu("egl") as gpu:
        name = gpu.renderer
    with open_gpu(f"egl:{name[:6].upper()}") as again:
        assert again.renderer == name


def test_backend_none_stands_for_no_opengl() -> None:
    with pytest.raises(GraphicsError, match="'none'") as caught:
        open_gpu("none")
    assert caught.value.exit_code == 5


def test_hardware_goes_before_software(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[int] = []
    real = contexts_egl.create

    def create(index: int) -> Any:
        made.append(index)
        if index == 1:
            raise GraphicsError("device 1: eglInitialize failed (0x3001)")
        return real(0)

    adopt = contexts.adopt

    def disguised(*args: Any, **kwargs: Any) -> Gpu:
        gpu = adopt(*args, **kwargs)
        object.__setattr__(gpu, "software", gpu.device != 2)
        return gpu

    monkeypatch.setattr(contexts_egl, "device_count", lambda: 4)
    monkeypatch.setattr(contexts_egl, "create", create)
    monkeypatch.setattr(contexts, "adopt", disguised)
    with open_gpu() as gpu:
        assert gpu.device == 2
        assert made == [0, 1, 2]
        assert [a.ok for a in gpu.attempts] == [True, False, True]
        assert "0x3001" in gpu.attempts[1].reason
        assert gpu.because == "the first hardware device that passed the probe"
        gpu.framebuffer((1, 1))


def test_ladder_falls_to_the_next_rung(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(index: int) -> Any:
        raise GraphicsError(f"device {index}: eglInitialize failed (0x3001)")

    monkeypatch.setattr(contexts_egl, "create", broken)
    with open_gpu() as gpu:
        assert gpu.rung in ("glfw-egl", "glfw-osmesa")
        assert "egl: device 0: eglInitialize failed" in gpu.because
        gpu.texture3d((3, 3, 3), 1, "f4", linear=True)


def test_probe_that_reads_back_wrong_fails_the_device(monkeypatch: pytest.MonkeyPatch) -> None:
    def wrong(gpu: Gpu) -> None:
        raise GraphicsError("does not draw")

    monkeypatch.setattr(contexts, "_probe", wrong)
    with pytest.raises(GraphicsError, match=r"egl: does not draw.*libegl1 libgl1-mesa-dri"):
        open_gpu("egl")


# --- shared ----------------------------------------------------------------------------------


def test_shared_gpu_is_one_per_backend(gpu: Gpu) -> None:
    assert shared_gpu() is shared_gpu("auto")
    assert shared_gpu("egl") is shared_gpu("egl:") is not shared_gpu()
    shared_gpu("egl").release()
    assert not shared_gpu("egl").released
    shared_gpu().activate()


def test_shared_gpu_of_another_thread_is_another_and_closes_with_it(gpu: Gpu) -> None:
    seen: list[Gpu] = []

    def work() -> None:
        seen.append(shared_gpu())
        seen[0].texture3d((2, 2, 2), 1, "f4", linear=True)

    mine = shared_gpu()
    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert seen[0] is not mine
    assert seen[0].released
    mine.texture3d((2, 2, 2), 1, "f4", linear=True).release()


def test_close_shared_closes_and_the_next_opens_again() -> None:
    outcome: list[bool] = []

    def work() -> None:
        first = shared_gpu()
        close_shared()
        outcome.extend([first.released, shared_gpu() is not first])

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert outcome == [True, True]
