"""Keys to commands: chords as text, pressed exactly, never while somebody types."""

from __future__ import annotations

from typing import TYPE_CHECKING

from volviz.ui.commands import COMMANDS
from volviz.ui.im import imgui

if TYPE_CHECKING:
    from volviz.ui.shell import Shell

MODS = {"ctrl": imgui.Key.mod_ctrl, "shift": imgui.Key.mod_shift, "alt": imgui.Key.mod_alt}
SIGNS = {"=": "equal", "-": "minus", ".": "period", ",": "comma"}
NAMES = {**SIGNS, **{str(n): f"_{n}" for n in range(10)}}


def chord(text: str) -> int:
    """ImGui's number for a chord such as "ctrl+shift+o". KeyError for an unknown key."""
    *mods, key = text.split("+")
    name = NAMES.get(key, key)
    if name not in imgui.Key.__members__:
        raise KeyError(text)
    number = int(imgui.Key[name])
    for mod in mods:
        number |= int(MODS[mod])
    return number


class Shortcuts:
    """The chords of all commands."""

    def __init__(self) -> None:
        self._chords = [(chord(k), c) for c in COMMANDS.values() for k in c.keys]

    def dispatch(self, shell: Shell) -> None:
        """Run the commands whose chord was pressed in this frame."""
        if imgui.get_io().want_text_input:
            return
        for number, command in self._chords:
            if imgui.is_key_chord_pressed(number):
                shell.do(command)
