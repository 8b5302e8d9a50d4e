"""Data: what the volume is, what to know about it, and the file's own header."""

from __future__ import annotations

from dataclasses import dataclass

from volviz.app.choosing import told
from volviz.errors import safe_text
from volviz.fields.facts import header_facts, odd_counts, range_text, unit_of
from volviz.fields.statistics import Statistics
from volviz.model.lengths import SMALL
from volviz.model.scene import SceneState
from volviz.model.volume import Volume, VolumeInfo
from volviz.text import binary_size
from volviz.ui import widgets
from volviz.ui.facts import Facts
from volviz.ui.im import ImVec2, imgui
from volviz.ui.part_rows import part_rows

LONGEST = 4000
ROOM = 12.0
"""Font sizes of height from which on the header scrolls by itself."""


@dataclass
class _Search:
    """What is searched for in the header."""

    text: str = ""


def panel(scene: SceneState, facts: Facts) -> SceneState:
    """Shows; changes nothing but which part of the source is open."""
    volume = scene.volume
    wish = part_rows(scene, facts)
    lines = rows(volume, facts)
    with widgets.facts("data", ("Orientation",)) as shown:
        for name, text in lines if shown else ():
            widgets.fact(name, text)
    for text in dict.fromkeys((*told(volume.info), *facts.notes)):
        widgets.wrapped(safe_text(text, LONGEST), widgets.warning_color())
    if widgets.button("data.copy", "Copy", "Copy all this as text."):
        imgui.set_clipboard_text("\n".join(f"{name}: {text}" for name, text in lines))
    if volume.info.fields:
        imgui.separator_text("The file's header")
        _header(volume, facts.local.of(_Search))
    return wish


def rows(volume: Volume, facts: Facts) -> list[tuple[str, str]]:
    """Name and text of what is known of a volume."""
    info = volume.info
    text = header_facts(info)
    several = [
        f"{which} {at + 1} of {n}"
        for which, at, n in (
            ("time", info.time, info.times),
            ("channel", info.channel, info.channels),
        )
        if n > 1
    ]
    text["samples"] = ", ".join([text["samples"], *several])
    if info.length_unit not in (None, "mm", *SMALL):
        text["spacing"] += f" (in the file: {info.length_unit})"
    found = {
        "name": text.pop("name"),
        "file": "" if info.source is None else str(info.source),
        **text,
        **_values(facts.statistics, info),
        "memory": binary_size(info.nbytes),
        "texture": "" if facts.texture is None else _texture(facts),
    }
    return [(n[:1].upper() + n[1:], safe_text(t, LONGEST)) for n, t in found.items() if t]


def _values(statistics: Statistics | None, info: VolumeInfo) -> dict[str, str]:
    if statistics is None:
        return {"values": "being counted …"}
    found = {"values": range_text(statistics, info)}
    if statistics.count:
        middle = ", ".join(f"{statistics.percentile(p):.5g}" for p in (1, 50, 99))
        found["mean"] = f"{statistics.mean:.5g} ± {statistics.std:.4g}{unit_of(info)}"
        found["1, 50, 99 %"] = middle
    odd = odd_counts(statistics).items()
    return found | {name: f"{n:,} voxels".replace(",", " ") for name, n in odd}


def _texture(facts: Facts) -> str:
    assert facts.texture is not None
    size = "" if facts.gpu_bytes is None else f", {binary_size(facts.gpu_bytes)}"
    return " × ".join(map(str, facts.texture)) + size


def _header(volume: Volume, search: _Search) -> None:
    imgui.set_next_item_width(widgets.FILL)
    search.text = widgets.search(
        "data.search", "Search", "Show fields whose name or value has this.", search.text
    )
    found = matching(volume, search.text)
    flags = imgui.TableFlags_.row_bg | imgui.TableFlags_.resizable
    room, height = imgui.get_content_region_avail().y, 0.0
    if room > widgets.em(ROOM):  # else the panel scrolls: two bars side by side are a nuisance
        flags, height = flags | imgui.TableFlags_.scroll_y, room
    if imgui.begin_table("###data.header", 2, flags, ImVec2(0, height)):
        imgui.table_setup_scroll_freeze(0, 1)
        imgui.table_setup_column("Field", imgui.TableColumnFlags_.width_stretch, 2)
        imgui.table_setup_column("Value", imgui.TableColumnFlags_.width_stretch, 3)
        imgui.table_headers_row()
        clipper = imgui.ListClipper()
        clipper.begin(len(found))
        while clipper.step():
            for i in range(clipper.display_start, clipper.display_end):
                _header_row(i, *found[i])
        imgui.end_table()
    if not found:
        widgets.dim("No field has this.")


def _header_row(index: int, name: str, value: str) -> None:
    imgui.table_next_row()
    imgui.table_next_column()
    text = f"{name}\n{value}\nClick to copy."
    if widgets.row(f"data.field{index}", name, text, False, span=True):
        imgui.set_clipboard_text(f"{name}: {value}")
    imgui.table_next_column()
    imgui.text_unformatted(value[:200])


def matching(volume: Volume, text: str) -> list[tuple[str, str]]:
    """Fields of the file's header whose name or value has this text, fit for the screen."""
    wanted = text.strip().lower()
    return [
        (safe_text(name, 200), safe_text(value, LONGEST))
        for name, value in volume.info.fields.items()
        if wanted in name.lower() or wanted in str(value).lower()
    ]
