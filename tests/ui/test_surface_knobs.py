"""The Surfaces panel shows a knob where it does something, and only there."""

from __future__ import annotations

import pytest

from volviz.isosurface.extractors import EXTRACTORS
from volviz.model.knobs import knobs_of
from volviz.model.surface import METHODS, Surface
from volviz.model.surface_look import SceneSurface
from volviz.ui.panels import PANELS

GENERAL = {"isovalue", "method", "level", "level_pixels"}
"""Knobs of every method; all others are an extractor's, or say how cells are found."""


@pytest.mark.parametrize("method", METHODS)
def test_a_knob_says_which_methods_take_it(method):
    row = EXTRACTORS[method]
    taken = {*row.knobs, *({"finder"} if row.by_cell else ())}
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
    assert shown == (GENERAL - {"isovalue"}) | set(row.knobs) | finder | {"method.reset"} & shown
    points = "surfaces.0.look.point_size" in one.seen.where
    assert points == (method == "dividing-cubes")
