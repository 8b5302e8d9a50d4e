"""What takes long or goes wrong under a window: the picture stays, and it says so once."""

from __future__ import annotations

import pytest

from tests.ui.display import check_played, needs_display, play


@needs_display
@pytest.mark.parametrize(
    "name",
    ["between_frames", "slabs", "prepared_beside", "out_of_memory", "tiny_limit", "shader", "lost"],
)
def test_the_picture_stays_and_it_is_told_once(name, tmp_path):
    check_played(play("scripts_viewport", name, tmp_path))


@needs_display
def test_a_context_that_stays_lost_ends_in_one_line_and_a_saved_scene(tmp_path):
    done = play("scripts_viewport", "lost_twice", tmp_path)
    assert done.returncode == 5, done.stderr[-3000:]
    assert done.stderr.count("\n") == 1
    assert "the scene is saved" in done.stderr
    (saved,) = (tmp_path / "config" / "autosave").glob("*.volviz.json")
    assert "marschner-lobb" in saved.read_text()
