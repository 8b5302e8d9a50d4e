"""Helpers run beside their caller, not in its place, and are not called for little."""

from __future__ import annotations

import os
import threading

import numpy as np
import pytest

from volviz.isosurface import turns
from volviz.isosurface.helpers import Helpers, current_processor
from volviz.progress import silent


@pytest.mark.skipif(
    current_processor() is None or len(os.sched_getaffinity(0)) < 2,
    reason="one processor, or nobody says which",
)
def test_a_helper_is_never_where_its_caller_is():
    helpers = Helpers(1)
    before = os.sched_getaffinity(0)
    try:
        for processor in sorted(before)[:4] * 2:
            os.sched_setaffinity(0, {processor, *sorted(before - {processor})[:1]})
            helpers.call([current_processor])[0].result()  # from the second call on it is known
            os.sched_setaffinity(0, {processor})
            os.sched_setaffinity(0, before)
            asked = helpers.call([lambda: (current_processor(), os.sched_getaffinity(0))])
            where, allowed = asked[0].result()
            assert helpers._away is not None
            assert where != helpers._away[0]
            assert allowed == before - {helpers._away[0]}
    finally:
        os.sched_setaffinity(0, before)


def test_what_may_not_be_moved_still_works(monkeypatch):
    def refuse(number, processors):
        raise PermissionError

    monkeypatch.setattr(os, "sched_setaffinity", refuse, raising=False)
    helpers = Helpers(2)
    for _ in range(3):
        assert [f.result() for f in helpers.call([lambda: 7] * 2)] == [7, 7]


@pytest.fixture
def claimed(monkeypatch):
    """`take` for a task that is not compiled, under a lock."""
    lock = threading.Lock()
    monkeypatch.setattr(turns, "_claim", lambda taken, at: taken.__setitem__(at, 1) or 0)

    def take(given):
        with lock:
            return turns.take.py_func(given)

    return take


@pytest.mark.parametrize("among", [None, [], [7], [3, 4, 499], range(0, 500, 2), range(500)])
@pytest.mark.parametrize("size", [1, 1 << 16])
@pytest.mark.parametrize("threads", [1, 2, 7])
def test_every_item_is_done_once_whoever_does_it(monkeypatch, claimed, among, size, threads):
    monkeypatch.setenv("NUMBA_NUM_THREADS", str(threads))
    done, who = np.zeros(500, int), set()
    listed = None if among is None else np.array(list(among), np.int32)

    def task(given, most):
        who.add(threading.get_ident())
        for _ in range(most):
            first, last = claimed(given)
            if first < 0:
                return
            done[first:last] += 1

    turns.in_turns(task, len(done), size, silent(), "testing", listed)
    worked = len(done) if listed is None else len(listed)
    assert (done == (1 if worked else 0)).all()
    if worked * size < 1 << 18:
        assert who <= {threading.get_ident()}


def test_each_thread_begins_with_a_part_of_its_own(monkeypatch, claimed):
    monkeypatch.setenv("NUMBA_NUM_THREADS", "2")
    begun, ready = {}, threading.Barrier(2)

    def task(given, most):
        if threading.get_ident() not in begun:
            begun[threading.get_ident()] = claimed(given)[0]
            ready.wait(20)
        given.looked[0] = given.taken.size

    rows = np.arange(100, 200, dtype=np.int32)
    turns.in_turns(task, 1000, 1 << 16, silent(), "testing", rows)
    assert sorted(begun.values()) == [0, 150]
