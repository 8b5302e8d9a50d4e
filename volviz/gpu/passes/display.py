"""From gathered light to what is shown: mean, background, encoding."""

from __future__ import annotations

import moderngl

from volviz.gpu import shaders
from volviz.gpu.checked import Gpu
from volviz.gpu.passes.view import View
from volviz.model.scene import Background
from volviz.model.transfer import srgb_to_linear


def draw(
    gpu: Gpu, gathered: moderngl.Texture, samples: int, background: Background, view: View
) -> None:
    """Draw the sum of `samples` into the bound framebuffer: sRGB, straight alpha."""
    program = shaders.program(gpu, "lib/fullscreen.vert", "display/display.frag", {})
    _, y, _, h = view.tile
    height = view.size[1] / view.stride
    shaders.set_uniforms(
        program,
        u_light=0,
        u_weight=1.0 / max(samples, 1),
        u_background_top=premultiplied(background.top),
        u_background_bottom=premultiplied(background.bottom),
        u_vertical=(h / height / 2, (y + h / 2) / height),
    )
    gathered.use(0)
    gpu.ctx.enable_only(moderngl.NOTHING)
    gpu.ctx.vertex_array(program, []).render(moderngl.TRIANGLES, vertices=3)
    gpu.check("display")


def weave(gpu: Gpu, quarter: moderngl.Texture, first: tuple[int, int]) -> None:
    """Every second pixel of the bound framebuffer, from `first` on, as a quarter of them has it."""
    program = shaders.program(gpu, "lib/fullscreen.vert", "display/weave.frag")
    shaders.set_uniforms(program, u_quarter=0, u_first=first)
    quarter.use(0)
    gpu.ctx.enable_only(moderngl.NOTHING)
    gpu.ctx.vertex_array(program, []).render(moderngl.TRIANGLES, vertices=3)
    gpu.check("weaving a picture")


def copy(gpu: Gpu, picture: moderngl.Texture) -> None:
    """Draw a finished picture into the bound framebuffer, filtered as its texture says."""
    program = shaders.program(gpu, "lib/fullscreen.vert", "display/copy.frag")
    shaders.set_uniforms(program, u_picture=0)
    picture.use(0)
    gpu.ctx.enable_only(moderngl.NOTHING)
    gpu.ctx.vertex_array(program, []).render(moderngl.TRIANGLES, vertices=3)
    gpu.check("copying a picture")


def premultiplied(color: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
    """sRGB with straight alpha to linear light times alpha."""
    r, g, b = (float(c) * color[3] for c in srgb_to_linear(color[:3]))
    return r, g, b, color[3]
