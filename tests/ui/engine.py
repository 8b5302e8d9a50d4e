"""The ImGui test engine on our own window: items by path, as a person finds them by their label.

The engine runs a test in a coroutine, which its C++ makes of a second thread. Frame and test then
wait for each other while one of them holds Python's global lock, so that from Python it works
inside HelloImGui's runner only, which hands the lock over. Our window has a loop of its own.
Here the four functions of the coroutine (imgui_te_coroutine.h) are Python's instead: its semaphores
let go of the lock while they wait. The engine is for tests alone; it is no part of the program.
"""

from __future__ import annotations

import ctypes
import threading
from collections.abc import Callable, Iterator
from typing import Any

from imgui_bundle import _imgui_bundle as native

from volviz.ui.im import imgui

Act = Callable[[Any], None]
FRAMES = 600

_MAIN = ctypes.CFUNCTYPE(None, ctypes.c_void_p)
_CREATE = ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p)
_DESTROY = ctypes.CFUNCTYPE(None, ctypes.c_void_p)
_RUN = ctypes.CFUNCTYPE(ctypes.c_bool, ctypes.c_void_p)
_YIELD = ctypes.CFUNCTYPE(None)


class _Interface(ctypes.Structure):
    """ImGuiTestCoroutineInterface."""

    _fields_ = (("create", _CREATE), ("destroy", _DESTROY), ("run", _RUN), ("give_way", _YIELD))


class _Coroutine:
    """A thread that runs only while `run` waits for it."""

    def __init__(self, main: int, argument: int) -> None:
        self.go, self.back = threading.Semaphore(0), threading.Semaphore(0)
        self.ended = False
        self.thread = threading.Thread(target=self._main, args=(main, argument), daemon=True)
        self.thread.start()

    def _main(self, main: int, argument: int) -> None:
        self.go.acquire()
        _MAIN(main)(argument)
        self.ended = True
        self.back.release()

    def run(self) -> bool:
        """Until it gives way; False once it has ended."""
        if self.ended:
            return False
        self.go.release()
        self.back.acquire()
        return not self.ended


_made: dict[int, _Coroutine] = {}


def _create(main: int, _: bytes, argument: int) -> int:
    handle = max(_made, default=0) + 1
    _made[handle] = _Coroutine(main, argument)
    return handle


def _give_way() -> None:
    mine = next(c for c in _made.values() if c.thread is threading.current_thread())
    mine.back.release()
    mine.go.acquire()


_FUNCTIONS = (
    _CREATE(_create),
    _DESTROY(lambda handle: _made.pop(handle).thread.join(10)),
    _RUN(lambda handle: _made[handle].run()),
    _YIELD(_give_way),
)


class Engine:
    """The engine, bound to the current ImGui context. Call `swapped` after each frame."""

    def __init__(self) -> None:
        self._api = imgui.test_engine
        self._engine = self._api.create_context()
        library = ctypes.CDLL(native.__file__)
        # Coroutine_ImplStdThread_GetInterface(): the table that create_context has just taken
        table = library._Z36Coroutine_ImplStdThread_GetInterfacev
        table.restype = ctypes.c_void_p
        interface = _Interface.from_address(table())
        interface.create, interface.destroy, interface.run, interface.give_way = _FUNCTIONS
        io = self._api.get_io(self._engine)
        io.config_saved_settings = False
        io.config_mouse_draw_cursor = False
        io.config_restore_focus_after_tests = False
        io.config_fixed_delta_time = 1 / 60  # so that two clicks are never a double click by chance
        self._count = 0
        self._api.start(self._engine, imgui.get_current_context())

    def swapped(self) -> None:
        """A frame was shown."""
        self._api.post_swap(self._engine)

    def do(self, act: Act) -> Iterator[None]:
        """Run `act(context)` of the engine; every `yield` is a frame of the window.

        AssertionError with the engine's log where it finds no such item or cannot reach it.
        """
        self._count += 1
        test = self._api.register_test(self._engine, "volviz", f"step {self._count}")
        test.test_func = act
        self._api.queue_test(self._engine, test)
        for _ in range(FRAMES):
            yield
            if self._api.is_test_queue_empty(self._engine):
                break
        assert test.output.status == self._api.TestStatus.success, test.output.log.buffer.c_str()

    def close(self, destroy: Callable[[], None]) -> None:
        """End it. destroy: destroys the ImGui context, which must be in between."""
        self._api.stop(self._engine)
        destroy()
        self._api.destroy_context(self._engine)
