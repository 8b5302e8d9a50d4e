"""`python -m tests.bench decimation`: decimation beside fast-simplification.

Both get the same mesh and the same number of triangles to end with, in one process, in turn. Time
is processor time (user and system, all threads), the least of some runs; ours with the search for
a mesh that it may not hurt, theirs with the loading of the mesh. Errors are two-sided and sampled
(`meshes.distance`), of either result to the given mesh. Ratios are ours over theirs: below 1 is
quicker, nearer. A boundary is simplified along itself in both (`--fixed`: held in both).
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from volviz.model.mesh import Mesh

DATA = Path(__file__).parents[3] / "shared" / "data"
REDUCTIONS = (0.5, 0.9, 0.98)


def _surface(volume: Any, isovalue: float) -> Mesh:
    from volviz.isosurface import extract_surface

    return extract_surface(volume, isovalue)


def _file(name: str, isovalue: float) -> Mesh:
    import volviz

    return _surface(volviz.load(DATA / name), isovalue)


def _sample(name: str, isovalue: float) -> Mesh:
    import volviz

    return _surface(volviz.sample(name), isovalue)


def _gyroid() -> Mesh:
    import volviz

    z, y, x = (a * np.float32(9) for a in np.ogrid[-1:1:112j, -1:1:112j, -1:1:112j])
    field = np.sin(x) * np.cos(y) + np.sin(y) * np.cos(z) + np.sin(z) * np.cos(x)
    return _surface(volviz.Volume.from_array(field.astype(np.float32)), 0.01)


def _icosphere() -> Mesh:
    import trimesh

    made = trimesh.creation.icosphere(subdivisions=7, radius=100.0)
    return Mesh(made.vertices.astype(np.float32), made.faces.astype(np.uint32))


CASES: dict[str, Callable[[], Mesh]] = {
    "skull (head CT, 300 HU)": lambda: _file("ct/cranium_head_ct.nrrd", 300.0),
    "skin (head CT, −200 HU)": lambda: _file("ct/cranium_head_ct.nrrd", -200.0),
    "bonsai (60.5)": lambda: _file("classics/bonsai_256.nii.gz", 60.5),
    "sample ct-head, bone": lambda: _sample("ct-head", 300.0),
    "sample ct-head, skin": lambda: _sample("ct-head", -200.0),
    "icosphere": _icosphere,
    "gyroid": _gyroid,
}


def _ours(mesh: Mesh, reduction: float, fixed: bool) -> Mesh:
    from volviz.meshes.decimate import decimate

    return decimate(mesh, reduction, boundary="fixed" if fixed else "simplified")


def _theirs(mesh: Mesh, reduction: float, fixed: bool) -> Mesh:
    from fast_simplification import simplify

    goal = round(len(mesh.faces) * (1 - reduction))
    points, faces = mesh.vertices, mesh.faces.astype(np.int32)
    made = simplify(points, faces, target_count=goal, preserve_border=fixed)
    return Mesh(made[0].astype(np.float32), made[1].astype(np.uint32))


def timed(run: Callable[[], Mesh]) -> tuple[float, Mesh]:
    """Processor seconds of a run, and what it made."""
    start = time.process_time()
    made = run()
    return time.process_time() - start, made


def compare(mesh: Mesh, reduction: float, runs: int, fixed: bool = False) -> dict[str, Any]:
    """Seconds, error and topology of both."""
    from volviz.meshes.distance import two_sided
    from volviz.meshes.measure import measure

    found: dict[str, Any] = {}
    for _ in range(runs):
        for name, how in (("ours", _ours), ("theirs", _theirs)):
            seconds, made = timed(lambda how=how: how(mesh, reduction, fixed))
            found[name] = (min(seconds, found.get(name, (np.inf,))[0]), made)
    row = {}
    step = 2 * float(np.sqrt(measure(mesh).area / len(mesh.faces)))
    for name, (seconds, made) in found.items():
        apart, report = two_sided(made, mesh, step=step), measure(made)
        row[name] = {
            "seconds": seconds,
            "rms": apart.rms,
            "hausdorff": apart.hausdorff,
            "faces": len(made.faces),
            "euler": report.euler,
            "bad": report.non_manifold_edges,
        }
    return row


def main(arguments: list[str]) -> None:
    """Run the cases and print the table."""
    parser = argparse.ArgumentParser(prog="python -m tests.bench decimation")
    parser.add_argument("cases", nargs="*", help=f"any part of {', '.join(CASES)}")
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--fixed", action="store_true", help="hold the boundary where it is")
    parser.add_argument("--reductions", type=float, nargs="*", default=REDUCTIONS)
    chosen = parser.parse_args(arguments)
    from volviz.meshes.measure import measure

    print(
        "| mesh | triangles | to | s | × time | × RMS | × largest | χ before, after | theirs ",
        end="",
    )
    print("| non-manifold edges before, after | theirs |\n|" + "---|" * 11)
    _ours(_icosphere(), 0.5, chosen.fixed)  # compiles
    for case, make in CASES.items():
        if chosen.cases and not any(part in case for part in chosen.cases):
            continue
        mesh = make()
        before = measure(mesh)
        for reduction in chosen.reductions:
            row = compare(mesh, reduction, chosen.runs, chosen.fixed)
            a, b = row["ours"], row["theirs"]
            ratios = " | ".join(f"{a[k] / b[k]:.2f}" for k in ("seconds", "rms", "hausdorff"))
            print(
                f"| {case} | {len(mesh.faces)} | {a['faces']} ({b['faces']}) | {a['seconds']:.2f} "
                f"| {ratios} | {before.euler}, {a['euler']} | {b['euler']} "
                f"| {before.non_manifold_edges}, {a['bad']} | {b['bad']} |",
                flush=True,
            )
