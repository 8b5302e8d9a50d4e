"""Text can be read: contrast by WCAG 2.2 (1.4.3), of the colours that are really set."""

from __future__ import annotations

import itertools

import pytest

from volviz.ui import theme
from volviz.ui.im import imgui, implot

LEAST = 4.5


def luminance(rgb: tuple[float, float, float]) -> float:
    """WCAG's relative luminance of an sRGB colour."""
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in rgb]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def contrast(a: tuple[float, float, float], b: tuple[float, float, float]) -> float:
    light, dark = sorted((luminance(a), luminance(b)), reverse=True)
    return (light + 0.05) / (dark + 0.05)


def test_contrast_is_that_of_the_standard():
    assert contrast((0, 0, 0), (1, 1, 1)) == pytest.approx(21)
    grey = (0x76 / 255,) * 3  # the standard's well-known limit on white
    assert contrast(grey, (1, 1, 1)) == pytest.approx(4.54, abs=0.01)


@pytest.fixture
def context():
    made, plots = imgui.create_context(), implot.create_context()
    yield
    implot.destroy_context(plots)
    imgui.destroy_context(made)


@pytest.mark.parametrize("name", ["dark", "light"])
def test_text_can_be_read_on_every_surface(context, name):
    theme.apply(name, 1.0)
    assert theme.name() == name
    style = imgui.get_style()

    def of(role: str) -> tuple[float, float, float]:
        value = style.color_(getattr(imgui.Col_, role))
        assert value.w == 1.0, f"{role} lets through what is behind"
        return value.x, value.y, value.z

    quiet = ["window_bg", "popup_bg", "menu_bar_bg", "title_bg", "frame_bg", "tab", "tab_selected"]
    strong = ["button", "button_hovered", "header", "header_hovered", "frame_bg_hovered"]
    for surface in quiet:
        for role in ("text", "text_disabled"):
            assert contrast(of(role), of(surface)) >= LEAST, (role, surface)
    for surface in strong:
        assert contrast(of("text"), of(surface)) >= LEAST, surface
    inks = [theme.accent(), *(theme.level(k) for k in theme.LEVELS)]
    for ink, surface in itertools.product(inks, ("window_bg", "popup_bg", "menu_bar_bg")):
        assert contrast((ink.x, ink.y, ink.z), of(surface)) >= LEAST, (ink, surface)
