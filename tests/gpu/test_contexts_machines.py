"""The ladder of contexts on broken machines, and through GLFW: mostly each in its own process."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

from volviz.errors import GraphicsError
from volviz.gpu import contexts, contexts_egl, contexts_glfw
from volviz.gpu.contexts import open_gpu

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


def test_shared_gpu_at_exit_leaves_no_noise() -> None:
    code = (
        "from volviz.gpu.contexts import shared_gpu; g = shared_gpu(); "
        "t = g.texture3d((4, 4, 4), 1, 'f4', linear=True)"
    )
    done = run(code)
    assert (done.returncode, done.stderr) == (0, "")


def test_contexts_that_another_library_closed_are_opened_again():
    """EGL displays are shared in a process: VTK terminates its own when it looks for devices."""
    done = subprocess.run(
        [sys.executable, "-c", LOST, "2"], capture_output=True, text=True, check=False, timeout=60
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
