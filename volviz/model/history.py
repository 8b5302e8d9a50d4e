"""Undo and redo: a list of scenes. Frozen; each call returns a new history."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Generic, TypeVar

S = TypeVar("S")
MAX_STEPS = 200


@dataclass(frozen=True)
class Step(Generic[S]):
    """A state and what made it. key: changes with the same key in a row are one step (a drag)."""

    state: S
    label: str
    key: str = ""


@dataclass(frozen=True)
class History(Generic[S]):
    """The present state, those before it (oldest first) and those undone (next first)."""

    present: Step[S]
    past: tuple[Step[S], ...] = ()
    future: tuple[Step[S], ...] = ()

    @classmethod
    def of(cls, state: S, label: str = "open") -> History[S]:
        """A history that begins with this state."""
        return cls(Step(state, label))

    @property
    def state(self) -> S:
        """The present state."""
        return self.present.state

    @property
    def steps(self) -> tuple[Step[S], ...]:
        """All steps, oldest first; the present is at index len(past)."""
        return (*self.past, self.present, *self.future)

    def push(self, state: S, label: str, key: str = "") -> History[S]:
        """A new present; what was undone is gone. Unchanged states are not recorded."""
        if state == self.present.state:
            return self
        if key and key == self.present.key and not self.future and self.past:
            return replace(self, present=Step(state, label, key))
        past = (*self.past, self.present)[-MAX_STEPS:]
        return History(Step(state, label, key), past, ())

    def settled(self) -> History[S]:
        """The end of a drag: the next change with the same key is a step of its own."""
        return replace(self, present=replace(self.present, key=""))

    def undo(self) -> History[S]:
        """One step back, or the same at the beginning."""
        return self.at(len(self.past) - 1) if self.past else self

    def redo(self) -> History[S]:
        """One step forward, or the same at the end."""
        return self.at(len(self.past) + 1) if self.future else self

    def at(self, index: int) -> History[S]:
        """The step with this index in `steps` becomes the present."""
        steps = self.steps
        if not 0 <= index < len(steps):
            raise IndexError(f"no step {index} in a history of {len(steps)}")
        return History(steps[index], steps[:index], steps[index + 1 :])
