"""What a picture with surfaces must be, by closed forms; and checks against them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tests.gpu import oracles
from volviz.gpu.renderer import Renderer
from volviz.model.camera import Camera
from volviz.model.frame import DrawnMesh, Frame
from volviz.model.mesh import Mesh
from volviz.model.scene import Light
from volviz.model.surface_look import SurfaceLook
from volviz.model.transfer import TransferFunction, srgb_to_linear
from volviz.model.volume import Volume

CENTRE = np.array([7.0, 8.0, 9.0])
LAMP = Light(light_azimuth=-40, light_elevation=25, ambient=0.2, diffuse=0.7)
DARK = Light(ambient=0, diffuse=0, specular=0)


def sphere(radius=6.0, rows=96, columns=192, centre=CENTRE) -> Mesh:
    """Latitudes and longitudes, with the sphere's own normals, counter-clockwise from outside."""
    theta = np.linspace(0, np.pi, rows + 1)[:, None]
    phi = np.linspace(0, 2 * np.pi, columns, endpoint=False)[None]
    out = np.stack(
        [np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta) + 0 * phi], -1
    ).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij")
    a, b = i * columns + j, i * columns + (j + 1) % columns
    quads = np.stack([a, a + columns, b + columns, a, b + columns, b], -1)
    return Mesh(centre + radius * out, quads.reshape(-1, 3), out)


def quad(origin, across, up) -> Mesh:
    """A rectangle about `origin`; seen from across × up it is its front."""
    origin, across, up = (np.array(v, dtype=float) for v in (origin, across, up))
    corners = [origin + s * across + t * up for s, t in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    normal = np.cross(across, up)
    normal /= np.linalg.norm(normal)
    return Mesh(np.array(corners), np.array([[0, 1, 2], [0, 2, 3]]), np.tile(normal, (4, 1)))


def drawn(mesh: Mesh, color=(0.8, 0.5, 0.3), **look) -> DrawnMesh:
    return DrawnMesh(mesh, SurfaceLook(**look), color)


def medium(camera=None, grid="isotropic", alpha=0.1, unit=1.0, light=DARK) -> oracles.Setup:
    """A white medium of the same density everywhere, unlit, about the sphere's centre."""
    volume = Volume.from_array(np.ones((16, 18, 20), np.float32), affine=oracles.GRIDS[grid])
    transfer = TransferFunction(((0, 1, 1, 1),), ((0, alpha),), unit)
    camera = camera or oracles.looking(volume)
    return oracles.Setup(volume, transfer, camera, light=light)


def frame_of(setup: oracles.Setup, *meshes: DrawnMesh, volume=True) -> Frame:
    frame = replace(setup.frame(), meshes=meshes)
    return replace(frame, raycast=replace(frame.raycast, show_volume=volume))


def light_of(renderer: Renderer, frame: Frame, size=(40, 40)) -> np.ndarray:
    return renderer.light(frame, size, samples=1, antialias=False)


def eye_of(camera: Camera):
    forward = np.subtract(camera.target, camera.position)
    forward = forward / np.linalg.norm(forward)
    right = np.cross(forward, camera.up)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(right, forward), -forward])


def hit_sphere(origin, direction, radius, centre=CENTRE):
    """Distances to both intersections, NaN where there is none."""
    to = origin - centre
    b = (to * direction).sum(-1)
    root = np.sqrt(b * b - ((to * to).sum(-1) - radius**2))
    return -b - root, -b + root


def expected_shade(normal, view, lamp, color, look: SurfaceLook, light: Light):
    ndl = np.maximum((normal * lamp).sum(-1), 0)
    half = lamp + view
    half = half / np.linalg.norm(half, axis=-1, keepdims=True)
    shine = np.maximum((normal * half).sum(-1), 0) ** look.gloss
    bright = light.ambient + light.diffuse * ndl
    highlight = np.where(ndl > 0, look.highlight * shine, 0)
    return srgb_to_linear(color) * bright[..., None] + highlight[..., None]


def check_sphere(renderer, projection="perspective", shading="phong", size=(90, 70)):
    """Colour inside, nothing outside, the silhouette where the sphere's is."""
    setup = medium(light=LAMP)
    camera = replace(oracles.looking(setup.volume, projection), target=tuple(CENTRE))
    setup = replace(setup, camera=camera)
    one = drawn(sphere(), shading=shading)
    shown = light_of(renderer, frame_of(setup, one, volume=False), size)
    with np.errstate(invalid="ignore"):
        origin, direction = oracles.rays(camera, size)
        near, _ = hit_sphere(origin, direction, 6.0)
        sure, _ = hit_sphere(origin, direction, 6.0 * 0.97)
        beyond, _ = hit_sphere(origin, direction, 6.0 * 1.02)
    inside, outside = np.isfinite(sure), ~np.isfinite(beyond)
    assert (shown[inside][:, 3] == 1).all()
    assert (shown[outside] == 0).all()
    normal = (origin + near[..., None] * direction - CENTRE) / 6.0
    lamp = LAMP.direction() @ eye_of(camera)
    wanted = expected_shade(normal, -direction, lamp, one.color, one.look, LAMP)
    error = np.abs(shown[..., :3] - wanted)[inside]
    assert error.max() < (0.01 if shading == "phong" else 0.06), error.max()
    assert inside.sum() > 300


def check_plane_in_medium(renderer, grid="oblique", projection="perspective"):
    """The medium in front of an oblique opaque plane, at every pixel."""
    setup = medium(grid=grid, alpha=0.08)
    setup = replace(setup, camera=oracles.looking(setup.volume, projection))
    middle = setup.volume.affine @ (9, 8, 7, 1)
    axes = eye_of(setup.camera)
    wall = quad(middle[:3], 100 * (axes[0] + 0.3 * axes[2]), 100 * (axes[1] - 0.2 * axes[2]))
    shown = light_of(renderer, frame_of(setup, drawn(wall, highlight=0)))
    origin, direction = oracles.rays(setup.camera, (40, 40))
    span = oracles.spans(setup.volume, origin, direction, projection == "perspective")
    normal = wall.normals[0].astype(float)
    t = ((middle[:3] - origin) @ normal) / (direction @ normal)
    length = np.maximum(np.minimum(span[1], t) - span[0], 0)
    wanted = 1 - (1 - 0.08) ** length
    assert (shown[..., 3] > 0.9999).all()
    assert np.abs(shown[..., 0] - wanted).max() < 2e-3
    assert np.ptp(wanted) > 0.3


def over(parts):
    """Premultiplied colours, first in front."""
    total = np.zeros(4)
    for part in parts:
        total = total + (1 - total[3]) * np.asarray(part)
    return total


def check_layers(renderer, side=1.0, count=2, volume=True):
    """Translucent quads with a medium between them, from either side: the closed form."""
    setup = medium(alpha=0.1, light=replace(DARK, ambient=1.0))
    place = (9.5, 8.5, 7.5)
    camera = replace(
        setup.camera, position=(9.5, 8.5 - side * 60, 7.5), target=place, up=(0, 0, 1), height=8.0
    )
    setup = replace(setup, camera=replace(camera, projection="orthographic"))
    at = np.linspace(2.0, 14.0, count)
    colors = np.random.default_rng(2).random((count, 3))
    opacity = 0.9 / count if count > 2 else 0.4
    order = np.random.default_rng(3).permutation(count)
    quads = [
        drawn(
            quad((9.5, at[i], 7.5), (30, 0, 0), (0, 0, 30)),
            tuple(colors[i]),
            opacity=opacity,
            highlight=0,
        )
        for i in order
    ]
    shown = light_of(renderer, frame_of(setup, *quads, volume=volume), (9, 9))[4, 4]
    ends = [-0.5, *at, 17.5][:: int(side)]
    parts = []
    for i in range(count + 1):
        a = 1 - 0.9 ** abs(ends[i + 1] - ends[i]) if volume else 0.0
        parts.append((a, a, a, a))
        if i < count:
            linear = srgb_to_linear(colors[:: int(side)][i])
            parts.append((*(linear * opacity), opacity))
    assert np.abs(shown - over(parts)).max() < 1e-3, (shown, over(parts))


def check_maximum(renderer, projection="orthographic", opaque=True):
    """Translucent layers in front of the whole maximum, which ends at what is opaque."""
    values = np.random.default_rng(4).random((16, 18, 20)).astype(np.float32)
    volume = Volume.from_array(values)
    ramp = TransferFunction(((0, 1, 1, 1),), ((0, 0.0), (1, 0.8)), 1.0)
    light = replace(DARK, ambient=1.0)
    setup = oracles.Setup(volume, ramp, oracles.looking(volume, projection), light=light)
    setup = setup.with_raycast(mode="mip", step=0.25)
    axes, size = eye_of(setup.camera), (24, 24)
    middle, way = volume.affine[:3, :3] @ (9.5, 8.5, 7.5), axes[2]
    tints = ((0.9, 0.2, 0.1), (0.1, 0.3, 0.9))
    sheets = [
        drawn(
            quad(middle + 3 * k * way, (1 + k) * axes[0] * 4, 30 * axes[1]),
            tint,
            opacity=0.4,
            highlight=0,
        )
        for k, tint in enumerate(tints)
    ]
    wall = drawn(quad(middle - 2 * way, 100 * axes[0], 100 * axes[1]), (0, 0, 0), highlight=0)
    walls = [wall] if opaque else []
    shown = light_of(renderer, frame_of(setup, *sheets, *walls), size)
    plain = light_of(renderer, frame_of(setup, *walls), size)
    each = [light_of(renderer, frame_of(setup, s, volume=False), size) for s in sheets]
    wanted = plain
    for sheet in each:  # the farther one first
        wanted = sheet + (1 - sheet[..., 3:]) * wanted
    covered = sum((s[..., 3] > 0.39).astype(int) for s in each)
    assert {0, 1, 2} == set(covered.ravel().tolist()) or projection == "perspective"
    assert np.ptp(plain[..., 0]) > 0.1
    assert np.abs(shown - wanted).max() < 2e-3


def check_back(renderer):
    """A wall seen from its back is as bright as one that is turned round."""
    setup = medium(light=LAMP)
    axes = eye_of(setup.camera)
    front, back = (quad((9, 8, 7), side * 4 * axes[0], 4 * axes[1]) for side in (1, -1))
    a, b = (light_of(renderer, frame_of(setup, drawn(m), volume=False)) for m in (front, back))
    assert np.abs(a - b).max() < 1e-3
    assert a[20, 20, :3].min() > 0.05
