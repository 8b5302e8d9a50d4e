"""Did a big texture really get its memory? Write its last texel and read it back.

Some drivers promise memory that they do not have and say so only when it is touched. GL 3.3 reads
back whole 3D textures only, so one texel is fetched by a shader into a 1×1 framebuffer.
"""

from __future__ import annotations

import math

import moderngl
import numpy as np

from volviz.errors import GraphicsError, LimitError
from volviz.gpu.checked import Gpu
from volviz.gpu.formats import TEXEL_DTYPES, times
from volviz.gpu.shaders import program, set_uniforms

VERIFY_BYTES = 64 << 20
_SAMPLERS = {"u": "probe/texel_uint.glsl", "i": "probe/texel_int.glsl"}


def kept_texture3d(
    gpu: Gpu,
    size: tuple[int, int, int],
    components: int,
    dtype: str,
    *,
    linear: bool,
    always: bool = False,
) -> moderngl.Texture3D:
    """`Gpu.texture3d`, and proof that it has its memory: from VERIFY_BYTES on, or always.

    Raises LimitError, also where the driver only found out when it was touched.
    """
    texture = gpu.texture3d(size, components, dtype, linear=linear)
    nbytes = math.prod(size) * components * TEXEL_DTYPES[dtype].itemsize
    if always or nbytes >= VERIFY_BYTES:
        try:
            verify_last_texel(gpu, texture)
        except (GraphicsError, LimitError):
            texture.release()
            raise
    return texture


def verify_last_texel(gpu: Gpu, texture: moderngl.Texture3D) -> None:
    """Write 1 into the last texel of all components and fetch it; LimitError if it is not there."""
    nx, ny, nz = texture.size
    kind = texture.dtype
    one = np.iinfo(TEXEL_DTYPES[kind]).max if kind in ("f1", "nu1", "nu2") else 1
    texel = np.full(texture.components, one, TEXEL_DTYPES[kind])
    with gpu.guarded("writing into a 3D texture"):
        texture.write(texel, viewport=(nx - 1, ny - 1, nz - 1, 1, 1, 1))
    choices = {"@sampler": _SAMPLERS.get(kind[0], "probe/texel_float.glsl")}
    prog = program(gpu, "probe/texel.vert", "probe/texel.frag", choices)
    target = gpu.framebuffer((1, 1), "f4")
    with gpu.guarded("reading from a 3D texture"):
        set_uniforms(prog, u_texture=0, u_last=(nx - 1, ny - 1, nz - 1))
        triangle = gpu.ctx.vertex_array(prog, [])
        texture.use(0)  # the textures of a moderngl scope raise GL_INVALID_ENUM (5.13)
        with gpu.ctx.scope(target, moderngl.NOTHING):
            triangle.render(moderngl.TRIANGLES, vertices=3)
        got = np.frombuffer(target.read(components=4, dtype="f4"), np.float32)
        triangle.release()
    gpu.release_framebuffer(target)
    if not np.all(got[: texture.components] == 1.0):
        raise LimitError(
            f"{gpu.renderer} did not keep a 3D texture of {times(texture.size)}: "
            "its memory is not enough",
            fix="reduce the volume",
        )
