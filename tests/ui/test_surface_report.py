"""The report of a surface in the Surfaces panel: what the command line says, of this mesh."""

from __future__ import annotations

import json
import time
from dataclasses import replace

import pytest

import volviz
from volviz.app.answers import Answers
from volviz.meshes.components import largest_component
from volviz.meshes.distance import two_sided
from volviz.meshes.measure import measure
from volviz.meshes.smooth import smooth
from volviz.model.surface_look import SceneSurface
from volviz.model.wanted import Wanted
from volviz.progress import silent
from volviz.resolve_surfaces import Extractions
from volviz.ui import clipboard, surface_report, widgets
from volviz.ui.panels import PANELS


@pytest.fixture
def unfolded(stage, scene, monkeypatch):
    """The panel with one surface, its report unfolded; and its mesh."""
    wanted = SceneSurface.at(300.0)
    found = Extractions().make(scene.volume, Wanted(wanted.surface), silent())
    one = stage(PANELS["surfaces"].function, scene.with_surfaces([wanted]))
    one.facts = replace(one.facts, statistics=volviz.resolve.known_statistics(scene.volume))
    one.facts = replace(one.facts, surfaces=(found,))
    said: dict[str, str] = {}
    monkeypatch.setattr(widgets, "fact", said.__setitem__)
    one.frame(2)
    one.click("surfaces.0.report")
    end = time.monotonic() + 200
    while "surfaces.0.report.json" not in one.seen.where:
        assert time.monotonic() < end
        one.frame()
    return one, found.mesh, said


def test_it_says_what_the_mesh_measures(unfolded, monkeypatch):
    one, mesh, said = unfolded
    report = measure(mesh)
    assert said["Triangles"] == str(len(mesh.faces))
    assert said["Euler characteristic"] == str(report.euler)
    assert said["Enclosed volume"] == f"{report.volume:.6g} mm³"
    copied: list[str] = []
    monkeypatch.setattr(clipboard, "put_text", copied.append)
    one.click("surfaces.0.report.json")
    one.click("surfaces.0.report.table")
    assert json.loads(copied[0]) == json.loads(json.dumps(report.as_dict()))
    assert f"area\t{report.area:.6g} mm²\n" in copied[1]
    assert one.scene.surfaces[0].surface.isovalue == 300.0


def test_it_is_kept_while_the_mesh_is_the_same(unfolded, monkeypatch):
    one, mesh, _ = unfolded
    answers = one.local.of(Answers)
    volume = one.scene.volume
    one.click("surfaces.0.report")
    for _ in range(3):
        answers.sweep(volume)
        one.frame()
    monkeypatch.setattr("volviz.meshes.measure.measure", lambda *_: 1 / 0)
    one.click("surfaces.0.report")
    assert "surfaces.0.report.json" in one.seen.where
    other = replace(one.facts.surfaces[0], mesh=replace(mesh))
    one.facts = replace(one.facts, surfaces=(other,))
    end = time.monotonic() + 200
    while "surfaces.0.report.again" not in one.seen.where:
        assert time.monotonic() < end
        one.frame()


def test_what_was_done_to_it_is_told_with_how_far_it_moved(scene):
    wanted = SceneSurface.at(300.0, smooth=3, keep_largest=True)
    made = Extractions()
    found = made.make(scene.volume, Wanted(wanted.surface, wanted.refining), silent())
    told = surface_report.measured(found, silent())
    plain = volviz.extract_surface(scene.volume, 300.0)
    largest = largest_component(plain)
    moved = two_sided(smooth(largest, 3), largest)
    assert told.report == measure(found.mesh)
    assert told.extracted == len(plain.faces)
    for name in ("hausdorff", "mean", "rms"):
        assert getattr(told.moved, name) == pytest.approx(getattr(moved, name))
    assert ("extracted", f"{len(plain.faces)} triangles") in told.lines("mm")
    assert told.as_dict()["distance_mm"]["hausdorff"] == pytest.approx(moved.hausdorff)
    assert moved.hausdorff > 0
    only = SceneSurface.at(300.0, keep_largest=True)
    found = made.make(scene.volume, Wanted(only.surface, only.refining), silent())
    assert surface_report.measured(found, silent()).moved is None
