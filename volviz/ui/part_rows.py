"""Rows of the Data panel that change to another series, array, time or channel of the open file."""

from __future__ import annotations

from volviz.app.choosing import asking, channel_titles
from volviz.model.scene import SceneState
from volviz.model.volume import VolumeInfo
from volviz.ui import widgets
from volviz.ui.facts import Facts
from volviz.ui.im import imgui

FEW = 32
"""So many channels are listed; more are counted off on a slider."""


def part_rows(scene: SceneState, facts: Facts) -> SceneState:
    """The section, where the source has several; the scene with the wish for another one."""
    info = scene.volume.info
    several = len(facts.parts) > 1 or info.times * info.channels > 1
    if scene.source is None or not several:
        return scene
    wanted = dict(scene.source.choices if facts.wanted is None else facts.wanted)
    asked: dict[str, int | str] = {}
    with widgets.form("part", ("Channel",)) as shown:
        if shown and len(facts.parts) > 1:
            asked |= _series(wanted.get("series"), facts)
        if shown and info.times > 1:
            asked |= _time(wanted.get("time", 0), info.times)
        if shown and info.channels > 1:
            asked |= _channel(wanted.get("channel", 0), info)
    imgui.spacing()
    return asking(scene, **asked) if asked else scene


def _series(now: str | None, facts: Facts) -> dict[str, int | str]:
    kind = facts.parts[0].kind.capitalize()
    widgets.label(kind)
    options = [
        ("", str(dict(p.choices)["series"]), p.title, f"{p.modality} {p.title}".strip())
        for p in facts.parts
    ]
    shown = next((label for _, name, label, _ in options if name == now), now or "")
    text = f"{kind} of this source that is open. Another one is opened in its place."
    new = widgets.choice("part.series", text, now or "", options, shown=shown)
    return {} if new == (now or "") else {"series": new, "time": 0, "channel": 0}


def _time(now: int, count: int) -> dict[str, int | str]:
    widgets.label("Time")
    text = "Which time point of the file is shown. Camera and transfer function stay."
    new = _slider("part.time", text, now, count)
    return {} if new == now else {"time": new}


def _channel(now: int, info: VolumeInfo) -> dict[str, int | str]:
    count, names = info.channels, channel_titles(info)
    widgets.label("Channel")
    text = "Which channel of the file is shown. Camera and transfer function stay."
    if count > FEW:
        new = _slider("part.channel", text, now, count)
    else:
        options = [("", str(k), name, f"Channel {k + 1}: {name}") for k, name in enumerate(names)]
        new = int(widgets.choice("part.channel", text, str(now), options, shown=names[now]))
    return {} if new == now else {"channel": new}


def _slider(id_: str, text: str, now: int, count: int) -> int:
    form = f"%d of {count}"
    return widgets.slide_whole(id_, text, now + 1, low=1, high=count, form=form) - 1
