"""Columns of surfaces in a comparison: cost, topology, distance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import volviz
from volviz.errors import Cancelled
from volviz.isosurface import built_finder, extract
from volviz.lab.surfaces import surface_facts
from volviz.meshes.measure import measure
from volviz.model.surface_look import SceneSurface
from volviz.progress import Progress


@pytest.fixture(scope="module")
def scene():
    z, y, x = np.mgrid[-9:9, -9:9, -9:9]
    values = (7 - np.sqrt(x**2 + y**2 + z**2)).astype(np.float32)
    plain = volviz.Scene.of(volviz.Volume.from_array(values, name="ball"))
    return plain.with_surfaces([SceneSurface.at(0.5)]).with_knobs(show_volume=False, samples=1)


def test_a_ball_is_one_closed_surface_at_no_distance(scene):
    (facts,) = surface_facts([scene], 2)
    assert facts is not None
    assert (facts.euler, facts.boundary_edges) == (2, 0)
    assert 0 < facts.visited < 17**3, "bricks"
    assert facts.distance == 0
    mesh = volviz.extract_surface(scene.volume, 0.5)
    assert facts.triangles == len(mesh.faces) != len(mesh.vertices)
    assert facts.extract_ms > 0


def test_methods_and_finders_differ_as_they_must(scene):
    names = ("brute-force", "octree", "interval-tree")
    scenes = [
        scene.with_surfaces([SceneSurface.at(0.5, finder=n, method="marching-tetrahedra")])
        for n in names
    ]
    brute, octree, tree = surface_facts(scenes, 1)
    assert brute.triangles == octree.triangles == tree.triangles
    assert brute.visited == 17**3 > tree.visited
    assert 0 < brute.distance < np.sqrt(3), "within a cell"


def test_sums_are_over_all_visible_surfaces_and_the_distance_is_both_ways(scene):
    """A surface that ends at the border has open edges; an island one side lacks is far away."""
    two = scene.with_surfaces([SceneSurface.at(0.5), SceneSurface.at(-3.0)])
    (facts,) = surface_facts([two], 0)
    meshes = [volviz.extract_surface(scene.volume, v) for v in (0.5, -3.0)]
    reports = [measure(mesh) for mesh in meshes]
    assert facts.triangles == sum(len(mesh.faces) for mesh in meshes)
    assert facts.euler == sum(r.euler for r in reports)
    assert facts.boundary_edges == reports[1].boundary_edges > 0
    with_speck = scene.volume.data.copy()
    with_speck[1, 1, 1] = 1.0
    info = scene.volume.info
    specked = replace(scene, volume=volviz.Volume(with_speck, info))
    for level, far in ((0, 0.0), (1, 4.0)):
        (found,) = surface_facts([specked.with_surfaces([SceneSurface.at(0.5, level=level)])], 0)
        assert found.distance >= far, "half as fine there is no speck, which is seen from it alone"
        assert (found.distance == 0) == (level == 0)


def test_what_is_not_visible_has_no_facts(scene):
    hidden = scene.surfaces[0]
    hidden = replace(hidden, look=replace(hidden.look, visible=False))
    assert surface_facts([scene.with_surfaces([hidden])], 1) == [None]


def test_the_table_has_columns_of_surfaces_only_where_there_are_some(scene):
    axes = {"surface.method": ["marching-cubes", "marching-tetrahedra"]}
    found = volviz.compare(scene, axes, size=(24, 24), repeat=1, reference="none")
    columns, rows = found.table()
    assert "χ" in columns
    assert [row[columns.index("χ")] for row in rows] == ["2", "2"]
    entries = found.document()["variants"]
    assert [e["euler"] for e in entries] == [2, 2]
    assert entries[0]["triangles"] < entries[1]["triangles"]
    plain = scene.with_surfaces([]).with_knobs(show_volume=True)
    none = volviz.compare(plain, {"step": [1.0]}, size=(24, 24), repeat=0, reference="none")
    assert "χ" not in none.table()[0]
    assert "euler" not in none.document()["variants"][0]


def test_millimetres_are_titles_only_where_the_unit_is_known(scene):
    axes = {"surface.method": ["marching-cubes"]}
    info = replace(scene.volume.info, length_unit=None)
    unknown = replace(scene, volume=replace(scene.volume, info=info))
    for one, title in ((scene, "distance mm"), (unknown, "distance")):
        found = volviz.compare(one, axes, size=(16, 16), repeat=0, reference="none")
        columns, rows = found.table()
        assert title in columns
        assert rows[0][columns.index(title)] == "0", "the same surface, without rounding"
        assert any(c.endswith(" mm") for c in columns) == (one is scene)


def test_what_was_visited_is_of_what_was_made(scene):
    """Of the coarser level, not of the volume; all cells where no finder helps; else not said."""
    spec = [{"level": 1}, {"method": "contour-tracing", "finder": "octree"}, {"level_pixels": 1.0}]
    made = [SceneSurface.at(0.5, **{"finder": "brute-force", **more}) for more in spec]
    facts = surface_facts([scene.with_surfaces([one]) for one in made], 1)
    assert [f.visited for f in facts] == [8**3, 17**3, None]
    both = surface_facts([scene.with_surfaces(made[:2]), scene.with_surfaces(made)], 1)
    assert [f.visited for f in both] == [8**3 + 17**3, None]
    found = volviz.compare(
        scene, {"surface.level-pixels": [0.0, 1.0]}, size=(16, 16), repeat=0, reference="none"
    )
    columns, rows = found.table()
    assert [row[columns.index("visited")] == "–" for row in rows] == [False, True]


def test_counting_leaves_the_reports_of_others_alone(scene):
    finder = built_finder(scene.volume, "octree")
    finder(3.0)
    before = finder.report
    surface_facts([scene.with_surfaces([SceneSurface.at(0.5, method="cuberille")])], 1)
    surface_facts([scene.with_surfaces([SceneSurface.at(0.5, finder="bricks")])], 1)
    assert finder.report == before


def test_times_are_of_extractions_alone(scene, monkeypatch):
    """Not of what is made once, and of none where nothing is timed."""
    seconds = iter([5.0, 4.0, 0.1, 0.4, 0.2, 0.3, 0.3, 0.2])
    clock = [0.0]
    calls = []

    def slow(volume, surface, progress=None):
        calls.append(surface.method)
        clock[0] += next(seconds)
        return extract(volume, surface)

    monkeypatch.setattr("volviz.lab.surfaces.extract", slow)
    monkeypatch.setattr("time.perf_counter", lambda: clock[0])
    monkeypatch.setattr("volviz.lab.surfaces._distance", lambda *_: None)
    methods = ("marching-cubes", "cuberille")
    scenes = [scene.with_surfaces([SceneSurface.at(0.5, method=m)]) for m in methods]
    cubes, blocks = surface_facts(scenes, 3)
    assert calls == list(methods) * 4
    assert (cubes.extract_ms, blocks.extract_ms) == pytest.approx((200, 300))
    seconds = iter([1.0, 1.0])
    assert [f.extract_ms for f in surface_facts(scenes, 0)] == [None, None]


def test_a_cancel_is_heard_while_a_surface_is_made(scene):
    told = []

    def stop(fraction, what):
        told.append(what)
        progress.cancel()

    progress = Progress(stop)
    with pytest.raises(Cancelled):
        surface_facts([scene], 3, progress)
    assert len(told) <= 2
    assert "measuring the distance" not in told
