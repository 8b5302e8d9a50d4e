"""Full collections of garbage wait for a quiet moment, and what holds a volume still goes."""

from __future__ import annotations

import gc
import weakref

import pytest

from volviz.app import garbage
from volviz.app.garbage import Garbage


class Held:
    """Something large in a cycle, as an exception with its frames makes one."""

    def __init__(self) -> None:
        self.itself = self


@pytest.fixture
def tidied():
    made = Garbage()
    before = gc.get_threshold()
    yield made
    made.end()
    assert gc.get_threshold() == before
    assert gc.get_freeze_count() == 0


@pytest.fixture
def full():
    """How many full collections there were."""
    seen: list[int] = []

    def watch(phase: str, info: dict[str, int]) -> None:
        if phase == "stop" and info["generation"] == 2:
            seen.append(info["collected"])

    gc.callbacks.append(watch)
    yield seen
    gc.callbacks.remove(watch)


def many(count: int) -> list[list[int]]:
    return [[n] for n in range(count)]


def test_none_comes_by_itself(tidied, full):
    tidied.begin()
    kept = many(300_000)
    assert full == []
    assert gc.get_count()[2] >= garbage.ENOUGH, "else this test shows nothing"
    assert len(kept) == 300_000


def test_what_is_in_a_cycle_goes_when_nothing_moves(tidied, monkeypatch):
    tidied.begin()
    held = Held()
    gone = weakref.ref(held)
    gc.collect(1)
    del held
    tidied.rest()
    assert gone() is not None, "too little has happened"
    monkeypatch.setattr(garbage, "ENOUGH", 0)
    tidied.rest()
    assert gone() is None


def test_what_is_loaded_is_set_aside_and_not_looked_through(tidied, full):
    tidied.begin()
    kept = many(300_000)
    gc.collect(1)
    before = gc.get_freeze_count()
    tidied.rest()
    assert full == []
    assert gc.get_freeze_count() > before + 250_000
    assert len(kept) == 300_000


def test_before_a_window_runs_nothing_changes(full, monkeypatch):
    monkeypatch.setattr(garbage, "ENOUGH", 0)
    Garbage().rest()
    assert full == []
