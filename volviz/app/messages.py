"""What the window tells: each cause once, with a count, newest last."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

from volviz.errors import safe_text

KEPT = 200
LEVELS = ("info", "warning", "error")


@dataclass(frozen=True)
class Message:
    """One line. when: seconds since the epoch, of the latest time; count: how many times; hidden:
    read and clicked away."""

    text: str
    level: str = "info"
    when: float = 0.0
    count: int = 1
    hidden: bool = False


class Messages:
    """The messages so far, as a tuple that is only ever replaced."""

    def __init__(self) -> None:
        self.all: tuple[Message, ...] = ()

    def add(self, text: object, level: str = "info") -> Message:
        """Tell something; the same text again only counts."""
        line = safe_text(text, 1000)
        same = [m for m in self.all if m.text == line and m.level == level]
        rest = tuple(m for m in self.all if m not in same)
        new = Message(line, level, time.time(), same[0].count + 1 if same else 1)
        self.all = (*rest, new)[-KEPT:]
        return new

    def once(self, text: object, level: str = "warning") -> None:
        """Tell something unless it was told before."""
        line = safe_text(text, 1000)
        if not any(m.text == line for m in self.all):
            self.add(line, level)

    def recent(self, seconds: float) -> tuple[Message, ...]:
        """Those of the last so many seconds; errors stay three times as long."""
        now = time.time()
        long = {"error": 3.0, "warning": 1.5}
        fresh = (m for m in self.all if now - m.when < seconds * long.get(m.level, 1.0))
        return tuple(m for m in fresh if not m.hidden)

    def hide(self, message: Message) -> None:
        """`recent` no longer has it; the log keeps it with its time."""
        self.all = tuple(replace(m, hidden=True) if m == message else m for m in self.all)
