"""The window of the desktop: GLFW and ImGui's backends, size, full screen, drops, waiting."""

from __future__ import annotations

import ctypes
import time
import warnings
from collections.abc import Callable
from typing import Any

from volviz.errors import GraphicsError
from volviz.ui.im import backends, glfw, imgui, implot, internal

SMALLEST = (480, 320)
TOOLTIP_SECONDS = 0.4
"""After so long a tooltip is there."""
SETTLING_FRAMES = 3
"""ImGui needs a few frames after an event until everything is where it will be."""


class Desktop:
    """One window with an OpenGL 3.3 context, current in this thread."""

    def __init__(self, title: str, size: tuple[int, int]) -> None:
        self.handle = _create(title, size)
        self.closed = False
        self._windowed: tuple[int, int, int, int] | None = None
        self._left = SETTLING_FRAMES
        self.on_drop: Callable[[list[str]], None] = lambda names: None
        glfw.set_drop_callback(self.handle, self._dropped)
        glfw.set_window_refresh_callback(self.handle, lambda _: self.touch())

    def start_imgui(self) -> None:
        """ImGui on this window; its native backends take the callbacks."""
        imgui.create_context()
        implot.create_context()
        io = imgui.get_io()
        io.config_flags |= imgui.ConfigFlags_.docking_enable
        io.config_error_recovery_enable_assert = False  # a panel's mistake must not end the program
        io.config_error_recovery_enable_tooltip = False  # nor talk of ImGui's inner life
        io.config_windows_move_from_title_bar_only = True
        io.config_input_text_cursor_blink = False  # a blinking cursor would keep the loop awake
        io.set_ini_filename("")
        address = ctypes.cast(self.handle, ctypes.c_void_p).value
        assert address is not None
        if not backends.glfw_init_for_opengl(address, True):
            raise GraphicsError("ImGui does not start on this window", fix="see 'volviz doctor'")
        if not backends.opengl3_init("#version 330"):
            raise GraphicsError("ImGui finds no OpenGL 3.3", fix="see 'volviz doctor'")

    @property
    def scale(self) -> float:
        """How much larger than usual things should be on this screen."""
        x, _ = glfw.get_window_content_scale(self.handle)
        width, _ = glfw.get_window_size(self.handle)
        pixels, _ = glfw.get_framebuffer_size(self.handle)
        already = pixels / width if width else 1.0
        return float(max(x / max(already, 1e-3), 0.5))

    @property
    def pixels(self) -> tuple[int, int]:
        """Size of the framebuffer; (0, 0) while minimised."""
        if glfw.get_window_attrib(self.handle, glfw.ICONIFIED):
            return 0, 0
        width, height = glfw.get_framebuffer_size(self.handle)
        return int(width), int(height)

    @property
    def size(self) -> tuple[int, int]:
        """Size of the window, in the system's units."""
        width, height = glfw.get_window_size(self.handle)
        return int(width), int(height)

    @property
    def closing(self) -> bool:
        """True if the user asked to close it. Setting it asks, or takes it back."""
        return bool(glfw.window_should_close(self.handle))

    @closing.setter
    def closing(self, value: bool) -> None:
        glfw.set_window_should_close(self.handle, value)

    @property
    def full_screen(self) -> bool:
        """True while it fills the screen."""
        return self._windowed is not None

    def toggle_full_screen(self) -> None:
        """Fill the screen the window is on, or be a window again."""
        if self._windowed is not None:
            x, y, width, height = self._windowed
            glfw.set_window_monitor(self.handle, None, x, y, width, height, 0)
            self._windowed = None
            return
        monitor = glfw.get_primary_monitor()
        if not monitor:
            return
        self._windowed = (
            *glfw.get_window_pos(self.handle),
            *glfw.get_window_size(self.handle),
        )
        mode = glfw.get_video_mode(monitor)
        glfw.set_window_monitor(
            self.handle, monitor, 0, 0, mode.size.width, mode.size.height, mode.refresh_rate
        )

    def title(self, text: str) -> None:
        """The text of the title bar."""
        glfw.set_window_title(self.handle, text)

    def touch(self) -> None:
        """Something changed: draw the next few frames."""
        self._left = SETTLING_FRAMES

    def wait(self, seconds: float | None) -> bool:
        """Take the waiting events; sleep until one comes, at most so long. True: draw now.

        seconds: None to sleep for ever, 0 not to sleep. After an event a few frames are due.
        """
        if self._left > 0 or seconds == 0:
            self._left = max(self._left - 1, 0)
            glfw.poll_events()
            return True
        start = time.monotonic()
        if seconds is None:
            glfw.wait_events()
        else:
            glfw.wait_events_timeout(seconds)
        early = seconds is None or time.monotonic() - start < seconds * 0.98
        if early:
            self.touch()
        return early

    def begin(self) -> None:
        """A new ImGui frame."""
        backends.opengl3_new_frame()
        backends.glfw_new_frame()
        imgui.new_frame()
        _escape()

    def end(self, screen: Any, ground: tuple[float, float, float]) -> None:
        """Draw what ImGui gathered, and show it."""
        imgui.render()
        screen.use()
        screen.viewport = (0, 0, *self.pixels)
        screen.clear(*ground, 1.0)
        backends.opengl3_render_draw_data(imgui.get_draw_data())
        glfw.swap_buffers(self.handle)

    def close(self) -> None:
        """End ImGui and destroy the window. Twice does no harm."""
        if self.closed:
            return
        self.closed = True
        if imgui.get_current_context() is not None:
            backends.opengl3_shutdown()
            backends.glfw_shutdown()
            implot.destroy_context()
            imgui.destroy_context()
        glfw.destroy_window(self.handle)

    def _dropped(self, _: Any, names: list[str]) -> None:
        self.touch()
        self.on_drop(list(names))


def hovering() -> bool:
    """True while the mouse rests on something that has a tooltip which is still to come."""
    context: Any = imgui.get_current_context()
    return bool(context.hover_item_delay_id) and context.hover_item_delay_timer < TOOLTIP_SECONDS


def _escape() -> None:
    """Escape closes the menu, list or picker that is in front, and does nothing else then."""
    if not imgui.is_key_pressed(imgui.Key.escape, False):
        return
    popups = list(imgui.get_current_context().open_popup_stack)
    window = popups[-1].window if popups else None
    if window is None or window.flags & imgui.WindowFlags_.modal:
        return
    internal.close_popup_to_level(len(popups) - 1, True)
    lock = internal.InputFlagsPrivate_.lock_this_frame
    internal.set_key_owner(imgui.Key.escape, internal.im_hash_str("volviz"), lock)


def wake() -> None:
    """From any thread: let `wait` return."""
    glfw.post_empty_event()


def _create(title: str, size: tuple[int, int]) -> Any:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # GLFW tells its errors as warnings; ours says more
        if not glfw.init():
            raise GraphicsError(
                "no window can be opened: there is no display",
                fix="use 'volviz render' to draw to a file",
            )
        glfw.default_window_hints()
        glfw.window_hint(glfw.CONTEXT_VERSION_MAJOR, 3)
        glfw.window_hint(glfw.CONTEXT_VERSION_MINOR, 3)
        glfw.window_hint(glfw.OPENGL_PROFILE, glfw.OPENGL_CORE_PROFILE)
        glfw.window_hint(glfw.OPENGL_FORWARD_COMPAT, True)
        glfw.window_hint(glfw.SCALE_TO_MONITOR, True)
        # without it nobody tells that the driver was reset; ignored where it is not known
        glfw.window_hint(glfw.CONTEXT_ROBUSTNESS, glfw.LOSE_CONTEXT_ON_RESET)
        window = glfw.create_window(*size, title, None, None)
    if not window:
        raise GraphicsError(
            "no window with OpenGL 3.3 can be opened",
            fix="see 'volviz doctor', or use 'volviz render' to draw to a file",
        )
    glfw.make_context_current(window)
    glfw.swap_interval(1)
    glfw.set_window_size_limits(window, *SMALLEST, glfw.DONT_CARE, glfw.DONT_CARE)
    return window
