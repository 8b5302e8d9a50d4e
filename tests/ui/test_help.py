"""The sheet of keys and mouse."""

from __future__ import annotations

import pytest

from tests.ui.test_theme import LEAST, contrast
from volviz.ui import help_overlay, theme
from volviz.ui.im import imgui, implot


@pytest.mark.parametrize("name", ["dark", "light"])
def test_headings_can_be_read_in_both_themes(name, monkeypatch):
    seen: list[tuple[float, float, float]] = []
    context, plots = imgui.create_context(), implot.create_context()
    io = imgui.get_io()
    io.backend_flags |= imgui.BackendFlags_.renderer_has_textures
    io.display_size = (1280, 800)
    io.set_ini_filename("")
    monkeypatch.setattr(imgui, "text_colored", lambda c, _: seen.append((c.x, c.y, c.z)))
    try:
        theme.apply(name, 1.0)
        imgui.new_frame()
        help_overlay.draw()
        imgui.end_frame()
        paper = imgui.get_style_color_vec4(imgui.Col_.popup_bg)
    finally:
        implot.destroy_context(plots)
        imgui.destroy_context(context)
    assert len(seen) == len(help_overlay.groups())
    assert min(contrast(ink, (paper.x, paper.y, paper.z)) for ink in seen) >= LEAST
