"""Shaders compiled before the window needs them, by a process beside it.

Mesa's software rasteriser compiles a shader when it is first drawn with: 0.1 to 0.2 s of the thread
that draws, for each mode, shading, gradient and kind of texture. What it made is kept in Mesa's own
cache on disk, for all processes; taken from there it is 3 to 15 ms. So a process beside the window
draws tiny pictures of the same kind first (ahead_child.py), and the window waits for that without
standing still: what was on the screen stays. What is known to be there is noted in our cache folder
too, so that usually no process is started at all. Graphics cards compile elsewhere: nothing is done
for them.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import queue
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import IO, Any

from volviz import resources
from volviz._version import __version__
from volviz.folders import cache_folder
from volviz.gpu.checked import Gpu
from volviz.gpu.passes import raycast
from volviz.gpu.passes.raycast import MODES, SHADINGS
from volviz.gpu.tiny import key_of, tiny
from volviz.model.frame import Frame

PATIENCE = 60.0
"""Seconds after which the window compiles by itself, whatever the process does. More than it takes
on a busy machine; that the process died is known at once."""
LINGER = 10.0
"""Seconds without work after which the process ends."""
CHILD = "from volviz.gpu.ahead_child import main; main()"
VARIABLES = ("MESA_SHADER_CACHE_DIR", "MESA_GLSL_CACHE_DIR", "XDG_CACHE_HOME", "HOME")
DISABLED = ("MESA_SHADER_CACHE_DISABLE", "MESA_GLSL_CACHE_DISABLE")
_URGENT, _LATER = 0, 1


class Ahead:
    """What is compiled for one OpenGL. wake: called from a worker when something is there.

    Only the thread of the window calls it. Kinds of frames are told apart by `tiny.key_of`.
    """

    def __init__(self, renderer: str, wake: Callable[[], None], folder: Path | None = None) -> None:
        self._wake = wake
        self._file = (folder or cache_folder() / "shaders") / f"{_circumstances(renderer)}.txt"
        self._done = _noted(self._file)
        self._asked: dict[str, float] = {}
        self._later: set[str] = set()
        self._work: queue.PriorityQueue[tuple[int, int, str, bytes]] = queue.PriorityQueue()
        self._count = 0
        self._lock = threading.Lock()
        self._worker: threading.Thread | None = None
        self._broken = any(os.environ.get(n, "").lower() in ("1", "true") for n in DISABLED)
        self._closed = False

    def ready(self, frame: Frame) -> bool:
        """True if drawing this frame compiles nothing, or nobody is there to do it before.

        Otherwise it is being seen to, and `wake` is called.
        """
        key = key_of(frame)
        if key in self._done or self._broken:
            return True
        now = time.monotonic()
        if key not in self._asked:
            self._asked[key] = now
            self._put(_URGENT, key, frame)
        return now - self._asked[key] > PATIENCE

    def look_ahead(self, frame: Frame) -> None:
        """See to what a person may ask for next, after all that is urgent."""
        for other in neighbours(frame):
            key = key_of(other)
            if key not in self._done and key not in self._asked and key not in self._later:
                self._later.add(key)
                self._put(_LATER, key, other)

    def close(self) -> None:
        """End the process; nothing is asked for any more."""
        self._closed = self._broken = True
        self._work.put((_URGENT, -1, "", b""))

    def _put(self, urgency: int, key: str, frame: Frame) -> None:
        if self._broken:
            return
        self._count += 1
        self._work.put((urgency, self._count, key, pickle.dumps(tiny(frame))))
        with self._lock:
            if self._worker is None:
                self._worker = threading.Thread(target=self._run, name="volviz ahead", daemon=True)
                self._worker.start()

    # --- in the worker ---------------------------------------------------------------------------

    def _run(self) -> None:
        try:
            with _child() as child:
                assert child.stdin is not None
                assert child.stdout is not None
                try:
                    while self._one(child.stdin, child.stdout):
                        pass
                finally:
                    with suppress(OSError):
                        child.stdin.close()
                    if self._closed or self._broken:
                        child.kill()
        except OSError:
            self._broken = True
        self._wake()

    def _one(self, to: IO[bytes], back: IO[bytes]) -> bool:
        """Have the next one drawn; False if there is no more to do."""
        try:
            urgency, _, key, content = self._work.get(timeout=LINGER)
        except queue.Empty:
            with self._lock:
                if self._work.empty():
                    self._worker = None
                    return False
            return True
        if self._closed:
            return False
        if key in self._done:
            return True
        to.write(bytes([urgency]) + len(content).to_bytes(8, "little") + content)
        to.flush()
        if back.readline() != b"done\n":
            self._broken = True  # without it the window compiles by itself
            return False
        self._done.add(key)
        with suppress(OSError):
            self._file.parent.mkdir(parents=True, exist_ok=True)
            with self._file.open("a", encoding="ascii") as file:
                file.write(f"{key}\n")
        self._wake()
        return True


def of(gpu: Gpu) -> Ahead | None:
    """The one of this OpenGL; None where nobody started one."""
    found: Ahead | None = gpu.owned.ahead
    return found


def start(gpu: Gpu, wake: Callable[[], None]) -> None:
    """From now on compile ahead for this OpenGL, if it gains from that."""
    if gpu.software and gpu.owned.ahead is None:
        made = gpu.owned.ahead = Ahead(f"{gpu.renderer} {gpu.version}", wake)
        gpu.owned.on_release.append(made.close)


def ready(gpu: Gpu, frame: Frame) -> bool:
    """True if drawing this frame compiles nothing that could be compiled elsewhere."""
    ahead = of(gpu)
    return ahead is None or ahead.ready(frame)


def look_ahead(gpu: Gpu, frame: Frame) -> None:
    """This frame is at rest: a moment to see to what may come next."""
    ahead = of(gpu)
    if ahead is not None:
        ahead.look_ahead(frame)


def neighbours(frame: Frame) -> Iterable[Frame]:
    """Frames that differ in what one click or drag changes."""
    cast, empty = frame.raycast, frame.emptiness
    if empty is not None:  # a drag of the opacity may show nearly all, or little
        worth = raycast.leaps(frame) is None
        frames = [frame, replace(frame, emptiness=replace(empty, shown=0.1 if worth else 1.0))]
    else:
        frames = [frame]
    for one in frames:
        yield one
        for shading in SHADINGS:
            yield replace(one, raycast=replace(cast, shading=shading))
    for mode in MODES:
        yield replace(frame, raycast=replace(cast, mode=mode))
    yield replace(frame, raycast=replace(cast, gradient="forward"))


def _child() -> subprocess.Popen[bytes]:
    paths = [p for p in sys.path if p]
    environment: Mapping[str, Any] = {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
    return subprocess.Popen(
        [sys.executable, "-c", CHILD],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env=environment,
    )


def _circumstances(renderer: str) -> str:
    """Under other circumstances all must be compiled again."""
    digest = hashlib.sha256(f"{renderer} {__version__}".encode())
    for name in VARIABLES:
        digest.update(f"{name}={os.environ.get(name)}".encode(errors="surrogateescape"))
    folder = resources.shader_dir()
    for path in sorted(p for p in folder.rglob("*") if p.is_file()):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:20]


def _noted(file: Path) -> set[str]:
    try:
        return set(file.read_text(encoding="ascii").split())
    except (OSError, UnicodeDecodeError):
        return set()
