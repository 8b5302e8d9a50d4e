"""Choosing and opening, driven in the real window."""

from __future__ import annotations

import pytest

from tests.ui.display import check_played, needs_display, play
from tests.ui.scripts_opening import SCRIPTS


@needs_display
@pytest.mark.parametrize("name", [script.__name__ for script in SCRIPTS])
def test_window(name, tmp_path):
    done = play("scripts_opening", name, tmp_path)
    check_played(done)
    if name == "closed_while_loading":
        assert "closed in time" in done.stdout
