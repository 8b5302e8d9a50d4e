"""The topology of the trilinear function, on random fields, float and integer with ties."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from tests.isosurface import oracles
from volviz.isosurface.extractors.marching_cubes import extract
from volviz.model.volume import Volume

LOW = -9.0


def fields(count, seed, kind):
    """float64[count, 5, 5, 5]: 2×2×2 cells of random values round 0, and low values round them."""
    rng = np.random.default_rng(seed)
    if kind == "float":
        inner = rng.standard_normal((count, 3, 3, 3)).astype(np.float32)
    else:
        inner = rng.integers(-3, 4, (count, 3, 3, 3))
    blocks = np.full((count, 5, 5, 5), LOW)
    blocks[:, 1:-1, 1:-1, 1:-1] = inner
    return blocks


def counted(blocks, ambiguity="trilinear"):
    """(χ, number of surfaces) of every block's mesh; all blocks in one volume."""
    n = len(blocks)
    data = blocks.reshape(5 * n, 5, 5)
    kind = np.int16 if np.array_equal(data, np.rint(data)) else np.float32
    mesh = extract(Volume.from_array(data.astype(kind)), 0.0, ambiguity=ambiguity)
    block = np.minimum((mesh.vertices[:, 2] // 5).astype(int), n - 1)
    chi = np.bincount(block, minlength=n)
    chi = chi - np.bincount(block[mesh.faces[:, 0]], minlength=n) // 2
    edges = oracles.directed_edges(mesh.faces)
    graph = coo_matrix((np.ones(len(edges)), edges.T), shape=(len(block),) * 2)
    _, part = connected_components(graph, directed=False)
    surfaces = np.bincount(block[np.unique(part, return_index=True)[1]], minlength=n)
    return mesh, chi, surfaces


def exact(blocks, seed=5):
    """χ of the surfaces; a little noise stands for the ties between neighbours."""
    noise = np.random.default_rng(seed).uniform(-1e-9, 1e-9, blocks.shape)
    level = -1e-4 if np.array_equal(blocks, np.rint(blocks)) else 0.0
    return 2 * oracles.solid_euler(blocks + noise, level), level


@pytest.mark.parametrize("kind", ["float", "integer"])
def test_euler_characteristic_is_that_of_the_trilinear_function(kind):
    blocks = fields(10_000, 1, kind)
    mesh, chi, _ = counted(blocks)
    oracles.assert_closed(mesh)
    assert np.count_nonzero(chi != exact(blocks)[0]) == 0


def compare_by_sampling(count, seed, kind):
    """(how many blocks a finer lattice could decide, how many of them differ)."""
    blocks = fields(count, seed, kind)
    _, _, surfaces = counted(blocks)
    chi, level = exact(blocks)
    decided = wrong = 0
    for block, expected, ours in zip(blocks, chi // 2, surfaces, strict=True):
        for refine in (8, 16, 32):
            found, number = oracles.sampled(block, level, refine)
            if found == expected and number is not None:
                decided += 1
                wrong += number != ours
                break
    return decided, wrong


@pytest.mark.parametrize(("kind", "share"), [("float", 0.9), ("integer", 0.6)])
def test_number_of_surfaces_is_that_of_a_finer_lattice(kind, share):
    decided, wrong = compare_by_sampling(250, 2, kind)
    assert decided >= share * 250
    assert wrong == 0


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "share"), [("float", 0.9), ("integer", 0.6)])
def test_number_of_surfaces_of_many_fields(kind, share):
    decided, wrong = compare_by_sampling(10_000, 3, kind)
    assert decided >= share * 10_000
    assert wrong == 0


def test_the_other_rules_are_seen_to_differ():
    """The oracle can fail: faces only miss tubes, the historic table has holes."""
    blocks = fields(2000, 4, "float")
    expected = exact(blocks)[0]
    faces_only, chi, _ = counted(blocks, "asymptotic")
    oracles.assert_closed(faces_only)
    assert 0 < np.count_nonzero(chi != expected) < 1000
    historic, _, _ = counted(blocks, "table15")
    assert oracles.boundary_edges(historic) > 0


@pytest.mark.parametrize("seed", range(3))
def test_ties_everywhere_stay_closed(seed):
    inner = np.random.default_rng(seed).integers(-1, 2, (12, 13, 70))
    data = np.pad(inner, 1, constant_values=-1).astype(np.int8)
    for ambiguity in ("trilinear", "asymptotic"):
        for level in (-0.5, 0, 0.5, 1):
            oracles.assert_closed(
                extract(Volume.from_array(data), level, ambiguity=ambiguity)
            )
