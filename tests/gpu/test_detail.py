"""What is drawn while things move: as exact as it shows, as light as it has to be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import volviz
from tests.isosurface.shapes import sphere
from volviz.gpu import detail
from volviz.model.levels import Level, coarser, keep_coarser
from volviz.model.mesh import Mesh
from volviz.model.surface_look import SceneSurface
from volviz.progress import silent
from volviz.resolve import resolve
from volviz.resolve_surfaces import make_levels, without_levels

SIZE = (400, 300)


@pytest.fixture(scope="module")
def frame():
    volume = sphere(40)
    scene = volviz.Scene.of(volume).with_surfaces([SceneSurface.at(0.0)])
    return resolve(scene)


def copies(frame, *parts):
    """Meshes with parts of the frame's triangles."""
    mesh = frame.meshes[0].mesh
    return [Mesh(mesh.vertices, mesh.faces[: int(len(mesh.faces) * p)]) for p in parts]


def test_light_meshes_stay(frame):
    assert detail.lighter(frame, SIZE) is frame


def test_the_level_that_errs_a_pixel_is_drawn_or_a_lighter_one(frame, monkeypatch):
    mesh = frame.meshes[0].mesh
    levels = [
        Level(m, e) for m, e in zip(copies(frame, 0.5, 0.2, 0.1), (1e-9, 1e-8, 9.0), strict=True)
    ]
    keep_coarser(mesh, levels)
    drawn = {}
    for light in (0.9, 0.6, 0.15, 0.01):
        monkeypatch.setattr(detail, "LIGHT", int(light * len(mesh.faces)))
        drawn[light] = detail.lighter(frame, SIZE).meshes[0].mesh
    # the coarsest of those that cannot be told from the finest, but no more than may be drawn
    assert drawn[0.9] is drawn[0.6] is levels[1].mesh
    assert drawn[0.15] is drawn[0.01] is levels[2].mesh
    keep_coarser(mesh, ())


def test_until_there_are_levels_something_stands_in(frame, monkeypatch):
    monkeypatch.setattr(detail, "LIGHT", 10)
    (stand_in,) = copies(frame, 0.1)
    (drawn,) = frame.meshes
    one = replace(frame, meshes=(replace(drawn, coarse=stand_in),))
    assert detail.lighter(one, SIZE).meshes[0].mesh is stand_in
    assert detail.lighter(frame, SIZE).meshes[0].mesh is drawn.mesh


def test_levels_are_made_once_kept_with_the_mesh_and_take_a_third_of_it(frame, monkeypatch):
    mesh = replace(frame.meshes[0].mesh)
    monkeypatch.setattr("volviz.resolve_surfaces.FEW", 100)
    made = volviz.resolve_surfaces.Extracted(None, mesh, mesh, 0.0)
    assert without_levels([None, made, made]) == [mesh]
    make_levels(mesh, silent())
    assert without_levels([made]) == []
    found = coarser(mesh)
    assert sum(le.mesh.nbytes for le in found) < 0.4 * mesh.nbytes
    assert len(found[0].mesh.faces) < 0.3 * len(mesh.faces)
    radius = np.linalg.norm(found[0].mesh.vertices, axis=1)
    assert np.abs(radius - 0.7).max() < 0.02
    assert 0 < found[0].error < 0.02
