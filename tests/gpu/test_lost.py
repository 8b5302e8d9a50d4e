"""A context that the driver took away is not one that was closed, and it is told every time."""

from __future__ import annotations

import ctypes

import moderngl
import numpy as np
import pytest

from volviz.errors import GraphicsError
from volviz.gpu import contexts_glfw
from volviz.gpu.checked import ContextLost
from volviz.gpu.contexts import open_gpu

KIND = ctypes.CFUNCTYPE(ctypes.c_uint)


class FakeContext:
    """What `watch_reset` asks of a moderngl context; `status` is what the driver answers."""

    def __init__(self, *extensions: str) -> None:
        self.extensions = set(extensions)
        self.status, self.asked = 0, 0
        self.function = KIND(self.answer)
        self.mglo = self
        self._context = self

    def answer(self) -> int:
        self.asked += 1
        return self.status

    def load_opengl_function(self, name: str) -> int:
        return ctypes.cast(self.function, ctypes.c_void_p).value or 0


def test_the_driver_is_asked_once_a_second(monkeypatch):
    now = [100.0]
    monkeypatch.setattr(contexts_glfw.time, "monotonic", lambda: now[0])
    context = FakeContext("GL_ARB_robustness")
    lost = contexts_glfw.watch_reset(context)
    assert [lost() for _ in range(50)] == [False] * 50
    assert context.asked == 1
    context.status = 0x8254  # GL_INNOCENT_CONTEXT_RESET
    assert not lost()
    now[0] += 1.5
    assert lost()


def test_where_nobody_can_tell_nothing_is_lost():
    context = FakeContext()
    context.status = 1
    assert not contexts_glfw.watch_reset(context)()
    assert context.asked == 0


def test_a_lost_context_is_lost_for_every_later_call():
    gpu = open_gpu()
    texture = gpu.texture3d((2, 2, 2), 1, "f4", linear=True)
    ended = []
    gpu.owned.on_release.append(lambda: ended.append(1))
    gpu.owned.lost = lambda: True
    for _ in range(2):
        with pytest.raises(ContextLost, match="was lost"):
            gpu.upload3d(texture, np.zeros((2, 2, 2), np.float32))
    assert gpu.released
    gpu.release()
    assert ended == [1]


def test_a_closed_context_was_not_lost():
    gpu = open_gpu()
    gpu.release()
    with pytest.raises(GraphicsError, match="was closed") as caught:
        gpu.activate()
    assert not isinstance(caught.value, ContextLost)


def test_the_error_of_a_lost_context_has_its_own_class(monkeypatch):
    with open_gpu() as gpu:
        with monkeypatch.context() as patched:
            patched.setattr(moderngl.Context, "error", property(lambda _: "GL_CONTEXT_LOST"))
            with pytest.raises(ContextLost):
                gpu.check("drawing")
        gpu.check("drawing")
