from __future__ import annotations

import os
import shutil
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from volviz.errors import GraphicsError, UsageError
from volviz.gpu import contexts, contexts_egl, contexts_glfw
from volviz.gpu.checked import Gpu
from volviz.gpu.contexts import close_shared, open_gpu, parse_backend, shared_gpu

# Opens what the environment asks for and tells the outcome in one line.
TRY = """
import sys
from volviz.errors import VolvizError
from volviz.gpu.contexts import open_gpu
try:
    with open_gpu() as gpu:
        print(gpu.rung, gpu.renderer, sep="|")
except VolvizError as error:
    print(error, file=sys.stderr)
    sys.exit(error.exit_code)
"""

# A real window's context; while it is open, GLFW has no other platform.
WINDOW = """
from volviz.errors import GraphicsError
from volviz.gpu.contexts import open_rung
with open_rung("window") as gpu:
    print(gpu.rung)
    gpu.texture3d((3, 3, 3), 1, "f4", linear=True)
    try:
        open_rung("glfw-egl")
    except GraphicsError as error:
        print("another platform" if "another platform" in error.what else error)
with open_rung("glfw-egl") as gpu:
    print(gpu.rung)
"""


@pytest.fixture(autouse=True)
def _no_backend_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(contexts.BACKEND_VARIABLE, raising=False)


def run(code: str = TRY, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )


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


# --- broken machines, each in its own process ------------------------------------------------


def test_without_any_driver_one_line_names_every_rung_and_the_cure(tmp_path: Path) -> None:
    done = run(__EGL_VENDOR_LIBRARY_FILENAMES=str(tmp_path / "missing.json"))
    if done.returncode == 0:  # where OSMesa is installed the ladder has one rung left
        assert done.stdout.startswith("glfw-osmesa")
        return
    assert done.returncode == 5
    assert len(done.stderr.splitlines()) == 1
    for words in ("EGL lists no device", "glfw-egl", "glfw-osmesa", "install libegl1", "doctor"):
        assert words in done.stderr


def test_too_old_opengl_is_named() -> None:
    with open_gpu() as gpu:
        if "Mesa" not in gpu.version:
            pytest.skip("only Mesa can be told to be old")
    done = run(MESA_GL_VERSION_OVERRIDE="2.1", VOLVIZ_BACKEND="egl")
    assert done.returncode == 5
    assert "OpenGL 2.1 found, 3.3 is needed" in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_opengl_3_3_is_enough() -> None:
    with open_gpu() as gpu:
        if "Mesa" not in gpu.version:
            pytest.skip("only Mesa can be told to be old")
    done = run(MESA_GL_VERSION_OVERRIDE="3.3", MESA_GLSL_VERSION_OVERRIDE="330")
    assert done.returncode == 0, done.stderr


def test_environment_of_glcontext_cannot_redirect_a_device() -> None:
    done = run(GLCONTEXT_DEVICE_INDEX="7", VOLVIZ_BACKEND="egl:0")
    assert done.stdout.startswith("egl|"), done.stderr


def test_missing_library_is_told_in_plain_words(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(contexts_egl, "_LIBRARIES", ("libEGL-not-there.so.1",))
    with pytest.raises(GraphicsError, match=r"libEGL\.so\.1 is not installed"):
        contexts_egl.device_count()


def test_second_library_name_is_tried(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(contexts_egl, "_LIBRARIES", ("libEGL-not-there.so.1", "libEGL.so.1"))
    assert contexts_egl.device_count() >= 1


def test_forked_process_gets_an_error_instead_of_a_hang() -> None:
    code = """
import os
from volviz.errors import GraphicsError
from volviz.gpu.contexts import shared_gpu
gpu = shared_gpu()
if os.fork() == 0:
    for call in (shared_gpu, lambda: gpu.buffer(b"x")):
        try:
            call()
        except GraphicsError as error:
            print(error, flush=True)
    os._exit(0)
os.wait()
assert shared_gpu() is gpu
"""
    done = run(code)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("forked") == 2
    assert "spawn" in done.stdout


# --- GLFW ------------------------------------------------------------------------------------


def test_glfw_null_platform_with_egl() -> None:
    with open_gpu("glfw-egl") as gpu:
        assert gpu.rung == "glfw-egl"
        texture = gpu.texture3d((3, 5, 7), 1, "nu2", linear=True)
        values = np.arange(105, dtype=np.uint16).reshape(7, 5, 3)
        gpu.upload3d(texture, values)
        assert np.array_equal(np.frombuffer(texture.read(), np.uint16), values.ravel())
    assert not contexts_glfw._running(contexts_glfw.import_glfw())


def test_glfw_osmesa_works_or_says_what_is_missing() -> None:
    done = run(VOLVIZ_BACKEND="glfw-osmesa")
    if done.returncode == 0:
        assert done.stdout.startswith("glfw-osmesa|")
    else:
        assert done.returncode == 5
        assert "glfw-osmesa: OSMesa: Library not found" in done.stderr


def test_glfw_off_the_main_thread_is_refused() -> None:
    reasons: list[str] = []

    def work() -> None:
        with pytest.raises(GraphicsError) as caught:
            open_gpu("glfw-egl")
        reasons.append(str(caught.value))

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert "main thread" in reasons[0]


def test_from_window_takes_the_windows_context() -> None:
    glfw = contexts_glfw.import_glfw()
    with open_gpu("glfw-egl"):  # keeps GLFW on its null platform for the window below
        glfw.window_hint(glfw.CONTEXT_CREATION_API, glfw.EGL_CONTEXT_API)
        glfw.window_hint(glfw.CONTEXT_VERSION_MAJOR, 3)
        glfw.window_hint(glfw.CONTEXT_VERSION_MINOR, 3)
        glfw.window_hint(glfw.OPENGL_PROFILE, glfw.OPENGL_CORE_PROFILE)
        window = glfw.create_window(40, 30, "test", None, None)
        glfw.default_window_hints()
        with contexts.from_window(window) as gpu:
            assert gpu.rung == "window"
            assert gpu.ctx.screen.size == (40, 30)
            gpu.ctx.screen.clear(0.0, 1.0, 0.0)
            assert gpu.ctx.screen.read()[:3] == b"\x00\xff\x00"
        assert glfw.get_window_size(window) == (40, 30)  # the window is still the caller's
        glfw.destroy_window(window)


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


def test_shared_gpu_at_exit_leaves_no_noise() -> None:
    code = (
        "from volviz.gpu.contexts import shared_gpu; g = shared_gpu(); "
        "t = g.texture3d((4, 4, 4), 1, 'f4', linear=True)"
    )
    done = run(code)
    assert (done.returncode, done.stderr) == (0, "")


def test_window_of_a_display(tmp_path: Path) -> None:
    server = shutil.which("Xvfb")
    if server is None:
        pytest.skip("Xvfb is not installed")
    read, write = os.pipe()
    with subprocess.Popen(
        [server, "-displayfd", str(write), "-screen", "0", "320x240x24", "-nolisten", "tcp"],
        pass_fds=[write],
        stderr=subprocess.DEVNULL,
        cwd=tmp_path,
    ) as process:
        try:
            os.close(write)
            with os.fdopen(read) as answer:
                display = answer.readline().strip()
            done = run(WINDOW, DISPLAY=f":{display}")
        finally:
            process.terminate()
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == ["window", "another platform", "glfw-egl"]


LOST = """
import ctypes, sys
import numpy as np
import volviz
from volviz.gpu import contexts_egl
from volviz.gpu.contexts import shared_gpu

scene = volviz.Scene.of(volviz.Volume.from_array(np.arange(64, dtype=np.uint8).reshape(4, 4, 4)))
first = shared_gpu("egl")
before = volviz.render(scene, (16, 16), samples=1, backend="egl").pixels
egl = contexts_egl._library()
egl.eglGetCurrentDisplay.restype = ctypes.c_void_p
display = ctypes.c_void_p(egl.eglGetCurrentDisplay())
for _ in range(int(sys.argv[1])):  # once for every library that initialised it
    egl.eglReleaseThread()
    egl.eglTerminate(display)
after = volviz.render(scene, (16, 16), samples=1, backend="egl").pixels
assert first.released, "the context lived on"
assert shared_gpu("egl") is not first
assert np.array_equal(before, after)
"""


def test_contexts_that_another_library_closed_are_opened_again():
    """EGL displays are shared in a process: VTK terminates its own when it looks for devices."""
    done = subprocess.run(
        [sys.executable, "-c", LOST, "2"], capture_output=True, text=True, check=False, timeout=60
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
