"""Distance and normals against closed forms: known spheres, a dense search, rates."""

from __future__ import annotations

import json
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy import special

import volviz
from volviz.cli import run
from volviz.errors import Cancelled
from volviz.lab.truth import crossings, nearest, truth_error
from volviz.model.mesh import Mesh
from volviz.model.surface import METHODS
from volviz.model.surface_look import SceneSurface
from volviz.progress import Progress
from volviz.samples import SAMPLES, field_of, sample
from volviz.samples.orbital import hydrogen, hydrogen_field
from volviz.samples.primitives import RADIUS

CLOSED = [n for n, s in SAMPLES.items() if s.field and not n.startswith("ct-head")]
KNOWN = [n for n, s in SAMPLES.items() if s.field]


def places(volume, rng, count):
    """Random positions between the samples."""
    index = rng.uniform(1, np.array(volume.dims) - 2, (count, 3))
    return index @ volume.affine[:3, :3].T + volume.affine[:3, 3]


# --- fields --------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", KNOWN)
def test_gradients_are_the_limit_of_differences(name, rng):
    volume = sample(name, size=32)
    field, points, h = field_of(volume), places(volume, rng, 2000), 1e-5
    steps = [field(points + h * e)[0] - field(points - h * e)[0] for e in np.eye(3)]
    slope = field(points)[1]
    apart = np.linalg.norm(np.stack(steps, axis=1) / (2 * h) - slope, axis=1)
    scale = np.linalg.norm(slope, axis=1).max()
    # kinks, where a stencil lies on both sides, are rare
    assert np.quantile(apart, 0.99) < 1e-5 * scale
    assert scale > 0


@pytest.mark.parametrize("name", ["marschner-lobb", "orbital", "sphere", "torus"])
def test_the_field_is_what_was_sampled(name):
    volume = sample(name, size=24)
    z, y, x = np.indices(volume.data.shape)
    index = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    there = index @ volume.affine[:3, :3].T + volume.affine[:3, 3]
    value = field_of(volume)(there)[0].reshape(volume.data.shape)
    np.testing.assert_allclose(volume.data, value, rtol=2e-6, atol=1e-6 * np.abs(value).max())


@pytest.mark.parametrize("name", ["ct-head", "vessel"])
def test_the_scanner_only_blurs_the_field(name):
    """Far from borders nothing is blurred: what is left there is the noise."""
    volume = sample(name, size=64)
    field = field_of(volume)
    z, y, x = np.indices(volume.data.shape)[:, 8:-8:5, 8:-8:5, 8:-8:5]
    at = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    there = at @ volume.affine[:3, :3].T + volume.affine[:3, 3]
    value = field(there)[0]
    steps = [1.5 * s * u for s in volume.spacing for u in (-1, 1)]
    near = [field(there + d * np.eye(3)[i // 2])[0] for i, d in enumerate(steps)]
    calm = np.max(np.abs(np.array(near) - value), axis=0) < 3
    assert calm.mean() > 0.1
    apart = volume.data[z, y, x].ravel()[calm] - value[calm]
    assert np.median(np.abs(apart)) < 15


@pytest.mark.parametrize(
    ("n", "l", "m"), [(1, 0, 0), (2, 1, 1), (3, 2, 1), (4, 2, 0), (4, 3, -2), (5, 3, 3), (6, 4, -4)]
)
def test_every_orbital_is_a_polynomial_in_space(n, l, m, rng):  # noqa: E741
    points = rng.uniform(-20, 20, (300, 3))
    value, _ = hydrogen_field(n, l, m)(points)
    np.testing.assert_allclose(value, hydrogen(n, l, m)(*points.T), rtol=1e-9, atol=1e-20)
    r, polar = (
        np.linalg.norm(points, axis=1),
        np.arccos(points[:, 2] / np.linalg.norm(points, axis=1)),
    )
    wave = special.sph_harm_y(l, abs(m), polar, np.arctan2(points[:, 1], points[:, 0]))
    part = wave.real if m >= 0 else wave.imag
    radial = np.exp(-r / n) * r**l * special.eval_genlaguerre(n - l - 1, 2 * l + 1, 2 * r / n)
    ratio = value / np.maximum((radial * part) ** 2, 1e-30)
    assert np.ptp(ratio[value > 1e-15]) < 1e-6 * ratio.max()


def test_other_volumes_have_no_field():
    assert field_of(sample("plume", size=16)) is None
    assert field_of(volviz.Volume.from_array(np.zeros((3, 3, 3)), name="sphere")) is None


# --- distance and normals ------------------------------------------------------------------------


def test_a_sphere_beside_the_true_one_is_as_far_away_as_it_is():
    volume = sample("sphere", size=40)
    mesh = volviz.extract_surface(volume, 0.0)
    out = mesh.vertices / np.linalg.norm(mesh.vertices, axis=1, keepdims=True)
    wrong = Mesh(RADIUS * out + 1.5 * out, mesh.faces, out)
    found = truth_error(wrong, volume, 0.0)
    assert found.greatest == pytest.approx(1.5, abs=1e-4)
    assert found.mean == pytest.approx(1.5, abs=0.1)  # of the flat triangles' inside as well
    assert found.angle_greatest < 0.05
    assert found.missed == 0
    at_minus = truth_error(wrong, volume, -1.5)
    assert at_minus.greatest < 0.1
    turned = truth_error(replace(wrong, normals=-out), volume, 0.0)
    assert turned.angle_mean == pytest.approx(180, abs=0.1)


@pytest.mark.parametrize("name", ["sphere", "torus"])
def test_errors_fall_with_the_square_of_the_spacing(name):
    """Half the spacing twice: each time a quarter of every error."""
    found = []
    for size in (25, 49, 97):
        volume = sample(name, size=size)
        found.append(truth_error(volviz.extract_surface(volume, 2.0), volume, 2.0))
    for coarse, fine in pairwise(found):
        for key in ("mean", "rms", "greatest", "angle_mean"):
            assert 3.1 < getattr(coarse, key) / getattr(fine, key) < 5.2, key


def test_numbers_of_a_sphere_are_those_of_its_formula():
    volume = sample("sphere", size=33)
    mesh = volviz.extract_surface(volume, 0.0)
    corners = mesh.vertices[mesh.faces].astype(float)
    # dense points of the triangles, every one exactly |p| − R away
    shares = np.random.default_rng(1).dirichlet((1, 1, 1), 60)
    at = np.einsum("sk,tkx->tsx", shares, corners)
    apart = np.abs(np.linalg.norm(at, axis=2) - RADIUS)
    area = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    mean = (apart.mean(axis=1) * area).sum() / area.sum()
    found = truth_error(mesh, volume, 0.0)
    assert found.mean == pytest.approx(mean, rel=0.12)
    assert found.greatest >= 0.85 * apart.max()


@pytest.mark.parametrize(
    ("name", "isovalue"), [("marschner-lobb", 0.5), ("orbital", 2e-5), ("vessel", 212.0)]
)
def test_the_nearest_point_is_that_of_a_dense_search(name, isovalue, rng):
    """Beside it: the least way to any zero of the field on a fine grid of rays near the point."""
    volume, count = sample(name), 8 if name == "vessel" else 24
    spacing, field = min(volume.spacing), field_of(volume)
    mesh = volviz.extract_surface(volume, isovalue)
    inner = np.abs(mesh.vertices - mesh.bounds.mean(axis=0)).max(axis=1)
    chosen = rng.choice(np.flatnonzero(inner < np.quantile(inner, 0.8)), count, replace=False)
    points = mesh.vertices[chosen] + rng.normal(0, 0.3 * spacing, (count, 3))
    feet, slopes = nearest(field, isovalue, points, mesh.normals[chosen].astype(float), spacing)
    assert np.isfinite(feet).all()
    value, slope = field(feet)
    steep = np.linalg.norm(slope, axis=1)
    assert (np.abs(value - isovalue) < 1e-3 * spacing * steep).all(), "not on the surface"
    np.testing.assert_allclose(np.linalg.norm(slopes, axis=1), 1, atol=1e-9)
    rays = rng.normal(size=(200, 3))
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    ways = np.linspace(0, 2.5 * spacing, 41)
    good = []
    for point, foot in zip(points, feet, strict=True):
        at = point + rays[:, None] * ways[None, :, None]
        inside = field(at.reshape(-1, 3))[0].reshape(len(rays), -1) >= isovalue
        crossed = inside[:, 1:] != inside[:, :-1]
        least = ways[1:][np.argmax(crossed, axis=1)][crossed.any(axis=1)].min()
        good.append(np.linalg.norm(foot - point) <= least + 0.08 * spacing)
    assert np.mean(good) > (0.9 if name == "marschner-lobb" else 0.99)


@pytest.mark.parametrize("method", METHODS)
def test_every_method_is_near_to_the_sphere(method):
    volume = sample("sphere", size=33)
    mesh = volviz.extract_surface(volume, 0.0, method=method)
    found = truth_error(mesh, volume, 0.0)
    assert 0 < found.mean <= found.rms <= found.greatest < np.sqrt(3) * volume.spacing[0]
    assert found.angle_mean < 35
    assert found.missed == 0


def test_what_is_nowhere_near_is_missed_and_said():
    volume = sample("sphere", size=33)
    far = Mesh(np.array([[1, 1, 1], [5, 1, 1], [1, 5, 1]], np.float32), np.array([[0, 1, 2]]))
    assert truth_error(far, volume, 0.0) is None
    mesh = volviz.extract_surface(volume, 0.0)
    both = Mesh(
        np.concatenate([mesh.vertices, far.vertices]),
        np.concatenate([mesh.faces, far.faces + len(mesh.vertices)]),
    )
    found = truth_error(both, volume, 0.0)
    share = 8 / (4 * np.pi * RADIUS**2)
    assert found.missed == pytest.approx(share, rel=0.05)
    assert found.greatest < 1
    assert truth_error(Mesh(np.empty((0, 3), np.float32)), volume, 0.0) is None


def test_it_can_be_cancelled():
    volume, progress = sample("sphere", size=33), Progress()
    mesh = volviz.extract_surface(volume, 0.0)
    progress.cancel()
    with pytest.raises(Cancelled):
        truth_error(mesh, volume, 0.0, progress=progress)


# --- from the truth to the mesh ------------------------------------------------------------------


def test_crossings_lie_on_the_surface_of_the_samples():
    """Of a linear function they are exact, on any grid; constant samples have none."""
    z, y, x = np.mgrid[:7, :8, :9].astype(np.float32)
    affine = np.array([[0.5, 0.3, 0, 4], [-0.3, 0.8, 0.1, 5], [0.1, 0, 3, 6], [0, 0, 0, 1]])
    volume = volviz.Volume.from_array(x + 2 * y - z, affine=affine)
    points = crossings(volume, 6.25)
    index = (points - affine[:3, 3]) @ np.linalg.inv(affine[:3, :3]).T
    assert len(points) > 100
    assert np.allclose(index @ [1, 2, -1], 6.25)
    assert np.all((index > -1e-9) & (index < np.array(volume.dims) - 1 + 1e-9))
    on_edges = (np.abs(index - np.round(index)) < 1e-9).sum(axis=1)
    assert np.all(on_edges >= 2)
    assert set(np.abs(index - np.round(index)).argmax(axis=1)) == {0, 1, 2}
    assert not len(crossings(volume, 1e9))


@pytest.mark.parametrize("height", [0.0, 0.5, 0.9])
def test_what_a_mesh_lacks_is_seen_from_the_truth(height):
    """A sphere without its cap: the pole is as far as its nearest point of the rim."""
    volume = sample("sphere", size=33)
    mesh = volviz.extract_surface(volume, 0.0)
    whole = truth_error(mesh, volume, 0.0)
    middle = mesh.vertices[mesh.faces].mean(axis=1)[:, 2]
    centre = volume.affine[:3, :3] @ (np.array(volume.dims) - 1) / 2 + volume.affine[:3, 3]
    kept = middle < centre[2] + height * RADIUS
    open_, rim = Mesh(mesh.vertices, mesh.faces[kept], mesh.normals), np.arccos(height)
    found = truth_error(open_, volume, 0.0)
    assert found.back == pytest.approx(2 * RADIUS * np.sin(rim / 2), abs=1.5 * volume.spacing[0])
    assert found.greatest <= whole.greatest
    assert 0 < whole.back < 0.1 * volume.spacing[0]


def test_of_points_the_way_back_is_to_the_nearest_one():
    volume = sample("sphere", size=33)
    points = volviz.extract_surface(volume, 0.0, method="dividing-cubes")
    found = truth_error(points, volume, 0.0)
    assert 0 < found.back < np.sqrt(3) * volume.spacing[0]
    half = Mesh(points.vertices[:10], normals=points.normals[:10])
    assert truth_error(half, volume, 0.0).back > RADIUS


# --- tables --------------------------------------------------------------------------------------


def test_columns_in_the_table_and_in_json():
    scene = volviz.Scene.of(sample("sphere", size=33))
    scene = scene.with_surfaces([SceneSurface.at(0.0)]).with_knobs(show_volume=False, samples=1)
    axes = {"surface.method": ["marching-cubes", "cuberille"]}
    found = volviz.compare(scene, axes, size=(24, 24), repeat=0, reference="none")
    columns, rows = found.table()
    titles = ["truth mean mm", "truth RMS mm", "truth max mm", "back max mm"]
    titles += ["normals mean °", "normals max °"]
    first = columns.index(titles[0])
    assert list(columns[first : first + len(titles)]) == titles
    smooth, blocks = (r[columns.index("truth mean mm")] for r in rows)
    assert 0 < float(smooth) < float(blocks)
    one, _ = found.document()["variants"]
    mesh = volviz.extract_surface(scene.volume, 0.0)
    direct = truth_error(mesh, scene.volume, 0.0)
    assert one["truth_rms"] == pytest.approx(direct.rms, rel=1e-5)
    assert one["truth_back"] == pytest.approx(direct.back, rel=1e-5)
    assert one["truth_angle_max"] == pytest.approx(direct.angle_greatest, rel=1e-5)
    assert "truth_missed" not in one


def test_small_numbers_stay_what_they_are():
    from volviz.lab.compare import _number

    assert _number(1.23456789e-9) == 1.234568e-9
    assert str(_number(4.0)) == "4"


def test_the_command_line_tells_the_truth(capsys):
    words = "compare sample:sphere --isovalue 0 --vary surface.method=cuberille,dividing-cubes"
    words += " --size 24x24 --repeat 0 --reference none --json -q"
    assert run(words.split()) == 0
    told = json.loads(capsys.readouterr().out)
    assert [v["changed"]["surface.method"] for v in told["variants"]] == [
        "cuberille",
        "dividing-cubes",
    ]
    assert all(0 < v["truth_rms"] < 4 and v["truth_angle"] < 40 for v in told["variants"])
