"""Draw the edges of many boxes as lines, over a picture: nodes of a tree, marked cells."""

from __future__ import annotations

from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from volviz.gpu import shaders
from volviz.gpu.checked import Gpu
from volviz.model.camera import Camera
from volviz.model.volume import Volume

VERTICES = 72
NEAR = 1e-4
"""Of the way to the farthest box: nothing nearer is drawn."""
SLACK = 0.5
"""Smallest spacings behind a surface that a line may be and is not covered by it."""
COVERED = 0.14
"""Opacity of covered lines, of that of the others."""
_ROW = np.dtype([("ends", "<f4", (2, 3)), ("color", "u1", 4)])


def packed(boxes: NDArray[np.float32], colors: NDArray[np.uint8]) -> bytes:
    """What `draw` takes. boxes: [n, 2, 3], least and greatest corner (x, y, z) in samples.

    colors: uint8[n, 4], sRGB with straight opacity.
    """
    rows = np.zeros(len(boxes), _ROW)
    rows["ends"], rows["color"] = boxes, colors
    return rows.tobytes()


def draw(
    gpu: Gpu,
    content: moderngl.Buffer,
    volume: Volume,
    camera: Camera,
    *,
    size: tuple[int, int],
    width: float,
    depth: moderngl.Texture | None = None,
) -> None:
    """Into the bound framebuffer, cleared to 0: sRGB with straight opacity.

    content: `packed`. volume: whose samples the boxes are given in; far lines are fainter. size:
    of the picture; width: of the lines; pixels. depth: of the opaque surfaces that cover them, as
    `Gathering.depth` has it, in as many pixels as it likes.
    """
    place = camera.view_matrix() @ volume.affine
    last = np.array(volume.dims, dtype=np.float64) - 1
    bounds = np.array(np.meshgrid(*[(0.0, n) for n in last])).reshape(3, 8).T
    depths = -(bounds @ place[:3, :3].T + place[:3, 3])[:, 2]
    perspective = camera.projection == "perspective"
    program = shaders.program(gpu, "overlay/boxes.vert", "overlay/boxes.frag", {})
    shaders.set_uniforms(
        program,
        u_place=place,
        u_half=camera.half(size[0] / size[1]),
        u_perspective=1.0 if perspective else 0.0,
        u_near=NEAR * max(float(depths.max()), 1e-30),
        u_reach=(float(depths.min()), float(depths.max())),
        u_size=(float(size[0]), float(size[1])),
        u_width=width,
        u_depth=0,
        u_covering=0.0 if depth is None else 1.0,
        u_covered=COVERED,
        u_slack=SLACK * float(min(volume.spacing)),
    )
    if depth is not None:
        depth.use(0)
    array = gpu.ctx.vertex_array(
        program, [(content, "3f 3f 4f1 /i", "in_low", "in_high", "in_color")]
    )
    context: Any = gpu.ctx  # its stubs take blend_equation for two numbers
    context.enable_only(moderngl.BLEND)
    context.blend_equation = moderngl.MAX
    try:
        array.render(moderngl.TRIANGLES, vertices=VERTICES, instances=content.size // _ROW.itemsize)
    finally:
        context.blend_equation = moderngl.FUNC_ADD
        context.enable_only(moderngl.NOTHING)
        array.release()
    gpu.check("drawing boxes")
