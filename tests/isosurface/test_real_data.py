"""Every volume of the data folder through every method and finder. Slow: minutes for them all.

Whole volumes through marching cubes, the densest piece of each through everything else. What a
mesh must be is counted from the samples: vertices on crossed edges, where it may end, what it may
enclose, and the Euler characteristic of the trilinear function (`oracles.solid_euler`).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import volviz
from tests.isosurface import oracles
from volviz.classify.isovalues import suggested_isovalue
from volviz.fields.statistics import statistics
from volviz.io import load
from volviz.isosurface.cells import CellRanges
from volviz.isosurface.extractors import EXTRACTORS
from volviz.isosurface.finders import FINDERS

FILES = (
    *("classics/bonsai_256.nii.gz", "classics/stent.npz", "ct/cranium_head_ct.nrrd"),
    *("ct/cranium_head_labels.nrrd", "ct/ct_pitch_oblique.nii.gz", "ct/totalseg_torso_ct.nii.gz"),
    *("ct/totalseg_torso_sm_ct.nii.gz", "ct/totalseg_torso_sm_labels117.nii.gz"),
    *("ct/totalseg_torso_vertebrae_labels.nii.gz", "dicom/ct_head_gantry_tilt_jls"),
    *("dicom/ct_head_phantom_5mm_j2k", "dicom/ct_headsq_plain", "dicom/tiny_multiframe_mr"),
    *("dicom/tiny_nonsquare_pixels", "dicom/tiny_rle", "formats/3pqr_mode0.ccp4"),
    *("formats/anatomical_bigendian.nii", "formats/emd_3001.map", "formats/emd_3197.map"),
    *("formats/example_nifti2.nii.gz", "formats/frogtissue.mhd"),
    *("formats/functional_4d_slope_inter.nii", "formats/nifti_dtypes/float64.nii"),
    *("formats/nifti_dtypes/int64.nii", "formats/nifti_dtypes/uint64.nii"),
    *("formats/nrrd/BallBinary30x30x30.nhdr", "formats/nrrd/test_customFields.nrrd"),
    *("formats/tooth_bigendian_uint16.nhdr", "large/connectomics_512_labels.nrrd"),
    *("microscopy/droplet_4d.tif", "microscopy/ome_multichannel_z.ome.tif", "microscopy/snow.tif"),
    *("microscopy/tgmm_mini_4d_labels.tif", "microscopy/em_isbi_png/image", "mri/asl_4d.nii.gz"),
    *("mri/ch2_aal_labels.nii.gz", "mri/ch2_colin27_t1.nii.gz", "mri/example4d.nii.gz"),
    *("mri/nifti_orientations/LPI.nii.gz", "mri/nifti_orientations/SAL.nii.gz"),
    *("mri/prostate_phantom.nrrd", "mri/stroke_FLAIR_oblique.nii.gz"),
    *("mri/stroke_T1_oblique.nii.gz", "simulation/heptane_302.nii.gz", "simulation/neghip.dat"),
    "simulation/nucleon.nrrd",
)
SIDE = 20
OPTIONS = {
    "marching-cubes": [{"ambiguity": "asymptotic"}, {"normals": "sobel"}, {"normals": "none"}],
    "marching-tetrahedra": [{"tetrahedra": 6}],
    "contour-tracing": [{"axis": "x"}, {"axis": "y"}],
}
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module", params=FILES)
def volume(request, data):
    path = data / request.param
    if not path.exists():
        pytest.skip(f"{request.param} is not in the folder of real volumes")
    return load(path)


def valid(volume):
    good = np.isfinite(volume.data) if volume.data.dtype.kind == "f" else np.ones((), bool)
    good = np.broadcast_to(good, volume.data.shape)
    return good if volume.info.padding is None else good & (volume.data != volume.info.padding)


def isovalues(volume):
    """A typical one, one of few samples, and one in what there is most of."""
    values = volume.data[valid(volume)].astype(float)[:: max(1, volume.data.size // 1_000_000)]
    counts, ends = np.histogram(values, 64)
    most = 1 + int(np.argmax(counts[1:]))
    typical = suggested_isovalue(volume, statistics(volume))
    return typical, float(np.quantile(values, 0.9995)), float(ends[most : most + 2].mean())


def densest(volume, level):
    """A piece with about as much inside as outside."""
    rng, best = np.random.default_rng(0), (-1, ())
    for _ in range(200 if max(volume.data.shape) > SIDE else 1):
        first = [int(rng.integers(0, max(1, n - SIDE + 1))) for n in volume.data.shape]
        at = tuple(slice(a, a + SIDE) for a in first)
        inside = volume.data[at] >= level
        best = max(best, (int(min(inside.sum(), (~inside).sum())), tuple(first)))
    first = best[1]
    affine = np.array(volume.info.affine, dtype=float)
    affine[:3, 3] += affine[:3, :3] @ np.array(first[::-1])
    piece = volume.data[tuple(slice(a, a + SIDE) for a in first)].copy()
    return volviz.Volume.from_array(piece, affine=affine, padding=volume.info.padding)


def index_places(volume, mesh):
    affine = np.asarray(volume.info.affine, dtype=float)
    return (mesh.vertices - affine[:3, 3]) @ np.linalg.inv(affine[:3, :3]).T


def check(volume, mesh, beyond):
    """Finite, within the box, unit normals; walked once each way, but at the border or at samples
    without a value. beyond: samples that the mesh may reach over the border."""
    assert np.isfinite(mesh.vertices).all()
    if len(mesh.normals):
        assert np.allclose(np.linalg.norm(mesh.normals, axis=1), 1, atol=1e-4)
    if mesh.empty:
        return
    at, last = index_places(volume, mesh), np.array(volume.data.shape[::-1]) - 1
    near = 1e-3 + 1e-6 * np.abs(mesh.vertices).max() / min(volume.spacing)
    assert (at > -beyond - near).all()
    assert (at < last + beyond + near).all()
    if not len(mesh.faces):
        return
    n, edges = len(mesh.vertices), oracles.directed_edges(mesh.faces)
    way = edges[:, 0] < edges[:, 1]
    keys = np.minimum(edges[:, 0], edges[:, 1]) * n + np.maximum(edges[:, 0], edges[:, 1])
    there, back = np.sort(keys[way]), np.sort(keys[~way])
    assert np.all(there[1:] > there[:-1])
    assert np.all(back[1:] > back[:-1])
    if valid(volume).all():
        ends = np.setxor1d(there, back, assume_unique=True)
        a, b = at[ends // n], at[ends % n]
        low = np.maximum(a, b) < near
        high = np.minimum(a, b) > last - near
        assert (low | high).any(axis=1).all(), "it ends within the volume"


def crossed_edges(volume, level):
    """Edges of the grid with one end inside, in a volume whose samples are all valid."""
    inside = volume.data >= level
    return sum(int(np.count_nonzero(np.diff(inside, axis=k))) for k in range(3))


def test_whole_volumes(volume):
    data = volume.data
    for level in isovalues(volume)[: 3 if data.size < 10_000_000 else 2]:
        mesh = volviz.extract_surface(volume, level)
        check(volume, mesh, 0)
        again = volviz.extract_surface(volume, level)  # by bricks
        for part in ("vertices", "normals", "faces"):
            assert np.array_equal(getattr(mesh, part), getattr(again, part))
        if min(data.shape) > 1 and valid(volume).all():
            plain = volviz.extract_surface(volume, level, ambiguity="table15")
            assert len(plain.vertices) == crossed_edges(volume, level)


def peak():
    lines = Path("/proc/self/status").read_text().splitlines()
    sizes = dict(line.split(":") for line in lines if line.startswith(("VmHWM", "VmRSS")))
    return {name: 1024 * int(text.split()[0]) for name, text in sizes.items()}


def test_memory_beyond_the_volume_and_three_meshes(volume):
    reset = Path("/proc/self/clear_refs")
    if not reset.exists():
        pytest.skip("the peak of memory is read as Linux tells it")
    level = isovalues(volume)[0]
    volviz.extract_surface(volume, level)  # compiled, and what is kept with the volume
    reset.write_text("5")
    before = peak()["VmRSS"]
    mesh = volviz.extract_surface(volume, level)
    most = volume.data.nbytes + 3 * mesh.nbytes + (8 << 20)
    assert peak()["VmHWM"] - before <= most


def test_pieces_through_every_method_and_finder(volume):
    levels = isovalues(volume)
    piece = densest(volume, levels[0])
    cells = CellRanges.of(piece)
    finders = {name: row.build(cells, None) for name, row in FINDERS.items()}
    for level in levels:
        ids = {name: finder(level) for name, finder in finders.items()}
        for method, row in EXTRACTORS.items():
            whole = row.extract(piece, level)
            beyond = 0.5 if method in ("cuberille", "contour-tracing") else 0
            check(piece, whole, beyond)
            for name in ids if row.by_cell else ():
                found = row.extract(piece, level, ids[name])
                for part in ("vertices", "normals", "faces"):
                    assert np.array_equal(getattr(whole, part), getattr(found, part)), name
            for knobs in OPTIONS.get(method, ()):
                check(piece, row.extract(piece, level, **knobs), beyond)


def test_pieces_have_the_topology_and_the_volume_of_the_trilinear_function(volume):
    """A little noise takes away ties, for which `solid_euler` is not made; a border closes it."""
    level = isovalues(volume)[0]
    piece = densest(volume, level).data.astype(np.float64)
    if not np.isfinite(piece).all() or min(piece.shape) < 2 or np.ptp(piece) > 1e15:
        pytest.skip("no finite values that a little noise changes")
    spread = 1e-3 * max(float(np.abs(piece - level).mean()), 1e-300)
    rough = np.pad(piece + np.random.default_rng(1).uniform(-spread, spread, piece.shape), 1)
    border = np.ones(rough.shape, bool)
    border[1:-1, 1:-1, 1:-1] = False
    rough[border] = min(float(rough.min()), level) - 100 * spread
    mesh = volviz.extract_surface(volviz.Volume.from_array(rough), level)
    if mesh.empty:
        return
    oracles.assert_closed(mesh)
    assert oracles.euler(mesh) == 2 * int(oracles.solid_euler(rough[None], level)[0])
    some = every = rough >= level
    for axis in range(3):
        some = np.delete(some, -1, axis) | np.delete(some, 0, axis)
        every = np.delete(every, -1, axis) & np.delete(every, 0, axis)
    assert every.sum() <= oracles.volume_inside(mesh) <= some.sum()
