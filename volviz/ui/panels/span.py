"""Span space: what each finder looks at to find a surface's cells, and the nodes of its tree."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from volviz.app.answers import Answer, Answers
from volviz.classify.isovalues import suggested_surface
from volviz.fields.statistics import Statistics
from volviz.model.knobs import knobs_of
from volviz.model.scene import SceneState
from volviz.model.surface import Surface
from volviz.model.surface_look import SceneSurface
from volviz.model.volume import Volume
from volviz.progress import Progress
from volviz.text import binary_size
from volviz.ui import edit, folds, isovalue_slider, span_nodes, span_plot, widgets
from volviz.ui.facts import Facts
from volviz.ui.im import icons
from volviz.ui.value_axis import Span

if TYPE_CHECKING:
    from volviz.isosurface.finder import Finder
    from volviz.isosurface.visits import Binned, Visits

LABELS = ("Surface", "Finder")
FINDER = next(k for k in knobs_of(Surface) if k.name == "finder")


@dataclass
class State:
    """number: of the surface that is looked at. whole: the axes have all values of this volume."""

    number: int = 0
    whole: bool = False
    volume: object = None


def panel(scene: SceneState, facts: Facts) -> SceneState:
    """Shows the query of one surface; its isovalue and its finder can be changed."""
    state, answers = facts.local.of(State), facts.local.of(Answers)
    if facts.statistics is None:
        widgets.dim("Counting the values …")
        return scene
    if not scene.surfaces:
        widgets.wrapped("Where the cells of a surface are found, by the values in them.")
        text = "One isosurface, at a value worth seeing (I)."
        if widgets.button("span.add", f"{icons.ICON_FA_PLUS}  Add surface", text):
            return scene.with_surfaces([suggested_surface(scene.volume, facts.statistics, ())])
        return scene
    if state.volume is not scene.volume:
        state.whole, state.volume = False, scene.volume
    state.number = min(state.number, len(scene.surfaces) - 1)
    now = _choices(scene, state)
    where = _bins(scene.volume, _axes(facts.statistics, now.surface.isovalue, state), answers)
    finder = _finder(scene.volume, now.surface.finder, answers)
    seen = _visits(scene.volume, now.surface, finder, where, answers)
    if where.value is not None:
        fitting = seen.value if seen is not None and _of(seen.value, now.surface.finder) else None
        now = _plot(now, where.value, fitting, scene.volume)
        _waiting(answers, finder, seen)
        if fitting is not None:
            _numbers(fitting, now.surface)
        span_nodes.section(scene.volume, fitting, facts)
    else:
        folds.waiting(answers, "span.bins", where)
    if now is scene.surfaces[state.number]:
        return scene
    return scene.with_surfaces(
        now if i == state.number else s for i, s in enumerate(scene.surfaces)
    )


def _axes(statistics: Statistics, isovalue: float, state: State) -> Span:
    """Nearly all values; all of them from the first isovalue on that is not among those."""
    low, high = isovalue_slider.span_of(statistics, ())
    room = 0.02 * (high - low)  # bins of whole numbers may end beyond
    state.whole |= not low - room <= isovalue <= high + room
    ends = (statistics.low, statistics.high) if state.whole else ()
    return isovalue_slider.span_of(statistics, ends)


def _choices(scene: SceneState, state: State) -> SceneSurface:
    """Which surface, and its finder; it as it is to be."""
    with widgets.form("span.choices", LABELS) as shown:
        if not shown:
            return scene.surfaces[state.number]
        if len(scene.surfaces) > 1:
            widgets.label("Surface")
            names = [f"{i + 1}: {s.surface.isovalue:g}" for i, s in enumerate(scene.surfaces)]
            options = [
                ("", str(i), name, f"Look at surface {name}.") for i, name in enumerate(names)
            ]
            text = "Whose cells are looked for."
            chosen = widgets.choice(
                "span.surface", text, str(state.number), options, shown=names[state.number]
            )
            state.number = int(chosen)
        now = scene.surfaces[state.number]
        widgets.label("Finder")
        finder = edit.knob_widget("span.finder", FINDER, now.surface.finder)
    surface = edit.changed(now.surface, finder=finder)
    return now if surface is now.surface else replace(now, surface=surface)


# --- what is worked out beside the window --------------------------------------------------------


def _bins(volume: Volume, span: Span, answers: Answers) -> Answer:
    def work(progress: Progress) -> Binned:
        from volviz.isosurface.cells import CellRanges  # brings the compiler with it
        from volviz.isosurface.visits import BINS, binned

        return binned(CellRanges.of(volume), BINS, progress, span=span)

    return answers.ask("span.bins", volume, span, work, title="Sorting cells into span space")


def _finder(volume: Volume, name: str, answers: Answers) -> Answer:
    def work(progress: Progress) -> Finder:
        from volviz.isosurface import built_finder

        return built_finder(volume, name, progress)

    return answers.ask("span.finder", volume, name, work, title=f"Building the finder {name}")


def _visits(
    volume: Volume, surface: Surface, finder: Answer, where: Answer, answers: Answers
) -> Answer | None:
    """What the finder looks at; None while there is nothing to look with."""
    if not (finder.fresh and where.fresh):
        return None

    def work(progress: Progress) -> Visits:
        from volviz.isosurface.visits import visits

        return visits(finder.value, where.value, surface.isovalue, progress)

    question = (surface.finder, surface.isovalue)
    title = "Following the search"
    return answers.ask("span.visits", volume, question, work, title=title, follow=True)


def _of(seen: Visits | None, finder: str) -> bool:
    return seen is not None and seen.report.name == finder


# --- what is shown -------------------------------------------------------------------------------


def _plot(now: SceneSurface, where: Binned, seen: Visits | None, volume: Volume) -> SceneSurface:
    unit = volume.info.value_unit
    value = now.surface.isovalue
    dragged = span_plot.draw("span.plot", where.space, seen, value, color=now.look.color, unit=unit)
    span_plot.legend(seen, int(where.space.counts.sum()))
    if dragged is None:
        return now
    surface = edit.changed(now.surface, isovalue=dragged)
    return now if surface is now.surface else replace(now, surface=surface)


def _waiting(answers: Answers, finder: Answer, seen: Answer | None) -> None:
    if not finder.fresh:
        folds.waiting(answers, "span.finder", finder)
    elif seen is not None and (seen.error or seen.stopped or seen.value is None):
        folds.waiting(answers, "span.visits", seen)


def _numbers(seen: Visits, surface: Surface) -> None:
    report = seen.report
    cells = max(report.cells, 1)
    rows: list[tuple[str, str]] = [
        ("Cells", f"{report.cells:,}"),
        ("Active", f"{report.active:,}  ({_share(report.active / cells)})"),
        ("Visited", f"{report.visited:,}  ({_share(report.visited / cells)}), nodes among them"),
        ("Built in", f"{1000 * report.build_seconds:,.0f} ms"),
        ("Memory", binary_size(report.nbytes)),
    ]
    with widgets.facts("span.numbers", [name for name, _ in rows]) as shown:
        if shown:
            for name, text in rows:
                widgets.fact(name, text)
    if surface.finder == "bricks":
        widgets.wrapped(
            "A first extraction, and any of up to 33 million samples, asks no bricks: the signs "
            "of all samples are found as quickly. This is what bricks do where they are asked."
        )


def _share(part: Any) -> str:
    return f"{np.round(100 * float(part), 3):.3g} %"
