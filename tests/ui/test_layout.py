"""How much of a window the picture gets."""

from __future__ import annotations

import pytest

from volviz.ui.im import ImVec2, imgui
from volviz.ui.layout import SHARES, WIDEST, Layout
from volviz.ui.theme import FONT_SIZE


@pytest.fixture
def layout(tmp_path):
    context = imgui.create_context()
    yield Layout(tmp_path, {})
    imgui.destroy_context(context)


def test_the_picture_gets_what_columns_leave(layout):
    usual = layout.aspect(ImVec2(1280, 800), panels=True) * 800
    assert usual == pytest.approx(1280 * (1 - SHARES["right"]) * (1 - SHARES["left"]))
    assert layout.aspect(ImVec2(1280, 800), panels=False) == pytest.approx(1.6)


def test_a_large_screen_is_for_the_picture(layout):
    columns = sum(WIDEST.values()) * FONT_SIZE
    assert layout.aspect(ImVec2(3840, 1600), panels=True) * 1600 == pytest.approx(3840 - columns)
