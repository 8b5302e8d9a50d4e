"""Surfaces beside the same scene in VTK: what is covered, how deep it is and how bright."""

from __future__ import annotations

import numpy as np
import pytest

import volviz
from tests.bench import stills
from tests.gpu.oracles import looking
from volviz.model.surface_look import COLORS

SIZE = (144, 144)
CASES = {
    # still: least overlap; most RMS of grey levels, and of the depth in voxels (its median: 0.02)
    "marching-cubes": (0.985, 9.0, 2.0),
    "bone-in-skin": (0.985, 9.0, 2.0),
    "back-faces": (0.97, 9.0, 2.0),
    "in-volume": (0.97, 9.0, 2.0),
}


@pytest.fixture(scope="module")
def head():
    return volviz.sample("ct-head", size=64)


@pytest.mark.parametrize("name", CASES)
def test_a_scene_looks_as_in_vtk(name, head):
    pytest.importorskip("vtk", exc_type=ImportError)
    overlap, gray, deep = CASES[name]
    scene = stills.STILLS[name].scene(head)
    ours, theirs = stills.ours(scene, SIZE), stills.theirs(scene, SIZE)
    found = stills.agreement(ours, theirs)
    voxel = min(head.spacing)
    assert found["covered"] > overlap, found
    assert found["silhouette"] > 0.985, found
    assert found["gray"] < gray, found
    assert found["depth"] < deep * voxel, found
    assert found["depth_median"] < 0.02 * voxel, found


@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
def test_dividing_cubes_leave_no_holes_and_no_speckle_on_anisotropic_voxels(projection):
    """Discs lie in the surface: in the outline of marching cubes, and about as bright."""
    z, y, x = np.mgrid[-1:1:16j, -1:1:40j, -1:1:40j]
    ball = volviz.Volume.from_array(
        (0.8 - np.sqrt(x * x + y * y + z * z)).astype(np.float32), spacing=(1, 1, 2.6)
    )
    pictures = []
    for method in ("marching-cubes", "dividing-cubes"):
        still = stills.Still(((0.0, {"method": method, "color": COLORS[0], "highlight": 0}),))
        scene = still.scene(ball).with_camera(looking(ball, projection=projection))
        pictures.append(volviz.render(scene, SIZE, samples=1).pixels.astype(float))
    there, points = (p[..., 3] > 0 for p in pictures)
    inside = there & np.roll(there, 2, 0) & np.roll(there, -2, 0)
    inside &= np.roll(there, 2, 1) & np.roll(there, -2, 1)
    assert inside.sum() > 3000
    assert points[inside].all()
    assert (there & points).sum() / (there | points).sum() > 0.8
    apart = np.abs(pictures[0] - pictures[1])[inside][:, :3].mean(axis=1)
    assert np.quantile(apart, 0.99) < 30
