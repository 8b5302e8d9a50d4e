"""How far two surfaces are apart, measured both ways.

The distance from a point to a mesh is exact (to the nearest point of its triangles). From a mesh
it is taken at samples: every vertex, and points spread evenly over the faces. So the greatest one
is the Hausdorff distance from below, as Metro measures it (Cignoni, Rocchini and Scopigno 1998):
what lies between two samples is at most half a `step` farther. Means are over the area.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from volviz.errors import UsageError
from volviz.meshes.nearest import Tree, face_samples, point_distances, tree_of
from volviz.model.mesh import Mesh
from volviz.progress import Progress, silent

_RANGE = 20_000  # faces or points between two looks at the cancel flag
_MOST = 4_000_000  # samples on one mesh


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

    step: mm between samples on a face; by default the mean edge of the finer mesh, or more where
    that would be over four million samples. Raises UsageError if one has no faces, Cancelled.
    """
    if not len(one.faces) or not len(other.faces):
        raise UsageError("the distance to a mesh without triangles is not defined", field="mesh")
    progress = progress or silent()
    if step is None:
        step = min(_mean_edge(one), _mean_edge(other))
    if not step > 0:
        step = max(_mean_edge(one), _mean_edge(other)) or 1.0
    floor = max(float(np.sqrt(2 * _area(m) / _MOST)) for m in (one, other))
    step = max(step, floor)
    return TwoSided(
        _one_way(one, tree_of(other), step, progress.part(0.0, 0.5)),
        _one_way(other, tree_of(one), step, progress.part(0.5, 1.0)),
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
    points = np.ascontiguousarray(mesh.vertices, dtype=np.float64)
    faces = mesh.faces.astype(np.int64)
    sums = np.zeros(8)
    sums[3] = -1.0
    used = np.zeros(len(points), bool)
    used[faces] = True
    points_used = points[used]
    for first in range(0, len(points_used), _RANGE):
        progress(0.3 * first / len(points_used), "measuring the distance")
        some = points_used[first : first + _RANGE]
        apart = np.empty(len(some))
        point_distances(some, *tree, apart)
        worst = int(np.argmax(apart))
        if apart[worst] > sums[3]:
            sums[3:7] = apart[worst], *some[worst]
        sums[7] += len(some)
    for first in range(0, len(faces), _RANGE):
        progress(0.3 + 0.7 * first / len(faces), "measuring the distance")
        face_samples(points, faces[first : first + _RANGE], step, *tree, sums)
    area = sums[0] or 1.0
    x, y, z = (float(v) for v in sums[4:7])
    mean, rms = float(sums[1] / area), float(np.sqrt(sums[2] / area))
    return OneWay(float(sums[3]), mean, rms, (x, y, z), int(sums[7]))


def _mean_edge(mesh: Mesh) -> float:
    corners = mesh.vertices[mesh.faces].astype(np.float64)
    return float(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).mean())


def _area(mesh: Mesh) -> float:
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces].astype(np.float64), 1, 0)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)
