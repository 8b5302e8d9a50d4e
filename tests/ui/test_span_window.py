"""Report, span space and ambiguous cells in the real window."""

from __future__ import annotations

import pytest

from tests.ui.display import check_played, needs_display, play


@needs_display
@pytest.mark.parametrize("name", ["reported", "spanned"])
def test_window(name, tmp_path):
    check_played(play("scripts_span", name, tmp_path))
