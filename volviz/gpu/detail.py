"""Lighter meshes while things move: as exact as the picture shows, as light as it has to be."""

from __future__ import annotations

from dataclasses import replace

from volviz.model.frame import DrawnMesh, Frame
from volviz.model.levels import Level, choose, coarser
from volviz.model.mesh import Mesh

LIGHT = 100_000
"""Triangles of all surfaces that a processor draws many times a second."""


def lighter(frame: Frame, size: tuple[int, int]) -> Frame:
    """The frame for a picture of so many pixels that is soon replaced.

    Of each mesh that is too heavy the coarsest level that errs by no more than a pixel, or a
    coarser one until all of them together are light; while there are no levels yet, what stands in.
    """
    heavy = sum(len(m.mesh.faces) for m in frame.meshes) > LIGHT
    if not heavy:
        return frame
    most = LIGHT // len(frame.meshes)
    return replace(frame, meshes=tuple(_lighter(m, frame, size, most) for m in frame.meshes))


def _lighter(drawn: DrawnMesh, frame: Frame, size: tuple[int, int], most: int) -> DrawnMesh:
    return replace(drawn, mesh=_mesh(drawn, frame, size, most))


def _mesh(drawn: DrawnMesh, frame: Frame, size: tuple[int, int], most: int) -> Mesh:
    found = coarser(drawn.mesh)
    if len(drawn.mesh.faces) <= most:
        return drawn.mesh
    if not found:
        return drawn.mesh if drawn.coarse is None else drawn.coarse
    levels = (Level(drawn.mesh, 0.0), *found)
    first = choose(levels, frame.camera, size)
    light = [le.mesh for le in levels[first:] if len(le.mesh.faces) <= most]
    return light[0] if light else levels[-1].mesh
