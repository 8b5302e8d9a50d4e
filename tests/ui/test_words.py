"""Things are found under the words that people type."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from volviz.ui import palette, words
from volviz.ui.commands import COMMANDS
from volviz.ui.panels import PANELS

SHELL = SimpleNamespace(app=SimpleNamespace(scene=object()), panels=PANELS)


def found(query: str) -> list[str]:
    every = [
        palette.Entry(f"command.{n}", c.title, lambda: None, c.help, f"{c.menu} {c.help} {more}")
        for n, c in COMMANDS.items()
        for more in [words.COMMAND_WORDS.get(n, "")]
    ]
    return [e.id for e in palette.found([*every, *palette._panels(SHELL)], query)]


@pytest.mark.parametrize(
    ("query", "wanted"),
    [
        ("screenshot", "command.screenshot"),
        ("export png", "command.screenshot"),
        ("exit", "command.quit"),
        ("zoom", "command.reset"),
        ("isosurface", "command.add-surface"),
        ("dark", "command.theme"),
        ("shortcuts", "command.help"),
        ("bokmark", "command.bookmark"),
        ("ful scren", "command.fullscreen"),
        ("shading", "panel.rendering"),
        ("jitter", "panel.rendering"),
        ("field of view", "panel.view"),
        ("fov", "panel.view"),
        ("isovalue", "panel.surfaces"),
        ("histogram", "panel.transfer"),
        ("metadata", "panel.data"),
        ("fps", "panel.performance"),
    ],
)
def test_found_among_the_first(query, wanted):
    assert wanted in found(query)[:3], found(query)[:6]


def test_words_are_of_what_there_is():
    assert set(words.COMMAND_WORDS) <= set(COMMANDS)
    assert set(words.PANEL_WORDS) <= set(PANELS)
    assert set(words.KNOBS) <= set(PANELS)
