"""Span space: the plot's colours, dragging, choices, nodes; without a window."""

from __future__ import annotations

import time

import numpy as np
import pytest

import volviz
from volviz.app.answers import Answers
from volviz.fields.statistics import statistics
from volviz.isosurface.cells import CellRanges
from volviz.isosurface.finders import FINDERS
from volviz.isosurface.visits import binned, visits
from volviz.model.surface_look import SceneSurface
from volviz.model.volume import Volume
from volviz.ui import ambiguous_view, cell_picture, span_nodes, span_plot
from volviz.ui.marks import Boxes, Marks
from volviz.ui.panels import PANELS
from volviz.ui.panels.span import State, _axes


@pytest.fixture
def panel(stage, scene, monkeypatch):
    """The panel with two surfaces, everything worked out."""
    monkeypatch.setattr("tests.ui.conftest.SIZE", (460, 1400))
    surfaces = [SceneSurface.at(300.0, finder="bono"), SceneSurface.at(0.0, finder="octree")]
    return settled(stage(PANELS["span"].function, scene.with_surfaces(surfaces)))


def settled(one):
    end = time.monotonic() + 240
    while True:
        one.frame()
        slots = one.local.of(Answers)._slots
        if "span.visits" in slots and all(s.answer.job is None for s in slots.values()):
            one.frame()
            return one
        assert time.monotonic() < end


def test_widgets_have_ids_of_their_own_and_tooltips(panel):
    panel.click("span.nodes")
    panel.frame(2)
    names = [name for _, name in panel.seen.ids]
    assert len(set(names)) == len(names)
    drawn = [number for number, _ in panel.seen.ids if number]
    assert len(set(drawn)) == len(drawn)
    assert all(len(text) > 3 for text in panel.seen.tips.values())
    assert {"span.plot", "span.finder", "span.surface", "span.idle", "span.level"} <= set(names)


def test_dragging_in_the_plot_sets_the_isovalue_along_the_diagonal(panel):
    left, top, right, bottom = panel.seen.where["span.plot"]
    x, y = (left + right) / 2, (top + bottom) / 2
    space = panel.local.of(Answers)._slots["span.bins"].answer.value.space
    middle = (space.edges[0] + space.edges[-1]) / 2
    after = panel.drag((x, y), (0, 0)).surfaces
    assert after[0].surface.isovalue == pytest.approx(middle, abs=np.ptp(space.edges) / 100)
    assert after[1].surface.isovalue == 0.0
    quarter = (right - left) / 4, -(bottom - top) / 4
    after = panel.drag((x, y), quarter).surfaces
    wanted = middle + np.ptp(space.edges) / 4
    assert after[0].surface.isovalue == pytest.approx(wanted, abs=np.ptp(space.edges) / 50)
    settled(panel)
    seen = panel.local.of(Answers)._slots["span.visits"].answer.value
    assert seen.isovalue == after[0].surface.isovalue


def test_surface_and_finder_are_chosen(panel):
    panel.click("span.surface")
    panel.frame(2)
    panel.click("span.surface.1")
    settled(panel)
    assert panel.local.of(Answers)._slots["span.visits"].answer.value.report.name == "octree"
    panel.click("span.finder")
    panel.frame(2)
    after = panel.click("span.finder.intervals")
    assert [s.surface.finder for s in after.surfaces] == ["bono", "intervals"]
    settled(panel)
    assert "span.nodes" not in panel.seen.where


def test_nodes_are_marked_and_go(panel):
    marks = panel.local.of(Marks)
    panel.click("span.nodes")
    boxes = marks.shown("nodes")
    seen = panel.local.of(Answers)._slots["span.visits"].answer.value
    assert len(boxes.ends) == sum(n.count for n in seen.levels)
    panel.click("span.idle")
    assert len(marks.shown("nodes").ends) == sum(n.looked_at for n in seen.levels)
    panel.click("span.nodes")
    assert marks.shown("nodes") is None


def test_too_many_nodes_are_left_out(monkeypatch, scene):
    cells = CellRanges.of(scene.volume)
    seen = visits(FINDERS["bono"].build(cells, None), binned(cells), 0.0)
    counts = [n.count for n in seen.levels]
    monkeypatch.setattr(span_nodes, "MOST", sum(counts[:-1]))
    assert span_nodes.chosen(seen, "all", idle=False) == list(seen.levels[:-1])
    assert span_nodes.chosen(seen, "2", idle=False) == []
    assert span_nodes.chosen(seen, "4", idle=False) == [seen.levels[-2]]
    told = span_nodes._left_out(seen, span_nodes.State(on=True))
    assert f"{counts[-1]:,} of 2³ cells" in told


def test_colours_say_what_was_done():
    counts = np.array([[0, 5, 5], [5, 5, 5]])
    tested = np.array([[0, 0, 3], [0, 2, 1]])
    reported = np.array([[0, 0, 0], [5, 3, 0]])
    assert span_plot.kinds(counts, tested, reported).tolist() == [[-1, 0, 1], [2, 2, 1]]


@pytest.mark.parametrize("kind", ["perspective", "orthographic"])
def test_looking_at_a_cell_keeps_the_direction(scene, kind):
    volume = scene.volume
    camera = volviz.Camera(**{**scene.camera.__dict__, "projection": kind})
    cell = 23 * 23 * 5 + 23 * 7 + 9
    after = ambiguous_view.looking_at(camera, volume, cell)
    middle = volume.affine[:3, :3] @ (9.5, 7.5, 5.5) + volume.affine[:3, 3]
    np.testing.assert_allclose(after.target, middle)
    np.testing.assert_allclose(after.axes(), camera.axes(), atol=1e-9)
    assert after.distance < camera.distance
    assert after.height < camera.height
    again = ambiguous_view.looking_at(after, volume, cell)
    assert again.distance == pytest.approx(after.distance)


def test_a_cell_fills_its_picture(scene):
    view = cell_picture.View(scene.volume, scene.camera, (3, 4, 5), 0.0)
    index = np.array([(3 + i, 4 + j, 5 + k) for i, j, k in np.ndindex(2, 2, 2)], float)
    world = index @ scene.volume.affine[:3, :3].T + scene.volume.affine[:3, 3]
    places = cell_picture.projected(view, world)
    assert np.abs(places).max() <= 0.5
    assert np.ptp(places[:, :2], axis=0).max() > 0.4
    np.testing.assert_allclose(places.mean(axis=0), 0, atol=1e-9)


def test_marks_stay_while_their_surface_does(scene):
    """Those that a panel has just shown, and those of an isovalue that the scene still has."""
    marks, ends = Marks(), np.zeros((1, 2, 3), np.float32)
    boxes = Boxes(scene.volume, 300.0, ends, np.zeros((1, 4), np.uint8), "span")
    there = scene.with_surfaces([SceneSurface.at(300.0)])
    moved = scene.with_surfaces([SceneSurface.at(301.0)])
    marks.show("a", boxes)
    assert marks._wanted(moved) == (boxes,)
    assert marks._wanted(moved) == ()
    assert marks._wanted(there) == (boxes,)
    other = volviz.Scene.of(volviz.Volume.from_array(np.zeros((3, 3, 3), np.uint8)))
    assert marks._wanted(other) == ()
    assert marks.shown("a") is None


def test_axes_have_the_isovalue_in_them():
    data = np.append(np.linspace(0, 1, 100_000), 5000.0).astype(np.float32).reshape(1, 1, -1)
    known, state = statistics(Volume.from_array(data)), State()
    assert _axes(known, 0.5, state)[1] < 2
    assert _axes(known, 4000.0, state)[1] == 5000
    assert _axes(known, 0.5, state)[1] == 5000, "axes do not jump back"
