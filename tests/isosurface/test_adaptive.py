"""View-dependent surfaces: no cracks, the plain surface in the lens, nothing seen is missing."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from tests.isosurface.oracles import assert_closed, boundary_edges, directed_edges, euler
from tests.isosurface.shapes import SHEARED, sphere, torus, volumes
from volviz.errors import Cancelled
from volviz.isosurface import adaptive, extract
from volviz.model.lens import Lens, Viewing, seen
from volviz.model.surface import Surface
from volviz.model.views import volume_camera
from volviz.model.volume import Volume
from volviz.progress import Progress
from volviz.samples import SAMPLES, sample

TWINS = {"ct-head-oblique", "ct-head-anisotropic"}
"""Samples with the voxels of ct-head."""


def lensed(volume, isovalue, *, cull=False, camera=None, opaque=True, rule="trilinear", **lens):
    focus = lens.pop("focus", (0.0, 0.0, 0.0))
    knobs = dict(zip(("lens_x", "lens_y", "lens_z"), map(float, focus), strict=True))
    made = Lens(lens=True, **{"lens_pixels": 0.0, **lens, **knobs})
    viewing = Viewing(camera or volume_camera(volume), (400, 300), made, opaque)
    wanted = seen(Surface(isovalue, ambiguity=rule), viewing)
    return adaptive.extract(volume, wanted, cull=cull)


def ordered(points):
    return points[np.lexsort(points.T)]


def noise(shape, seed, smooth=0.0, border=3):
    from scipy import ndimage

    field = np.random.default_rng(seed).standard_normal(shape)
    field = ndimage.gaussian_filter(field, smooth) if smooth else field
    return np.pad(field / field.std(), border, constant_values=-9).astype(np.float32)


# --- no cracks -----------------------------------------------------------------------------------


@pytest.mark.parametrize("growth", [0.05, 0.2, 0.7])
@pytest.mark.parametrize("smooth", [0.0, 1.5, 4.0])
def test_random_fields_are_closed_whatever_the_sizes_of_cells(smooth, growth):
    rng = np.random.default_rng(int(10 * smooth + 100 * growth))
    for seed in range(3):
        shape = rng.integers(20, 50, 3)
        volume = Volume.from_array(noise(shape, seed, smooth), affine=SHEARED if seed else None)
        focus = volume.affine[:3, :3] @ (rng.random(3) * volume.dims) + volume.affine[:3, 3]
        mesh = lensed(volume, 0.0, lens_growth=growth, lens_radius=0.05, focus=focus).mesh
        assert len(mesh.faces) > 500 * (1 - growth)
        assert_closed(mesh)


@pytest.mark.parametrize("name", sorted(set(SAMPLES) - TWINS))
def test_the_samples_have_no_edge_of_three_and_no_hole_but_at_the_border(name):
    volume = sample(name)
    data = volume.data[::3, ::3, ::3] if max(volume.dims) > 64 else volume.data
    low, high = np.nanmin(data), np.nanmax(data)
    # as wide as the coarsest cell, so that no cell at the border is inside
    padded = np.pad(data.astype(np.float32), 16, constant_values=float(low))
    volume = Volume.from_array(padded, affine=np.diag([1, 1.3, 0.7, 1]))
    focus = [n * 0.45 for n in volume.dims]
    for part in (0.3, 0.6):
        value = float(low + part * (high - low)) + 1e-3
        mesh = lensed(volume, value, lens_growth=0.3, lens_radius=0.05, focus=focus).mesh
        if np.isfinite(data).all():
            if len(mesh.faces):
                assert_closed(mesh)
        else:
            _, counts = np.unique(directed_edges(mesh.faces), axis=0, return_counts=True)
            assert counts.max(initial=1) == 1


def test_topology_of_smooth_shapes_stays():
    for volume, expected in ((sphere(50), 2), (torus(60), 0), (torus(60, 2), -2)):
        mesh = lensed(volume, 0.0, lens_growth=0.05, focus=(0.4, 0, 0.1)).mesh
        assert_closed(mesh)
        assert euler(mesh) == expected


def test_holes_stay_where_samples_are_not_valid():
    field = noise((30, 30, 30), 5, 2.0)
    field[10:14, 12:16, 8:20] = np.nan
    volume = Volume.from_array(field)
    whole = extract(volume, Surface(0.0))
    mesh = lensed(volume, 0.0, lens_growth=0.4, lens_radius=0.0).mesh
    assert len(mesh.faces) < len(whole.faces)
    assert boundary_edges(mesh) > 0
    used = mesh.vertices[_on_boundary(mesh)]
    near = np.all((used >= (7, 11, 9)) & (used <= (20, 16, 14)), axis=1)
    assert near.all()


def _on_boundary(mesh):
    edges = np.sort(directed_edges(mesh.faces), axis=1)
    known, counts = np.unique(edges, axis=0, return_counts=True)
    return np.unique(known[counts == 1])


# --- the lens ------------------------------------------------------------------------------------


def test_without_growth_it_is_marching_cubes():
    for name, volume, isovalues in volumes():
        if volume.data.dtype != np.float32:
            continue
        for isovalue in list(isovalues)[::3]:
            plain = extract(volume, Surface(float(isovalue)))
            mesh = lensed(volume, float(isovalue), lens_growth=0.0).mesh
            assert len(mesh.faces) == len(plain.faces), name
            size = float(np.linalg.norm(np.multiply(volume.spacing, volume.dims)))
            if len(mesh.faces):
                ours, theirs = ordered(mesh.vertices.round(3)), ordered(plain.vertices.round(3))
                assert np.abs(ours - theirs).max() < 1e-3 + 1e-5 * size, name


def test_in_the_lens_triangles_and_normals_are_those_of_marching_cubes_elsewhere_fewer():
    volume, focus = sphere(70), np.array([0.0, 0.0, 0.7])
    plain = extract(volume, Surface(0.0))
    mesh = lensed(volume, 0.0, lens_growth=0.2, lens_radius=0.1, focus=focus).mesh
    assert len(mesh.faces) < 0.4 * len(plain.faces)
    radius = 0.1 * np.sqrt(3) * 2 * 70 / 69

    def in_it(of):
        inside = np.linalg.norm(of.vertices - focus, axis=1) < radius
        order = np.lexsort(of.vertices[inside].T.round(5))
        faces = int(inside[of.faces].all(axis=1).sum())
        return of.vertices[inside][order], of.normals[inside][order], faces

    ours, theirs = in_it(mesh), in_it(plain)
    assert ours[2] == theirs[2] > 500
    assert np.abs(ours[0] - theirs[0]).max() < 1e-6
    assert np.abs(ours[1] - theirs[1]).max() < 1e-5


def test_cells_grow_with_the_distance_from_the_focus():
    volume, focus = sphere(90), np.array([0.0, 0.0, 0.7])
    mesh = lensed(volume, 0.0, lens_growth=0.15, lens_radius=0.05, focus=focus).mesh
    corners = mesh.vertices[mesh.faces]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    away = np.linalg.norm(corners.mean(axis=1) - focus, axis=1)
    rings = [longest[(away >= a) & (away < a + 0.3)].mean() for a in (0.0, 0.4, 0.8, 1.1)]
    assert all(b > 1.2 * a for a, b in pairwise(rings))


def test_nothing_is_finer_than_a_pixel():
    volume = sphere(90)
    camera, knobs = volume_camera(volume), {"lens_pixels": 2.0, "lens_radius": 1.0}
    counts = [
        len(lensed(volume, 0.0, camera=camera.dollied(z), **knobs).mesh.faces)
        for z in (1.0, 0.25, 0.0625)
    ]
    assert counts[0] > 3 * counts[1] > 9 * counts[2] > 0
    far = camera.dollied(0.0625)
    mesh = lensed(volume, 0.0, camera=far, **knobs).mesh
    # the sphere's 1.4 mm are seen on so many pixels; cells of at least two of them
    pixels = 1.4 / far.distance / (2 * np.tan(np.radians(far.fov) / 2)) * 300
    edges = np.linalg.norm(np.diff(mesh.vertices[mesh.faces], axis=1), axis=2)
    assert np.median(edges) / 1.4 * pixels > 1


# --- what is left out ----------------------------------------------------------------------------


def hit(mesh, origins, directions):
    """float64[n]: distance along rays to the nearest triangle, infinite if none (by brute force:
    Möller and Trumbore 1997)."""
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces].astype(np.float64), 1, 0)
    out = np.full(len(origins), np.inf)
    for n, (o, d) in enumerate(zip(origins, directions, strict=True)):
        p = np.cross(d, c - a)
        det = np.einsum("ij,ij->i", b - a, p)
        with np.errstate(all="ignore"):
            u = np.einsum("ij,ij->i", o - a, p) / det
            q = np.cross(o - a, b - a)
            v, t = q @ d / det, np.einsum("ij,ij->i", c - a, q) / det
            good = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)
        out[n] = t[good].min(initial=np.inf)
    return out


@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
def test_every_ray_of_the_picture_meets_what_it_would_meet_without_culling(projection):
    volume = Volume.from_array(noise((60, 70, 64), 3, 5.0))
    camera = volume_camera(volume, "front", projection=projection).dollied(2.5)
    focus = np.array(volume.dims) / 2
    knobs = {"camera": camera, "focus": focus, "lens_growth": 0.05, "lens_radius": 0.1}
    culled = lensed(volume, 0.5, cull=True, **knobs)
    whole = lensed(volume, 0.5, **knobs)
    assert culled.culled.hidden > 10
    assert culled.culled.outside > 5
    assert len(culled.mesh.faces) < 0.9 * len(whole.mesh.faces)
    origin, direction = camera.rays(4 / 3)
    at = np.random.default_rng(2).uniform(-1, 1, (300, 2))
    here = np.concatenate([np.ones((300, 1)), at], axis=1)
    origins, directions = here @ origin.T, here @ direction.T
    ours, theirs = (hit(m.mesh, origins, directions) for m in (culled, whole))
    assert np.isfinite(theirs).sum() > 100
    assert np.array_equal(np.isfinite(ours), np.isfinite(theirs))
    seen_ = np.isfinite(theirs)
    assert np.abs(ours[seen_] - theirs[seen_]).max() < 1e-4


def test_edges_are_open_only_next_to_what_was_left_out():
    volume = Volume.from_array(noise((60, 70, 64), 3, 5.0))
    camera = volume_camera(volume, "front").dollied(2.5)
    focus = np.array(volume.dims) / 2
    made = lensed(volume, 0.5, cull=True, camera=camera, focus=focus, lens_growth=0.05)
    open_ = _on_boundary(made.mesh)
    assert len(open_)
    blocks = made.left_out
    for x, y, z in made.mesh.vertices[open_]:
        k, j, i = (int(v) // 16 for v in (z, y, x))
        around = blocks[max(k - 1, 0) : k + 2, max(j - 1, 0) : j + 2, max(i - 1, 0) : i + 2]
        assert around.any()
    _, counts = np.unique(directed_edges(made.mesh.faces), axis=0, return_counts=True)
    assert counts.max() == 1


def test_what_is_seen_through_is_not_hidden():
    volume = Volume.from_array(noise((60, 70, 64), 3, 5.0))
    made = lensed(volume, 0.5, cull=True, opaque=False, lens_growth=0.02)
    assert made.culled.hidden == 0
    assert lensed(volume, 0.5, cull=True, lens_growth=0.02).culled.hidden > 0


# --- the rest ------------------------------------------------------------------------------------


@pytest.mark.parametrize("isovalue", [-99.0, 99.0])
def test_nothing_at_an_isovalue_outside_the_range(isovalue):
    made = lensed(sphere(20), isovalue)
    assert made.mesh.empty
    assert made.culled.made == 0


def test_thin_constant_and_empty_volumes():
    for name, volume, isovalues in volumes():
        if volume.data.dtype == np.float32:
            made = lensed(volume, float(isovalues[0]), cull=True)
            assert name not in ("one-thin", "one-wide", "all-nan") or made.mesh.empty


def test_a_mirrored_volume_is_wound_the_same_way():
    volume = sphere(40)
    mirror = Volume.from_array(volume.data, affine=volume.affine @ np.diag([-1, 1, 1, 1]))
    for each in (volume, mirror):
        mesh = lensed(each, 0.0, lens_growth=0.3).mesh
        a, b, c = np.moveaxis(mesh.vertices[mesh.faces].astype(float), 1, 0)
        facing = np.einsum("ij,ij->i", np.cross(b - a, c - a), mesh.normals[mesh.faces[:, 0]])
        assert (facing > 0).mean() > 0.99


def test_it_can_be_cancelled():
    def stop(fraction, message=""):
        raise Cancelled()

    viewing = Viewing(volume_camera(sphere(40)), (400, 300), Lens(lens=True))
    with pytest.raises(Cancelled):
        adaptive.extract(sphere(40), seen(Surface(0.0), viewing), Progress(stop))


# --- following the lens --------------------------------------------------------------------------


def _fields(mesh):
    return mesh.vertices, mesh.faces, mesh.normals


@pytest.mark.parametrize("cull", [False, True])
def test_a_dragged_lens_gives_what_it_gives_from_nothing(cull):
    """With holes, vertices inside cells, growth and radius turned on the way, and back again."""
    field = noise((44, 40, 56), 5, 1.0)
    field[20:24, 20:24, 10:40] = np.nan
    volume = Volume.from_array(field, affine=SHEARED)
    middle = volume.affine[:3, :3] @ (np.array(volume.dims) / 2) + volume.affine[:3, 3]
    way = volume.affine[:3, 0]
    again = []
    for step, more in (
        (0, {}),
        (0.001, {}),
        (3, {}),
        (9, {"lens_growth": 0.3}),
        (9, {"lens_radius": 0.2}),
        (-20, {}),
        (0, {}),
    ):
        knobs = {"lens_growth": 0.15, "lens_radius": 0.08, "focus": middle + step * way, **more}
        moved = lensed(volume, 0.1, cull=cull, **knobs)
        adaptive.forget(_twin(volume))
        whole = lensed(_twin(volume), 0.1, cull=cull, **knobs)
        for mine, theirs in zip(_fields(moved.mesh), _fields(whole.mesh), strict=True):
            assert np.array_equal(mine, theirs)
        assert np.array_equal(moved.left_out, whole.left_out)
        assert whole.culled.again == 0
        again.append(moved.culled.again)
    assert again[0] == 0
    assert again[1] > 0


_twins: dict[int, Volume] = {}


def _twin(volume):
    """Another volume of the same samples."""
    if id(volume) not in _twins:
        _twins.clear()
        _twins[id(volume)] = Volume.from_array(volume.data, affine=volume.affine)
    return _twins[id(volume)]


def test_a_lens_elsewhere_in_a_large_volume_leaves_most_as_it_was():
    ball = sphere(96)
    knobs = {"lens_growth": 0.1, "lens_radius": 0.05, "lens_pixels": 0.0}
    lensed(ball, 0.0, focus=(0.0, 0.0, 0.7), **knobs)
    moved = lensed(ball, 0.0, focus=(0.01, 0.0, 0.7), **knobs).culled
    assert moved.again > 0.4 * moved.made
    other = lensed(ball, 0.02, focus=(0.01, 0.0, 0.7), **knobs).culled  # another surface
    assert other.again == 0


def test_a_cancelled_picture_does_not_spoil_the_next_one():
    ball = sphere(64)
    knobs = {"lens_growth": 0.2, "lens_radius": 0.05}
    lensed(ball, 0.0, focus=(0, 0, 0.7), **knobs)
    viewing = Viewing(volume_camera(ball), (400, 300), Lens(lens=True, lens_z=0.2, lens_pixels=0.0))

    def stop(fraction, message=""):
        raise Cancelled

    with pytest.raises(Cancelled):
        adaptive.extract(ball, seen(Surface(0.0), viewing), Progress(stop), cull=False)
    moved = lensed(ball, 0.0, focus=(0.1, 0, 0.7), **knobs)
    adaptive.forget(ball)
    whole = lensed(ball, 0.0, focus=(0.1, 0, 0.7), **knobs)
    for mine, theirs in zip(_fields(moved.mesh), _fields(whole.mesh), strict=True):
        assert np.array_equal(mine, theirs)
