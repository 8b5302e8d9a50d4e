"""How far two surfaces are apart, measured both ways.

The distance from a point to a mesh is exact (to the nearest point of its triangles). From a mesh
it is taken at samples: every vertex, and points spread evenly over the faces. So the greatest one
is the Hausdorff distance from below, as Metro measures it (Cignoni, Rocchini and Scopigno 1998):
what lies between two samples is at most half a `step` farther. Means are over the area.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from volviz.errors import UsageError
from volviz.meshes.nearest import Tree, face_samples, point_distances, tree_of
from volviz.model.mesh import Mesh
from volviz.progress import Progress, silent

_RANGE = 5000  # samples in a task
_MOST = 1_000_000  # samples on the faces of one mesh, about
_THREADS = 2
_ROUNDING = 64 * float(np.finfo(np.float64).eps)
"""Of the largest coordinate: a surface that is nowhere farther off is the same, and 0 is said."""


@dataclass(frozen=True)
class OneWay:
    """From the samples of one mesh to another, mm. at: the sample that is farthest."""

    greatest: float
    mean: float
    rms: float
    at: tuple[float, float, float]
    samples: int


@dataclass(frozen=True)
class TwoSided:
    """Both ways, mm; step: the samples on a face lie at most so far apart."""

    forth: OneWay
    back: OneWay
    step: float

    @property
    def hausdorff(self) -> float:
        """The greatest distance of any sample, mm."""
        return max(self.forth.greatest, self.back.greatest)

    @property
    def mean(self) -> float:
        """The mean distance of the way on which it is greater, mm."""
        return max(self.forth.mean, self.back.mean)

    @property
    def rms(self) -> float:
        """The root of the mean square of the way on which it is greater, mm."""
        return max(self.forth.rms, self.back.rms)

    def as_dict(self) -> dict[str, Any]:
        """JSON-ready."""
        return {"hausdorff": self.hausdorff, "mean": self.mean, "rms": self.rms, **asdict(self)}


def two_sided(
    one: Mesh, other: Mesh, *, step: float | None = None, progress: Progress | None = None
) -> TwoSided:
    """The distance between two meshes with faces, sampled both ways.

    step: mm between samples on a face; by default twice the mean edge of the finer mesh (its
    vertices are samples too), or more where that would be over a million samples. Raises
    UsageError if one has no faces, Cancelled.
    """
    if not len(one.faces) or not len(other.faces):
        raise UsageError("the distance to a mesh without triangles is not defined", field="mesh")
    progress = progress or silent()
    if step is None:
        edge = _mean_edge(one)
        progress(None, "measuring the distance")
        step = 2 * min(edge, _mean_edge(other))
        progress(None, "measuring the distance")
    if not step > 0:
        step = max(_mean_edge(one), _mean_edge(other)) or 1.0
    floor = max(float(np.sqrt(2 * _area(m) / _MOST)) for m in (one, other))
    step = max(step, floor)
    return TwoSided(
        _one_way(one, tree_of(other, progress), step, progress.part(0.0, 0.5)),
        _one_way(other, tree_of(one, progress), step, progress.part(0.5, 1.0)),
        step,
    )


def distances(points: ArrayLike, mesh: Mesh) -> NDArray[np.float64]:
    """float64[n]: exact distance in mm of points, float[n, 3], to a mesh with faces."""
    if not len(mesh.faces):
        raise UsageError("the distance to a mesh without triangles is not defined", field="mesh")
    places = np.ascontiguousarray(points, dtype=np.float64).reshape(-1, 3)
    out = np.empty(len(places))
    point_distances(places, *tree_of(mesh), out)
    return out


def _one_way(mesh: Mesh, tree: Tree, step: float, progress: Progress) -> OneWay:
    """On two threads, in tasks of some thousand samples, between which a cancel takes effect."""
    points = mesh.vertices.astype(np.float64)
    faces = mesh.faces.astype(np.int64)
    used = np.zeros(len(points), bool)
    used[faces] = True
    used_points = points[used]

    def vertices(first: int, last: int) -> NDArray[np.float64]:
        some = used_points[first:last]
        apart = np.empty(len(some))
        point_distances(some, *tree, apart)
        worst = int(np.argmax(apart))
        return np.array([0, 0, 0, apart[worst], *some[worst], len(some)])

    def inside(first: int, last: int) -> NDArray[np.float64]:
        sums = np.array([0, 0, 0, -1, 0, 0, 0, 0], np.float64)
        face_samples(points, faces[first:last], step, *tree, sums)
        return sums

    cuts = [*range(0, len(used_points), _RANGE), len(used_points)]
    tasks: list[tuple[Any, int, int]] = [(vertices, a, b) for a, b in pairwise(cuts)]
    tasks += [(inside, a, b) for a, b in pairwise(_face_cuts(mesh, step))]
    found = []
    with ThreadPoolExecutor(_THREADS) as pool:
        futures = [pool.submit(task, a, b) for task, a, b in tasks]
        try:
            for k, future in enumerate(futures):
                progress(k / len(futures), "measuring the distance")
                found.append(future.result())
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    sums = np.array(found)
    if sums[:, 3].max() <= _ROUNDING * max(np.abs(mesh.bounds).max(), np.abs(tree.corners).max()):
        sums[:, 1:3] = 0.0
        sums[:, 3] = np.minimum(sums[:, 3], 0.0)
    area, moment, square = sums[:, :3].sum(axis=0)
    worst = sums[int(np.argmax(sums[:, 3]))]
    mean, rms = moment / (area or 1.0), np.sqrt(square / (area or 1.0))
    x, y, z = (float(v) for v in worst[4:7])
    return OneWay(float(worst[3]), float(mean), float(rms), (x, y, z), int(sums[:, 7].sum()))


def _face_cuts(mesh: Mesh, step: float) -> list[int]:
    """Where to cut the list of faces for about so many samples in each piece."""
    parts = np.ceil(_edge_lengths(mesh).max(axis=1) / step).clip(1)
    total = np.cumsum(parts * parts)
    inner = np.searchsorted(total, np.arange(_RANGE, total[-1], _RANGE), side="right")
    return [*np.unique([0, *inner]).tolist(), len(parts)]


def _edge_lengths(mesh: Mesh) -> NDArray[np.float64]:
    """float64[m, 3]"""
    corners = mesh.vertices[mesh.faces].astype(np.float64)
    return np.asarray(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2))


def _mean_edge(mesh: Mesh) -> float:
    return float(_edge_lengths(mesh).mean())


def _area(mesh: Mesh) -> float:
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces].astype(np.float64), 1, 0)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)
