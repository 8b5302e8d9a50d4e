"""The cells whose corners can be joined in several ways, and what each rule makes of them.

A face is ambiguous if two inside corners stand diagonally across; the inside of a cell is, if two
loops of its surface could be the ends of one tube (`ambiguity.py`, which decides; here it is told).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volviz.isosurface import built_finder
from volviz.isosurface.ambiguity import RULES, corner_values, decide, joined_faces
from volviz.isosurface.cases import cases
from volviz.isosurface.extractors.marching_cubes import extract
from volviz.isosurface.kernel import in_slabs, kernel
from volviz.isosurface.trace import Trace
from volviz.model.mesh import Mesh
from volviz.model.volume import Volume
from volviz.progress import Progress, silent

FACES, INTERIOR = 1, 2


@dataclass(frozen=True, eq=False)
class AmbiguousCells:
    """ids: int64[n], sorted cell numbers (x first, then y, then z).

    kinds: uint8[n], FACES where a face is ambiguous, INTERIOR where the inside is, or both.
    outcomes: int32[n, 3], a number for the surface in the cell, by the rules in the order of
    `ambiguity.RULES`; equal numbers are equal surfaces, up to where vertices lie on the edges.
    """

    isovalue: float
    ids: NDArray[np.int64]
    kinds: NDArray[np.uint8]
    outcomes: NDArray[np.int32]

    def differ(self, rule: str, other: str = "trilinear") -> NDArray[np.bool_]:
        """bool[n]: where two rules make different surfaces."""
        names = list(RULES)
        return np.asarray(
            self.outcomes[:, names.index(rule)] != self.outcomes[:, names.index(other)]
        )

    @property
    def disputed(self) -> NDArray[np.bool_]:
        """bool[n]: where not all rules agree."""
        return np.asarray((self.outcomes != self.outcomes[:, :1]).any(axis=1))

    def as_dict(self) -> dict[str, Any]:
        """JSON-ready counts."""
        faces, interior = self.kinds & FACES > 0, self.kinds & INTERIOR > 0
        return {
            "cells": int(self.ids.size),
            "faces": int(faces.sum()),
            "interior": int(interior.sum()),
            "disputed": int(self.disputed.sum()),
            "differ_from_trilinear": {
                rule: int(self.differ(rule).sum()) for rule in RULES if rule != "trilinear"
            },
        }


def ambiguous_cells(
    volume: Volume, isovalue: float, progress: Progress | None = None
) -> AmbiguousCells:
    """All ambiguous cells of an isovalue, valid ones only.

    The finder `bricks` is built for it once, and kept with the volume. Raises Cancelled.
    """
    report = progress or silent()
    finder = built_finder(volume, "bricks", report.part(0, 0.4))
    found, _ = finder.followed(isovalue, Trace(), report.part(0.4, 0.6))
    kinds = np.zeros(found.size, dtype=np.uint8)
    outcomes = np.zeros((found.size, len(RULES)), dtype=np.int32)
    rules = np.array(list(RULES.values()))
    task = partial(_judge, volume.data, float(isovalue), cases(), rules, found)
    in_slabs(
        lambda a, b: task(a, b, kinds, outcomes), found.size, 8, report.part(0.6, 1), "ambiguity"
    )
    chosen = kinds > 0
    return AmbiguousCells(float(isovalue), found[chosen], kinds[chosen], outcomes[chosen])


def first_samples(volume: Volume, ids: NDArray[np.int64]) -> NDArray[np.int64]:
    """int64[n, 3]: x, y, z of the least corner of cells."""
    shape = tuple(max(n - 1, 1) for n in volume.data.shape)
    return np.stack(np.unravel_index(ids, shape)[::-1], axis=-1)


def cell_mesh(volume: Volume, cell: int, isovalue: float, rule: str) -> Mesh:
    """What a rule makes of one cell, in world mm: marching cubes on its eight samples alone."""
    x, y, z = first_samples(volume, np.array([cell]))[0].tolist()
    affine = volume.affine.copy()
    affine[:3, 3] += affine[:3, :3] @ (x, y, z)
    data = volume.data[z : z + 2, y : y + 2, x : x + 2]
    alone = Volume.from_array(data, affine=affine, space=volume.info.space)
    return extract(alone, isovalue, ambiguity=rule, normals="none")


@kernel
def _judge(
    data: Any, isovalue: float, cases: Any, rules: Any, ids: Any, first: int, last: int,
    kinds: Any, outcomes: Any,
) -> None:  # fmt: skip
    """Kinds and outcomes of the cells first..last of ids; 0 where nothing is ambiguous."""
    ny, nx = data.shape[1] - 1, data.shape[2] - 1
    values, found = np.empty(8), np.empty((2, 3))
    for n in range(first, last):
        cell = ids[n]
        x, y, z = cell % nx, cell // nx % ny, cell // (nx * ny)
        corner_values(data, isovalue, z, y, x, values)
        case = 0
        for c in range(8):
            case |= (1 << c) if values[c] >= 0 else 0
        ambiguous = np.int64(cases.ambiguous[case])
        if ambiguous == 0:
            continue
        kind = 1 if ambiguous & 63 else 0
        entry = np.int64(cases.entry[case, joined_faces(values, ambiguous)])
        if cases.tube[entry, 0] >= 0:
            kind |= 2
        kinds[n] = kind
        for r in range(rules.size):
            made, tube = decide(values, case, cases, rules[r], found)
            outcomes[n, r] = made + (tube + 1) * 65536
