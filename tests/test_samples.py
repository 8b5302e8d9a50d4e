"""Sample volumes against closed forms, hand-measured geometry and independent libraries."""

from __future__ import annotations

import math
import subprocess
import sys

import numpy as np
import pytest
import SimpleITK as sitk
from scipy import ndimage, special

from volviz.errors import Cancelled, UsageError
from volviz.model.volume import Volume
from volviz.progress import Progress
from volviz.samples import names, sample, truth
from volviz.samples.ct_head import MATERIALS, NOISE
from volviz.samples.marschner_lobb import signal
from volviz.samples.noise import Lattice, blur, gaussian_taps
from volviz.samples.orbital import hydrogen
from volviz.samples.shapes import Grid, add, carve, cone, cut, ellipsoid, ribbon
from volviz.samples.vessel import BLOOD, TISSUE, TRUNK_RADIUS

EXACT = ("marschner-lobb", "orbital", "sphere", "torus")
"""Nothing in them is random."""
HEADS = [n for n in names() if n.startswith("ct-head")]


@pytest.fixture(scope="module")
def head() -> Volume:
    return sample("ct-head")


@pytest.fixture(scope="module")
def tissues() -> Volume:
    return truth("ct-head")


def core(tissues: Volume, material: str, depth: int) -> np.ndarray:
    """Where a material is at least `depth` samples thick all around."""
    mask = tissues.data == MATERIALS[material][0]
    return ndimage.binary_erosion(mask, np.ones((3, 3, 3)), iterations=depth) if depth else mask


def to_sitk(volume: Volume) -> sitk.Image:
    image = sitk.GetImageFromArray(volume.data)
    image.SetSpacing(volume.spacing)
    image.SetOrigin(volume.info.origin)
    image.SetDirection((volume.affine[:3, :3] / np.array(volume.spacing)).ravel())
    return image


# every sample


@pytest.mark.parametrize("name", names())
def test_every_sample_is_a_volume_of_the_size_asked_for(name):
    volume = sample(name, size=40)
    assert max(volume.dims) == 40
    assert volume.name == name
    assert volume.info.format == "sample"
    assert np.isfinite(volume.data).all()
    assert volume.data.min() < volume.data.max()
    assert volume.info.modality == ("CT" if name.startswith(("ct", "vessel")) else None)
    assert volume.info.space == ("LPS" if volume.info.modality else None)
    assert volume.data.dtype == (np.int16 if volume.info.modality else np.float32)


@pytest.mark.parametrize("name", names())
def test_same_seed_same_bytes(name):
    first, again, other = (sample(name, size=48, seed=s).data for s in (3, 3, 4))
    assert first.tobytes() == again.tobytes()
    assert (first.tobytes() == other.tobytes()) == (name in EXACT)


@pytest.mark.parametrize("name", names())
def test_can_be_cancelled(name):
    progress = Progress()
    progress.cancel()
    with pytest.raises(Cancelled):
        sample(name, size=48, progress=progress)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: sample("ct-haed"), "did you mean 'ct-head'"),
        (lambda: sample("ct-head", size=7), "8..512"),
        (lambda: sample("ct-head", size=100_000), "8..512"),
        (lambda: sample("ct-head", size=40.5), "whole number"),
        (lambda: sample("ct-head", size=40, seed=-1), "negative"),
        (lambda: truth("nothing-of-the-kind"), "choose one of"),
        (lambda: truth("plume"), "no separate truth"),
        (lambda: hydrogen(2, 2, 0), "no orbital"),
    ],
)
def test_wrong_requests_say_what_to_do(call, words):
    with pytest.raises(UsageError, match=words):
        call()


def test_only_numpy_is_needed():
    code = (
        "import sys, volviz.samples as s; s.sample('ct-head', size=16); s.sample('plume', size=16);"
        "heavy = {'scipy', 'nibabel', 'PIL', 'moderngl', 'pydicom', 'numba', 'pyrr'};"
        "sys.exit(' '.join(heavy & set(sys.modules)) or 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


# the head


def test_head_has_every_material(tissues):
    present = set(np.unique(tissues.data).tolist())
    assert present == {number for number, _ in MATERIALS.values()}
    assert tissues.info.kind == "labels"
    assert tissues.info.fields["material 17"] == "enamel, 2850 HU"


@pytest.mark.parametrize(
    ("material", "depth", "tolerance"),
    [
        ("air", 3, 2),
        ("fat", 3, 2),
        ("muscle", 3, 2),
        ("gland", 3, 3),
        ("csf", 2, 3),
        ("white matter", 3, 2),
        ("grey matter", 2, 3),
        ("vitreous", 3, 2),
        ("cartilage", 2, 25),
        ("spongy bone", 2, 80),
        ("compact bone", 2, 160),
        ("dentine", 1, 150),
        ("enamel", 1, 350),
    ],
)
def test_head_has_the_hounsfield_units_of_its_materials(head, tissues, material, depth, tolerance):
    inside = core(tissues, material, depth)
    assert inside.sum() > 15
    assert head.data[inside].mean() == pytest.approx(MATERIALS[material][1], abs=tolerance)


def test_head_covers_the_range_of_the_scanner(head, tissues):
    metal = head.data[core(tissues, "metal", 0)]
    assert metal.max() > 4000
    assert 2300 < np.median(head.data[core(tissues, "enamel", 1)]) < 3100
    compact = head.data[core(tissues, "compact bone", 1)]
    assert np.all(np.abs(np.percentile(compact, [5, 95]) - [1300, 1700]) < 250)
    assert head.data.min() >= -1024


def test_noise_of_the_head_has_the_stated_strength_and_is_coloured(head, tissues):
    inside = core(tissues, "white matter", 3)
    values = head.data.astype(float)
    assert values[inside].std() == pytest.approx(NOISE, rel=0.12)
    air = np.clip(values[:12, :12, :], -1060, None) + 1000
    assert 0.2 < np.mean(air[..., 1:] * air[..., :-1]) / np.mean(air**2) < 0.8


def test_head_is_where_the_world_says(head, tissues):
    assert head.info.orientation == "LPS"
    assert head.dims == (192, 224, 256)

    def middle(material, half=None):
        z, y, x = np.nonzero(tissues.data == MATERIALS[material][0])
        at = np.column_stack([x, y, z, np.ones_like(x)]) @ tissues.affine.T[:, :3]
        return at[at[:, 0] * (half or 1) > 0 if half else slice(None)].mean(axis=0)

    np.testing.assert_allclose(middle("lens", +1), [31.5, -86.2, 17], atol=0.5)
    np.testing.assert_allclose(middle("lens", -1), [-31.5, -86.2, 17], atol=0.5)
    assert middle("metal")[0] > 15, "the filling is on the patient's left"
    assert middle("enamel")[1] < middle("cartilage")[1] - 20, "teeth are in front of the spine"
    nose = np.argwhere(head.data > -300)[:, 1].min()
    z, x = np.argwhere(head.data[:, nose + 1] > -300).mean(axis=0)
    tip = head.affine @ [x, nose + 1, z, 1]
    assert abs(tip[0]) < 3
    assert -25 < tip[2] < -5
    assert tip[1] < -115


def test_skin_covers_the_whole_head(tissues):
    """Whatever the air around the head touches is skin; nostrils and ear canals count as closed."""
    air = tissues.data == 0
    wide = ndimage.label(ndimage.binary_erosion(air, iterations=5, border_value=1))[0]
    around = ndimage.binary_dilation(wide == wide[-1, 0, 0], iterations=6)
    touched = np.unique(tissues.data[8:][(around & ~air)[8:]])
    assert touched.tolist() == [MATERIALS["skin"][0]]


def test_brain_is_sealed_in_bone(tissues):
    soft = [MATERIALS[m][0] for m in ("csf", "grey matter", "white matter", "blood")]
    upper = np.isin(tissues.data, soft)[140:]
    upper = ndimage.label(upper)[0] == ndimage.label(upper)[0][20, 112, 96]
    shell = ndimage.binary_dilation(upper) & ~upper
    shell[0] = False
    around = tissues.data[140:][shell]
    assert np.isin(around, [MATERIALS[m][0] for m in ("compact bone", "spongy bone")]).mean() > 0.99
    assert MATERIALS["air"][0] not in around


def test_bone_has_compact_tables_around_spongy_bone(tissues):
    """A ray into the crown: air, skin, fat, compact, spongy, compact, fluid."""
    column = tissues.data[::-1, 112, 150]
    layers = [int(k) for k in column[np.r_[True, column[1:] != column[:-1]]]][:7]
    wanted = ("air", "skin", "fat", "compact bone", "spongy bone", "compact bone", "csf")
    assert layers == [MATERIALS[m][0] for m in wanted]


@pytest.mark.parametrize("name", HEADS[1:])
def test_variants_show_the_same_head_in_the_world(name):
    reference, variant = truth("ct-head", size=128), truth(name, size=128)
    moved = sitk.Resample(
        to_sitk(variant), to_sitk(reference), sitk.Transform(), sitk.sitkNearestNeighbor, 0
    )
    labels = sitk.GetArrayFromImage(moved)
    inner = (slice(8, -8),) * 3
    same = labels[inner] == reference.data[inner]
    assert same.mean() > 0.85
    block = (5, 5, 5)
    plain = ndimage.minimum_filter(reference.data, block) == ndimage.maximum_filter(
        reference.data, block
    )
    for material in ("air", "fat", "muscle", "white matter", "spongy bone"):
        where = (plain & (reference.data == MATERIALS[material][0]))[inner]
        assert where.sum() > 20
        assert same[where].mean() > 0.99, material


@pytest.mark.parametrize(
    ("name", "tolerance"), [("ct-head-anisotropic", 60), ("ct-head-oblique", 40)]
)
def test_variants_have_the_same_values_in_the_world(name, tolerance):
    reference, variant = sample("ct-head", size=128), sample(name, size=128)
    moved = sitk.GetArrayFromImage(
        sitk.Resample(
            to_sitk(variant), to_sitk(reference), sitk.Transform(), sitk.sitkLinear, -1000
        )
    )
    inner = (slice(8, -8),) * 3
    ours = reference.data[inner].astype(float)
    assert np.median(np.abs(moved[inner] - ours)) < 20
    smooth = [ndimage.gaussian_filter(v, 2.5) for v in (moved[inner].astype(float), ours)]
    assert np.sqrt(np.mean((smooth[0] - smooth[1]) ** 2)) < tolerance
    assert np.corrcoef(smooth[0].ravel(), smooth[1].ravel())[0, 1] > 0.995


def test_grids_of_the_variants():
    thick, turned = sample("ct-head-anisotropic", size=64), sample("ct-head-oblique", size=64)
    assert thick.spacing[2] / thick.spacing[0] == pytest.approx(2.5 / 0.7)
    assert not thick.info.oblique
    assert turned.info.oblique
    axes = turned.affine[:3, :3] / turned.spacing[0]
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(axes) == pytest.approx(1)


# closed forms


def test_marschner_lobb_is_the_formula_of_the_paper(rng):
    volume = sample("marschner-lobb")
    assert volume.dims == (41, 41, 41)
    for k, j, i in rng.integers(0, 41, (200, 3)):
        x, y, z = (volume.affine @ [i, j, k, 1])[:3]
        rho = math.cos(2 * math.pi * 6 * math.cos(math.pi * math.hypot(x, y) / 2))
        value = (1 - math.sin(math.pi * z / 2) + 0.25 * (1 + rho)) / (2 * 1.25)
        assert volume.data[k, j, i] == pytest.approx(value, abs=1e-6)
    assert volume.data[20, 20, 20] == pytest.approx(0.6)
    assert truth("marschner-lobb") is signal


@pytest.mark.parametrize(
    ("n", "l", "m"), [(1, 0, 0), (2, 1, 0), (3, 2, 1), (4, 2, 0), (4, 3, -2), (5, 3, 3), (6, 0, 0)]
)
def test_orbital_is_the_solution_of_the_textbook(n, l, m, rng):  # noqa: E741
    x, y, z = rng.uniform(-25, 25, (3, 500))
    r = np.sqrt(x * x + y * y + z * z)
    rho = 2 * r / n
    radial = (
        math.sqrt((2 / n) ** 3 * math.factorial(n - l - 1) / (2 * n * math.factorial(n + l)))
        * np.exp(-rho / 2)
        * rho**l
        * special.eval_genlaguerre(n - l - 1, 2 * l + 1, rho)
    )
    harmonic = special.sph_harm_y(l, abs(m), np.arccos(z / r), np.arctan2(y, x))
    part = harmonic.real if m >= 0 else harmonic.imag
    expected = (radial * part * (1 if m == 0 else math.sqrt(2))) ** 2
    np.testing.assert_allclose(hydrogen(n, l, m)(x, y, z), expected, rtol=1e-9, atol=1e-18)


def test_orbital_sample_holds_one_electron_and_its_symmetries():
    volume = sample("orbital")
    assert volume.data.sum(dtype=float) * np.prod(volume.spacing) == pytest.approx(1, abs=0.02)
    data = volume.data.astype(float)
    for mirrored in (data[::-1], data[:, ::-1], data[:, :, ::-1], data.transpose(0, 2, 1)):
        np.testing.assert_allclose(mirrored, data, rtol=1e-5, atol=1e-12)
    x, y, z = (volume.affine @ [90, 40, 77, 1])[:3]
    assert data[77, 40, 90] == pytest.approx(float(truth("orbital")(x, y, z)), rel=1e-6)


# vessel


@pytest.fixture(scope="module")
def angiogram() -> Volume:
    return sample("vessel")


def section(volume: Volume, height: float) -> np.ndarray:
    k = round((height - volume.info.origin[2]) / volume.spacing[2])
    return volume.data[k] > (BLOOD + TISSUE) / 2


@pytest.mark.parametrize("height", [-75, -70, -50])
def test_trunk_has_its_radius(angiogram, height):
    area = section(angiogram, height).sum() * angiogram.spacing[0] ** 2
    assert area == pytest.approx(math.pi * TRUNK_RADIUS**2, rel=0.03)


def test_first_fork_has_two_branches_of_known_area(angiogram):
    left, right = (s for s in truth("vessel").segments if s.level == 1)
    slope = (np.array(left.end) - left.start) / np.linalg.norm(np.array(left.end) - left.start)
    found, count = ndimage.label(section(angiogram, -20))
    assert count == 2
    for number, branch in enumerate((left, right), start=1):
        area = np.sum(found == number) * angiogram.spacing[0] ** 2
        assert area == pytest.approx(math.pi * branch.radius**2 / slope[2], rel=0.04)
        at = branch.start[0] + (branch.end[0] - branch.start[0]) * (-20 - branch.start[2]) / (
            branch.end[2] - branch.start[2]
        )
        column = np.argwhere(found == number)[:, 1].mean()
        x = (angiogram.affine @ [column, 0, 0, 1])[0]
        assert x == pytest.approx(at, abs=0.4)


def test_tree_obeys_murray_and_stays_in_the_volume(angiogram):
    tree = truth("vessel")
    ends = {}
    for s in tree.segments:
        ends.setdefault(s.start, []).append(s)
    forks = [(s, ends[s.end]) for s in tree.segments if len(ends.get(s.end, [])) == 2]
    assert len(forks) == 63
    for stem, branches in forks:
        assert sum(b.radius**3 for b in branches) == pytest.approx(stem.radius**3)
    inverse = np.linalg.inv(angiogram.affine)
    middles = np.array([(np.array(s.start) + s.end) / 2 for s in tree.segments if s.level])
    index = middles @ inverse[:3, :3].T + inverse[:3, 3]
    assert np.all(index > 1)
    assert np.all(index < np.array(angiogram.dims) - 2)
    values = ndimage.map_coordinates(angiogram.data.astype(float), index[:, ::-1].T, order=1)
    wide = np.array([s.radius for s in tree.segments if s.level]) > 2.2
    np.testing.assert_allclose(values[wide], BLOOD, atol=5 * 12)
    assert values.min() > (BLOOD + TISSUE) / 2


# plume


def test_plume_rises_and_widens():
    volume = sample("plume", size=96)
    data = volume.data.astype(float)
    assert data.min() == 0
    assert 0.2 < np.mean(data == 0) < 0.95, "clear air around the smoke"
    z, y, x = np.indices(data.shape)
    spread = [
        np.sqrt(np.average((x[k] - 31.5) ** 2 + (y[k] - 31.5) ** 2, weights=data[k] + 1e-9))
        for k in (2, 30, 60)
    ]
    assert spread[0] < spread[1] < spread[2]
    assert z.size == data.size


# clay


def test_lattice_is_one_field_on_every_grid():
    field = Lattice(5, 7.0)
    coarse = field.sample(Grid.of(np.arange(-90, 90, 6), np.arange(-90, 90, 4), [3.0, 50.0]))
    fine = field.sample(Grid.of(np.arange(-90, 90, 3), np.arange(-90, 90, 2), [3.0, 20.0, 50.0]))
    np.testing.assert_allclose(fine[[0, 2], ::2, ::2], coarse, atol=1e-5)
    spread = field.sample(Grid.of(*(np.arange(-150, 150, 5.3),) * 3)).std()
    assert spread == pytest.approx(1, abs=0.1)


def test_blur_is_scipys_gaussian(rng):
    field = rng.standard_normal((9, 10, 11)).astype(np.float32)
    for axis in range(3):
        expected = ndimage.gaussian_filter1d(
            field, 0.7, axis=axis, mode="nearest", radius=len(gaussian_taps(0.7)) - 1
        )
        np.testing.assert_allclose(blur(field, gaussian_taps(0.7), axis), expected, atol=1e-5)


def test_shapes_measure_distance():
    axis = np.linspace(-20, 20, 41)
    grid = Grid.of(axis, axis, axis)
    x, y, z = np.meshgrid(axis, axis, axis, indexing="ij", sparse=False)
    r = np.sqrt(x * x + y * y + z * z).T
    ball = carve(grid, [add(ellipsoid((0, 0, 0), (8, 8, 8), (30, 20, 10)))])
    near = np.abs(r - 8) < 1.5
    np.testing.assert_allclose(ball[near], (r - 8)[near], atol=1e-4)
    rod = carve(grid, [add(cone((0, 0, -5), (0, 0, 5), 4, 4))])
    assert rod[20, 20, 20] == pytest.approx(-4)
    assert rod[20, 20, 25] == pytest.approx(1)
    hollow = carve(
        grid, [add(ellipsoid((0, 0, 0), (8, 8, 8))), cut(cone((0, 0, 0), (0, 0, 1), 4, 4))]
    )
    assert hollow[20, 20, 20] > 0 > hollow[20, 20, 26]
    band = carve(grid, [add(ribbon([(-9, 0, 0, 6, 2), (9, 0, 0, 6, 2)]))])
    assert band[25, 20, 20] == pytest.approx(-2)
    assert band[29, 20, 20] == pytest.approx(1)
