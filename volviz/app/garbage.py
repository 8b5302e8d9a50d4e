"""Python's full collections of garbage, kept away from what a person feels.

With the surfaces' compiler in memory one takes 0.13 s and comes at any time, in any thread, while
all others wait. So while a window runs none comes by itself. When nothing moves, what has gathered
is looked through, which is quick; what was gathered by the hundred thousand are modules and
compiled kernels, which stay: they are set aside and looked through no more.
"""

from __future__ import annotations

import gc

NEVER = 1 << 30
ENOUGH = 10
"""Collections of the middle generation between two looks: 70 000 new objects and more."""
MANY = 40_000
"""To look through so many objects takes about 20 ms."""


class Garbage:
    """The collections of one window. Nothing is changed before `begin`; `end` undoes it."""

    def __init__(self) -> None:
        self._before: tuple[int, int, int] | None = None

    def begin(self) -> None:
        """No full collections from now on but in `rest`; what is loaded stays."""
        first, second, _ = self._before = gc.get_threshold()
        gc.set_threshold(first, second, NEVER)
        gc.freeze()

    def rest(self) -> None:
        """Nothing moves: a moment to look through what has gathered, if that is quick."""
        if self._before is None or gc.get_count()[2] < ENOUGH:
            return
        if len(gc.get_objects(generation=2)) > MANY:
            gc.freeze()
        else:
            gc.collect()

    def end(self) -> None:
        """As it was before."""
        if self._before is not None:
            gc.set_threshold(*self._before)
            self._before = None
            gc.unfreeze()
