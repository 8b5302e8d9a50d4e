"""`python -m tests.bench surfaces`: isosurfaces beside VTK, scikit-image and PyMCubes.

All peers get the same array and isovalue and give vertices, triangles and normals (PyMCubes has
none). They are asked in turn, in one process per setting of threads; medians; only ratios are
claims. "moved" is volviz with the ranges of bricks already built, as the window has them from the
second isovalue on, and every run has another isovalue; the other peers have the same ones. VTK's
wheel runs one thread unless VTK_SMP_BACKEND_IN_USE says otherwise; both are shown. Peers that are
not installed are left out and named. Processor time (of all threads, user and system) stands
beside: it can be judged on a machine that is not quiet. So can the clock, as root, where all peers
go before everything else for the milliseconds they take: `chrt -f 10 python -m tests.bench
surfaces`.

`--growth OUT.png` draws how the cost grows with the volume instead (see growth.py).
"""

from __future__ import annotations

import argparse
import importlib.util
import multiprocessing
import os
import statistics
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from tests.bench import growth

DATA = Path(__file__).parents[3] / "shared" / "data"
BACKENDS = {"VTK Flying Edges, 1 thread": "Sequential", "VTK Flying Edges, 2 threads": "STDThread"}


def sphere(radius: float = 0.7) -> np.ndarray:
    z, y, x = np.ogrid[-1:1:256j, -1:1:256j, -1:1:256j]
    return (radius - np.sqrt(x * x + y * y + z * z)).astype(np.float32)


def gyroid(turns: float = 28) -> np.ndarray:
    z, y, x = (a * np.float32(turns) for a in np.ogrid[-1:1:256j, -1:1:256j, -1:1:256j])
    field = np.sin(x) * np.cos(y) + np.sin(y) * np.cos(z) + np.sin(z) * np.cos(x)
    return field.astype(np.float32)


def _read(name: str) -> np.ndarray:
    import volviz

    return np.array(volviz.load(DATA / name).data)


CASES: dict[str, tuple[Callable[[], np.ndarray], float]] = {
    "sphere 256³ float": (sphere, 0.0),
    "gyroid 256³ float": (lambda: gyroid(9.1), 0.01),
    "fine gyroid 256³ float": (gyroid, 0.01),
    "bonsai 256³ uint8": (lambda: _read("classics/bonsai_256.nii.gz"), 60.5),
    "head CT, bone": (lambda: _read("ct/cranium_head_ct.nrrd"), 300.0),
    "head CT, skin": (lambda: _read("ct/cranium_head_ct.nrrd"), -200.0),
    "sparse: small sphere 256³ float": (lambda: sphere(0.22), 0.0),
    "sparse: bonsai 256³ uint8, pot": (lambda: _read("classics/bonsai_256.nii.gz"), 222.5),
    "sparse: head CT, enamel": (lambda: _read("ct/cranium_head_ct.nrrd"), 1550.0),
    "sparse: head CT, densest enamel": (lambda: _read("ct/cranium_head_ct.nrrd"), 1850.0),
}
"""Those that are called sparse have less than 100 k triangles in 7 to 17 M samples."""


MOVES = (0.0, 1e-3, -1e-3, 2e-3, -2e-3)
"""Of the range of values: how far from its isovalue a case is extracted, run by run."""
Run = Callable[[float], int]


def ours(array: np.ndarray) -> dict[str, Run]:
    """Cold, and with a finder built."""
    import volviz
    from volviz.isosurface.cells import CellRanges
    from volviz.isosurface.extractors.marching_cubes import extract
    from volviz.isosurface.finders import FINDERS

    volume = volviz.Volume.from_array(array)
    rows = FINDERS["bricks"].build(CellRanges.of(volume), None).rows
    return {
        "volviz": lambda level: len(extract(volume, level).faces),
        "volviz, plain table": lambda level: len(extract(volume, level, ambiguity="table15").faces),
        "volviz, moved": lambda level: len(extract(volume, level, rows=rows).faces),
    }


def vtk_edges(array: np.ndarray) -> Run:
    """vtkFlyingEdges3D with normals, no gradients."""
    from vtkmodules.util.numpy_support import numpy_to_vtk
    from vtkmodules.vtkCommonDataModel import vtkImageData
    from vtkmodules.vtkFiltersCore import vtkFlyingEdges3D

    image = vtkImageData()
    image.SetDimensions(*array.shape[::-1])
    image.GetPointData().SetScalars(numpy_to_vtk(array.ravel(), deep=False))
    image.keep = array

    def run(isovalue: float) -> int:
        edges = vtkFlyingEdges3D()
        edges.SetInputData(image)
        edges.SetValue(0, isovalue)
        edges.ComputeNormalsOn()
        edges.ComputeGradientsOff()
        edges.ComputeScalarsOff()
        edges.Update()
        return edges.GetOutput().GetNumberOfPolys()

    return run


def scikit(array: np.ndarray) -> Run:
    """skimage.measure.marching_cubes (Lewiner), which takes floats."""
    from skimage.measure import marching_cubes

    floats = array.astype(np.float32)
    return lambda isovalue: len(marching_cubes(floats, isovalue)[1])


def pymcubes(array: np.ndarray) -> Run:
    """mcubes.marching_cubes; no normals."""
    import mcubes

    return lambda isovalue: len(mcubes.marching_cubes(array, isovalue)[1])


def serve(pipe: Any, case: str, peer: str) -> None:
    """One peer in its process: seconds, processor seconds, triangles for every move."""
    make, isovalue = CASES[case]
    array = make()
    span = float(array.max()) - float(array.min())
    if peer.startswith("VTK"):
        run = vtk_edges(array)
    elif peer == "scikit-image":
        run = scikit(array)
    elif peer == "PyMCubes":
        run = pymcubes(array)
    else:
        run = ours(array)[peer]
    for _ in range(2):
        run(isovalue)  # compile, warm up
    pipe.send("ready")
    while (move := pipe.recv()) is not None:
        start, worked = time.perf_counter(), time.process_time()
        triangles = run(isovalue + move * span)
        pipe.send((time.perf_counter() - start, time.process_time() - worked, triangles))


def peers() -> list[str]:
    """Those that can be run here."""
    found = ["volviz", "volviz, plain table", "volviz, moved"]
    if importlib.util.find_spec("vtkmodules"):
        found += list(BACKENDS)
    for module, name in (("skimage", "scikit-image"), ("mcubes", "PyMCubes")):
        if importlib.util.find_spec(module):
            found.append(name)
        else:
            print(f"not run: {name} is not installed")
    return found


def measure(case: str, runs: int) -> dict[str, tuple[float, float, int]]:
    """Median milliseconds, processor milliseconds, triangles of every peer, asked in turn."""
    context = multiprocessing.get_context("spawn")
    pipes, children = {}, []
    for peer in peers():
        os.environ["VTK_SMP_BACKEND_IN_USE"] = BACKENDS.get(peer, "Sequential")
        os.environ["VTK_SMP_MAX_THREADS"] = "2"
        here, there = context.Pipe()
        child = context.Process(target=serve, args=(there, case, peer))
        child.start()
        there.close()
        assert here.recv() == "ready"
        pipes[peer] = here
        children.append(child)
    found: dict[str, list[tuple[float, float, int]]] = {peer: [] for peer in pipes}
    for run in range(runs):
        for peer, pipe in pipes.items():
            pipe.send(MOVES[run % len(MOVES)])
            found[peer].append(pipe.recv())
    for pipe in pipes.values():
        pipe.send(None)
    for child in children:
        child.join()
    return {
        peer: (
            1000 * statistics.median(wall for wall, _, _ in rows),
            1000 * statistics.median(worked for _, worked, _ in rows),
            rows[0][2],
        )
        for peer, rows in found.items()
    }


def main(arguments: list[str]) -> None:
    """Run the cases and print the table."""
    parser = argparse.ArgumentParser(prog="python -m tests.bench surfaces")
    parser.add_argument("cases", nargs="*", help=f"any of {', '.join(CASES)}")
    parser.add_argument("--runs", type=int, default=9)
    parser.add_argument("--growth", type=Path, help="draw time against size into this PNG instead")
    chosen = parser.parse_args(arguments)
    if chosen.growth:
        growth.main(chosen.growth, chosen.runs)
        return
    heads = ("case", "peer", "ms", "× ours", "× moved", "processor ms", "triangles")
    print(f"| {' | '.join(heads)} |\n{'|---' * len(heads)}|")
    for case in chosen.cases or CASES:
        found = measure(case, chosen.runs)
        for peer, (ms, worked, triangles) in found.items():
            ratios = [f"{ms / found[own][0]:.2f}" for own in ("volviz", "volviz, moved")]
            cells = (case, peer, f"{ms:.1f}", *ratios, f"{worked:.1f}", str(triangles))
            print(f"| {' | '.join(cells)} |", flush=True)
