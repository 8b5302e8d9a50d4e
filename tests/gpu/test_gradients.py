"""Gradient shaders, one by one, against `fields.gradient` at the samples, on any grid."""

from __future__ import annotations

import shutil

import moderngl
import numpy as np
import pytest

from tests.gpu import oracles
from volviz.fields.gradient import OPERATORS, gradient
from volviz.gpu import shaders
from volviz.gpu.passes.raycast import GRADIENTS
from volviz.gpu.renderer import Renderer
from volviz.lab import vary
from volviz.model import scene as model_scene
from volviz.model.transfer import TransferFunction
from volviz.resources import shader_dir
from volviz.scene import Scene

PROBE = """#version 330 core
out vec4 o_color;
uniform ivec3 u_dims;
uniform int u_slice;
#include "@sample"
#include "@gradient"
void main() {
    vec3 at = (vec3(ivec3(gl_FragCoord.xy, u_slice)) + 0.5) / vec3(u_dims);
    float value;
    sample_volume(at, value);
    o_color = vec4(gradient(at, value), value);
}
"""


def drawn_gradients(gpu, volume, operator, folder):
    """float32[z, y, x, 3] and the values, as the shader of this operator finds them."""
    if not (folder / "lib").is_dir():
        shutil.copytree(shader_dir(), folder, dirs_exist_ok=True)
        (folder / "probe.frag").write_text(PROBE)
    setup = oracles.Setup(volume, oracles.smooth_transfer(), oracles.looking(volume))
    frame = setup.frame()
    renderer = Renderer(gpu)
    texture = renderer.resident.volume(frame.voxels, linear=True)
    choices = {"@sample": "lib/sample.glsl", "@gradient": GRADIENTS[operator]}
    made = shaders.program(gpu, "lib/fullscreen.vert", "probe.frag", choices, root=folder)
    nx, ny, nz = volume.dims
    target = gpu.framebuffer((nx, ny), "f4")
    found = np.empty((nz, ny, nx, 4), np.float32)
    for z in range(nz):
        target.use()
        texture.use(0)
        shaders.set_uniforms(
            made,
            u_volume=0,
            u_value=(frame.voxels.scale, frame.voxels.offset),
            u_index_to_world_t=np.linalg.inv(volume.affine[:3, :3]).T,
            u_voxel=tuple(1.0 / np.array(volume.dims)),
            u_dims=volume.dims,
            u_slice=z,
        )
        gpu.ctx.vertex_array(made, []).render(moderngl.TRIANGLES, vertices=3)
        raw = np.frombuffer(target.read(components=4, dtype="f4"), np.float32)
        found[z] = raw.reshape(ny, nx, 4)
    gpu.release_framebuffer(target)
    renderer.release()
    return found[..., :3], found[..., 3]


@pytest.mark.parametrize("grid", oracles.GRIDS)
@pytest.mark.parametrize("operator", OPERATORS)
def test_the_shader_is_the_operator(gpu, operator, grid, tmp_path):
    volume = oracles.noise_volume((7, 9, 11), oracles.GRIDS[grid])
    found, values = drawn_gradients(gpu, volume, operator, tmp_path)
    expected = gradient(volume, operator)
    inner = (slice(1, -1),) * 3
    np.testing.assert_allclose(values, volume.data, atol=1e-5)
    scale = np.abs(expected[inner]).max()
    assert np.abs(found[inner] - expected[inner]).max() < 1e-4 * scale
    others = [gradient(volume, o)[inner] for o in OPERATORS if o != operator]
    assert all(np.abs(found[inner] - o).max() > 0.1 * scale for o in others)


def test_names_are_those_of_the_fields():
    assert set(GRADIENTS) == set(OPERATORS) == set(model_scene.GRADIENTS)
    assert tuple(GRADIENTS) == model_scene.GRADIENTS


def test_sobel_is_less_moved_by_noise(gpu):
    """Of a noisy ball: its picture is nearer to that of the ball without noise."""
    z, y, x = np.mgrid[-12:13, -12:13, -12:13]
    ball = (9 - np.sqrt(x**2 + y**2 + z**2)).astype(np.float32)
    noise = np.random.default_rng(2).normal(0, 0.15, ball.shape).astype(np.float32)
    volume, noisy = (oracles.Volume.from_array(data) for data in (ball, ball + noise))
    transfer = TransferFunction(((0, 0.8, 0.5, 0.3),), ((0, 0.0), (1e-3, 1.0)), 0.01)
    camera = oracles.looking(volume, "orthographic")
    renderer, errors = Renderer(gpu), {}
    for operator in OPERATORS:
        pair = [
            oracles.light_of(
                renderer,
                oracles.Setup(v, transfer, camera).with_raycast(
                    gradient=operator, shading="phong", step=0.05
                ),
                (40, 40),
            )
            for v in (volume, noisy)
        ]
        both = (pair[0][..., 3] > 0.99) & (pair[1][..., 3] > 0.99)
        assert both.sum() > 100
        errors[operator] = float(np.abs(pair[0] - pair[1])[both].mean())
    renderer.release()
    assert errors["sobel"] < 0.8 * errors["central"]


def test_the_lab_varies_it():
    volume = oracles.noise_volume()
    axis = vary.axis("gradient=all", Scene.of(volume))
    assert set(axis.values) == set(OPERATORS)
