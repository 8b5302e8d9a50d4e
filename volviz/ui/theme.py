"""How it looks: colours, roundness, distances, fonts. Calm, so that the picture stands out."""

from __future__ import annotations

from typing import Any

from volviz.ui.im import FONT, FONT_ICONS, ImVec2, ImVec4, imgui, implot

FONT_SIZE = 15.0
ACCENT = {"dark": (0.36, 0.62, 0.93), "light": (0.1, 0.38, 0.74)}

# role: grey or colour in each theme; (red, green, blue, opacity)
GROUND = {"dark": (0.105, 0.115, 0.13), "light": (0.945, 0.95, 0.955)}
RAISED = {"dark": (0.135, 0.147, 0.165), "light": (0.985, 0.985, 0.99)}
BAR = {"dark": (0.083, 0.09, 0.103), "light": (0.90, 0.905, 0.915)}
FIELD = {"dark": (0.185, 0.2, 0.225), "light": (0.875, 0.885, 0.9)}
LINE = {"dark": (0.2, 0.215, 0.24), "light": (0.8, 0.81, 0.83)}
TEXT = {"dark": (0.875, 0.89, 0.91), "light": (0.11, 0.12, 0.14)}
FAINT = {"dark": (0.61, 0.635, 0.67), "light": (0.35, 0.37, 0.41)}
PLOT = {"dark": (0.125, 0.137, 0.155), "light": (0.9, 0.908, 0.92)}
LEVELS = {
    "info": ACCENT,
    "warning": {"dark": (0.93, 0.69, 0.25), "light": (0.54, 0.33, 0.0)},
    "error": {"dark": (0.96, 0.46, 0.44), "light": (0.7, 0.08, 0.06)},
}

Rgb = tuple[float, float, float]


def color(rgb: Rgb, alpha: float = 1.0) -> Any:
    """An ImGui colour."""
    return ImVec4(*rgb, alpha)


def packed(rgb: Rgb, alpha: float = 1.0) -> int:
    """A colour for a draw list."""
    return int(imgui.color_convert_float4_to_u32(color(rgb, alpha)))


def name() -> str:
    """The theme in use, "dark" or "light"."""
    back = imgui.get_style_color_vec4(imgui.Col_.window_bg)
    return "dark" if back.x + back.y + back.z < 1.5 else "light"


def accent() -> Any:
    """The accent colour, to be read on any surface of the theme in use."""
    return color(ACCENT[name()])


def level(of: str) -> Any:
    """The colour of "info", "warning" or "error" text in the theme in use."""
    return color(LEVELS[of][name()])


def load_fonts() -> None:
    """One text font with the icons merged into it."""
    fonts = imgui.get_io().fonts
    fonts.add_font_from_file_ttf(str(FONT), FONT_SIZE)
    merged = imgui.ImFontConfig()
    merged.merge_mode = True
    merged.glyph_min_advance_x = FONT_SIZE
    merged.glyph_offset = ImVec2(0.0, 1.0)
    fonts.add_font_from_file_ttf(str(FONT_ICONS), FONT_SIZE * 0.86, merged)


def apply(theme: str, scale: float) -> None:
    """Colours and sizes of a theme. scale: of everything, 1 for a usual screen."""
    style = imgui.Style()
    (imgui.style_colors_dark if theme == "dark" else imgui.style_colors_light)(style)
    for role, value in _colors(theme).items():
        style.set_color_(getattr(imgui.Col_, role), value)
    _shape(style)
    style.scale_all_sizes(scale)
    style.font_size_base = FONT_SIZE
    style.font_scale_dpi = scale
    _assign(style)
    (implot.style_colors_dark if theme == "dark" else implot.style_colors_light)()
    plot = implot.get_style()
    plot.set_color_(implot.Col_.plot_bg, color(PLOT[theme]))
    plot.set_color_(implot.Col_.frame_bg, color(GROUND[theme], 0.0))
    plot.set_color_(implot.Col_.plot_border, color(LINE[theme]))


def _shape(style: Any) -> None:
    style.window_rounding = style.popup_rounding = 6.0
    style.child_rounding = style.frame_rounding = style.grab_rounding = 4.0
    style.tab_rounding = 4.0
    style.scrollbar_rounding = 8.0
    style.window_border_size = style.popup_border_size = 1.0
    style.frame_border_size = style.tab_border_size = 0.0
    style.tab_bar_border_size = 0.0
    style.tab_bar_overline_size = 2.0
    style.window_padding = ImVec2(12.0, 10.0)
    style.frame_padding = ImVec2(8.0, 4.0)
    style.item_spacing = ImVec2(8.0, 6.0)
    style.item_inner_spacing = ImVec2(6.0, 4.0)
    style.scrollbar_size = 11.0
    style.grab_min_size = 10.0
    style.docking_separator_size = 2.0
    style.window_title_align = ImVec2(0.0, 0.5)
    style.window_menu_button_position = imgui.Dir.none
    style.disabled_alpha = 0.45
    style.separator_text_border_size = 1.0
    style.separator_text_padding = ImVec2(0.0, 5.0)
    style.color_marker_size = 0.0


def _colors(theme: str) -> dict[str, Any]:
    return {**_surfaces(theme), **_widgets(theme), **_docks(theme)}


def _surfaces(theme: str) -> dict[str, Any]:
    accent, text, line = ACCENT[theme], TEXT[theme], LINE[theme]
    ground, raised, bar = GROUND[theme], RAISED[theme], BAR[theme]
    return {
        "text": color(text),
        "text_disabled": color(FAINT[theme]),
        "window_bg": color(ground),
        "child_bg": color(ground, 0.0),
        "popup_bg": color(raised),
        "border": color(line),
        "menu_bar_bg": color(bar),
        "title_bg": color(bar),
        "title_bg_active": color(bar),
        "title_bg_collapsed": color(bar),
        "text_selected_bg": color(accent, 0.4),
        "text_link": color(accent),
        "plot_histogram": color(accent),
        "nav_cursor": color(accent, 0.8),
        "modal_window_dim_bg": color((0.0, 0.0, 0.0), 0.45),
        "table_header_bg": color(raised),
        "table_border_light": color(line, 0.6),
    }


def _widgets(theme: str) -> dict[str, Any]:
    accent, text, line = ACCENT[theme], TEXT[theme], LINE[theme]
    raised, field = RAISED[theme], FIELD[theme]
    return {
        "frame_bg": color(field),
        "frame_bg_hovered": color(_mix(field, accent, 0.18)),
        "frame_bg_active": color(_mix(field, accent, 0.3)),
        "check_mark": color(accent),
        "checkbox_selected_bg": color(_mix(field, accent, 0.22)),
        "slider_grab": color(accent, 0.85),
        "slider_grab_active": color(accent),
        "button": color(field),
        "button_hovered": color(_mix(field, accent, 0.35)),
        "button_active": color(_mix(field, accent, 0.6)),
        "header": color(_mix(raised, accent, 0.16)),
        "header_hovered": color(_mix(raised, accent, 0.28)),
        "header_active": color(_mix(raised, accent, 0.4)),
        "separator": color(line),
        "separator_hovered": color(accent, 0.6),
        "separator_active": color(accent),
        "scrollbar_bg": color(field, 0.0),
        "scrollbar_grab": color(_mix(field, text, 0.12)),
        "scrollbar_grab_hovered": color(_mix(field, text, 0.25)),
        "scrollbar_grab_active": color(_mix(field, text, 0.35)),
    }


def _docks(theme: str) -> dict[str, Any]:
    accent, line, ground, bar = ACCENT[theme], LINE[theme], GROUND[theme], BAR[theme]
    return {
        "resize_grip": color(ground, 0.0),
        "resize_grip_hovered": color(accent, 0.5),
        "resize_grip_active": color(accent),
        "tab": color(bar),
        "tab_hovered": color(_mix(ground, accent, 0.3)),
        "tab_selected": color(ground),
        "tab_selected_overline": color(accent),
        "tab_dimmed": color(bar),
        "tab_dimmed_selected": color(ground),
        "tab_dimmed_selected_overline": color(line),
        "docking_preview": color(accent, 0.5),
        "docking_empty_bg": color(bar),
    }


def _assign(style: Any) -> None:
    """Copy a whole style into the current one."""
    current = imgui.get_style()
    for name in dir(style):
        if name.startswith("_") or callable(getattr(style, name)):
            continue
        value = getattr(style, name)
        if isinstance(value, bool | int | float | ImVec2) or type(value).__name__ == "Dir":
            setattr(current, name, value)
    for index in range(imgui.Col_.count):
        current.set_color_(index, style.color_(index))


def _mix(a: Rgb, b: Rgb, part: float) -> Rgb:
    r, g, bl = (x + (y - x) * part for x, y in zip(a, b, strict=True))
    return r, g, bl
