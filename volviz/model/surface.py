"""What a surface is made of: its isovalue, the method, the finder, and what else can be turned."""

from __future__ import annotations

from dataclasses import dataclass

from volviz.model.knobs import check_knobs, knob

METHODS = (
    "marching-cubes",
    "marching-tetrahedra",
    "cuberille",
    "dividing-cubes",
    "discretized-marching-cubes",
    "contour-tracing",
)
CELL_BY_CELL = METHODS[:-1]
"""Methods that a finder helps: contour-tracing looks at whole slices."""
FINDERS = (
    "bricks",
    "brute-force",
    "octree",
    "bono",
    "intervals",
    "interval-tree",
    "noise",
    "issue",
    "propagation",
)
AMBIGUITIES = ("trilinear", "asymptotic", "table15")
NORMALS = ("central", "sobel", "forward", "backward", "none")


@dataclass(frozen=True)
class Surface:
    """One isosurface: everything that decides its mesh."""

    isovalue: float = knob(0.0, "value on the surface; samples at least as high are inside")
    method: str = knob("marching-cubes", "what is built in a cell", choices=METHODS)
    finder: str = knob(
        "bricks",
        "how the cells that the surface meets are found",
        choices=FINDERS,
        used_with={"method": CELL_BY_CELL},
    )
    ambiguity: str = knob(
        "trilinear",
        "where corners can be joined in several ways: as the trilinear function does, faces only, "
        "or the historic table with its holes",
        choices=AMBIGUITIES,
        used_with={"method": ("marching-cubes",)},
    )
    normals: str = knob(
        "central",
        "gradient operator of the normals",
        choices=NORMALS,
        used_with={"method": ("marching-cubes", "cuberille", "dividing-cubes")},
    )
    tetrahedra: int = knob(
        5,
        "tetrahedra per cell, 5 or 6, of marching-tetrahedra",
        low=5,
        high=6,
        used_with={"method": ("marching-tetrahedra",)},
    )
    size: float = knob(
        0.0,
        "greatest side of the faces of cuberille, and distance of the points of dividing-cubes; "
        "0: the voxels'",
        low=0,
        unit="mm",
        used_with={"method": ("cuberille", "dividing-cubes")},
    )
    size_pixels: float = knob(
        0.0,
        "that size in the picture instead: of dividing-cubes by the distance of each cell, of "
        "cuberille by that of the nearest one; 0: as the size says",
        low=0,
        high=64,
        unit="pixels",
        used_with={"method": ("cuberille", "dividing-cubes")},
    )
    front_faces: bool = knob(
        False,
        "of cuberille only the faces that turn to the camera",
        used_with={"method": ("cuberille",)},
    )
    axis: str = knob(
        "z",
        "index axis across the slices of contour-tracing",
        choices=("x", "y", "z"),
        used_with={"method": ("contour-tracing",)},
    )

    level: int = knob(
        0,
        "of the pyramid of the volume, each level half as fine as the one before; 0 is the volume",
        low=0,
        high=8,
    )
    level_pixels: float = knob(
        0.0,
        "the coarsest level whose distance to the finest is at most this in the picture; "
        "0: the level as it is said",
        low=0,
        high=64,
        unit="pixels",
    )

    def __post_init__(self) -> None:
        check_knobs(self)
