"""How far a mesh is from the surface that a closed form has, and how wrong its normals are.

Samples of the mesh are its vertices and the middles of equal parts of its triangles, none larger
than a voxel; means are over the area (over the points, where there are no triangles). Of each the
nearest point of the true surface is sought: Newton's method along the gradient, from where the line
along the mesh's normal meets the surface if that fails, then its foot (E. Hartmann, "On the
curvature of curves and surfaces defined by normalforms", CAGD 1999). What the mesh does not have
is not found this way, so points of the true surface, by Newton's method from where the samples of
the volume cross the isovalue, are measured against the mesh as well; what is so thin that no
sample meets it stays unseen.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from volviz.meshes.distance import distances
from volviz.model.mesh import Mesh
from volviz.model.volume import Volume
from volviz.progress import Progress, silent
from volviz.samples import field_of
from volviz.samples.closed_form import Field, Floats

MOST = 25_000
"""Triangles that are measured; of more, as many, spread evenly over the list."""
REACH = 4.0
"""Voxels within which the true surface is sought."""
DOUBT = 0.5
"""Voxels: what Newton's method finds beyond need not be the nearest."""
CHUNK = 1 << 17
NEWTON, FEET, LOOKS, HALVINGS = 12, 8, 33, 30
NEAR = 1e-6
"""Of a voxel: a point so near to the surface is on it."""
BETTER = 1e-5
"""Of a voxel: to gain less is not worth another step."""


@dataclass(frozen=True)
class TruthError:
    """Distances in mm, angles in degrees. missed: part of the area (or points) from which no point
    of the true surface was found; it has no part in the other numbers. back: the greatest distance
    from the true surface to the mesh."""

    mean: float
    rms: float
    greatest: float
    angle_mean: float
    angle_greatest: float
    missed: float
    back: float


def truth_error(
    mesh: Mesh,
    volume: Volume,
    isovalue: float,
    field: Field | None = None,
    *,
    progress: Progress | None = None,
) -> TruthError | None:
    """The errors of a mesh of this isovalue; None where nothing true is known, or found.

    field: of `samples.field_of`, made of the volume if it is not given. Only what lies within the
    outer sample centres counts. Raises Cancelled.
    """
    field = field_of(volume) if field is None else field
    if field is None or mesh.empty:
        return None
    spacing, progress = min(volume.spacing), progress or silent()
    points, normals, weights = _samples(mesh, spacing)
    inside = _within(volume, points)
    points, normals, weights = points[inside], normals[inside], weights[inside]
    apart, angles = np.full(len(points), np.nan), np.full(len(points), np.nan)
    shares = [0.0]

    def patient(at: Floats) -> tuple[Floats, Floats]:
        progress(shares[-1], "comparing with the truth")  # the one place where a cancel is heard
        return field(at)

    for start in range(0, len(points), CHUNK):
        part = slice(start, start + CHUNK)
        shares.append(0.9 * start / len(points))
        feet, slopes = nearest(patient, isovalue, points[part], normals[part], spacing)
        apart[part] = np.linalg.norm(feet - points[part], axis=1)
        cosine = -(slopes * normals[part]).sum(axis=1)
        angles[part] = np.degrees(np.arccos(np.clip(cosine, -1, 1)))
    shares.append(0.9)
    return _summed(apart, angles, weights, _back(mesh, volume, isovalue, patient))


def _back(mesh: Mesh, volume: Volume, isovalue: float, field: Field) -> float:
    """The greatest distance of points of the true surface to the mesh; 0 without any."""
    start, spacing = crossings(volume, isovalue), min(volume.spacing)
    found = _newton(field, isovalue, start, spacing)
    near = np.linalg.norm(found - start, axis=1) <= 2 * max(volume.spacing)
    true = found[near & _within(volume, np.where(near[:, None], found, 0.0))]
    if not len(true):
        return 0.0
    if not len(mesh.faces):  # triangles whose corners are one are points
        same = np.arange(len(mesh.vertices), dtype=np.uint32)
        mesh = Mesh(mesh.vertices, np.repeat(same[:, None], 3, axis=1))
    return float(distances(true, mesh).max())


def crossings(volume: Volume, isovalue: float) -> Floats:
    """float64[n, 3]: mm, on edges of the grid whose ends are inside and outside, where the line
    between the samples has the isovalue; of more than `MOST`, as many, spread evenly."""
    inside = volume.data >= isovalue
    found = []
    for axis in range(3):
        ahead, behind = (
            np.take(inside, range(k, inside.shape[axis] - 1 + k), axis) for k in (1, 0)
        )
        low = np.argwhere(ahead != behind)
        low = low[:: max(3 * len(low) // MOST, 1)]
        high = low + np.eye(3, dtype=int)[axis]
        a, b = (volume.data[tuple(at.T)].astype(np.float64) for at in (low, high))
        share = (isovalue - a) / np.where(a == b, 1.0, b - a)
        found.append(low + np.clip(share, 0, 1)[:, None] * (high - low))
    index = np.concatenate(found)[:, ::-1]
    return np.asarray(index @ volume.affine[:3, :3].T + volume.affine[:3, 3])


def _summed(apart: Floats, angles: Floats, weights: Floats, back: float) -> TruthError | None:
    found = np.isfinite(apart) & np.isfinite(angles)
    if not found.any():
        return None
    # vertices of triangles have no area: they count for what is greatest
    share = weights[found] if weights[found].any() else np.ones(int(found.sum()))
    share = share / share.sum()
    total = weights.sum()
    return TruthError(
        float(share @ apart[found]),
        float(np.sqrt(share @ apart[found] ** 2)),
        float(apart[found].max()),
        float(share @ angles[found]),
        float(angles[found].max()),
        float(weights[~found].sum() / total) if total > 0 else float(np.mean(~found)),
        back,
    )


def nearest(
    field: Field, isovalue: float, points: Floats, normals: Floats, spacing: float
) -> tuple[Floats, Floats]:
    """The points of the true surface nearest to float64[n, 3] points, and the field's unit gradient
    there; NaN where none is within reach. normals: of the mesh there, to look along.

    Where the field turns within a voxel or two another point may be nearer than the one found."""
    start = _newton(field, isovalue, points, spacing)
    apart = np.linalg.norm(start - points, axis=1)
    doubtful = ~(apart <= DOUBT * spacing)
    if doubtful.any():
        other = _along(field, isovalue, points[doubtful], normals[doubtful], spacing)
        way = np.linalg.norm(other - points[doubtful], axis=1)
        better = ~(way >= apart[doubtful])
        start[np.flatnonzero(doubtful)[better]] = other[better]
    feet = _feet(field, isovalue, points, start, spacing)
    value, slope = field(np.where(np.isfinite(feet), feet, 0.0))
    steep = np.linalg.norm(slope, axis=1)
    off = ~(np.abs(value - isovalue) <= 100 * NEAR * spacing * steep)
    off |= ~(np.linalg.norm(feet - points, axis=1) <= REACH * spacing)
    feet[off] = np.nan
    return feet, slope / np.where(steep > 0, steep, np.nan)[:, None]


def _newton(field: Field, isovalue: float, points: Floats, spacing: float) -> Floats:
    """Onto the surface along the gradient, no step longer than a voxel; NaN where it does not."""
    at = points.copy()
    todo = np.flatnonzero(np.isfinite(at).all(axis=1))
    left = np.full(len(at), np.inf)
    for _ in range(NEWTON):
        value, slope = field(at[todo])
        square = np.maximum((slope**2).sum(axis=1), 1e-300)
        step = (isovalue - value) / np.sqrt(square)
        left[todo] = np.abs(step)
        go = np.clip(step, -spacing, spacing) / np.sqrt(square)
        at[todo] += go[:, None] * slope
        todo = todo[left[todo] > NEAR * spacing]
        if not todo.size:
            break
    at[~(left <= NEAR * spacing)] = np.nan
    return at


def _along(
    field: Field, isovalue: float, points: Floats, normals: Floats, spacing: float
) -> Floats:
    """Where the line along the normal meets the surface, nearest to the point; NaN if nowhere."""
    ways = np.linspace(-REACH, REACH, LOOKS) * spacing
    at = points[:, None] + ways[None, :, None] * normals[:, None]
    inside = (field(at.reshape(-1, 3))[0] >= isovalue).reshape(len(points), LOOKS)
    crossed = inside[:, 1:] != inside[:, :-1]
    middle = np.abs(ways[1:] + ways[:-1]) + np.where(crossed, 0.0, np.inf)
    best = np.argmin(middle, axis=1)
    rows = np.arange(len(points))
    low, high, first = ways[best], ways[best + 1], inside[rows, best]
    for _ in range(HALVINGS):
        half = (low + high) / 2
        same = (field(points + half[:, None] * normals)[0] >= isovalue) == first
        low, high = np.where(same, half, low), np.where(same, high, half)
    found = points + low[:, None] * normals
    found[~crossed[rows, best]] = np.nan
    return found


def _feet(field: Field, isovalue: float, points: Floats, start: Floats, spacing: float) -> Floats:
    """From points on the surface to the feet of the perpendiculars: the point is projected onto the
    tangent plane and from there onto the surface, again and again; the nearest is kept."""
    best = start.copy()
    least = np.linalg.norm(best - points, axis=1)
    todo, at = np.flatnonzero(np.isfinite(least)), start
    for _ in range(FEET):
        at = at[todo] if len(at) != len(todo) else at
        slope = field(at)[1]
        length = np.linalg.norm(slope, axis=1)
        normal = slope / np.maximum(length, 1e-300)[:, None]
        off = points[todo] - at
        flat = points[todo] - (off * normal).sum(axis=1)[:, None] * normal
        at = _newton(field, isovalue, flat, spacing)
        apart = np.linalg.norm(at - points[todo], axis=1)
        better = apart < least[todo] - BETTER * spacing
        nearer = apart < least[todo]
        best[todo[nearer]], least[todo[nearer]] = at[nearer], apart[nearer]
        todo, at = todo[better], at[better]
        if not todo.size:
            break
    return best


def _samples(mesh: Mesh, spacing: float) -> tuple[Floats, Floats, Floats]:
    """Points float64[n, 3], unit normals float64[n, 3] and the area that each stands for."""
    vertices = mesh.vertices.astype(np.float64)
    if not len(mesh.faces):
        step = max(-(-len(vertices) // MOST), 1)
        some = vertices[::step]
        known = mesh.normals[::step] if len(mesh.normals) else np.zeros_like(some)
        return some, known.astype(np.float64), np.ones(len(some))
    faces = mesh.faces[:: max(-(-len(mesh.faces) // MOST), 1)].astype(np.int64)
    corners = vertices[faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(across, axis=1) / 2
    flat = across / np.maximum(2 * area, 1e-300)[:, None]
    own = len(mesh.normals) > 0
    shown = mesh.normals[faces].astype(np.float64) if own else np.repeat(flat[:, None], 3, axis=1)
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    parts = np.clip(np.ceil(longest / spacing), 1, 64).astype(int)
    pieces: list[tuple[Floats, Floats, Floats]] = []
    for count in np.unique(parts):
        rows = np.flatnonzero((parts == count) & (area > 0))
        weight = area[rows] / count**2
        pieces += [(c @ corners[rows], c @ shown[rows], weight) for c in _middles(int(count))]
    used, first = np.unique(faces[area > 0], return_index=True)
    ends = shown[area > 0].reshape(-1, 3)[first]
    pieces.append((vertices[used], ends, np.zeros(len(used))))
    points, normals, weights = (np.concatenate(part) for part in zip(*pieces, strict=True))
    length = np.linalg.norm(normals, axis=1)
    return points, normals / np.maximum(length, 1e-300)[:, None], weights


def _middles(count: int) -> Floats:
    """float64[count², 3]: barycentric middles of the equal parts of a triangle cut so often."""
    found = []
    for i in range(count):
        for j in range(count - i):
            found.append((i + 1 / 3, j + 1 / 3))
            if j < count - i - 1:
                found.append((i + 2 / 3, j + 2 / 3))
    at = np.array(found) / count
    return np.column_stack([1 - at.sum(axis=1), at])


def _within(volume: Volume, points: Floats) -> NDArray[np.bool_]:
    """Which lie between the outer sample centres."""
    index = points @ np.linalg.inv(volume.affine)[:3, :3].T + np.linalg.inv(volume.affine)[:3, 3]
    return ((index >= -1e-6) & (index <= np.array(volume.dims) - 1 + 1e-6)).all(axis=1)
