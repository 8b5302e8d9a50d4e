"""Surfaces in the real window."""

from __future__ import annotations

import pytest

from tests.ui.display import check_played, needs_display, play


@needs_display
@pytest.mark.parametrize("name", ["adding", "sliding", "panel"])
def test_window(name, tmp_path):
    check_played(play("scripts_surfaces", name, tmp_path))
