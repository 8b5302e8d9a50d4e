"""Recent files that are gone are told apart on a worker, and looked for again."""

from __future__ import annotations

import threading
import time

from volviz.ui import whereabouts
from volviz.ui.whereabouts import Whereabouts


class App:
    def __init__(self) -> None:
        self.woken = threading.Event()
        self.wake = self.woken.set


def looked(seen: Whereabouts, names: list[str], app: App) -> frozenset[str]:
    end = time.monotonic() + 200
    seen.gone(names, app)
    while seen._job is not None and not seen._job.finished:
        assert time.monotonic() < end
        time.sleep(0.005)
    return seen.gone(names, app)


def test_what_is_gone(tmp_path, monkeypatch):
    here, lost, link = (str(tmp_path / n) for n in ("here.npy", "lost.npy", "link.npy"))
    open(here, "w").close()
    (tmp_path / "link.npy").symlink_to(tmp_path / "nowhere")
    names, seen, app = [here, lost, link, "sample:ct-head"], Whereabouts(), App()
    assert seen.gone(names, app) == frozenset(), "until somebody looked"
    assert looked(seen, names, app) == {lost}
    assert app.woken.is_set()
    open(lost, "w").close()
    monkeypatch.setattr(whereabouts, "AGAIN_SECONDS", 0.0)
    assert looked(seen, names[:2], app) == frozenset()


def test_a_drive_that_does_not_answer_holds_nothing_up(monkeypatch):
    go = threading.Event()
    monkeypatch.setattr(whereabouts.os.path, "lexists", lambda _: go.wait(20))
    seen, app = Whereabouts(), App()
    start = time.monotonic()
    for _ in range(5):
        assert seen.gone(["/net/far.npy"], app) == frozenset()
    assert time.monotonic() - start < 5
    go.set()


def test_samples_are_always_there():
    seen = Whereabouts()
    assert seen.gone(["sample:ct-head"], App()) == frozenset()
    assert seen._job is None
