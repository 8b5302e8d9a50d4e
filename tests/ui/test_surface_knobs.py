"""The Surfaces panel shows a knob where it does something, and only there."""

from __future__ import annotations

import pytest

from volviz.isosurface.extractors import EXTRACTORS
from volviz.model.knobs import knobs_of
from volviz.model.refining import Refining
from volviz.model.surface import METHODS, Surface
from volviz.model.surface_look import SceneSurface
from volviz.ui.panels import PANELS

GENERAL = {"isovalue", "method", "level", "level_pixels"}
"""Knobs of every method; all others are an extractor's, or say how cells are found."""
BY_VIEW = {"cuberille": {"size_pixels", "front_faces"}, "dividing-cubes": {"size_pixels"}}
"""Knobs that reach the extractor through the camera."""


@pytest.mark.parametrize("method", METHODS)
def test_a_knob_says_which_methods_take_it(method):
    row = EXTRACTORS[method]
    taken = {*row.knobs, *({"finder"} if row.by_cell else ()), *BY_VIEW.get(method, ())}
    used = {k.name for k in knobs_of(Surface) if k.used({"method": method})}
    assert used - GENERAL == taken


@pytest.mark.parametrize("method", ["marching-cubes", "dividing-cubes", "contour-tracing"])
def test_only_those_are_shown(method, stage, scene, monkeypatch):
    monkeypatch.setattr("tests.ui.conftest.SIZE", (460, 1400))
    one = stage(
        PANELS["surfaces"].function,
        scene.with_surfaces([SceneSurface.at(300.0, method=method)]),
    )
    one.click("surfaces.0.more")
    one.frame(2)
    scope = "surfaces.0.surface."
    shown = {id_.removeprefix(scope) for id_ in one.seen.where if id_.startswith(scope)}
    row = EXTRACTORS[method]
    finder = {"finder"} if row.by_cell else set()
    general = GENERAL - {"isovalue"} | BY_VIEW.get(method, set())
    assert shown == general | set(row.knobs) | finder | {"method.reset"} & shown
    points = "surfaces.0.look.point_size" in one.seen.where
    assert points == (method == "dividing-cubes")


AFTER = {k.name for k in knobs_of(Refining)}


def after(one) -> set[str]:
    """Knobs of the folded part that are shown."""
    scope = "surfaces.0.after."
    found = {i.removeprefix(scope) for i in one.seen.where if i.startswith(scope)}
    return {name for name in found if not name.endswith(".reset")}


@pytest.mark.parametrize(
    ("knobs", "lens", "hidden"),
    [
        ({}, False, {"boundary"}),
        ({"smooth": 3}, False, set()),
        ({"max_error": 0.5}, False, set()),
        ({"boundary": "simplified"}, False, set()),
        ({"method": "contour-tracing"}, False, {"boundary"}),
        ({"method": "dividing-cubes"}, False, AFTER - {"flip"}),
        ({"smooth": 3}, True, AFTER - {"flip"}),
        ({"smooth": 3, "method": "cuberille"}, True, set()),
        ({"method": "cuberille", "front_faces": True}, False, AFTER - {"flip"}),
    ],
)
def test_after_extraction_shows_what_acts(knobs, lens, hidden, stage, scene, monkeypatch):
    monkeypatch.setattr("tests.ui.conftest.SIZE", (460, 1400))
    one = stage(
        PANELS["surfaces"].function,
        scene.with_surfaces([SceneSurface.at(300.0, **knobs)]).with_knobs(lens=lens),
    )
    assert after(one) == set()
    one.click("surfaces.0.after")
    one.frame(2)
    assert after(one) == AFTER - hidden


def test_a_step_is_turned_where_it_stands(stage, scene, monkeypatch):
    monkeypatch.setattr("tests.ui.conftest.SIZE", (460, 1400))
    one = stage(
        PANELS["surfaces"].function,
        scene.with_surfaces([SceneSurface.at(300.0), SceneSurface.at(-300.0, smooth=2)]),
    )
    one.click("surfaces.0.after")
    one.frame(2)
    one.click("surfaces.0.after.keep_largest")
    first, second = one.scene.surfaces
    assert first == SceneSurface.at(300.0, keep_largest=True)
    assert second == SceneSurface.at(-300.0, smooth=2)
    one.frame(2)
    one.click("surfaces.0.after.keep_largest.reset")
    assert one.scene.surfaces[0] == SceneSurface.at(300.0)


def test_every_widget_of_several_surfaces_has_an_id_of_its_own_and_a_tooltip(
    stage, scene, monkeypatch
):
    monkeypatch.setattr("tests.ui.conftest.SIZE", (460, 2400))
    kinds = [{"coloring": "field"}, {"method": "dividing-cubes"}]
    surfaces = [SceneSurface.at(v, **k) for v, k in zip((300.0, -300.0), kinds, strict=True)]
    one = stage(PANELS["surfaces"].function, scene.with_surfaces(surfaces))
    for number in (1, 0):  # the lower one while it is within reach
        one.click(f"surfaces.{number}.more")
        one.frame(2)
        one.click(f"surfaces.{number}.after")
        one.frame(2)
    names = [name for _, name in one.seen.ids]
    numbers = [number for number, _ in one.seen.ids if number]
    assert {"surfaces.0.look.color_field", "surfaces.1.look.point_size"} <= set(names)
    assert {"surfaces.0.save", "surfaces.1.save"} <= set(names)
    assert len(set(names)) == len(names)
    assert len(set(numbers)) == len(numbers)
    assert all(len(text) > 3 for _, text in one.shape())
