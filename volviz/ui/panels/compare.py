"""Compare: one knob over several values, as pictures with time and error; a wipe between two."""

from __future__ import annotations

from dataclasses import dataclass

from volviz.errors import VolvizError
from volviz.lab import measure, vary
from volviz.lab.vary import Axis
from volviz.model.knobs import Knob
from volviz.model.scene import SceneState
from volviz.model.surface_look import FIELDS
from volviz.ui import edit, gallery, looks, widgets
from volviz.ui.facts import Facts
from volviz.ui.im import ImVec2, icons, imgui
from volviz.ui.trials import MOST, SIDE, Trial, Trials

PRESET = "preset"
FIRST = "raycast.step"
GROUPS = {"raycast": "Rays", "refining": "After extraction"}
PRESETS = 4
"""Presets that are proposed, of those made for such data."""
TURNS = {"step": (0.5, 1.0, 2.0, 4.0)}
USUAL = (0.5, 1.0, 2.0)
"""Times the present value: proposed where a range spans several powers of ten."""


@dataclass
class State:
    """name: what varies. text: its values as they are typed. errors: these are measured, too.
    left, right: numbers of the variants for the wipe. proposed: for which knob values were."""

    name: str = FIRST
    text: str = ""
    errors: bool = True
    left: int = 0
    right: int = 1
    proposed: str = ""


def panel(scene: SceneState, facts: Facts) -> SceneState:
    """Choose what varies, try it, take one over."""
    state, trials = facts.local.of(State), facts.local.of(Trials)
    places = vary.places(scene)
    if state.name not in places and state.name != PRESET:
        state.name = next(iter(places), PRESET)
    _knob(scene, state, places)
    if state.proposed != state.name:
        state.text, state.proposed = proposal(scene, state.name, facts), state.name
    axis, wrong = _values(scene, state)
    _run(scene, axis, state, trials)
    if wrong:
        widgets.wrapped(wrong, widgets.warning_color())
    if not trials.all:
        imgui.spacing()
        widgets.wrapped(
            "One knob over several values: each as a picture of this view, with the time it takes "
            "and how far it is from the same scene finely sampled."
        )
        return scene
    taken = _pictures(scene, state, trials)
    _surfaces(trials)
    _wipe(state, trials)
    if taken is None:
        return scene
    new = vary.turned(scene, taken.variant.changed, aspect=facts.aspect)
    return scene if new == scene else new


def _knob(scene: SceneState, state: State, places: dict[str, vary.Place]) -> None:
    options = [("Look", PRESET, "Preset", vary.MORE[PRESET].help)]
    for name, place in places.items():
        alone = place.knob.choices and len(place.knob.choices) < 2
        if not alone:
            group = GROUPS.get(place.part, place.part.capitalize())
            options.append((group, name, edit.title(place.knob), edit.about(place.knob)))
    shown = {name: f"{group} · {label}" for group, name, label, _ in options}
    imgui.set_next_item_width(widgets.FILL)
    state.name = widgets.choice(
        "compare.knob", "What varies.", state.name, options, shown=shown.get(state.name)
    )


def proposal(scene: SceneState, name: str, facts: Facts) -> str:
    """Values to begin with, from what the knob says of itself and from where it stands."""
    if name == PRESET:
        if facts.statistics is None:
            return ""
        found = looks.catalogue(scene.volume, facts.statistics)
        return ", ".join([c.name for c in found if c.preset and c.suits][:PRESETS])
    place = vary.places(scene)[name]
    values = _around(place.knob, vary.value_of(scene, place))
    return ", ".join(map(vary.value_text, values))


def _around(knob: Knob, now: object) -> list[object]:
    if knob.choices:
        return list(knob.choices)
    if knob.type is bool:
        return [False, True]
    if knob.name == "color_field":
        return list(dict.fromkeys([now, *FIELDS]))
    assert isinstance(now, int | float)
    low = -1e30 if knob.low is None else knob.low
    high = 1e30 if knob.high is None else knob.high
    if low > 0 and high / low >= edit.WIDE:
        near = [now * f for f in TURNS.get(knob.name, USUAL)]
    elif high - low <= 4:
        near = [low, (low + high) / 2, high]
    else:
        reach = (high - low) / 8 if high - low <= 1000 else 1
        near = [now - reach, now, now + reach]
    kept = (min(max(v, low), high) for v in near)
    return list(dict.fromkeys(round(v) if knob.type is int else widgets.rounded(v) for v in kept))


def _values(scene: SceneState, state: State) -> tuple[Axis | None, str]:
    """The field of the values; the axis they make, or what is wrong with them."""
    imgui.set_next_item_width(widgets.FILL)
    text = "Values, with commas between them; 'all' for all choices."
    state.text = widgets.search("compare.values", "Values", text, state.text)
    if not state.text.strip():
        return None, ""
    try:
        axis = vary.axis(f"{state.name}={state.text.strip().rstrip(',')}", scene)
    except VolvizError as error:
        fix = f" – {error.fix}" if error.fix else ""
        return None, f"{error.what[:1].upper()}{error.what[1:]}{fix}"
    if len(axis.values) > MOST:
        return None, f"{len(axis.values)} values are more than {MOST} – 'volviz compare' takes more"
    return axis, ""


def _run(scene: SceneState, axis: Axis | None, state: State, trials: Trials) -> None:
    if trials.running:
        label = f"{icons.ICON_FA_STOP}  Stop"
        if widgets.button("compare.stop", label, "What is drawn by now stays."):
            trials.stop()
        imgui.same_line()
        imgui.progress_bar(trials.fraction, ImVec2(widgets.FILL, 0), f"{trials.fraction:.0%}")
        return
    text = "Draw each variant as it is seen now, measure its time and its error."
    label = f"{icons.ICON_FA_PLAY}  Try them"
    if widgets.button("compare.run", label, text, enabled=axis is not None) and axis is not None:
        trials.begin(scene, axis, errors=state.errors)
        state.left, state.right = 0, len(trials.all) - 1
    errors = "Measure errors"
    widgets.beside(errors, box=True)
    text = (
        "Also draw each of them finely sampled, and say how far it is from that; measure surfaces, "
        "of samples against their closed form too. This takes long."
    )
    state.errors = widgets.toggle("compare.errors", errors, text, state.errors)


def _pictures(scene: SceneState, state: State, trials: Trials) -> Trial | None:
    """All variants; the one that was clicked."""
    imgui.spacing()
    grid, picked = gallery.Grid(), None
    ends = {state.right: "B", state.left: "A"} if len(trials.all) > 1 else {}
    for number, trial in enumerate(trials.all):
        hit = grid.cell(
            f"compare.{number}",
            trial.title,
            _about(trial),
            None if trial.texture is None else int(trial.texture.glo),
            active=_worn(scene, trial),
            badge=ends.get(number, "") if trials.wipe is not None else "",
            note=_numbers(trial),
        )
        picked = trial if hit.clicked else picked
        if hit.asked:
            texture = None if trial.texture is None else int(trial.texture.glo)
            gallery.preview(texture, trial.title, _about(trial).split("\n"), None)
    return picked


def _worn(scene: SceneState, trial: Trial) -> bool:
    """True if the scene has what this variant has."""
    places = vary.places(scene)
    return all(
        vary.value_of(scene, places[name]) == value
        if name in places
        else scene.transfer.name == value
        for name, value in trial.variant.changed.items()
    )


def _numbers(trial: Trial) -> str:
    parts = [] if trial.ms is None else [measure.time_text(trial.ms)]
    parts += [] if trial.rmse is None else [f"Δ {trial.rmse:.2f}"]
    return " · ".join(parts)


def _about(trial: Trial) -> str:
    lines = ["Click to take it over."]
    if trial.ms is not None:
        lines.insert(0, f"{measure.time_text(trial.ms)} for {SIDE} × {SIDE} pixels, drawn once.")
    if trial.rmse is not None:
        told = f"RMSE {trial.rmse:.2f}, at most {trial.largest}, in 1/255 of sRGB"
        lines.insert(1, f"{told}, against the same finely sampled.")
    return "\n".join(lines)


def _surfaces(trials: Trials) -> None:
    """A table of what was measured of the variants' surfaces: a column for each variant."""
    columns = measure.columns_of([t.facts for t in trials.all])
    if not columns:
        return
    imgui.separator_text("Surfaces")
    kinds = imgui.TableFlags_
    flags = kinds.borders_inner_v | kinds.row_bg | kinds.scroll_x | kinds.sizing_fixed_fit
    line = imgui.get_text_line_height() + 2 * imgui.get_style().cell_padding.y
    tall = (len(columns) + 1) * line + imgui.get_style().scrollbar_size
    if not imgui.begin_table("measured", 1 + len(trials.all), flags, ImVec2(0, tall)):
        return
    imgui.table_setup_scroll_freeze(1, 1)
    imgui.table_next_row()
    for title in ("", *(t.title for t in trials.all)):
        imgui.table_next_column()
        imgui.text_disabled(title)
    for name, column in columns.items():
        imgui.table_next_row()
        imgui.table_next_column()
        imgui.text_unformatted(column.title)
        imgui.set_item_tooltip(f"{column.help[:1].upper()}{column.help[1:]}.")
        for trial in trials.all:
            imgui.table_next_column()
            known = name in trial.facts
            imgui.text_unformatted(column.text(trial.facts[name]) if known else "–")
    imgui.end_table()


def _wipe(state: State, trials: Trials) -> None:
    """Which two stand in the view, and whether they do."""
    count = len(trials.all)
    if count < 2:
        return
    imgui.separator_text("Wipe")
    state.left, state.right = (min(n, count - 1) for n in (state.left, state.right))
    before = (state.left, state.right)
    options = [("", str(i), t.title, "") for i, t in enumerate(trials.all)]
    half = (imgui.get_content_region_avail().x - imgui.get_style().item_spacing.x) / 2
    chosen = []
    for side, number in (("left", state.left), ("right", state.right)):
        imgui.set_next_item_width(half)
        shown = trials.all[number].variant.label
        text = f"The variant on the {side}."
        chosen.append(
            int(widgets.choice(f"compare.{side}", text, str(number), options, shown=shown))
        )
        if side == "left":
            imgui.same_line()
    state.left, state.right = chosen
    on = trials.wipe is not None
    label = f"{icons.ICON_FA_XMARK}  End" if on else f"{icons.ICON_FA_TABLE_COLUMNS}  Show both"
    text = (
        "The view shows the scene again (Esc)."
        if on
        else "Both in the view, left and right of a line that can be dragged."
    )
    pressed = widgets.button("compare.wipe", label, text)
    if pressed and on:
        trials.end_wipe()
    elif pressed or (on and before != (state.left, state.right)):
        trials.begin_wipe(trials.all[state.left], trials.all[state.right])
