"""Data: what the volume is, what to know about it, and the file's own header."""

from __future__ import annotations

from dataclasses import dataclass

from volviz.errors import safe_text
from volviz.fields.statistics import Statistics
from volviz.model.scene import SceneState
from volviz.model.volume import Volume
from volviz.text import binary_size
from volviz.ui import widgets
from volviz.ui.facts import Facts
from volviz.ui.im import ImVec2, imgui

LONGEST = 4000


@dataclass
class _Search:
    """What is searched for in the header."""

    text: str = ""


def panel(scene: SceneState, facts: Facts) -> SceneState:
    """Shows; changes nothing."""
    volume = scene.volume
    lines = rows(volume, facts)
    with widgets.facts("data", ("Orientation",)) as shown:
        for name, text in lines if shown else ():
            widgets.fact(name, text)
    for text in dict.fromkeys((*volume.info.warnings, *facts.notes)):
        widgets.wrapped(safe_text(text, LONGEST), widgets.warning_color())
    if widgets.button("data.copy", "Copy", "Copy all this as text."):
        imgui.set_clipboard_text("\n".join(f"{name}: {text}" for name, text in lines))
    if volume.info.fields:
        imgui.separator_text("The file's header")
        _header(volume, facts.local.of(_Search))
    return scene


def rows(volume: Volume, facts: Facts) -> list[tuple[str, str]]:
    """Name and text of what is known of a volume."""
    info, statistics = volume.info, facts.statistics
    several = [
        f"{which} {at + 1} of {n}"
        for which, at, n in (
            ("time", info.time, info.times),
            ("channel", info.channel, info.channels),
        )
        if n > 1
    ]
    unit = f" {info.value_unit}" if info.value_unit else ""
    length = "mm" if info.length_unit else "(unit unknown)"
    if info.length_unit not in (None, "mm"):
        length += f" (in the file: {info.length_unit})"
    found = [
        ("Name", info.name),
        ("File", "" if info.source is None else str(info.source)),
        ("Format", f"{info.format}, {info.encoding}"),
        ("Modality", info.modality or ""),
        ("Kind", "labels" if info.kind == "labels" else ""),
        ("Grid", "uniform, oblique" if info.oblique else "uniform"),
        ("Samples", ", ".join([" × ".join(map(str, info.dims)), *several])),
        ("Type", f"{info.dtype}{unit}"),
        ("Spacing", " × ".join(f"{s:.5g}" for s in info.spacing) + f" {length}"),
        ("Size", " × ".join(f"{s * n:.5g}" for s, n in zip(info.spacing, info.dims, strict=True))
         + " mm"),
        ("Orientation", info.orientation or "unknown"),
        ("Origin", ", ".join(f"{v:.6g}" for v in info.origin)),
        *_values(statistics, unit),
        ("Memory", binary_size(info.nbytes)),
        ("Texture", "" if facts.texture is None else _texture(facts)),
    ]  # fmt: skip
    return [(name, safe_text(text, LONGEST)) for name, text in found if text]


def _values(statistics: Statistics | None, unit: str) -> list[tuple[str, str]]:
    if statistics is None:
        return [("Values", "being counted …")]
    if statistics.count == 0:
        found = [("Values", "none that is finite")]
    else:
        middle = ", ".join(f"{statistics.percentile(p):.5g}" for p in (1, 50, 99))
        found = [
            ("Values", f"{statistics.low:.6g} … {statistics.high:.6g}{unit}"),
            ("Mean", f"{statistics.mean:.5g} ± {statistics.std:.4g}{unit}"),
            ("1, 50, 99 %", middle),
        ]
    counts = (
        ("NaN", statistics.nan_count),
        ("Infinite", statistics.inf_count),
        ("Padding", statistics.padding_count),
    )
    return found + [(name, f"{n:,} voxels".replace(",", " ")) for name, n in counts if n]


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
    flags = imgui.TableFlags_.row_bg | imgui.TableFlags_.resizable | imgui.TableFlags_.scroll_y
    height = max(imgui.get_content_region_avail().y, widgets.em(8))
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
