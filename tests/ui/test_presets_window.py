"""The gallery and the bookmarks, driven in the real window."""

from __future__ import annotations

import pytest

from tests.ui.display import check_played, needs_display, play

NAMES = ("thumbnails_of_this_volume", "work_waits_while_things_move", "own_and_bookmarks")


@needs_display
@pytest.mark.parametrize("name", NAMES)
def test_window(name, tmp_path):
    check_played(play("scripts_presets", name, tmp_path))
