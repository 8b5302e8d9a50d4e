"""A plain window: the scene, turned with the mouse, drawn coarser while it moves."""

from __future__ import annotations

import time
import warnings
from dataclasses import dataclass, replace
from typing import Any

from volviz.errors import GraphicsError
from volviz.gpu.checked import Gpu
from volviz.gpu.contexts import from_window
from volviz.gpu.contexts_glfw import import_glfw
from volviz.gpu.renderer import FULL, Quality, Renderer
from volviz.model.history import History
from volviz.model.scene import SceneState
from volviz.resolve import TextureLimits, resolve
from volviz.ui import navigate

glfw = import_glfw()
SIZE = (1024, 768)
TARGET_SECONDS = 0.05
MOVING_SECONDS = 0.25
MAX_SAMPLES = 64


@dataclass
class _Viewer:
    """What changes while the window is open."""

    window: Any
    gpu: Gpu
    renderer: Renderer
    history: History[SceneState]
    first: SceneState
    limits: TextureLimits
    rays: float = 0.5
    moved: float = 0.0
    at: tuple[float, float] = (0.0, 0.0)
    frame: Any = None

    def change(self, scene: SceneState) -> None:
        self.history = self.history.push(scene, "camera", "camera")
        self.frame = None
        self.moved = time.perf_counter()

    def draw(self) -> bool:
        """Draw once; False if there was nothing left to improve."""
        size = glfw.get_framebuffer_size(self.window)
        if min(size) < 1:
            return False
        if self.frame is None:
            self.frame = resolve(self.history.state, limits=self.limits)
        moving = time.perf_counter() - self.moved < MOVING_SECONDS
        quality = Quality(self.rays, 2.0) if moving else FULL
        screen = self.gpu.ctx.detect_framebuffer(0)
        screen.viewport = (0, 0, *size)
        start = time.perf_counter()
        samples = self.renderer.draw(self.frame, screen, quality)
        self.gpu.ctx.finish()
        spent = time.perf_counter() - start
        if moving:  # rays on a side go with the root of the time
            self.rays = min(max(self.rays * (TARGET_SECONDS / spent) ** 0.5, 0.1), 1.0)
        glfw.swap_buffers(self.window)
        return moving or samples < MAX_SAMPLES


def show(scene: SceneState) -> None:
    """Show a scene until its window is closed. Raises GraphicsError where there is no display."""
    window = _open(f"volviz – {scene.volume.name}")
    try:
        gpu = from_window(window)
        limits = TextureLimits(max_dim=gpu.limits.max_texture_3d, promote8=gpu.software)
        viewer = _Viewer(window, gpu, Renderer(gpu), History.of(scene), scene, limits)
        _listen(viewer)
        while not glfw.window_should_close(window):
            if viewer.draw():
                glfw.poll_events()
            else:
                glfw.wait_events_timeout(0.5)
        viewer.renderer.release()
        gpu.release()
    finally:
        glfw.destroy_window(window)


def _open(title: str) -> Any:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # GLFW tells its errors as warnings; ours says more
        started = glfw.init()
    if not started:
        raise GraphicsError(
            "no window can be opened: there is no display",
            fix="use 'volviz render' to draw to a file",
        )
    glfw.window_hint(glfw.CONTEXT_VERSION_MAJOR, 3)
    glfw.window_hint(glfw.CONTEXT_VERSION_MINOR, 3)
    glfw.window_hint(glfw.OPENGL_PROFILE, glfw.OPENGL_CORE_PROFILE)
    window = glfw.create_window(*SIZE, title, None, None)
    if not window:
        raise GraphicsError("no window with OpenGL 3.3 can be opened", fix="see 'volviz doctor'")
    glfw.make_context_current(window)
    return window


def _listen(viewer: _Viewer) -> None:
    window = viewer.window

    def on_move(_: Any, x: float, y: float) -> None:
        dx, dy = x - viewer.at[0], y - viewer.at[1]
        viewer.at = (x, y)
        camera = _dragged(viewer, dx, dy)
        if camera is not None:
            viewer.change(viewer.history.state.with_camera(camera))

    def on_wheel(_: Any, __: float, clicks: float) -> None:
        state = viewer.history.state
        viewer.change(state.with_camera(navigate.dollied(state.camera, clicks)))

    def on_key(_: Any, key: int, __: int, action: int, mods: int) -> None:
        if action == glfw.PRESS:
            _key(viewer, key, mods)

    def on_resize(*_: Any) -> None:
        viewer.moved = 0.0

    glfw.set_cursor_pos_callback(window, on_move)
    glfw.set_scroll_callback(window, on_wheel)
    glfw.set_key_callback(window, on_key)
    glfw.set_framebuffer_size_callback(window, on_resize)


def _dragged(viewer: _Viewer, dx: float, dy: float) -> Any:
    window, camera = viewer.window, viewer.history.state.camera
    size = glfw.get_window_size(window)
    pressed = {
        b: glfw.get_mouse_button(window, b) == glfw.PRESS
        for b in (glfw.MOUSE_BUTTON_LEFT, glfw.MOUSE_BUTTON_MIDDLE, glfw.MOUSE_BUTTON_RIGHT)
    }
    shift = glfw.get_key(window, glfw.KEY_LEFT_SHIFT) == glfw.PRESS
    control = glfw.get_key(window, glfw.KEY_LEFT_CONTROL) == glfw.PRESS
    if pressed[glfw.MOUSE_BUTTON_MIDDLE] or (pressed[glfw.MOUSE_BUTTON_LEFT] and shift):
        return navigate.panned(camera, dx, dy, size)
    if pressed[glfw.MOUSE_BUTTON_LEFT] and control:
        return navigate.rolled(camera, dx, size)
    if pressed[glfw.MOUSE_BUTTON_LEFT]:
        return navigate.rotated(camera, dx, dy, size)
    if pressed[glfw.MOUSE_BUTTON_RIGHT]:
        return navigate.dollied(camera, -dy / 20)
    return None


def _key(viewer: _Viewer, key: int, mods: int) -> None:
    if key in (glfw.KEY_ESCAPE, glfw.KEY_Q):
        glfw.set_window_should_close(viewer.window, True)
    elif key == glfw.KEY_R:
        viewer.change(replace(viewer.history.state, camera=viewer.first.camera))
    elif mods & glfw.MOD_CONTROL and key in (glfw.KEY_Z, glfw.KEY_Y):
        step = viewer.history.undo if key == glfw.KEY_Z else viewer.history.redo
        viewer.history, viewer.frame = step(), None
