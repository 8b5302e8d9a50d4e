"""Where compiled kernels are kept, and when they go."""

from __future__ import annotations

import multiprocessing
import os
import sys
import threading
import time

import pytest

from volviz import compiled

DAY = 86400.0
NOW = 2e9


def folder_of(caches, name, days):
    """A folder of kernels that was last used so many days before NOW."""
    folder = caches / name
    (folder / "meshes_0").mkdir(parents=True)
    (folder / "meshes_0" / "a.nbi").write_bytes(b"index")
    os.utime(folder, (NOW - days * DAY,) * 2)
    return folder


def left(caches):
    return sorted(p.name for p in caches.iterdir())


def test_what_was_not_used_for_a_month_goes(tmp_path):
    for name, days in (("new", 0.1), ("week", 7), ("old", 31), ("older", 400)):
        folder_of(tmp_path, name, days)
    compiled.prune(tmp_path, NOW)
    assert left(tmp_path) == ["new", "week"]
    assert (tmp_path / "week" / "meshes_0" / "a.nbi").read_bytes() == b"index"


def test_only_the_newest_few_stay(tmp_path):
    for i in range(compiled.KEPT + 5):
        folder_of(tmp_path, f"{i:02d}", 2 + i / 10)
    compiled.prune(tmp_path, NOW)
    assert left(tmp_path) == [f"{i:02d}" for i in range(compiled.KEPT)]


def test_what_was_used_today_stays_however_many_there_are(tmp_path):
    names = [f"{i:02d}" for i in range(3 * compiled.KEPT)]
    for name in names:
        folder_of(tmp_path, name, 0.5)
    compiled.prune(tmp_path, NOW)
    assert left(tmp_path) == names


def test_leftovers_of_a_prune_that_was_cut_off_go(tmp_path):
    folder_of(tmp_path, "abc.123", 40)
    compiled.prune(tmp_path, NOW)
    assert left(tmp_path) == []


def test_a_cache_that_is_not_there_or_cannot_be_cleared(tmp_path, monkeypatch):
    compiled.prune(tmp_path / "none", NOW)
    folder_of(tmp_path, "old", 99)

    def refuse(*_):
        raise PermissionError("read-only")

    monkeypatch.setattr("pathlib.Path.rename", refuse)
    compiled.prune(tmp_path, NOW)
    assert left(tmp_path) == ["old"]


def prune_when_told(caches, go):
    go.wait()
    compiled.prune(caches, NOW)


def test_processes_may_prune_at_once(tmp_path):
    for i in range(60):
        folder_of(tmp_path, f"{i:02d}", 0.5 if i < 3 else 50)
    context = multiprocessing.get_context("spawn")
    go = context.Event()
    workers = [context.Process(target=prune_when_told, args=(tmp_path, go)) for _ in range(3)]
    for worker in workers:
        worker.start()
    go.set()
    for worker in workers:
        worker.join(60)
    assert [w.exitcode for w in workers] == [0, 0, 0]
    compiled.prune(tmp_path, NOW)  # one that found another at work has left some
    assert left(tmp_path) == ["00", "01", "02"]


@pytest.fixture
def caches(tmp_path, monkeypatch):
    monkeypatch.setattr("platformdirs.user_cache_path", lambda *_, **__: tmp_path)
    compiled.cache_folder.cache_clear()
    yield tmp_path / "kernels"
    compiled.cache_folder.cache_clear()


def test_new_sources_make_room_and_old_ones_are_marked_as_used(caches):
    old = folder_of(caches, "0123456789abcdef", 0)
    os.utime(old, (time.time() - 60 * DAY,) * 2)
    mine = compiled.cache_folder("meshes")
    assert left(caches) == []
    mine.mkdir()
    os.utime(mine, (time.time() - 60 * DAY,) * 2)
    compiled.cache_folder.cache_clear()
    assert compiled.cache_folder("meshes") == mine
    assert time.time() - mine.stat().st_mtime < DAY


def test_threads_that_import_at_once_keep_their_kernels_in_the_same_folder():
    """numba reads its folder twice, and another thread may have put it back between: kernels were
    then kept in the folder that the program was started in."""
    from volviz.isosurface.signs import pack_valid

    folder = str(compiled.cache_folder("isosurface"))
    before, found = sys.getswitchinterval(), []

    def decorate():
        for _ in range(30):
            made = compiled.kernel(pack_valid.py_func)
            found.append(made._cache.cache_path)

    threads = [threading.Thread(target=decorate) for _ in range(4)]
    sys.setswitchinterval(1e-6)
    try:
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    finally:
        sys.setswitchinterval(before)
    assert len(found) == 120
    assert all(path.startswith(folder) for path in found)
