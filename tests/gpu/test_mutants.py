"""A test that cannot fail is no evidence: shaders with a fault in them must turn checks red."""

from __future__ import annotations

import shutil
from dataclasses import replace

import numpy as np
import pytest

from tests.gpu import oracles, surface_oracles
from volviz import resources
from volviz.errors import VolvizError
from volviz.fields.bricks import bricks, emptiness
from volviz.gpu.contexts import open_gpu
from volviz.gpu.renderer import Renderer
from volviz.model.scene import Background

# name: (file, what stands there, what the mutant says)
MUTANTS = {
    "light is not dimmed by what is in front": (
        "raycast/modes/dvr.glsl",
        "gathered += (1.0 - gathered.a) * light",
        "gathered += light",
    ),
    "the last partial step counts as a whole one": (
        "raycast/modes/dvr.glsl",
        "if (weight < 1.0) light.a",
        "if (false) light.a",
    ),
    "half a voxel off": (
        "lib/sample.glsl",
        "textureLod(u_volume, at, 0.0)",
        "textureLod(u_volume, at + 0.5 / vec3(textureSize(u_volume, 0)), 0.0)",
    ),
    "picture transposed": (
        "raycast/raycast.frag",
        "pixel * u_pixel.xy + u_pixel.zw",
        "(pixel * u_pixel.xy + u_pixel.zw).yx",
    ),
    "gradient left in index space": (
        "lib/gradient_central.glsl",
        "return u_index_to_world_t * index;",
        "return index;",
    ),
    "backward difference": (
        "lib/gradient_central.glsl",
        "0.5 * (ahead - behind)",
        "(centre - behind)",
    ),
    "backward for forward difference": (
        "lib/gradient_forward.glsl",
        "sample_volume(at + offset, ahead) ? ahead - centre",
        "sample_volume(at - offset, ahead) ? centre - ahead",
    ),
    "forward for backward difference": (
        "lib/gradient_backward.glsl",
        "sample_volume(at - offset, behind) ? centre - behind",
        "sample_volume(at + offset, behind) ? behind - centre",
    ),
    "smoothed along one axis": (
        "lib/gradient_sobel.glsl",
        "sum += o *",
        "sum += vec3(o.x, o.y, 2.0 * o.z) *",
    ),
    "minimum for maximum": ("raycast/modes/mip.glsl", "max(largest, value)", "min(largest, value)"),
    "samples at the start of their step": (
        "raycast/raycast.frag",
        "float(i) + place)",
        "float(i))",
    ),
    "rays from behind the camera": (
        "raycast/raycast.frag",
        "max(near.z, u_near)",
        "near.z",
    ),
    "highlight from the lamp alone": (
        "raycast/shading/blinn_phong.glsl",
        "normalize(u_lamp + view)",
        "u_lamp",
    ),
    "table one entry off": ("lib/classify.glsl", "+ 0.5);", "+ 40.5);"),
    "leaps too far": ("lib/skip_bricks.glsl", "ceil(min(nearest, 1e6) - 1e-3)", "nearest + 3.0"),
    "rays go on behind a surface": (
        "raycast/ends_layers.glsl",
        "span.y = min(span.y, far * u_place.x + u_place.y)",
        "span.y = min(span.y, 1e9)",
    ),
    "what is in front of a layer is forgotten": (
        "raycast/ends_layers.glsl",
        "return in_front + (1.0 - in_front.a) * part",
        "return part",
    ),
    "the part behind a layer begins at the camera": (
        "raycast/ends_layers.glsl",
        "span.x = max(span.x, near * u_place.x + u_place.y)",
        "span.x = max(span.x, -1e9)",
    ),
    "the same layer is peeled again": (
        "surface/peel.glsl",
        "key <= before + u_thick",
        "key < before",
    ),
    "only the front of a surface is lit": (
        "surface/phong.glsl",
        "gl_FrontFacing ? normal : -normal",
        "normal",
    ),
    "surfaces two pixels off": (
        "surface/surface.vert",
        "- u_shift * w;",
        "- (u_shift + 2.0) * w;",
    ),
    "distance to the eye's plane for the way along the ray": (
        "surface/surface.frag",
        "u_perspective > 0.5 ? length(eye) : -eye.z",
        "-eye.z",
    ),
    "light not encoded": ("display/display.frag", "encode(shown.a", "(shown.a"),
    "background over the volume": ("display/display.frag", "(1.0 - light.a) * ground", "ground"),
}


def check_leaping(renderer):
    data = np.zeros((20, 20, 20), np.float32)
    data[8:11, 9:12, 9:13] = 1
    volume = oracles.Volume.from_array(data)
    transfer = oracles.TransferFunction(((0, 1, 1, 1),), ((0.1, 0), (1, 0.5)), 1.0)
    setup = oracles.Setup(volume, transfer, oracles.looking(volume))
    frame = setup.frame()
    empty = emptiness(bricks(frame.voxels), frame.voxels, frame.table)
    leapt = renderer.light(replace(frame, emptiness=empty), (24, 24), antialias=False)
    assert np.array_equal(leapt, oracles.light_of(renderer, setup))


def check_display(renderer):
    """A half-covered pixel: linear light blended, then encoded."""
    volume = oracles.Volume.from_array(np.ones((4, 4, 4), np.float32))
    transfer = oracles.TransferFunction(((0, 0.2, 0.6, 1),), ((0, 0.5),), 4.0)
    camera = oracles.standard_view("anterior")
    camera = replace(camera, projection="orthographic").fitted(oracles.box_corners(volume))
    setup = oracles.Setup(volume, transfer, camera)
    ground = Background.plain((0.9, 0.3, 0.1))
    shown = renderer.image(replace(setup.frame(), background=ground), (9, 9), samples=1)[4, 4]
    linear = oracles.srgb_to_linear
    light = 0.5 * linear((0.2, 0.6, 1)) + 0.5 * linear(ground.top[:3])
    expected = np.where(light > 0.0031308, 1.055 * light ** (1 / 2.4) - 0.055, 12.92 * light)
    assert np.abs(shown[:3] - 255 * expected).max() <= 1.01
    assert shown[3] == 255


def check_inside(renderer):
    volume = oracles.Volume.from_array(np.ones((20, 20, 20), np.float32))
    transfer = oracles.TransferFunction(((0, 1, 1, 1),), ((0, 0.1),), 1.0)
    camera = oracles.looking(volume, azimuth=0, elevation=0)
    camera = replace(camera, position=(9.5, 9.5, 9.5), target=(9.5, 19.5, 9.5))
    drawn = oracles.light_of(renderer, oracles.Setup(volume, transfer, camera), (9, 9))
    assert abs(drawn[4, 4, 3] - (1 - 0.9**10)) < 1e-3


CHECKS = [
    lambda r: oracles.check_integral(r, "oblique", "perspective"),
    lambda r: oracles.check_constant_medium(r, "anisotropic", "orthographic"),
    lambda r: oracles.check_single_voxel(r, "isotropic", "orthographic"),
    oracles.check_mip_is_max,
    lambda r: oracles.check_shaded_sphere(r, "oblique", "blinn-phong"),
    lambda r: oracles.check_shaded_sphere(r, "anisotropic", "phong", "forward"),
    lambda r: oracles.check_shaded_sphere(r, "anisotropic", "phong", "backward"),
    lambda r: oracles.check_shaded_sphere(r, "anisotropic", "phong", "sobel"),
    check_leaping,
    check_display,
    check_inside,
    surface_oracles.check_sphere,
    surface_oracles.check_plane_in_medium,
    lambda r: surface_oracles.check_layers(r, -1.0, 3),
    surface_oracles.check_back,
]


def failures() -> list[int]:
    gpu = open_gpu()
    renderer = Renderer(gpu)
    failed = []
    try:
        for i, check in enumerate(CHECKS):
            try:
                check(renderer)
            except (AssertionError, VolvizError):
                failed.append(i)
    finally:
        renderer.release()
        gpu.release()
    return failed


def test_the_shaders_as_they_are_pass():
    assert failures() == []


@pytest.mark.parametrize("name", MUTANTS)
def test_mutants_are_caught(name, tmp_path, monkeypatch):
    file, there, instead = MUTANTS[name]
    shutil.copytree(resources.shader_dir(), tmp_path / "shaders")
    path = tmp_path / "shaders" / file
    text = path.read_text()
    assert text.count(there) == 1, f"{file} no longer says what the mutant changes"
    path.write_text(text.replace(there, instead))
    monkeypatch.setattr(resources, "shader_dir", lambda: tmp_path / "shaders")
    assert failures()
