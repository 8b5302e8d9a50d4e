"""The lens in the real window."""

from __future__ import annotations

import pytest

from tests.ui.display import check_played, needs_display, play


@needs_display
@pytest.mark.parametrize("name", ["dragging", "turning", "keys"])
def test_window(name, tmp_path):
    check_played(play("scripts_lens", name, tmp_path))
