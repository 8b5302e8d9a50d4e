"""Meshes read back by trimesh and VTK."""

from __future__ import annotations

import errno
import json

import numpy as np
import pytest
import trimesh

import volviz
from tests.meshes.shapes import sphere
from volviz.errors import Cancelled, OutputError, UsageError
from volviz.files import write_atomically
from volviz.io.mesh_files import FORMATS
from volviz.meshes.normals import with_normals
from volviz.model.mesh import Mesh
from volviz.progress import Progress


@pytest.fixture(params=["LPS", None])
def mesh(request, rng):
    made = with_normals(sphere(20.0, 2))
    count = len(made.vertices)
    vertices = made.vertices * [1, 2, 3] + [100.25, -50, 7]
    colors = rng.integers(0, 256, (count, 4)).astype(np.uint8)
    values = rng.random(count)
    return Mesh(vertices, made.faces, made.normals, values, colors, request.param)


def loaded(path):
    return trimesh.load(path, process=False, maintain_order=True)


def vtk_read(path):
    """Points, triangles, normals and colours as VTK reads them, the node's matrix not applied."""
    vtk = pytest.importorskip("vtk", exc_type=ImportError)
    from vtk.util.numpy_support import vtk_to_numpy

    kinds = {"stl": "STL", "ply": "PLY", "obj": "OBJ", "glb": "GLTF"}
    reader = getattr(vtk, f"vtk{kinds[path.suffix[1:]]}Reader")()
    reader.SetFileName(str(path))
    if path.suffix == ".stl":
        reader.MergingOff()
    reader.Update()
    out = reader.GetOutputDataObject(0)
    while out.IsA("vtkMultiBlockDataSet"):
        out = out.GetBlock(0)
    data = out.GetPointData()
    normals, colors = data.GetNormals(), data.GetScalars()
    if path.suffix == ".glb":
        colors = data.GetArray("COLOR_0")
    faces = vtk_to_numpy(out.GetPolys().GetConnectivityArray()).reshape(-1, 3)
    arrays = [vtk_to_numpy(a) if a is not None else None for a in (normals, colors)]
    return vtk_to_numpy(out.GetPoints().GetData()), faces, *arrays


def test_stl(mesh, tmp_path):
    path = tmp_path / "a.stl"
    volviz.save_mesh(mesh, path)
    content = path.read_bytes()
    assert len(content) == 84 + 50 * len(mesh.faces)
    assert (b"SPACE=LPS" in content[:80]) == (mesh.space == "LPS")
    corners = mesh.vertices[mesh.faces].reshape(-1, 3)
    back = trimesh.load(path, process=False)
    assert np.array_equal(back.vertices[back.faces].reshape(-1, 3), corners)
    exact = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).face_normals
    stored = np.frombuffer(content, offset=84, dtype="V50").copy().view("<f4,<f4,<f4,V38")
    assert np.allclose(np.stack([stored[f"f{k}"] for k in range(3)], 1), exact, atol=1e-5)
    points, faces, *_ = vtk_read(path)
    assert np.array_equal(points[faces].reshape(-1, 3), corners)


def test_ply(mesh, tmp_path):
    path = tmp_path / "a.ply"
    volviz.save_mesh(mesh, path)
    back = loaded(path)
    assert np.array_equal(back.vertices, mesh.vertices)
    assert np.array_equal(back.faces, mesh.faces)
    assert np.allclose(back.vertex_normals, mesh.normals, atol=1e-6)
    assert np.array_equal(back.visual.vertex_colors, mesh.colors)
    head = path.read_bytes().split(b"end_header")[0]
    assert b"units mm" in head
    assert (b"SPACE=LPS" in head) == (mesh.space == "LPS")
    points, faces, normals, colors = vtk_read(path)
    assert np.array_equal(points, mesh.vertices)
    assert np.array_equal(faces, mesh.faces)
    assert np.allclose(normals, mesh.normals, atol=1e-6)
    assert np.array_equal(colors, mesh.colors)


def test_obj(mesh, tmp_path):
    path = tmp_path / "a.obj"
    volviz.save_mesh(mesh, path)
    back = loaded(path)
    assert np.array_equal(back.vertices.astype(np.float32), mesh.vertices)
    assert np.array_equal(back.faces, mesh.faces)
    assert np.allclose(back.vertex_normals, mesh.normals, atol=1e-6)
    assert np.array_equal(back.visual.vertex_colors[:, :3], mesh.colors[:, :3])
    assert path.read_text().startswith("# volviz: units mm")
    points, faces, normals, _ = vtk_read(path)
    assert np.array_equal(points.astype(np.float32), mesh.vertices)
    assert np.array_equal(faces, mesh.faces)
    assert np.allclose(normals, mesh.normals, atol=1e-6)


def srgb_to_linear(colors):
    encoded = colors / 255.0
    return np.where(encoded > 0.04045, ((encoded + 0.055) / 1.055) ** 2.4, encoded / 12.92)


def test_glb(mesh, tmp_path):
    path = tmp_path / "a.glb"
    volviz.save_mesh(mesh, path)
    points, faces, _, colors = vtk_read(path)
    assert np.array_equal(faces, mesh.faces)
    linear = srgb_to_linear(mesh.colors)
    linear[:, 3] = mesh.colors[:, 3] / 255
    assert np.allclose(colors / (65535 if colors.max() > 1 else 1), linear, atol=1e-5)
    scene = trimesh.load(path, process=False)
    (node,) = scene.graph.nodes_geometry
    matrix, name = scene.graph[node]
    raw = scene.geometry[name]
    assert np.array_equal(raw.vertices, mesh.vertices)
    assert np.array_equal(raw.faces, mesh.faces)
    assert np.allclose(raw.vertex_normals, mesh.normals, atol=1e-6)
    assert np.linalg.det(matrix[:3, :3]) == pytest.approx(1e-9)  # no mirror; mm to m
    size = np.ptp(mesh.vertices, axis=0) / 1000
    placed = trimesh.transform_points(raw.vertices, matrix)
    assert np.allclose(np.ptp(placed, axis=0), size if mesh.space is None else size[[0, 2, 1]])
    # VTK gives the points as its reader places them
    assert np.allclose(points, placed, atol=1e-6) or np.array_equal(points, mesh.vertices)
    length = int.from_bytes(path.read_bytes()[12:16], "little")
    tree = json.loads(path.read_bytes()[20 : 20 + length])
    assert tree["meshes"][0]["extras"] == {"units": "mm", "space": mesh.space, "by": "volviz"}


def test_a_patient_stands_in_gltf(tmp_path):
    """Superior is +y (up), anterior is +z (front), the patient's left is +x."""
    path = tmp_path / "a.glb"
    axes = np.array([[0, 0, 0], [1000, 0, 0], [0, 1000, 0], [0, 0, 1000]])  # L, P, S
    volviz.save_mesh(Mesh(axes, [[0, 1, 2], [0, 2, 3]], space="LPS"), path)
    scene = trimesh.load(path, process=False)
    (node,) = scene.graph.nodes_geometry
    placed = trimesh.transform_points(axes, scene.graph[node][0])
    assert np.allclose(placed, [[0, 0, 0], [1, 0, 0], [0, 0, -1], [0, 1, 0]])


def test_without_a_space_gltf_shows_it_as_a_picture(tmp_path):
    """x to the right, y down, the first slice in front (glTF's +z comes to the viewer)."""
    path = tmp_path / "a.glb"
    axes = np.array([[0, 0, 0], [1000, 0, 0], [0, 1000, 0], [0, 0, 1000]])
    volviz.save_mesh(Mesh(axes, [[0, 1, 2], [0, 2, 3]]), path)
    scene = trimesh.load(path, process=False)
    (node,) = scene.graph.nodes_geometry
    placed = trimesh.transform_points(axes, scene.graph[node][0])
    assert np.allclose(placed, [[0, 0, 0], [1, 0, 0], [0, -1, 0], [0, 0, -1]])


@pytest.mark.parametrize("suffix", FORMATS)
def test_bare_meshes_and_capital_letters(suffix, tmp_path):
    path = tmp_path / ("a" + suffix.upper())
    shape = sphere(3.0, 1)
    volviz.save_mesh(shape, path)
    back = trimesh.load(path, file_type=suffix[1:], process=False, force="mesh")
    assert len(back.faces) == len(shape.faces)


@pytest.mark.parametrize("suffix", FORMATS)
def test_nothing_is_lost_when_it_goes_wrong(suffix, tmp_path, monkeypatch):
    path = tmp_path / ("a" + suffix)
    path.write_text("precious")
    shape = sphere(3.0, 2)
    with pytest.raises(OutputError, match="exists already"):
        volviz.save_mesh(shape, path)
    progress = Progress()
    progress.cancel()
    with pytest.raises(Cancelled):
        volviz.save_mesh(shape, path, overwrite=True, progress=progress)
    late = Progress(lambda fraction, _: late.cancel() if fraction == 1.0 else None)

    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr("os.fsync", full)
        with pytest.raises(OutputError, match="No space left"):
            volviz.save_mesh(shape, path, overwrite=True)
    assert path.read_text() == "precious"
    assert [p.name for p in tmp_path.iterdir()] == [path.name]
    volviz.save_mesh(shape, path, overwrite=True, progress=late)
    assert path.read_bytes() != b"precious"


def test_points_are_a_ply_with_normals(tmp_path, rng):
    path = tmp_path / "points.ply"
    points = rng.standard_normal((50, 3)).astype(np.float32)
    ways = points / np.linalg.norm(points, axis=1, keepdims=True)
    volviz.save_mesh(Mesh(points, normals=ways, space="LPS"), path)
    assert np.array_equal(trimesh.load(path).vertices, points)
    seen, faces, normals, _ = vtk_read(path)
    assert np.array_equal(seen, points)
    assert len(faces) == 0
    assert np.allclose(normals, ways, atol=1e-6)


def test_what_is_not_written():
    with pytest.raises(UsageError, match=r"did you mean '\.stl'"):
        volviz.save_mesh(sphere(), "a.stla")
    with pytest.raises(UsageError, match="nothing to write"):
        volviz.save_mesh(Mesh(np.empty((0, 3))), "a.stl")
    for suffix in (".stl", ".obj", ".glb"):
        with pytest.raises(UsageError, match=r"4 points without triangles .* \.ply"):
            volviz.save_mesh(Mesh(np.eye(4, 3)), "a" + suffix)
    with pytest.raises(UsageError, match=r"standard output: .*\.stl"):
        volviz.save_mesh(sphere(), "-")
    with pytest.raises(UsageError, match="no path"):
        volviz.save_mesh(sphere(), None)
    with pytest.raises(UsageError, match="a str is no mesh"):
        volviz.save_mesh("sphere", "a.stl")
    with pytest.raises(OutputError, match="does not exist"):
        volviz.save_mesh(sphere(), "/nowhere/at/all.stl")


def test_the_atomic_writer_is_the_one(monkeypatch, tmp_path):
    seen = []
    monkeypatch.setattr(
        "volviz.io.mesh_files.write_atomically",
        lambda *a, **k: (seen.append(a[0]), write_atomically(*a, **k)),
    )
    volviz.save_mesh(sphere(), tmp_path / "a.ply")
    assert seen == [tmp_path / "a.ply"]


@pytest.mark.parametrize("links", [True, False])
def test_what_another_program_wrote_meanwhile_stays(tmp_path, monkeypatch, links):
    """Also where the file system has no links; only overwrite=True replaces it."""
    path = tmp_path / "a.stl"

    def meanwhile(fraction, _):
        if fraction == 1.0:
            path.write_text("theirs")

    def none(*_):
        raise OSError(errno.EPERM, "Operation not permitted")

    if not links:
        monkeypatch.setattr("os.link", none)
    with pytest.raises(OutputError, match="exists already"):
        volviz.save_mesh(sphere(3.0, 2), path, progress=Progress(meanwhile))
    assert path.read_text() == "theirs"
    assert [p.name for p in tmp_path.iterdir()] == ["a.stl"]
    volviz.save_mesh(sphere(3.0, 2), path, overwrite=True, progress=Progress(meanwhile))
    assert len(path.read_bytes()) > 84
    path.unlink()
    volviz.save_mesh(sphere(3.0, 2), path)
    assert len(path.read_bytes()) > 84
    assert [p.name for p in tmp_path.iterdir()] == ["a.stl"]
