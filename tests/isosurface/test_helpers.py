"""Helpers run beside their caller, not in its place, and are not called for little."""

from __future__ import annotations

import os
import threading

import numpy as np
import pytest

from volviz.isosurface import kernel
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
            helpers.call(1, current_processor)[0].result()  # from the second call on it is known
            os.sched_setaffinity(0, {processor})
            os.sched_setaffinity(0, before)
            asked = helpers.call(1, lambda: (current_processor(), os.sched_getaffinity(0)))
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
        assert [f.result() for f in helpers.call(2, lambda: 7)] == [7, 7]


@pytest.mark.parametrize("worked", [None, 3, 10_000])
@pytest.mark.parametrize("size", [1, 1 << 16])
def test_every_item_is_done_once_whoever_does_it(monkeypatch, worked, size):
    monkeypatch.setenv("NUMBA_NUM_THREADS", "3")
    done, who = np.zeros(500, int), set()
    lock = threading.Lock()

    def task(turns, most):
        who.add(threading.get_ident())
        for _ in range(most):
            with lock:
                first = int(turns[0])
                turns[0] += turns[1]
            if first >= len(done):
                return
            done[first : first + turns[1]] += 1

    kernel.in_turns(task, len(done), size, silent(), "testing", worked)
    assert (done == 1).all()
    if (worked or len(done)) * size < 1 << 18:
        assert who == {threading.get_ident()}
