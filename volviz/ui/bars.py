"""The menu bar, the status bar, the notices in the corner, and the progress of what is loaded."""

from __future__ import annotations

from typing import TYPE_CHECKING

from volviz.app.messages import Message
from volviz.errors import safe_text
from volviz.samples import SAMPLES
from volviz.ui import theme, widgets
from volviz.ui.commands import COMMANDS, MENUS, shown_key
from volviz.ui.im import ImVec2, icons, imgui, internal
from volviz.ui.whereabouts import GONE, Whereabouts

if TYPE_CHECKING:
    from volviz.ui.shell import Shell

TOAST_SECONDS = 6.0
MARKS = {
    "info": icons.ICON_FA_CIRCLE_INFO,
    "warning": icons.ICON_FA_TRIANGLE_EXCLAMATION,
    "error": icons.ICON_FA_CIRCLE_XMARK,
}


def menu_bar(shell: Shell) -> None:
    """All commands by menu, and what is particular to a menu."""
    imgui.push_style_var(imgui.StyleVar_.window_border_size, 0.0)
    shown = imgui.begin_main_menu_bar()
    imgui.pop_style_var()
    if not shown:
        return
    for menu in MENUS:
        if imgui.begin_menu(menu):
            _menu(shell, menu)
            imgui.end_menu()
    imgui.end_main_menu_bar()


def _menu(shell: Shell, menu: str) -> None:
    if menu == "Window":
        _panel_items(shell)
    group = None
    listed = {n: c for n, c in COMMANDS.items() if c.menu == menu and not c.series}
    for name, command in listed.items():
        if group is not None and command.group != group:
            imgui.separator()
        group = command.group
        item(shell, name)
        if name == "open-folder":
            _sources(shell)


def item(shell: Shell, name: str) -> None:
    """One command in a menu."""
    command = COMMANDS[name]
    key = shown_key(command.keys[0]) if command.keys else ""
    checked = command.checked is not None and command.checked(shell)
    enabled = command.enabled(shell)
    if imgui.menu_item_simple(f"{command.title}###menu.{name}", key, checked, enabled):
        shell.do(command)
    widgets.tip(f"menu.{name}", command.help)


def _sources(shell: Shell) -> None:
    recent = shell.app.settings.recent
    if imgui.begin_menu("Open Recent", bool(recent)):
        gone = shell.host.local.of(Whereabouts).gone(recent, shell.app)
        for index, name in enumerate(recent):
            there = name not in gone
            if imgui.menu_item_simple(f"{_label(name)}###recent{index}", "", False, there):
                shell.open([name])
            about = safe_text(name, 1000)
            widgets.tip(f"recent.{index}", about if there else f"{about}\n{GONE}")
        imgui.end_menu()
    if imgui.begin_menu("Open Sample"):
        for name, sample in SAMPLES.items():
            if imgui.menu_item_simple(name):
                shell.open([f"sample:{name}"])
            widgets.tip(f"sample.{name}", sample.about)
        imgui.end_menu()


def _panel_items(shell: Shell) -> None:
    hidden = set(shell.app.settings.hidden)
    for name, panel in shell.panels.items():
        if imgui.menu_item_simple(f"{panel.title}###panel.{name}", "", name not in hidden):
            shell.show_panel(name, name in hidden)
        widgets.tip(f"panel.{name}", f"Show or hide the panel {panel.title}")
    if shell.panels:
        imgui.separator()


def status_bar(shell: Shell) -> None:
    """One line below: what is open, how it is drawn, what is going on."""
    flags = imgui.WindowFlags_.no_scrollbar | imgui.WindowFlags_.no_saved_settings
    flags |= imgui.WindowFlags_.menu_bar
    height = imgui.get_frame_height()
    viewport = imgui.get_main_viewport()
    imgui.push_style_var(imgui.StyleVar_.window_border_size, 0.0)
    shown = internal.begin_viewport_side_bar("###status", viewport, imgui.Dir.down, height, flags)
    imgui.pop_style_var()
    if shown and imgui.begin_menu_bar():
        _status_line(shell)
        imgui.end_menu_bar()
    imgui.end()


def _status_line(shell: Shell) -> None:
    scene = shell.app.scene
    if scene is None:
        imgui.text_disabled(shell.gpu.renderer)
        return
    volume = scene.volume
    x, y, z = volume.dims
    imgui.text(shell.stem() + (" *" if shell.app.dirty else ""))
    imgui.text_disabled(f"{x} × {y} × {z}  {volume.data.dtype}")
    if shell.viewport.frame is not None and shell.viewport.frame.voxels.dims != volume.dims:
        shown = " × ".join(map(str, shell.viewport.frame.voxels.dims))
        imgui.text_colored(theme.level("warning"), f"shown as {shown}")
    state = shell.viewport.state
    samples = scene.raycast.samples
    quality = f"sample {state.samples} of {samples}" if state.samples else f"{state.rays:.0%} rays"
    text = f"{quality}   {state.seconds * 1000:.0f} ms   {shell.gpu.renderer.split(' (')[0]}"
    room = imgui.get_window_width() - imgui.calc_text_size(text).x - imgui.get_font_size()
    if room > imgui.get_cursor_pos_x():
        imgui.set_cursor_pos_x(room)
        imgui.text_disabled(text)


def progress(shell: Shell, place: tuple[float, float, float, float]) -> None:
    """What a worker does, how far it is, and the button that stops it. place: x, y, w, h."""
    job = shell.app.job
    if job is None or job.elapsed < 0.2:
        return
    em = imgui.get_font_size()
    x, y, w, _ = place
    imgui.set_next_window_pos(ImVec2(x + w / 2, y + em), 0, ImVec2(0.5, 0.0))
    if imgui.begin("###busy", None, _floating())[0]:
        imgui.text(job.title)
        left = job.remaining
        note = job.message + (f", about {_seconds(left)} left" if left is not None else " …")
        imgui.text_disabled(note)
        fraction = -float(imgui.get_time()) if job.fraction is None else job.fraction
        line = imgui.get_cursor_pos_y()
        imgui.set_cursor_pos_y(line + em * 0.28)  # beside the middle of the button
        imgui.progress_bar(fraction, ImVec2(em * 18, em * 0.45), "")
        imgui.same_line()
        imgui.set_cursor_pos_y(line)
        cancelled = imgui.small_button("Cancel")
        widgets.tip("progress.cancel", "Stop it; what is open stays")
        if cancelled:
            shell.app.cancel()
            shell.app.messages.add(f"{job.title}: cancelled")
    imgui.end()


def export_progress(shell: Shell, place: tuple[float, float, float, float]) -> None:
    """How far a picture is that is drawn, written or copied, and the button that stops it."""
    picture, job = shell.exports.picture, shell.exports.job
    if picture is None and (job is None or job.elapsed < 0.3):
        return
    em = imgui.get_font_size()
    x, y, w, _ = place
    below = em if shell.app.job is None else 7 * em
    imgui.set_next_window_pos(ImVec2(x + w / 2, y + below), 0, ImVec2(0.5, 0.0))
    if imgui.begin("###exporting", None, _floating())[0]:
        left = None if picture is None else picture.remaining
        title = picture.title if picture is not None else job.title if job is not None else ""
        imgui.text_unformatted(title)
        imgui.text_disabled(" …" if left is None else f"about {_seconds(left)} left")
        done = None if picture is None else picture.fraction
        done = -float(imgui.get_time()) if done is None else done
        imgui.progress_bar(done, ImVec2(em * 18, em * 0.45), "")
        imgui.same_line()
        if widgets.button("export.cancel", "Cancel", "Stop it; no file is written"):
            shell.exports.cancel()
    imgui.end()


def toasts(shell: Shell, place: tuple[float, float, float, float]) -> None:
    """The latest messages, in the lower right corner of the view."""
    x, y, w, h = place
    em = imgui.get_font_size()
    bottom = y + h - em
    for index, message in enumerate(reversed(shell.app.messages.recent(TOAST_SECONDS)[-4:])):
        imgui.set_next_window_pos(ImVec2(x + w - em, bottom), 0, ImVec2(1.0, 1.0))
        imgui.set_next_window_bg_alpha(0.94)
        if imgui.begin(f"###toast{index}", None, _floating())[0]:
            _toast(message, min(em * 28, w - 4 * em))
        size = imgui.get_window_size()
        if imgui.is_window_hovered() and imgui.is_mouse_clicked(0):
            shell.app.messages.hide(message)
        imgui.end()
        bottom -= size.y + em * 0.5


def _toast(message: Message, width: float) -> None:
    tint = theme.level(message.level)
    imgui.text_colored(tint, MARKS[message.level])
    imgui.same_line()
    imgui.push_text_wrap_pos(imgui.get_cursor_pos_x() + max(width, 60.0))
    imgui.text_unformatted(message.text + (f"  ({message.count}×)" if message.count > 1 else ""))
    imgui.pop_text_wrap_pos()


def _floating() -> int:
    kinds = imgui.WindowFlags_
    flags = kinds.no_decoration | kinds.always_auto_resize | kinds.no_saved_settings
    return int(
        flags | kinds.no_focus_on_appearing | kinds.no_nav | kinds.no_docking | kinds.no_move
    )


def _seconds(left: float) -> str:
    return f"{left / 60:.0f} min" if left > 90 else f"{max(left, 1):.0f} s"


def _label(name: str) -> str:
    """The end of a path; ImGui would hide what stands behind ##."""
    shown = name if len(name) <= 60 else "…" + name[-59:]
    return safe_text(shown).replace("##", "# #")
