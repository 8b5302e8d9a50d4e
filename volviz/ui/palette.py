"""Find anything by typing: commands, panels, presets, colours, samples, recent files."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from volviz.app.opening import title_of
from volviz.classify.colormaps import RAMPS
from volviz.classify.presets import recent
from volviz.resolve import known_statistics
from volviz.samples import SAMPLES
from volviz.sources import is_sample
from volviz.ui import looks, widgets, words
from volviz.ui.commands import COMMANDS, shown_keys
from volviz.ui.im import ImVec2, imgui

if TYPE_CHECKING:
    from volviz.model.scene import SceneState
    from volviz.ui.shell import Shell

WIDTH, HEIGHT = 32.0, 22.0
PAGE = 10


@dataclass(frozen=True)
class Entry:
    """Something that can be found. more: words that find it too, though later; hint: at the right;
    kind: what it is, "" for commands."""

    id: str
    title: str
    act: Callable[[], None]
    about: str
    more: str = ""
    hint: str = ""
    kind: str = ""
    enabled: bool = True


def score(query: str, title: str, more: str = "") -> float | None:
    """How well a query fits, less is better: prefixes first, then words, letters, other words.

    None if it does not fit. Case does not matter.
    """
    wanted, name = " ".join(query.casefold().split()), title.casefold()
    words = re.findall(r"\w+", name)
    if name.startswith(wanted):
        return len(name) / 1000
    parts = wanted.split()
    if _begin_in_order(parts, words):
        return 1 + len(name) / 1000
    close = wanted.replace(" ", "")
    if "".join(w[0] for w in words).startswith(close):
        return 2 + len(name) / 1000
    if wanted in name:
        return 3 + name.index(wanted) / 1000
    every = [*words, *re.findall(r"\w+", more.casefold())]
    if all(any(w.startswith(p) for w in every) for p in parts):
        return 4
    span = _letters(close, name)
    return None if span is None else 5 + span / 100


def _begin_in_order(parts: list[str], words: list[str]) -> bool:
    """True if each part begins a word, one after the other."""
    left = iter(words)
    return all(any(word.startswith(part) for word in left) for part in parts)


def _letters(wanted: str, name: str) -> int | None:
    """Characters over which all wanted letters are found in order, from a word's beginning."""
    spans = []
    for start in (m.start() for m in re.finditer(r"\b\w", name)):
        at = start - 1
        for letter in wanted:
            at = name.find(letter, at + 1)
            if at < 0:
                break
        else:
            if wanted and name[start] == wanted[0]:
                spans.append(at - start + 1)
    return min(spans, default=None)


def found(entries: list[Entry], query: str) -> list[Entry]:
    """Those that fit, best first; what cannot be done now comes last."""
    if not query.strip():
        return sorted(entries, key=lambda e: not e.enabled)
    scored = [(score(query, e.title, e.more), i, e) for i, e in enumerate(entries)]
    fit = [(not e.enabled, s, i, e) for s, i, e in scored if s is not None]
    return [e for *_, e in sorted(fit, key=lambda f: f[:3])]


def entries(shell: Shell) -> list[Entry]:
    """Everything that can be found now."""
    made = [*_commands(shell), *_panels(shell)]
    if shell.app.scene is not None:
        made += _looks(shell, shell.app.scene)
    return [*made, *_sources(shell)]


def _commands(shell: Shell) -> Iterator[Entry]:
    for name, command in COMMANDS.items():
        if name != "palette":
            yield Entry(
                f"command.{name}",
                command.title,
                lambda c=command: shell.do(c),  # type: ignore[misc]
                command.help,
                f"{command.menu} {command.help} {words.COMMAND_WORDS.get(name, '')}",
                shown_keys(command),
                enabled=command.enabled(shell),
            )


def _panels(shell: Shell) -> Iterator[Entry]:
    for name, panel in shell.panels.items():
        window = f"{panel.title}###{name}"
        yield Entry(
            f"panel.{name}",
            panel.title,
            lambda n=name, w=window: shell.dialogs.show_panel(n, w),  # type: ignore[misc]
            "Show this panel, in front of others at its place",
            words.of_panel(name),
            kind="panel",
            enabled=shell.app.scene is not None,
        )


def _looks(shell: Shell, scene: SceneState) -> Iterator[Entry]:
    presets = recent()
    names = {looks.SUGGESTED: "Suggested"} | {n: p.title for n, p in presets.items()}
    for name, title in names.items():
        known = presets.get(name)
        yield Entry(
            f"preset.{name}",
            title,
            lambda n=name: _dress(shell, n),  # type: ignore[misc]
            known.description if known else "What volviz reads off the values",
            f"preset transfer function {name} {known.group if known else ''}",
            kind="preset",
        )
    for name in RAMPS:
        yield Entry(
            f"colors.{name}",
            name.capitalize(),
            lambda n=name: _color(shell, n),  # type: ignore[misc]
            f"The colours of {name}, spread over the same values",
            "colour color map",
            kind="colours",
        )


def _sources(shell: Shell) -> Iterator[Entry]:
    for name, sample in SAMPLES.items():
        yield Entry(
            f"sample.{name}",
            name,
            lambda n=name: shell.open([f"sample:{n}"]),  # type: ignore[misc]
            sample.about,
            "open sample",
            kind="sample",
        )
    recent = [n for n in shell.app.settings.recent if not is_sample(n)]
    for index, name in enumerate(recent):
        yield Entry(
            f"recent.{index}",
            title_of(name),
            lambda n=name: shell.open([n]),  # type: ignore[misc]
            name,
            f"open recent file {name}",
            kind="recent",
        )


def _dress(shell: Shell, name: str) -> None:
    scene = shell.app.scene
    if scene is None:
        return
    look = looks.named_look(name, scene.volume, known_statistics(scene.volume))
    if look is not None:
        shell.app.change(looks.dressed(scene, look), f"Preset: {name}")
        if look.warning:
            shell.app.messages.once(look.warning)


def _color(shell: Shell, name: str) -> None:
    scene = shell.app.scene
    if scene is not None:
        transfer = looks.with_color_map(scene.transfer, name)
        shell.app.change(scene.with_transfer(transfer), f"Colours: {name}")


class Palette:
    """The body of the dialog: a line to type in, and a list that the arrows go through."""

    def __init__(self, shell: Shell) -> None:
        self.entries = entries(shell)
        self.query = ""
        self.at = 0

    def draw(self) -> Entry | None:
        """Into the current window; what was chosen."""
        if imgui.is_window_appearing():
            imgui.set_keyboard_focus_here()
        width = min(widgets.em(WIDTH), imgui.get_main_viewport().work_size.x * 0.9)
        imgui.set_next_item_width(width)
        about = "Type a few letters; Up and Down choose, Enter does it, Esc leaves."
        hint = "a command, a panel, a preset, a sample …"
        query = widgets.search("palette.query", hint, about, self.query)
        if query != self.query:
            self.query, self.at = query, 0
        rows = found(self.entries, self.query)
        moved = self._move(len(rows))
        height = min(widgets.em(HEIGHT), imgui.get_main_viewport().work_size.y * 0.6)
        chosen = None
        if imgui.begin_child("###palette.found", ImVec2(width, height)):
            for index, entry in enumerate(rows):
                if self._row(entry, index, moved):
                    chosen = entry
            if not rows:
                widgets.dim("Nothing is called so.")
        imgui.end_child()
        entered = imgui.is_key_pressed(imgui.Key.enter) or imgui.is_key_pressed(
            imgui.Key.keypad_enter
        )
        if entered and rows and rows[self.at].enabled:
            chosen = rows[self.at]
        return chosen

    def _move(self, count: int) -> bool:
        """Follow the arrow keys; True if they were pressed."""
        keys = imgui.Key
        steps = {keys.down_arrow: 1, keys.up_arrow: -1, keys.page_down: PAGE, keys.page_up: -PAGE}
        step = sum(by for key, by in steps.items() if imgui.is_key_pressed(key))
        self.at = min(max(self.at + step, 0), max(count - 1, 0))
        return step != 0

    def _row(self, entry: Entry, index: int, moved: bool) -> bool:
        imgui.begin_disabled(not entry.enabled)
        clicked = widgets.row(entry.id, "", entry.about, index == self.at)
        if moved and index == self.at:
            imgui.set_scroll_here_y()
        imgui.same_line(widgets.em(0.4))
        imgui.text_unformatted(entry.title)
        right = entry.hint or entry.kind
        if right:
            edge = imgui.get_content_region_avail().x + imgui.get_cursor_pos_x()
            imgui.same_line()
            wide = imgui.calc_text_size(right).x
            imgui.set_cursor_pos_x(max(imgui.get_cursor_pos_x(), edge - wide - widgets.em(0.4)))
            widgets.dim(right)
        imgui.end_disabled()
        return clicked and entry.enabled
