"""`python -m tests.bench surfaces`: isosurfaces beside VTK, scikit-image and PyMCubes.

All peers get the same array and isovalue and give vertices, triangles and normals (PyMCubes has
none). They are asked in turn, in one process per setting of threads; medians; only ratios are
claims. "moved" is volviz with a finder of the volume already built. VTK's wheel runs one thread
unless VTK_SMP_BACKEND_IN_USE says otherwise; both are shown. Peers that are not installed are
left out and named.
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

DATA = Path(__file__).parents[3] / "shared" / "data"
BACKENDS = {"VTK Flying Edges, 1 thread": "Sequential", "VTK Flying Edges, 2 threads": "STDThread"}


def sphere() -> np.ndarray:
    z, y, x = np.ogrid[-1:1:256j, -1:1:256j, -1:1:256j]
    return (0.7 - np.sqrt(x * x + y * y + z * z)).astype(np.float32)


def gyroid() -> np.ndarray:
    z, y, x = (a * np.float32(28) for a in np.ogrid[-1:1:256j, -1:1:256j, -1:1:256j])
    field = np.sin(x) * np.cos(y) + np.sin(y) * np.cos(z) + np.sin(z) * np.cos(x)
    return field.astype(np.float32)


def _read(name: str) -> np.ndarray:
    import volviz

    return np.array(volviz.load(DATA / name).data)


CASES: dict[str, tuple[Callable[[], np.ndarray], float]] = {
    "sphere 256³ float": (sphere, 0.0),
    "gyroid 256³ float": (gyroid, 0.01),
    "bonsai 256³ uint8": (lambda: _read("classics/bonsai_256.nii.gz"), 60.5),
    "head CT, bone": (lambda: _read("ct/cranium_head_ct.nrrd"), 300.0),
    "head CT, skin": (lambda: _read("ct/cranium_head_ct.nrrd"), -200.0),
}


def ours(array: np.ndarray, isovalue: float) -> dict[str, Callable[[], int]]:
    """Cold, and with a finder built."""
    import volviz
    from volviz.isosurface.cells import CellRanges
    from volviz.isosurface.extractors.marching_cubes import extract
    from volviz.isosurface.finders import FINDERS

    volume = volviz.Volume.from_array(array)
    finder = FINDERS["bricks"].build(CellRanges.of(volume), None)
    return {
        "volviz": lambda: len(extract(volume, isovalue).faces),
        "volviz, plain table": lambda: len(extract(volume, isovalue, ambiguity="table15").faces),
        "volviz, moved": lambda: len(extract(volume, isovalue, finder(isovalue)).faces),
    }


def vtk_edges(array: np.ndarray, isovalue: float) -> Callable[[], int]:
    """vtkFlyingEdges3D with normals, no gradients."""
    from vtkmodules.util.numpy_support import numpy_to_vtk
    from vtkmodules.vtkCommonDataModel import vtkImageData
    from vtkmodules.vtkFiltersCore import vtkFlyingEdges3D

    image = vtkImageData()
    image.SetDimensions(*array.shape[::-1])
    image.GetPointData().SetScalars(numpy_to_vtk(array.ravel(), deep=False))
    image.keep = array

    def run() -> int:
        edges = vtkFlyingEdges3D()
        edges.SetInputData(image)
        edges.SetValue(0, isovalue)
        edges.ComputeNormalsOn()
        edges.ComputeGradientsOff()
        edges.ComputeScalarsOff()
        edges.Update()
        return edges.GetOutput().GetNumberOfPolys()

    return run


def scikit(array: np.ndarray, isovalue: float) -> Callable[[], int]:
    """skimage.measure.marching_cubes (Lewiner), which takes floats."""
    from skimage.measure import marching_cubes

    floats = array.astype(np.float32)
    return lambda: len(marching_cubes(floats, isovalue)[1])


def pymcubes(array: np.ndarray, isovalue: float) -> Callable[[], int]:
    """mcubes.marching_cubes; no normals."""
    import mcubes

    return lambda: len(mcubes.marching_cubes(array, isovalue)[1])


def serve(pipe: Any, case: str, peer: str, runs: int) -> None:
    """One peer in its process: seconds and triangles for every 'run'."""
    make, isovalue = CASES[case]
    array = make()
    if peer.startswith("VTK"):
        run = vtk_edges(array, isovalue)
    elif peer == "scikit-image":
        run = scikit(array, isovalue)
    elif peer == "PyMCubes":
        run = pymcubes(array, isovalue)
    else:
        run = ours(array, isovalue)[peer]
    run()  # compile, warm up
    pipe.send("ready")
    while pipe.recv() is not None:
        start = time.perf_counter()
        triangles = run()
        pipe.send((time.perf_counter() - start, triangles))


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


def measure(case: str, runs: int) -> dict[str, tuple[float, int]]:
    """Median milliseconds and triangles of every peer, asked in turn."""
    context = multiprocessing.get_context("spawn")
    pipes, children = {}, []
    for peer in peers():
        os.environ["VTK_SMP_BACKEND_IN_USE"] = BACKENDS.get(peer, "Sequential")
        os.environ["VTK_SMP_MAX_THREADS"] = "2"
        here, there = context.Pipe()
        child = context.Process(target=serve, args=(there, case, peer, runs))
        child.start()
        there.close()
        assert here.recv() == "ready"
        pipes[peer] = here
        children.append(child)
    times: dict[str, list[float]] = {peer: [] for peer in pipes}
    triangles = {}
    for _ in range(runs):
        for peer, pipe in pipes.items():
            pipe.send("run")
            seconds, triangles[peer] = pipe.recv()
            times[peer].append(seconds)
    for pipe in pipes.values():
        pipe.send(None)
    for child in children:
        child.join()
    return {p: (1000 * statistics.median(t), triangles[p]) for p, t in times.items()}


def main(arguments: list[str]) -> None:
    """Run the cases and print the table."""
    parser = argparse.ArgumentParser(prog="python -m tests.bench surfaces")
    parser.add_argument("cases", nargs="*", help=f"any of {', '.join(CASES)}")
    parser.add_argument("--runs", type=int, default=9)
    chosen = parser.parse_args(arguments)
    print("| case | peer | ms | × ours | triangles |\n|---|---|---|---|---|")
    for case in chosen.cases or CASES:
        found = measure(case, chosen.runs)
        for peer, (ms, triangles) in found.items():
            ratio = ms / found["volviz"][0]
            print(f"| {case} | {peer} | {ms:.1f} | {ratio:.2f} | {triangles} |", flush=True)
