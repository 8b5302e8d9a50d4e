"""The desktop window, driven for real on a virtual X display (see scenarios/)."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.ui.display import ARTEFACTS, display, needs_display, run
from tests.ui.scenarios import GROUPS, SCENARIOS

ALONE = ("crash", "recovered", "dense_screen")


@pytest.fixture(scope="module")
def screen():
    with display() as env:
        yield env


def play(folder: Path, names: tuple[str, ...], env: dict[str, str]) -> subprocess.CompletedProcess:
    """Scenarios in a process of their own."""
    return run("tests.ui.scenarios", str(folder), *names, folder=folder, env=env)


def check(done: subprocess.CompletedProcess, names: tuple[str, ...]) -> None:
    driven = [line.split()[1] for line in done.stdout.splitlines() if line.startswith("driven ")]
    assert driven == list(names), done.stderr[-3000:]
    assert done.returncode == 0, done.stderr[-3000:]


def test_every_scenario_is_played():
    grouped = [name for names in GROUPS.values() for name in names]
    assert sorted([*grouped, *ALONE]) == sorted(SCENARIOS)


@needs_display
@pytest.mark.parametrize("group", GROUPS)
def test_window(group, tmp_path, screen):
    check(play(tmp_path, GROUPS[group], screen), GROUPS[group])


@needs_display
def test_what_a_killed_window_saved_is_recovered(tmp_path, screen):
    killed = play(tmp_path, ("crash",), screen)
    assert "killed" in killed.stdout, killed.stderr[-3000:]
    assert killed.returncode == -9
    check(play(tmp_path, ("recovered",), screen), ("recovered",))


@needs_display
def test_a_dense_screen(tmp_path):
    with display(1400, 1000, scale=2) as env:
        check(play(tmp_path, ("dense_screen",), env), ("dense_screen",))


@pytest.mark.slow
@pytest.mark.timeout(3000)
@needs_display
def test_screens_to_look_at(tmp_path):
    screens = str(ARTEFACTS / "screens")
    done = run("tests.ui.screens", screens, folder=tmp_path, env={**os.environ}, timeout=3000)
    assert done.returncode == 0, done.stderr[-3000:]
    assert (ARTEFACTS / "screens" / "sheet.png").exists()


def test_no_display_is_one_line_that_says_what_to_do():
    env = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY")}
    for more in ("sample:marschner-lobb",), ():
        command = [sys.executable, "-m", "volviz", "view", *more]
        done = subprocess.run(
            command, capture_output=True, text=True, env=env, timeout=60, check=False
        )
        assert done.returncode == 5
        assert done.stderr.count("\n") == 1
        assert "volviz render" in done.stderr
