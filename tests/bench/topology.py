"""`python -m tests.bench topology`: whose surfaces have the topology of the trilinear function.

Random fields of 2×2×2 cells in a border of low values, all in one volume; every method gets the
same array and isovalue 0. Counted, of the fields: those whose Euler characteristic is not that of
the trilinear function (exact, by Morse theory: `tests/isosurface/oracles.py`), and those with
another number of surfaces than a refined lattice has, where two refinements agree on it. Meshes
are taken as their lists of indices say, faces with a corner twice left out. A field is wrong too
if its surface is not closed.

Float samples never equal the isovalue. Integer ones (−3 to 3) often do, and then it is a matter of
convention which side they are on: each method is held against both, ≥ is inside and > is inside,
and the one that suits it better is shown. Open edges (of one face) and non-manifold ones (of more
than two) are told apart from that, since they are wrong whatever the convention.
"""

from __future__ import annotations

import argparse
import importlib.util
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from tests.isosurface import oracles
from tests.isosurface.test_topology import fields

Arrays = tuple[np.ndarray, np.ndarray]
STEPS = (10, 16, 22)  # refinements
TIE = 1e-3  # how far from 0 the level is that stands for a convention


def ours(ambiguity: str) -> Callable[[np.ndarray], Arrays]:
    def run(data: np.ndarray) -> Arrays:
        import volviz
        from volviz.isosurface.extractors.marching_cubes import extract

        mesh = extract(volviz.Volume.from_array(data), 0.0, ambiguity=ambiguity)
        return mesh.vertices[:, 2], mesh.faces

    return run


def scikit(method: str) -> Callable[[np.ndarray], Arrays]:
    def run(data: np.ndarray) -> Arrays:
        from skimage.measure import marching_cubes

        made = marching_cubes(data.astype(np.float32), 0.0, method=method)
        return made[0][:, 0], made[1]

    return run


def pymcubes(data: np.ndarray) -> Arrays:
    import mcubes

    vertices, faces = mcubes.marching_cubes(data.astype(np.float64), 0.0)
    return vertices[:, 0], faces


def vtk(name: str) -> Callable[[np.ndarray], Arrays]:
    def run(data: np.ndarray) -> Arrays:
        from vtkmodules import vtkFiltersCore
        from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
        from vtkmodules.vtkCommonDataModel import vtkImageData

        image = vtkImageData()
        image.SetDimensions(*data.shape[::-1])
        image.GetPointData().SetScalars(numpy_to_vtk(data.ravel(), deep=True))
        made = getattr(vtkFiltersCore, name)()
        made.SetInputData(image)
        made.SetValue(0, 0.0)
        made.Update()
        polygons = made.GetOutput()
        faces = vtk_to_numpy(polygons.GetPolys().GetConnectivityArray()).reshape(-1, 3)
        return vtk_to_numpy(polygons.GetPoints().GetData())[:, 2], faces

    return run


# method: (module it needs, (z of each vertex, faces) of an array)
METHODS: dict[str, tuple[str, Callable[[np.ndarray], Arrays]]] = {
    "volviz, trilinear": ("volviz", ours("trilinear")),
    "volviz, asymptotic": ("volviz", ours("asymptotic")),
    "volviz, table15": ("volviz", ours("table15")),
    "scikit-image, Lewiner": ("skimage", scikit("lewiner")),
    "scikit-image, Lorensen": ("skimage", scikit("lorensen")),
    "PyMCubes": ("mcubes", pymcubes),
    "VTK Flying Edges": ("vtkmodules", vtk("vtkFlyingEdges3D")),
    "VTK marching cubes": ("vtkmodules", vtk("vtkMarchingCubes")),
}


class Counts(NamedTuple):
    """Per field: χ, surfaces, open and non-manifold edges."""

    chi: np.ndarray
    surfaces: np.ndarray
    open: np.ndarray
    crowded: np.ndarray


class Truth(NamedTuple):
    """Per field: χ of the surfaces, and how many there are (−1: the lattices do not agree)."""

    chi: np.ndarray
    surfaces: np.ndarray


def count(made: Arrays, n: int) -> Counts:
    """What a mesh has in each of n blocks of five layers."""
    z, faces = np.asarray(made[0]), np.asarray(made[1], dtype=np.int64)
    a, b, c = faces.T
    faces = faces[(a != b) & (b != c) & (c != a)]
    used, faces = np.unique(faces, return_inverse=True)
    faces = faces.reshape(-1, 3)
    block = np.minimum((z[used] // 5).astype(int), n - 1)
    edges = np.sort(oracles.directed_edges(faces), axis=1)
    edges, uses = np.unique(edges, axis=0, return_counts=True)
    of_edge, of_face = block[edges[:, 0]], block[faces[:, 0]]

    def per(blocks: np.ndarray) -> np.ndarray:
        return np.bincount(blocks, minlength=n)

    total, part = _parts(edges, len(used))
    first = np.unique(part, return_index=True)[1]
    assert len(first) == total
    return Counts(
        per(block) - per(of_edge) + per(of_face),
        per(block[first]),
        per(of_edge[uses == 1]),
        per(of_edge[uses > 2]),
    )


def _parts(edges: np.ndarray, n: int) -> Any:
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    graph = coo_matrix((np.ones(len(edges), bool), tuple(edges.T)), shape=(n, n))
    return connected_components(graph, directed=False)


def truth(blocks: np.ndarray, level: float, decide: int) -> Truth:
    """χ of all fields; of the first `decide` also the number of surfaces."""
    if level:  # ties among neighbours: noise far below the level
        noise = np.random.default_rng(5).uniform(-TIE / 30, TIE / 30, blocks.shape)
        blocks = blocks.astype(np.longdouble) + noise
    solid = oracles.solid_euler(blocks, level)
    surfaces = np.full(len(blocks), -1)
    for i in range(min(decide, len(blocks))):
        before = None
        for refine in STEPS:
            found, number = oracles.sampled(blocks[i].astype(np.float64), level, refine)
            if found != solid[i]:
                before = None
            elif number is not None and number == before:
                surfaces[i] = number
                break
            else:
                before = number
    return Truth(2 * solid, surfaces)


def wrong(counts: Counts, truth: Truth) -> tuple[int, int]:
    """Fields with a wrong χ or a surface that is not closed, and with another number of parts."""
    bad = (counts.chi != truth.chi) | (counts.open > 0) | (counts.crowded > 0)
    decided = truth.surfaces >= 0
    return int(bad.sum()), int((counts.surfaces != truth.surfaces)[decided].sum())


def table(kind: str, n: int, decide: int, seed: int) -> None:
    """Print the rows of one kind of samples."""
    blocks = fields(n, seed, kind)
    levels = {"": 0.0} if kind == "float" else {"≥": -TIE, ">": TIE}
    truths = {name: truth(blocks, level, decide) for name, level in levels.items()}
    decided = min(int((t.surfaces >= 0).sum()) for t in truths.values())
    print(f"\n{kind} samples, {n} fields; the number of surfaces is known of {decided}\n")
    print(
        "| method | ties | wrong | % | of these closed, χ wrong | wrong number of surfaces ", end=""
    )
    print("| open edges | non-manifold edges |\n|" + "---|" * 8)
    data = blocks.reshape(5 * n, 5, 5).astype(np.float32 if kind == "float" else np.int16)
    for method, (module, run) in METHODS.items():
        if not importlib.util.find_spec(module):
            print(f"not run: {method} is not installed")
            continue
        counts = count(run(data), n)
        (bad, parts), name = min((wrong(counts, t), name) for name, t in truths.items())
        closed = (counts.open == 0) & (counts.crowded == 0)
        other = int((closed & (counts.chi != truths[name].chi)).sum())
        print(
            f"| {method} | {name or '–'} | {bad} | {100 * bad / n:.1f} | {other} | {parts} "
            f"| {counts.open.sum()} | {counts.crowded.sum()} |",
            flush=True,
        )


def main(arguments: list[str]) -> None:
    """Run all methods on both kinds of samples."""
    parser = argparse.ArgumentParser(prog="python -m tests.bench topology")
    parser.add_argument("--fields", type=int, default=1000)
    parser.add_argument("--surfaces", type=int, help="fields whose surfaces are counted, or all")
    parser.add_argument("--seed", type=int, default=7)
    chosen = parser.parse_args(arguments)
    decide = chosen.fields if chosen.surfaces is None else chosen.surfaces
    for kind in ("float", "integer"):
        table(kind, chosen.fields, decide, chosen.seed)
