"""The topology of the trilinear function, on random fields, float and integer with ties."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from tests.isosurface import oracles
from volviz.isosurface.ambiguity import TRILINEAR, decide, joined_faces
from volviz.isosurface.cases import EDGES, cases, loops
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
    """(χ of the surfaces, the level that is meant).

    A sample equal to the isovalue is inside: that is the level a little below. Neighbours that
    are equal get a little noise, much less than that; a long double has digits enough for both.
    """
    if not np.array_equal(blocks, np.rint(blocks)):
        return 2 * oracles.solid_euler(blocks, 0.0), 0.0
    noise = np.random.default_rng(seed).uniform(-3e-5, 3e-5, blocks.shape)
    return 2 * oracles.solid_euler(blocks.astype(np.longdouble) + noise, -1e-3), -1e-3


@pytest.mark.parametrize("kind", ["float", "integer"])
def test_euler_characteristic_is_that_of_the_trilinear_function(kind):
    blocks = fields(10_000, 1, kind)
    mesh, chi, _ = counted(blocks)
    oracles.assert_closed(mesh)
    assert np.count_nonzero(chi != exact(blocks)[0]) == 0


def compare_by_sampling(count, seed, kind):
    """(how many blocks a finer lattice could decide, how many of them differ).

    It decides where two lattices in a row have the exact χ and the same number of surfaces.
    """
    blocks = fields(count, seed, kind)
    _, _, surfaces = counted(blocks)
    chi, level = exact(blocks)
    decided = wrong = 0
    for block, expected, ours in zip(blocks, chi // 2, surfaces, strict=True):
        before = None
        for refine in (10, 16, 22):
            found, number = oracles.sampled(block, level, refine)
            if found == expected and number is not None and number == before:
                decided += 1
                wrong += number != ours
                break
            before = number if found == expected else None
    return decided, wrong


@pytest.mark.parametrize("kind", ["float", "integer"])
def test_number_of_surfaces_is_that_of_a_finer_lattice(kind):
    decided, wrong = compare_by_sampling(60, 2, kind)
    assert decided >= 40
    assert wrong == 0


@pytest.mark.slow
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("kind", ["float", "integer"])
def test_number_of_surfaces_of_many_fields(kind):
    decided, wrong = compare_by_sampling(2_000, 3, kind)
    assert decided >= 1_800
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
            oracles.assert_closed(extract(Volume.from_array(data), level, ambiguity=ambiguity))


def necks(count, seed):
    """Cells whose surface has a tube, by construction, and what fills it: (float64[8], sign).

    In a box inside the cell, with r, s, t from 0 to 1, p (1−r)(1−s) t + q r s (1−t) is trilinear
    and vanishes on a closed chain of six edges of the box; between them it has the sign of p, q.
    """
    rng = np.random.default_rng(seed)
    x, y, z = (np.arange(8) >> k & 1 for k in range(3))
    for _ in range(count):
        low, high = np.moveaxis(rng.uniform(0.02, 0.98, (3, 2)), 1, 0)
        r, s, t = ((c - a) / (b - a) for c, a, b in zip((x, y, z), low, high, strict=True))
        p, q = rng.uniform(0.02, 1, 2) * rng.choice((-1, 1))
        yield p * (1 - r) * (1 - s) * t + q * r * s * (1 - t), np.sign(p)


def test_of_three_loops_the_right_two_are_one_tube():
    """Case 13: an isolated corner is joined with its like where the tube is filled with it."""
    table, found, seen = cases(), np.empty((2, 3)), set()
    for values, sign in necks(4000, 9):
        case = sum(1 << c for c in range(8) if values[c] >= 0)
        if not table.ambiguous[case]:
            continue
        entry, tube = decide(values, case, table, TRILINEAR, found)
        rings = loops(case, joined_faces(values, int(table.ambiguous[case])))
        if len(rings) < 2:
            continue
        assert tube >= 0
        if len(rings) == 3:
            first = table.tubes[tube, 3:6]
            (corner,) = set.intersection(*(set(EDGES[e]) for e in first))
            assert (values[corner] >= 0) == (sign > 0)
            assert entry == table.entry[case, joined_faces(values, int(table.ambiguous[case]))]
            seen.add(float(sign))
    assert seen == {-1.0, 1.0}
