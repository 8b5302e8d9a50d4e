"""What panels ask and what takes long to answer: worked out beside the window, kept while it holds.

A panel asks in every frame that it is drawn, and shows what is known by then. Only the window's
thread calls this; the work runs as jobs.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import Any

from volviz.app.jobs import Job
from volviz.errors import Cancelled, VolvizError
from volviz.progress import Progress


@dataclass
class Answer:
    """What is known of a question. value: the latest there is, maybe of the question before.

    fresh: it is of the question that was asked. job: that works on it. error: one line, where it
    failed. stopped: the user did not want to wait.
    """

    value: Any = None
    fresh: bool = False
    job: Job | None = None
    error: str = ""
    stopped: bool = False


class _Slot:
    def __init__(self, about: object) -> None:
        self.about, self.asked = about, True
        self.answer = Answer()
        self.known: Hashable = None  # the question that `answer.value` is of
        self.working: Hashable = None  # the question that the job works on, or that failed


class Answers:
    """The questions of one window, by the name of who asks. wake: as in `Job`."""

    def __init__(self) -> None:
        self.wake: Callable[[], None] = lambda: None
        self._slots: dict[str, _Slot] = {}

    def ask(
        self,
        name: str,
        about: object,
        question: Hashable,
        work: Callable[[Progress], Any],
        *,
        title: str,
        follow: bool = False,
    ) -> Answer:
        """What is known; `work` is begun where nothing is. about: what is open, see `sweep`.

        A job for another question is stopped; with `follow`, for questions that change faster than
        they are answered, it is let finish, and the latest question comes next.
        """
        slot = self._slots.get(name)
        if slot is None or slot.about is not about:
            self.forget(name)
            slot = self._slots[name] = _Slot(about)
        slot.asked, answer = True, slot.answer
        if answer.job is not None and answer.job.finished:
            _take(slot)
        if answer.job is not None and slot.working != question and not follow:
            answer.job.cancel()
            answer.job = None
        answer.fresh = answer.value is not None and slot.known == question
        tried = slot.working == question and (answer.error or answer.stopped)
        if not answer.fresh and answer.job is None and not tried:
            slot.working, answer.error, answer.stopped = question, "", False
            answer.job = Job(title, work, lambda value: _keep(slot, value), self.wake)
        return answer

    def stop(self, name: str) -> None:
        """Do not wait for this one; asking anew is for `again`."""
        slot = self._slots.get(name)
        if slot is not None and slot.answer.job is not None:
            slot.answer.job.cancel()
            slot.answer.job, slot.answer.stopped = None, True

    def again(self, name: str) -> None:
        """Try once more what was stopped or failed."""
        slot = self._slots.get(name)
        if slot is not None:
            slot.answer.stopped, slot.answer.error, slot.working = False, "", None

    def forget(self, name: str) -> None:
        """Stop it and drop what is known."""
        slot = self._slots.pop(name, None)
        if slot is not None and slot.answer.job is not None:
            slot.answer.job.cancel()

    def sweep(self, about: object) -> None:
        """After each frame: stop what nobody asked for, drop what is not of this open thing."""
        for name, slot in list(self._slots.items()):
            if slot.about is not about or (slot.answer.job is not None and not slot.asked):
                self.forget(name)
            slot.asked = False

    def close(self) -> None:
        """Stop all."""
        for name in list(self._slots):
            self.forget(name)


def _keep(slot: _Slot, value: Any) -> None:
    slot.answer.value, slot.known = value, slot.working


def _take(slot: _Slot) -> None:
    """Take over what the job of a slot made."""
    job = slot.answer.job
    slot.answer.job = None
    assert job is not None
    try:
        job.deliver()
    except Cancelled:
        slot.answer.stopped = True
    except VolvizError as error:
        slot.answer.error = str(error)
    except Exception as error:
        slot.answer.error = f"a bug in volviz: {type(error).__name__}: {error}"
