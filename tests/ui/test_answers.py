"""Questions of panels: answered beside the window, kept while they hold, stopped when unasked."""

from __future__ import annotations

import threading
import time

import pytest

from volviz.app.answers import Answer, Answers
from volviz.errors import UsageError


def settled(ask, seconds: float = 120.0) -> Answer:
    end = time.monotonic() + seconds
    while True:
        answer = ask()
        if answer.job is None:
            return answer
        assert time.monotonic() < end
        time.sleep(0.002)


def test_an_answer_is_worked_out_once_per_question():
    answers, about, made = Answers(), object(), []

    def ask(question: int) -> Answer:
        def work(progress):
            made.append(question)
            return question * 10

        return answers.ask("a", about, question, work, title="ten times")

    first = settled(lambda: ask(1))
    assert (first.value, first.fresh) == (10, True)
    answers.sweep(about)
    assert settled(lambda: ask(1)).value == 10
    assert made == [1]
    other = ask(2)
    assert (other.value, other.fresh) == (10, False)
    assert settled(lambda: ask(2)).value == 20
    assert made == [1, 2]


@pytest.mark.parametrize("follow", [False, True])
def test_of_questions_that_change_only_the_latest_comes_next(follow):
    answers, about, begun = Answers(), object(), []
    gate = threading.Event()

    def ask(question: int) -> Answer:
        def work(progress):
            begun.append(question)
            while not gate.wait(0.001):
                progress(None)
            return question

        return answers.ask("a", about, question, work, title="slow", follow=follow)

    jobs = {id(ask(n).job) for n in range(5)}
    assert len(jobs) == (1 if follow else 5)
    gate.set()
    assert settled(lambda: ask(5)).value == 5
    assert begun[-1] == 5
    if follow:
        assert begun == [0, 5]


def test_what_is_stopped_or_fails_is_not_begun_again_unasked():
    answers, about, count = Answers(), object(), [0]

    def ask(question: str = "q") -> Answer:
        def work(progress):
            count[0] += 1
            if question == "bad":
                raise UsageError("no", fix="yes")
            while True:
                progress(None)
                time.sleep(0.001)

        return answers.ask("a", about, question, work, title="endless")

    job = ask().job
    answers.stop("a")
    assert ask().stopped
    assert ask().job is None
    assert job is not None
    assert job.cancelled
    answers.again("a")
    assert ask().job is not None
    assert count[0] <= 2
    failed = settled(lambda: ask("bad"))
    assert failed.error == "no — yes"
    assert settled(lambda: ask("bad")).error == "no — yes"
    assert count[0] <= 3


def test_what_nobody_asks_for_is_stopped_and_what_is_closed_is_dropped():
    answers, about = Answers(), object()

    def forever(progress):
        while True:
            progress(None)
            time.sleep(0.001)

    job = answers.ask("slow", about, 1, forever, title="slow").job
    settled(lambda: answers.ask("quick", about, 1, lambda _: 7, title="quick"))
    answers.sweep(about)
    assert job is not None
    assert not job.cancelled
    answers.sweep(about)
    assert job.cancelled
    kept = answers.ask("quick", about, 1, lambda _: 8, title="quick")
    assert (kept.value, kept.fresh) == (7, True)
    answers.sweep(object())
    assert settled(lambda: answers.ask("quick", about, 1, lambda _: 9, title="quick")).value == 9
