"""Log: what was said, newest last, to read and to copy."""

from __future__ import annotations

import time
from dataclasses import dataclass

from volviz.errors import safe_text
from volviz.model.scene import SceneState
from volviz.ui import widgets
from volviz.ui.facts import Facts, Message
from volviz.ui.im import imgui


@dataclass
class _Wanted:
    """What is searched for, and how many messages there were."""

    text: str = ""
    count: int = 0


def panel(scene: SceneState, facts: Facts) -> SceneState:
    """The messages, with a search and a button that copies them."""
    wanted = facts.local.of(_Wanted)
    shown = [m for m in facts.messages if wanted.text.lower() in m.text.lower()]
    if widgets.button("log.copy", "Copy", "Copy these messages.", enabled=bool(shown)):
        imgui.set_clipboard_text("\n".join(line(m) for m in shown))
    imgui.same_line()
    imgui.set_next_item_width(widgets.FILL)
    wanted.text = widgets.search("log.search", "Search", "Show messages with this.", wanted.text)
    if imgui.begin_child("###log.lines"):
        if not shown:
            widgets.dim("No messages." if not facts.messages else "No message has this.")
        for message in shown:
            _show(message)
        if len(facts.messages) != wanted.count:
            imgui.set_scroll_here_y(1.0)
            wanted.count = len(facts.messages)
    imgui.end_child()
    return scene


def line(message: Message) -> str:
    """A message as plain text."""
    clock = time.strftime("%H:%M:%S", time.localtime(message.time))
    level = "" if message.level == "info" else f"{message.level}: "
    return f"{clock}  {level}{safe_text(message.text, 2000)}"


def _show(message: Message) -> None:
    colors = {"warning": widgets.warning_color, "error": widgets.error_color}
    color = colors[message.level]() if message.level in colors else None
    widgets.wrapped(line(message), color)
