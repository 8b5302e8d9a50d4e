"""Cast the rays of a frame: one jittered sample per pixel and call, added to what is there."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import moderngl
import numpy as np

from volviz.gpu import shaders
from volviz.gpu.checked import Gpu
from volviz.gpu.passes.view import PLASTIC, View, subpixel
from volviz.gpu.residency import Residency
from volviz.model.frame import Emptiness, Frame
from volviz.progress import Progress

GOLDEN = 0.6180339887498949


@dataclass(frozen=True)
class Mode:
    """A ray mode: its shader file, and whether opacity is per length of ray."""

    file: str
    per_length: bool


MODES: dict[str, Mode] = {
    "dvr": Mode("raycast/modes/dvr.glsl", per_length=True),
    "mip": Mode("raycast/modes/mip.glsl", per_length=False),
}
SHADINGS: dict[str, str] = {
    "none": "raycast/shading/none.glsl",
    "phong": "raycast/shading/phong.glsl",
    "blinn-phong": "raycast/shading/blinn_phong.glsl",
}
GRADIENTS: dict[str, str] = {
    "central": "lib/gradient_central.glsl",
    "sobel": "lib/gradient_sobel.glsl",
    "forward": "lib/gradient_forward.glsl",
    "backward": "lib/gradient_backward.glsl",
}
NOTHING = "lib/nothing.glsl"
NO_ENDS = "raycast/ends_none.glsl"
MOSTLY_SHOWN = 0.85


@dataclass(frozen=True)
class Ends:
    """What rays meet on their way, see `gpu/layers.py`: the shader file that knows, its uniforms,
    and textures by unit."""

    file: str = NO_ENDS
    uniforms: dict[str, Any] = field(default_factory=dict)
    textures: dict[int, moderngl.Texture] = field(default_factory=dict)


def draw(
    gpu: Gpu,
    resident: Residency,
    frame: Frame,
    view: View,
    *,
    progress: Progress | None = None,
    ends: Ends | None = None,
    add: bool = True,
) -> None:
    """Add one sample of the tile to the bound float framebuffer (premultiplied linear light).

    add: False writes it instead.
    """
    ends = ends or Ends()
    cast = frame.raycast
    mode = MODES[cast.mode]
    linear = cast.interpolation == "linear"
    texture = resident.volume(frame.voxels, linear=linear, progress=progress)
    step = frame.step * view.step_scale
    table = resident.table(frame.table, step=step * frame.spacing, per_length=mode.per_length)
    program = shaders.program(
        gpu, "lib/fullscreen.vert", "raycast/raycast.frag", choices(frame, ends)
    )
    shaders.set_uniforms(
        program,
        **_volume_uniforms(frame),
        **_view_uniforms(frame, view),
        **(_light_uniforms(frame) if shaded(frame) else {}),
        **_leap_uniforms(frame),
        **ends.uniforms,
        u_step=step,
        u_termination=termination(frame),
        u_volume=0,
        u_table=1,
    )
    texture.use(0)
    table.use(1)
    if (empty := leaps(frame)) is not None:
        resident.distances(empty).use(2)
    for unit, layer in ends.textures.items():
        layer.use(unit)
    cover(gpu, program, add=add)
    gpu.check("ray casting")


def cover(gpu: Gpu, program: moderngl.Program, *, add: bool) -> None:
    """Run a program for every pixel of the bound framebuffer, adding to it or writing."""
    gpu.ctx.enable_only(moderngl.BLEND if add else moderngl.NOTHING)
    gpu.ctx.blend_func = moderngl.ONE, moderngl.ONE
    gpu.ctx.vertex_array(program, []).render(moderngl.TRIANGLES, vertices=3)
    gpu.ctx.enable_only(moderngl.NOTHING)


def termination(frame: Frame) -> float:
    """Opacity at which the shader ends a ray; beyond 1: never early."""
    return frame.raycast.termination if frame.raycast.termination < 1 else 2.0


def choices(frame: Frame, ends: Ends) -> dict[str, str]:
    """Which shader files this frame asks for."""
    cast = frame.raycast
    lit = shaded(frame)
    gradient = (
        GRADIENTS[cast.gradient] if cast.interpolation == "linear" else "lib/gradient_labels.glsl"
    )
    return {
        "@skip": "lib/skip_nothing.glsl" if leaps(frame) is None else "lib/skip_bricks.glsl",
        "@sample": "lib/sample_masked.glsl" if frame.voxels.masked else "lib/sample.glsl",
        "@gradient": gradient if lit else NOTHING,
        "@lighting": "lib/lighting.glsl" if lit else NOTHING,
        "@shading": SHADINGS[cast.shading if lit else "none"],
        "@mode": MODES[cast.mode].file,
        "@ends": ends.file,
    }


def shaded(frame: Frame) -> bool:
    """True if this frame asks for gradients and light."""
    return frame.raycast.shading != "none" and MODES[frame.raycast.mode].per_length


def _volume_uniforms(frame: Frame) -> dict[str, Any]:
    table = frame.table
    last = len(table.entries) - 1
    dims = np.array(frame.voxels.dims, dtype=np.float64)
    index_to_world = frame.affine[:3, :3] / frame.spacing
    return {
        "u_value": (
            _single(frame.voxels.scale * table.per_value),
            _single((frame.voxels.offset - table.low) * table.per_value),
        ),
        "u_last": float(last),
        "u_tex_to_world": index_to_world * dims,
    }


def leaps(frame: Frame) -> Emptiness | None:
    """What may be leapt over: nothing in modes whose every sample counts, or where to look for
    empty bricks costs more than it saves (measured: a fifth of the time where all are shown)."""
    empty = frame.emptiness
    worth = empty is not None and empty.shown < MOSTLY_SHOWN
    return empty if worth and MODES[frame.raycast.mode].per_length else None


def _leap_uniforms(frame: Frame) -> dict[str, Any]:
    empty = leaps(frame)
    if empty is None:
        return {}
    per_axis = np.array(frame.voxels.dims, dtype=np.float64) / empty.side
    return {"u_distance": 2, "u_bricks": tuple(per_axis), "u_half": 0.5 / empty.side}


def _light_uniforms(frame: Frame) -> dict[str, Any]:
    light = frame.light
    return {
        "u_index_to_world_t": np.linalg.inv(frame.affine[:3, :3] / frame.spacing).T,
        "u_voxel": tuple(1.0 / np.array(frame.voxels.dims, dtype=np.float64)),
        "u_material": (light.ambient, light.diffuse, light.specular, light.exponent),
        "u_lamp": tuple(light.direction() @ np.stack(frame.camera.axes())),
    }


def _view_uniforms(frame: Frame, view: View) -> dict[str, Any]:
    width, height = view.size
    x, y = view.tile[:2]
    shift_x, shift_y = subpixel(view.sample) if view.antialias else (0.0, 0.0)
    origin, direction = frame.camera.rays(width / height)
    to_tex = np.linalg.inv(frame.affine)
    dims = np.array(frame.voxels.dims, dtype=np.float64)[:, None]
    origin_index = to_tex[:3, :3] @ origin
    origin_index[:, 0] += to_tex[:3, 3] + 0.5
    perspective = frame.camera.projection == "perspective"
    # directions have any length: by a power of two, so that no bit of the picture changes
    scale = 2.0 ** round(math.log2(frame.spacing))
    return {
        "u_ray_origin": _single(origin_index / dims),
        "u_ray_direction": _single((to_tex[:3, :3] @ direction) * scale / dims),
        "u_pixel": (
            2 / width,
            2 / height,
            (1 + 2 * shift_x) / width - 1,
            (1 + 2 * shift_y) / height - 1,
        ),
        "u_origin_px": (
            float(x * view.stride + view.first[0]),
            float(y * view.stride + view.first[1]),
        ),
        "u_stride": float(view.stride),
        "u_jitter": (
            frame.raycast.jitter,
            (view.sample * GOLDEN + frame.raycast.seed // 1024 * PLASTIC[0]) % 1.0,
            float(frame.raycast.seed % 1024),  # larger places would lose digits
        ),
        "u_near": 0.0 if perspective else -1e30,
    }


def _single(values: Any) -> Any:
    """Numbers that float32 holds: what lies beyond is out of sight all the same."""
    return np.clip(values, -1e30, 1e30)
