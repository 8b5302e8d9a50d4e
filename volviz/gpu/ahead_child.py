"""The process that draws tiny pictures, so that their shaders are in the driver's cache.

`python -c "from volviz.gpu.ahead_child import main; main()"`: frames come in as pickles, each after
a byte (1: nobody waits for it) and its length in 8 bytes; a line "done" goes out for each. It ends
when its input does. Its input is the window that started it, nobody else.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import sys
import time
from functools import cache
from pathlib import Path

from volviz.gpu import contexts
from volviz.gpu.checked import Gpu
from volviz.gpu.progressive import Progressive
from volviz.gpu.residency import Residency
from volviz.gpu.texel import kept_texture3d
from volviz.model.frame import Frame

SIZE = (30, 27)
"""No power of two, with half and a third of the rays neither: as the sides of a window."""
NICE = 5
WRITING_SECONDS, LOOK_SECONDS, LOOKS = 5.0, 0.003, 3
WRITERS = "disk$"
"""In the names of Mesa's threads that write its cache."""


def main() -> None:
    """Draw until the input ends."""
    source = sys.stdin.buffer
    with contexts.open_gpu("egl") as gpu:
        if not gpu.software:
            return  # another one than the window's
        while len(head := source.read(9)) == 9:
            if head[0]:
                _stand_back()
            frame: Frame = pickle.loads(source.read(int.from_bytes(head[1:], "little")))
            compiled(gpu, frame)
            sys.stdout.write("done\n")
            sys.stdout.flush()


def compiled(gpu: Gpu, frame: Frame) -> None:
    """Have all that drawing such a frame takes in the driver's cache, as another process asks for.

    llvmpipe makes code for a program and the state that it is drawn with, kept under a name that
    comes from both. But compiling changes what it takes for the program: the code for a second
    state would get a name for which nobody looks who did not compile the first himself. So each
    frame gets programs of its own, and where rays are both written (to a layer) and added (behind
    the last) they are drawn once more: what is in the cache by then leaves the program alone.
    """
    translucent = any(not m.opaque and not m.mesh.empty for m in frame.meshes)
    for _ in range(2 if translucent else 1):
        gpu.owned.programs.clear()
        draw(gpu, frame)
        wait_for_writers()


def wait_for_writers(threads: Path = Path("/proc/self/task")) -> None:
    """Until all that was compiled is in the driver's cache, where that can be known.

    Mesa writes it on threads of low priority. Who was told too soon would compile it again.
    """
    end, quiet = time.monotonic() + WRITING_SECONDS, 0
    while quiet < LOOKS and time.monotonic() < end:
        quiet = 0 if any(map(_writing, threads.glob("*"))) else quiet + 1
        time.sleep(LOOK_SECONDS)


def _writing(thread: Path) -> bool:
    try:
        name, _, rest = (thread / "stat").read_text().rpartition(")")
    except OSError:
        return False  # it has ended
    return WRITERS in name and not rest.lstrip().startswith("S")


@cache
def _stand_back() -> None:
    with contextlib.suppress(OSError, AttributeError):  # no such thing on Windows
        os.nice(NICE)


def draw(gpu: Gpu, frame: Frame) -> None:
    """All that the window does with such a frame: while it moves, and at rest."""
    resident = Residency(gpu)
    picture = Progressive(gpu, resident, between=0.0)
    try:
        picture.coarse(frame, SIZE, 1.0)
        while not picture.refine(frame, SIZE, 1.0).done:
            pass
        voxels = frame.voxels
        kind = {"uint8": "nu1", "uint16": "nu2", "float32": "f4"}[voxels.array.dtype.name]
        parts = 2 if voxels.masked else 1
        kept_texture3d(gpu, voxels.dims, parts, kind, linear=True, always=True).release()
    finally:
        picture.release()
        resident.release()
