"""`volviz surface`, on a ball, with the real extraction."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
import trimesh

import volviz
from volviz.cli import run
from volviz.model.knobs import knobs_of
from volviz.model.refining import Refining
from volviz.model.surface import Surface


@pytest.fixture
def ball(tmp_path):
    """Distance from the middle, mm: spheres around (12, 12, 12); a speck in a corner. LPS."""
    z, y, x = np.mgrid[:25, :25, :25]
    data = 20 - np.sqrt((x - 12.0) ** 2 + (y - 12) ** 2 + (z - 12) ** 2)
    data[2, 2, 2] = 15
    path = tmp_path / "ball.nrrd"
    volviz.save_volume(volviz.Volume.from_array(data.astype(np.float32), space="LPS"), path)
    return path


def facts(capsys, *args):
    assert run(["surface", *map(str, args), "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_report(ball, capsys):
    said = facts(capsys, ball, "--isovalue", "12")
    mesh = said["mesh"]
    assert (mesh["components"], mesh["euler"], mesh["genus"], mesh["closed"]) == (2, 4, 0, True)
    assert mesh["parts"][0]["area_mm2"] == pytest.approx(4 * np.pi * 64, rel=0.02)
    assert mesh["parts"][0]["volume_mm3"] == pytest.approx(4 / 3 * np.pi * 512, rel=0.02)
    assert mesh["low_mm"][0] == pytest.approx(2 - (15 - 12) / 9, abs=0.3)
    assert mesh["space"] == "LPS"
    assert said["surface"]["method"] == "marching-cubes"
    assert said["distance_mm"] is None
    assert run(["surface", str(ball), "--isovalue", "12"]) == 0
    shown = capsys.readouterr()
    assert "enclosed volume" in shown.out
    assert "components" in shown.out
    assert f"{mesh['triangles']} triangles, mm, LPS" in shown.err


def test_every_step(ball, tmp_path, capsys):
    out = tmp_path / "a.ply"
    steps = ["--keep-largest", "--smooth", "5", "--decimate", "0.8", "--weld", "0.001"]
    said = facts(capsys, ball, "--isovalue", "12", *steps, "-o", out)
    assert said["mesh"]["components"] == 1
    assert said["mesh"]["triangles"] < 0.21 * said["extracted_triangles"]
    assert 0 < said["distance_mm"]["rms"] < said["distance_mm"]["hausdorff"] < 0.5
    back = trimesh.load(out, process=False)
    assert len(back.faces) == said["mesh"]["triangles"]
    assert back.is_watertight
    radius = np.linalg.norm(back.vertices - 12, axis=1)
    assert np.abs(radius - 8).max() < 0.3
    outwards = (back.vertex_normals * (back.vertices - 12) / radius[:, None]).sum(axis=1)
    assert outwards.min() > 0.9


def test_islands_and_error(ball, capsys):
    plain = facts(capsys, ball, "--isovalue", "12", "--min-triangles", "20")
    assert plain["mesh"]["components"] == 1
    held = facts(capsys, ball, "--isovalue", "12", "--max-error", "0.1")
    assert held["distance_mm"]["hausdorff"] <= 0.1
    assert held["mesh"]["triangles"] < held["extracted_triangles"]
    assert held["mesh"]["components"] == 2


def test_every_knob_is_a_flag(capsys):
    assert run(["surface", "--help"]) == 0
    text = capsys.readouterr().out
    for knob in (*knobs_of(Surface), *knobs_of(Refining)):
        assert knob.flag in text


@pytest.mark.parametrize("suffix", ["stl", "obj", "glb"])
def test_every_format(ball, tmp_path, capsys, suffix):
    out = tmp_path / f"a.{suffix}"
    assert run(["surface", str(ball), "--isovalue", "12", "-o", str(out)]) == 0
    shown = capsys.readouterr()
    assert shown.out == ""
    assert f"a.{suffix}" in shown.err
    assert len(trimesh.load(out, force="mesh").faces) > 100


def test_outside_the_values(ball, tmp_path, capsys):
    assert run(["surface", str(ball), "--isovalue", "5000"]) == 0
    said = capsys.readouterr()
    assert "no surface at 5000" in said.err
    assert "to 20" in said.err
    assert facts(capsys, ball, "--isovalue", "5000")["mesh"]["triangles"] == 0
    assert run(["surface", str(ball), "--isovalue", "5000", "-o", str(tmp_path / "a.stl")]) == 2
    assert "to 20" in capsys.readouterr().err
    assert not (tmp_path / "a.stl").exists()
    assert run(["surface", str(ball), "--isovalue", "12", "--min-triangles", "100000"]) == 0
    assert "none of the" in capsys.readouterr().err


@pytest.mark.parametrize("kind", ["constant", "nan", "thin"])
def test_odd_volumes(kind, tmp_path, capsys):
    data = np.full((4, 5, 6), 7, np.float32)
    if kind == "nan":
        data[:] = np.nan
    if kind == "thin":
        data = np.linspace(0, 9, 120, dtype=np.float32).reshape(2, 6, 10)
    path = tmp_path / "odd.nrrd"
    volviz.save_volume(volviz.Volume.from_array(data), path)
    assert run(["surface", str(path), "--isovalue", "7.5"]) == 0
    said = capsys.readouterr()
    assert ("no surface" in said.err or "no finite value" in said.err) == (kind != "thin")
    assert ("every value is 7" in said.err) == (kind == "constant")


@pytest.mark.parametrize(
    ("flags", "code", "words"),
    [
        ([], 2, ["--isovalue", "the values go from"]),
        (["--isovalue", "nan"], 2, ["--isovalue", "not a number"]),
        (["--isovalue", "12", "--method", "marching-cube"], 2, ["did you mean 'marching-cubes'"]),
        (["--isovalue", "12", "--finder", "brick"], 2, ["did you mean 'bricks'"]),
        (["--isovalue", "12", "--boundary", "fixt"], 2, ["did you mean 'fixed'"]),
        (["--isovalue", "12", "--decimate", "90"], 2, ["--decimate", "0 to 1"]),
        (["--isovalue", "12", "--smooth", "-1"], 2, ["--smooth"]),
        (["--isovalue", "12", "-o", "a.stlx"], 2, ["did you mean '.stl'"]),
        (["--isovalue", "12", "-o", "-"], 2, ["standard output", ".stl"]),
        (["--isovalue", "12", "-o", "/nowhere/a.stl"], 7, ["/nowhere", "make it first"]),
    ],
)
def test_wrong_flags_are_one_helpful_line(ball, capsys, flags, code, words):
    assert run(["surface", str(ball), *flags]) == code
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.count("\n") == 1
    for word in words:
        assert word in said.err


def saved(tmp_path, data):
    path = tmp_path / "made.nrrd"
    volviz.save_volume(volviz.Volume.from_array(data), path, overwrite=True)
    return str(path)


def test_points_are_told_and_written_as_points(ball, tmp_path, capsys):
    """dividing-cubes makes no triangles, which is not to say that there is no surface."""
    base = ["surface", str(ball), "--isovalue", "12", "--method", "dividing-cubes"]
    assert run(base) == 0
    said = capsys.readouterr().err
    assert "points without triangles" in said
    assert "no surface" not in said
    out = tmp_path / "a.ply"
    assert run([*base, "-o", str(out)]) == 0
    points = trimesh.load(out).vertices - 12
    radius = np.linalg.norm(points, axis=1)
    assert (np.abs(radius - 8) < 1).sum() > 500
    assert run([*base, "-o", str(tmp_path / "a.stl")]) == 2
    assert ".ply" in capsys.readouterr().err
    assert not (tmp_path / "a.stl").exists()


def test_an_isovalue_that_every_sample_reaches_is_told(tmp_path, capsys):
    path = saved(tmp_path, np.arange(1, 61, dtype=np.float32).reshape(3, 4, 5))
    assert run(["surface", path, "--isovalue", "1"]) == 0
    said = capsys.readouterr().err
    assert "every sample is at least that, so inside; the values go from 1 to 60" in said
    assert run(["surface", path, "--isovalue", "61"]) == 0
    assert "every sample" not in capsys.readouterr().err


def test_a_folder_is_no_mesh_file(ball, tmp_path, capsys):
    assert run(["surface", str(ball), "--isovalue", "12", "-o", str(tmp_path)]) == 2
    said = capsys.readouterr().err
    assert "is a folder" in said
    assert ".stl" in said


def test_one_slice_is_said_to_be_too_thin(tmp_path, capsys):
    path = saved(tmp_path, np.arange(20, dtype=np.float32).reshape(1, 4, 5))
    assert run(["surface", path, "--isovalue", "7.5"]) == 0
    said = capsys.readouterr().err
    assert "two samples along every axis, there are 5 × 4 × 1" in said
    assert "no surface at" not in said


def test_cells_without_value_are_in_the_report(tmp_path, capsys):
    data = np.zeros((6, 6, 6), np.float32)
    data[2:4, 2:4, 2:4] = 1
    data[3, 3, 3] = np.nan
    path = saved(tmp_path, data)
    assert run(["surface", path, "--isovalue", "0.5"]) == 0
    said = capsys.readouterr()
    assert "8, left out" in said.out
    assert "8 cells have a sample without a value" in said.err
    data[:] = np.where(np.indices(data.shape).sum(axis=0) % 2, np.nan, data)
    path = saved(tmp_path, data)
    assert run(["surface", path, "--isovalue", "0.5", "-o", str(tmp_path / "a.stl")]) == 2
    assert "125 cells have a sample without a value" in capsys.readouterr().err


def test_wrong_knobs_are_told_before_anything_is_read(tmp_path, capsys):
    path = tmp_path / "broken.nrrd"
    path.write_bytes(b"NRRD0004\nbroken")
    assert run(["surface", str(path), "--isovalue", "3", "--method", "marching-cube"]) == 2
    assert "did you mean 'marching-cubes'" in capsys.readouterr().err
    assert run(["surface", str(path), "--decimate", "2"]) == 2
    assert "--decimate" in capsys.readouterr().err
    assert run(["surface", str(path), "--isovalue", "3"]) == 3


def test_several_isovalues_are_not_taken_for_the_last_one(ball, tmp_path, capsys):
    given = ["--isovalue", "12", "--isovalue", "14", "-o", str(tmp_path / "a.stl")]
    assert run(["surface", str(ball), *given]) == 2
    assert "2 isovalues were given" in capsys.readouterr().err
    assert not (tmp_path / "a.stl").exists()


@pytest.mark.parametrize("name", ["isovalue", "size", "min-area", "weld", "max-error"])
def test_infinite_knobs_are_refused(ball, capsys, name):
    """They were taken, and then no JSON held them."""
    given = ["--isovalue", "12"] if name != "isovalue" else []
    for word in ("inf", "1e999"):
        assert run(["surface", str(ball), *given, f"--{name}", word, "--json"]) == 2
        assert f"--{name}: inf is not a finite number" in capsys.readouterr().err


def test_flags_that_do_nothing_with_the_method_are_told(ball, capsys):
    base = ["surface", str(ball), "--isovalue", "12"]
    assert run([*base, "--axis", "x"]) == 0
    said = "warning: --axis does nothing with marching-cubes, it is for contour-tracing"
    assert said in capsys.readouterr().err
    for fitting in (["--normals", "sobel"], ["--method", "contour-tracing", "--axis", "x"]):
        assert run([*base, *fitting]) == 0
        assert "does nothing" not in capsys.readouterr().err


@pytest.mark.parametrize("size", ["0x0", "8x0", "axb", "100000x100000"])
def test_pictures_without_pixels(ball, capsys, size):
    base = ["surface", str(ball), "--isovalue", "12", "--method", "dividing-cubes"]
    assert run([*base, "--size-pixels", "3", "--picture", size]) == 2
    assert "--picture: " in capsys.readouterr().err


def test_help_does_not_wait_for_the_compiler():
    code = (
        "import sys; from volviz.cli import run; run(['surface', '--help']); "
        "sys.exit(any(m in sys.modules for m in ('numba', 'trimesh', 'moderngl', 'scipy')))"
    )
    subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, timeout=60)


def test_nothing_is_overwritten_without_force(ball, tmp_path, capsys):
    out = tmp_path / "a.stl"
    out.write_text("precious")
    base = ["surface", str(ball), "--isovalue", "12", "-q", "-o", str(out)]
    assert run(base) == 7
    assert "--force" in capsys.readouterr().err
    assert out.read_text() == "precious"
    assert run([*base, "--force"]) == 0
    assert len(out.read_bytes()) > 84
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM], ids=["ctrl-c", "ended"])
def test_what_is_interrupted_while_it_writes_leaves_nothing(tmp_path, number):
    """A batch system ends programs by SIGTERM: the half-written file stayed."""
    rough = np.random.default_rng(0).random((70, 70, 70)).astype(np.float32)
    path, out = tmp_path / "rough.nrrd", tmp_path / "to" / "a.obj"
    out.parent.mkdir()
    volviz.save_volume(volviz.Volume.from_array(rough), path, compress=False)
    command = [sys.executable, "-m", "volviz", "surface", str(path), "--isovalue", "0.5"]
    work = subprocess.Popen([*command, "-o", str(out)], stderr=subprocess.PIPE, text=True)
    while work.poll() is None and not list(out.parent.iterdir()):
        time.sleep(0.005)
    assert [p.suffix for p in out.parent.iterdir()] == [".part"], "too quick to be interrupted"
    work.send_signal(number)
    _, said = work.communicate(timeout=120)
    assert work.returncode == 130
    assert said.strip().endswith("cancelled")
    assert list(out.parent.iterdir()) == []


def test_ctrl_c_leaves_nothing_behind(tmp_path):
    rough = np.random.default_rng(0).random((160, 160, 160)).astype(np.float32)
    path, out = tmp_path / "rough.nrrd", tmp_path / "a.obj"
    volviz.save_volume(volviz.Volume.from_array(rough), path, compress=False)
    command = [sys.executable, "-m", "volviz", "surface", str(path), "--isovalue", "0.5"]
    work = subprocess.Popen(
        [*command, "--decimate", "0.9", "-o", str(out)], stderr=subprocess.PIPE, text=True
    )
    time.sleep(2.5)
    assert work.poll() is None, "too quick to be interrupted"
    work.send_signal(signal.SIGINT)
    _, said = work.communicate(timeout=120)
    assert work.returncode == 130
    assert said.strip().endswith("cancelled")
    assert [p.name for p in tmp_path.iterdir()] == ["rough.nrrd"]


@pytest.mark.parametrize("suffix", ["stl", "ply", "obj", "glb"])
def test_millimetres_are_said_only_where_the_file_knows_its_unit(tmp_path, capsys, suffix):
    z, y, x = np.mgrid[:9, :9, :9].astype(np.float32)
    ball = np.sqrt((x - 4) ** 2 + (y - 4) ** 2 + (z - 4) ** 2)
    for known, name in ((False, "plain.npy"), (True, "known.nrrd")):
        path = tmp_path / name
        if known:
            volviz.save_volume(volviz.Volume.from_array(ball, space="LPS"), path)
        else:
            np.save(path, ball)
        out = tmp_path / f"{name}.{suffix}"
        assert run(["surface", str(path), "--isovalue", "3", "--report", "-o", str(out)]) == 0
        told = capsys.readouterr()
        assert (" mm³" in told.out) == (" mm²" in told.out) == known
        assert ("units²" in told.out) == (not known)
        assert (" triangles, mm, LPS" in told.err) == known
        assert ("unit of length unknown" in told.err) == (not known)
        content = out.read_bytes()
        assert (b"units mm" in content or b'"units":"mm"' in content) == known
        assert (b"units unknown" in content or b'"units":null' in content) == (not known)
        said = facts(capsys, path, "--isovalue", "3")
        assert said["length_unit"] == ("mm" if known else None)


def test_a_unit_that_no_mesh_has(tmp_path):
    mesh = volviz.Mesh(np.zeros((3, 3)), np.array([[0, 1, 2]]))
    with pytest.raises(volviz.VolvizError, match="'inch' is no unit"):
        volviz.save_mesh(mesh, tmp_path / "a.stl", unit="inch")
    assert not (tmp_path / "a.stl").exists()


def test_flipped_it_faces_the_brighter_side(tmp_path, capsys):
    """A dark ball: its surface encloses less than nothing until it is turned."""
    z, y, x = np.mgrid[:17, :17, :17].astype(np.float32)
    path = tmp_path / "dark.nrrd"
    data = np.sqrt((x - 8) ** 2 + (y - 8) ** 2 + (z - 8) ** 2)
    volviz.save_volume(volviz.Volume.from_array(data, space="LPS"), path)
    inside = 4 / 3 * np.pi * 5**3
    for flip, sign in (([], -1), (["--flip"], 1), (["--flip", "--decimate", "0.3"], 1)):
        out = tmp_path / "a.stl"
        said = facts(capsys, path, "--isovalue", "5", *flip, "-o", out, "--force")
        assert said["mesh"]["volume_mm3"] == pytest.approx(sign * inside, rel=0.03)
        assert trimesh.load(out).volume == pytest.approx(sign * inside, rel=0.03)
    points = ["--method", "dividing-cubes", "-o", str(tmp_path / "a.ply"), "-q"]
    for flip, sign in (([], -1), (["--flip"], 1)):
        assert run(["surface", str(path), "--isovalue", "5", *points, *flip, "--force"]) == 0
        back = volviz_normals(tmp_path / "a.ply")
        assert np.all(sign * back > 0.5)


def volviz_normals(path):
    """Of points in a PLY, along the way out from (8, 8, 8)."""
    with open(path, "rb") as file:
        read = trimesh.exchange.ply.load_ply(file)
    at = np.stack([read["metadata"]["_ply_raw"]["vertex"]["data"][k] for k in "xyz"], axis=-1) - 8
    rows = read["metadata"]["_ply_raw"]["vertex"]["data"]
    ways = np.stack([rows[k] for k in ("nx", "ny", "nz")], axis=-1)
    return (ways * at).sum(axis=-1) / np.linalg.norm(at, axis=-1)


def test_triangles_without_area_are_explained_and_welding_takes_them(tmp_path, capsys):
    """Labels, and the isovalue that people type for one of them."""
    z, y, x = np.mgrid[:9, :9, :9]
    path = saved(tmp_path, ((x - 4) ** 2 + (y - 4) ** 2 + (z - 4) ** 2 < 9).astype(np.float32))
    for isovalue, more, explained in (
        ("1", [], True),
        ("0.5", [], False),
        ("1", ["--weld", "1e-6"], False),
    ):
        assert run(["surface", path, "--isovalue", isovalue, *more]) == 0
        said = capsys.readouterr()
        assert ("--weld 1e-6" in said.err) == explained
        flat = next(line.split()[2] for line in said.out.splitlines() if "degenerate" in line)
        assert (int(flat) > 0) == explained


def test_discretized_marching_cubes_tell_what_merging_saved(ball, capsys):
    base = [ball, "--isovalue", "12", "--method", "discretized-marching-cubes"]
    said = facts(capsys, *base)
    merged = said["merged"]
    assert merged["after"] == said["extracted_triangles"] == said["mesh"]["triangles"]
    plain = facts(capsys, *base[:-1], "marching-cubes", "--ambiguity", "asymptotic")
    assert merged["before"] == plain["extracted_triangles"] > merged["after"]
    assert merged["share"] == pytest.approx(1 - merged["after"] / merged["before"])
    assert 0 < merged["polygons"] <= merged["after"]
    assert plain["merged"] is None
    assert run(["surface", *map(str, base)]) == 0
    assert f"{merged['before']} to {merged['after']}, " in capsys.readouterr().out


def test_the_picture_decides_how_dense_points_are(ball, tmp_path, capsys):
    counts = []
    for more in (
        ["--size-pixels", "8"],
        ["--size-pixels", "4"],
        ["--size-pixels", "8", "--picture", "400x300"],
    ):
        out = tmp_path / "a.ply"
        base = ["surface", str(ball), "--isovalue", "12", "--method", "dividing-cubes", "-q", "-f"]
        assert run([*base, "-o", str(out), *more]) == 0
        counts.append(len(trimesh.load(out).vertices))
    assert counts[0] < counts[1]
    assert counts[2] <= counts[0]
    assert counts[1] > 2 * counts[2]
