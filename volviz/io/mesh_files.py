"""Meshes to files: STL, PLY, OBJ and GLB, written whole or not at all.

PLY and GLB are made by trimesh. STL and OBJ are a few lines, and are made piece by piece, because
trimesh takes seconds for them without a look at the cancel flag.

Vertices are world millimetres as they are, and the file says so where it has room: in the header
of an STL, in comments of PLY and OBJ, in the extras of a GLB. `SPACE=LPS` is how 3D Slicer marks
it, and reads it. STL has neither normals of vertices nor colours, OBJ has colours without opacity.

glTF is metres, y up, looking along +z. There the vertices stay in millimetres too, and the node
that holds the mesh has the matrix that turns and scales them, so that the file opens the right
way up and in its real size: for a patient superior is up and anterior in front; where the space
is not known, as pictures are shown (x right, y down, the first slice in front).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from os import PathLike
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from volviz.errors import UsageError, did_you_mean
from volviz.files import check_writable, write_atomically
from volviz.model.mesh import Mesh
from volviz.progress import Progress, silent

Pieces = Iterator[tuple[float, bytes]]
_CHUNK = 1 << 22
_ROWS = 50_000
_STL_HEADER = 80
_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
PATIENT_TO_GLTF = 0.001 * np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]], dtype=np.float64)
IMAGE_TO_GLTF = 0.001 * np.diag([1.0, -1.0, -1.0])


def save_mesh(
    mesh: Mesh,
    path: str | Path,
    *,
    overwrite: bool = False,
    unit: str | None = "mm",
    progress: Progress | None = None,
) -> None:
    """Write a mesh as .stl, .ply, .obj or .glb, by the name; binary but for OBJ.

    unit: of length, as the file then says; None where nobody knows it (`info.length_unit` of the
    volume is None). Points without triangles go into a .ply. Raises UsageError for another suffix
    or unit, for what is no mesh and for one with nothing to write; OutputError if the file cannot
    be written, or is there and `overwrite` is false; Cancelled. What was there before stays on any
    failure.
    """
    check_mesh_path(path)
    if not isinstance(mesh, Mesh):
        raise UsageError(
            f"a {type(mesh).__name__} is no mesh", file=path, fix="extract_surface makes one"
        )
    if unit not in ("mm", None):
        raise UsageError(f"{unit!r} is no unit of a mesh", field="unit", fix="give 'mm' or None")
    check_content(mesh, path)
    check_writable(path, overwrite=overwrite)
    progress = progress or silent()
    pieces = FORMATS[Path(path).suffix.lower()](mesh, unit)

    def write(file: BinaryIO) -> None:
        for fraction, piece in pieces:
            progress(fraction, "writing the mesh")
            file.write(piece)
        progress(1.0, "writing the mesh")

    write_atomically(path, write, overwrite=overwrite)


def check_mesh_path(path: str | Path) -> None:
    """Raise UsageError unless the name says a format that meshes are written in."""
    if not isinstance(path, str | PathLike):
        raise UsageError(f"{path!r} is no path", field="path", fix="give the name of a file")
    if path == "-":
        raise UsageError(
            "a mesh needs a file, whose name says the format",
            file="standard output",
            fix=f"give one with {', '.join(FORMATS)}",
        )
    suffix = Path(path).suffix.lower()
    if Path(path).is_dir():
        raise UsageError(
            "is a folder", file=path, fix=f"name a file in it that ends in {', '.join(FORMATS)}"
        )
    if suffix not in FORMATS:
        raise UsageError(
            f"meshes are not written as '{suffix or Path(path).name}'",
            file=path,
            fix=did_you_mean(suffix, FORMATS),
        )


def check_content(mesh: Mesh, path: str | Path) -> None:
    """Raise UsageError if the format of this name has nothing to take from the mesh."""
    if mesh.empty:
        raise UsageError(
            "the mesh is empty, so there is nothing to write",
            file=path,
            fix="choose another isovalue",
        )
    if not len(mesh.faces) and Path(path).suffix.lower() != ".ply":
        raise UsageError(
            f"{len(mesh.vertices)} points without triangles are only written as .ply",
            file=path,
            fix="give such a name, or choose another method",
        )


def _pieces(content: bytes) -> Pieces:
    for start in range(0, len(content), _CHUNK):
        yield start / len(content), content[start : start + _CHUNK]


def _ranges(*counts: int) -> Iterator[tuple[int, slice, float]]:
    """Which array, the rows of a piece of it, and how much of all is done before."""
    done, total = 0, sum(counts)
    for which, count in enumerate(counts):
        for start in range(0, count, _ROWS):
            yield which, slice(start, start + _ROWS), (done + start) / total
        done += count


def _said(mesh: Mesh, unit: str | None) -> str:
    """One line that says what the numbers are."""
    units = f"volviz: units {unit or 'unknown'}"
    return f"{units}; SPACE={mesh.space}" if mesh.space else units


def _trimesh(mesh: Mesh) -> Any:
    """The same for trimesh, nothing merged or reordered."""
    import trimesh

    return trimesh.Trimesh(
        vertices=mesh.vertices,
        faces=mesh.faces.astype(np.int64),
        vertex_normals=mesh.normals if len(mesh.normals) else None,
        vertex_colors=mesh.colors,
        process=False,
        validate=False,
    )


def _stl(mesh: Mesh, unit: str | None) -> Pieces:
    """Binary; each facet with its normal by the right-hand rule. Must not begin with "solid"."""
    head = _said(mesh, unit).encode().ljust(_STL_HEADER, b" ")
    yield 0.0, head + len(mesh.faces).to_bytes(4, "little")
    for _, rows, done in _ranges(len(mesh.faces)):
        corners = mesh.vertices[mesh.faces[rows]]
        a, b, c = np.moveaxis(corners.astype(np.float64), 1, 0)
        normals = np.cross(b - a, c - a)
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        facets = np.zeros(len(corners), _FACET)
        facets["normal"] = normals / np.where(length > 0, length, 1.0)
        facets["corners"] = corners
        yield done, facets.tobytes()


def _ply(mesh: Mesh, unit: str | None) -> Pieces:
    from trimesh.exchange.ply import export_ply

    made = _trimesh(mesh)
    if mesh.values is not None:
        made.vertex_attributes["value"] = mesh.values
    content: bytes = export_ply(made, vertex_normal=bool(len(mesh.normals)))
    first, rest = content.split(b"comment", 1)
    yield 0.0, first + f"comment {_said(mesh, unit)}\ncomment".encode()
    yield from _pieces(rest)


def _obj(mesh: Mesh, unit: str | None) -> Pieces:
    """Text: `v x y z [r g b]`, `vn x y z`, `f a b c` or `f a//a b//b c//c`, counted from 1."""
    yield 0.0, f"# {_said(mesh, unit)}\n".encode()
    with_normals = bool(len(mesh.normals))
    corner = "{0}//{0}" if with_normals else "{0}"
    face = "f " + " ".join(corner.replace("0", str(k)) for k in range(3)) + "\n"
    vertex = "v {:.9g} {:.9g} {:.9g}" + (" {:.6g} {:.6g} {:.6g}" if mesh.colors is not None else "")
    formats = (vertex + "\n", "vn {:.9g} {:.9g} {:.9g}\n", face)
    for which, rows, done in _ranges(len(mesh.vertices), len(mesh.normals), len(mesh.faces)):
        table = (mesh.vertices, mesh.normals, mesh.faces)[which][rows]
        table = table + np.uint32(1) if which == 2 else table
        if which == 0 and mesh.colors is not None:
            table = np.concatenate([table, mesh.colors[rows, :3] / 255.0], axis=1)
        line = formats[which].format
        yield done, "".join([line(*row) for row in table.tolist()]).encode()


def _glb(mesh: Mesh, unit: str | None) -> Pieces:
    import trimesh
    from trimesh.exchange.gltf import export_glb

    made = _trimesh(mesh)
    made.visual = trimesh.visual.ColorVisuals()
    if mesh.colors is not None:  # glTF's are linear; 16 bits, so that dark ones keep their steps
        made.vertex_attributes["_COLOR"] = _linear(mesh.colors)
    made.metadata = {"units": unit, "space": mesh.space, "by": "volviz"}
    matrix = np.eye(4)
    matrix[:3, :3] = PATIENT_TO_GLTF if mesh.space else IMAGE_TO_GLTF
    scene = trimesh.Scene()
    scene.add_geometry(made, node_name="surface", geom_name="surface", transform=matrix)
    content: bytes = export_glb(
        scene, include_normals=bool(len(mesh.normals)), tree_postprocessor=_name_colors
    )
    yield from _pieces(content)


def _name_colors(tree: dict[str, Any]) -> None:
    """Say in a glTF tree that our attribute is the colour."""
    for primitive in tree["meshes"][0]["primitives"]:
        attributes = primitive["attributes"]
        if "_COLOR" in attributes:
            attributes["COLOR_0"] = attributes.pop("_COLOR")
            tree["accessors"][attributes["COLOR_0"]]["normalized"] = True


def _linear(colors: NDArray[np.uint8]) -> NDArray[np.uint16]:
    """uint16[n, 4]: sRGB in 8 bits to linear light in 16; opacity is only widened."""
    encoded = colors / 255.0
    light = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    light[:, 3] = encoded[:, 3]
    return np.rint(light * 65535).astype(np.uint16)


# suffix: mesh and unit to the bytes of a file in pieces, each with the share done before it
FORMATS: dict[str, Callable[[Mesh, str | None], Pieces]] = {
    ".stl": _stl,
    ".ply": _ply,
    ".obj": _obj,
    ".glb": _glb,
}
