"""What a picture must be, by closed forms and a plain numpy ray integral; and checks against them.

Nothing here uses volviz's own ray set-up, sampling or compositing: rays come from the camera's
position, directions and angles, samples from scipy's interpolation.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import map_coordinates

from volviz.gpu.renderer import Renderer
from volviz.model.camera import Camera, standard_view
from volviz.model.frame import ColorTable, Frame, Voxels
from volviz.model.scene import Background, Light, Raycast, box_corners
from volviz.model.transfer import TransferFunction, srgb_to_linear
from volviz.model.volume import Volume, affine_of

ISOTROPIC = affine_of((1, 1, 1))
ANISOTROPIC = affine_of((0.7, 1.3, 2.1), (5, -3, 11))


def oblique_affine() -> np.ndarray:
    a, b = 0.5, -0.35
    turn = np.array([[math.cos(a), -math.sin(a), 0], [math.sin(a), math.cos(a), 0], [0, 0, 1]])
    tip = np.array([[1, 0, 0], [0, math.cos(b), -math.sin(b)], [0, math.sin(b), math.cos(b)]])
    affine = np.eye(4)
    shear = np.array([[1, 0, 0.15], [0, 1, -0.2], [0, 0, 1]])
    affine[:3, :3] = turn @ tip @ shear @ np.diag([0.8, 1.1, 1.7])
    affine[:3, 3] = (-4, 9, 2)
    return affine


EXACT = Raycast(jitter=0.0, samples=1, shading="none", termination=1.0)
PLAIN = Light()
GRIDS = {"isotropic": ISOTROPIC, "anisotropic": ANISOTROPIC, "oblique": oblique_affine()}
PROJECTIONS = ("perspective", "orthographic")


@dataclass(frozen=True)
class Setup:
    """A volume with all that decides its picture, before the renderer's encoding."""

    volume: Volume
    transfer: TransferFunction
    camera: Camera
    raycast: Raycast = EXACT
    light: Light = PLAIN

    def frame(self) -> Frame:
        low, high = self.transfer.domain
        entries = self.transfer.table(self.transfer.table_size(integers=False))
        table = ColorTable(entries, low, high, self.transfer.unit_distance)
        voxels = Voxels(self.volume.data.astype(np.float32), 1.0, 0.0)
        clear = Background.plain((0, 0, 0, 0))
        return Frame(
            voxels, self.volume.affine, table, self.camera, self.raycast, self.light, clear
        )

    def with_raycast(self, **knobs) -> Setup:
        return replace(self, raycast=replace(self.raycast, **knobs))


def light_of(renderer: Renderer, setup: Setup, size=(24, 24)) -> np.ndarray:
    """float32[h, w, 4] as drawn, one sample through the middle of each pixel."""
    return renderer.light(setup.frame(), size, samples=1, antialias=False)


def noise_volume(shape=(9, 11, 13), affine=ISOTROPIC, seed=3) -> Volume:
    rng = np.random.default_rng(seed)
    return Volume.from_array(rng.random(shape, dtype=np.float32), affine=affine)


def smooth_transfer(unit=2.0) -> TransferFunction:
    return TransferFunction(
        ((0, 0.1, 0.2, 0.9), (0.5, 0.9, 0.6, 0.1), (1, 1, 1, 1)),
        ((0, 0.0), (0.35, 0.05), (0.7, 0.5), (1, 0.9)),
        unit,
    )


def looking(volume: Volume, projection="perspective", azimuth=33.0, elevation=21.0) -> Camera:
    camera = replace(standard_view("anterior", azimuth, elevation), projection=projection)
    return camera.fitted(box_corners(volume))


# --- the plain ray integral -------------------------------------------------------------------


def rays(camera: Camera, size) -> tuple[np.ndarray, np.ndarray]:
    """World origins and unit directions, float64[h, w, 3], through pixel middles, row 0 on top."""
    w, h = size
    forward = np.subtract(camera.target, camera.position)
    forward = forward / np.linalg.norm(forward)
    right = np.cross(forward, camera.up)
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    x = (np.arange(w) + 0.5) - w / 2
    y = h / 2 - (np.arange(h) + 0.5)
    xs, ys = np.meshgrid(x, y)
    across = xs[..., None] * right + ys[..., None] * up
    if camera.projection == "perspective":
        pixel = 2 * math.tan(math.radians(camera.fov) / 2) / min(w, h)
        direction = forward + across * pixel
        origin = np.broadcast_to(np.array(camera.position), direction.shape)
        return origin, direction / np.linalg.norm(direction, axis=-1, keepdims=True)
    pixel = camera.height / min(w, h)
    origin = np.array(camera.position) + across * pixel
    return origin, np.broadcast_to(forward, origin.shape)


def spans(volume: Volume, origin, direction, perspective) -> tuple[np.ndarray, np.ndarray]:
    """Distances in mm at which rays enter and leave the box of voxels."""
    inverse = np.linalg.inv(volume.affine)
    o = origin @ inverse[:3, :3].T + inverse[:3, 3] + 0.5
    d = direction @ inverse[:3, :3].T
    with np.errstate(divide="ignore", invalid="ignore"):
        a, b = (0 - o) / d, (np.array(volume.dims) - o) / d
    near = np.nanmax(np.minimum(a, b), axis=-1)
    far = np.nanmin(np.maximum(a, b), axis=-1)
    return (np.maximum(near, 0) if perspective else near), far


def integral(setup: Setup, size=(24, 24)) -> np.ndarray:
    """float64[h, w, 4]: emission and absorption by midpoint samples, premultiplied linear light."""
    origin, direction = rays(setup.camera, size)
    near, far = spans(setup.volume, origin, direction, setup.camera.projection == "perspective")
    step = setup.raycast.step * min(setup.volume.spacing)
    inverse = np.linalg.inv(setup.volume.affine)
    color = np.zeros((*near.shape, 3))
    clear = np.ones(near.shape)
    for i in range(math.ceil(float(np.max(far - near, initial=0)) / step) + 1):
        length = np.clip(far - near - i * step, 0, step)
        at = origin + direction * (near + i * step + length / 2)[..., None]
        index = at @ inverse[:3, :3].T + inverse[:3, 3]
        data = setup.volume.data.astype(np.float64)
        value = map_coordinates(data, index[..., ::-1].reshape(-1, 3).T, order=1, mode="nearest")
        value = value.reshape(near.shape)
        opacity = 1 - (1 - setup.transfer.opacity_at(value)) ** (
            length / setup.transfer.unit_distance
        )
        opacity[length <= 0] = 0
        rgb = srgb_to_linear(setup.transfer.color_at(value))
        color += (clear * opacity)[..., None] * rgb
        clear *= 1 - opacity
    return np.concatenate([color, 1 - clear[..., None]], axis=-1)


# --- checks: each raises AssertionError if the renderer is wrong -------------------------------


def check_integral(renderer: Renderer, grid="isotropic", projection="perspective") -> None:
    volume = noise_volume(affine=GRIDS[grid])
    setup = Setup(volume, smooth_transfer(), looking(volume, projection))
    drawn, expected = light_of(renderer, setup), integral(setup)
    assert expected[..., 3].max() > 0.5
    # the table has 4096 entries, so a sample's opacity is exact to about 1e-4
    assert np.abs(drawn - expected).max() < 2e-3


def check_constant_medium(renderer: Renderer, grid="isotropic", projection="perspective") -> None:
    volume = Volume.from_array(np.full((6, 8, 10), 0.4, np.float32), affine=GRIDS[grid])
    transfer = TransferFunction(((0, 1, 1, 1), (1, 1, 1, 1)), ((0, 0.3), (1, 0.3)), 2.5)
    setup = Setup(volume, transfer, looking(volume, projection)).with_raycast(jitter=1.0)
    origin, direction = rays(setup.camera, (24, 24))
    near, far = spans(volume, origin, direction, projection == "perspective")
    sigma = -math.log(1 - 0.3) / 2.5
    expected = 1 - np.exp(-sigma * np.maximum(far - near, 0))
    assert np.abs(light_of(renderer, setup)[..., 3] - expected).max() < 1e-4


def check_linear_ramp(renderer: Renderer, grid="isotropic", projection="perspective") -> None:
    """Extinction proportional to a value that is linear in space: depth = mean value · length."""
    affine = GRIDS[grid]
    x, y, z = np.meshgrid(np.arange(12), np.arange(10), np.arange(8), indexing="ij")
    data = (0.03 * x + 0.02 * y + 0.04 * z).transpose(2, 1, 0).astype(np.float32)
    volume = Volume.from_array(data, affine=affine)
    values = np.linspace(0, 1, 2001)
    opacities = tuple(zip(values, 1 - np.exp(-0.8 * values), strict=True))
    transfer = TransferFunction(((0, 1, 1, 1),), opacities, 1.0)
    setup = Setup(volume, transfer, looking(volume, projection)).with_raycast(step=0.25)
    origin, direction = rays(setup.camera, (24, 24))
    near, far = spans(volume, origin, direction, projection == "perspective")
    inverse = np.linalg.inv(affine)
    ends = [
        (origin + direction * t[..., None]) @ inverse[:3, :3].T + inverse[:3, 3]
        for t in (near, far)
    ]
    # beyond the outer sample centres the field stays as it is there: clamp, then the mean is exact
    parts = (np.arange(500) + 0.5) / 500
    along = ends[0] + (ends[1] - ends[0]) * parts[:, None, None, None]
    mean = (np.clip(along, 0, np.array(volume.dims) - 1) @ np.array([0.03, 0.02, 0.04])).mean(
        axis=0
    )
    expected = 1 - np.exp(-0.8 * mean * np.maximum(far - near, 0))
    assert expected.max() > 0.9
    assert np.abs(light_of(renderer, setup)[..., 3] - expected).max() < 2e-3


def check_sphere_chords(renderer: Renderer, grid="isotropic", projection="perspective") -> None:
    volume, radius, centre = sphere_volume(grid)
    transfer = TransferFunction(((0, 1, 1, 1),), ((0, 0.0), (1e-3, 0.12), (radius, 0.12)), 1.0)
    setup = Setup(volume, transfer, looking(volume, projection)).with_raycast(step=0.1)
    origin, direction = rays(setup.camera, (32, 32))
    to_centre = centre - origin
    along = (to_centre * direction).sum(-1)
    distance2 = (to_centre**2).sum(-1) - along**2
    chord = 2 * np.sqrt(np.maximum(radius**2 - distance2, 0))
    expected = 1 - (1 - 0.12) ** chord
    drawn = light_of(renderer, setup, (32, 32))[..., 3]
    middle = distance2 < (0.8 * radius) ** 2
    assert middle.sum() > 30
    # trilinear interpolation cuts the sphere's curvature: h²/8R at each end of the chord
    flat = max(volume.spacing) ** 2 / (8 * radius) * 2
    assert np.abs(drawn - expected)[middle].max() < 0.008 + 0.13 * flat
    assert abs(float((drawn - expected)[middle].mean())) < 0.004 + 0.06 * flat
    assert drawn[distance2 > (radius * 1.05) ** 2].max() < 0.01


def sphere_volume(grid="isotropic", radius=7.0) -> tuple[Volume, float, np.ndarray]:
    """Depth below the surface of a sphere, mm, on a grid that holds it."""
    affine = GRIDS[grid].copy()
    steps = np.linalg.norm(affine[:3, :3], axis=0)
    dims = np.ceil(2 * radius * 1.5 / steps).astype(int)
    index = np.stack(np.meshgrid(*(np.arange(n) for n in dims), indexing="ij"), axis=-1)
    world = index @ affine[:3, :3].T + affine[:3, 3]
    centre = affine[:3, :3] @ ((dims - 1) / 2) + affine[:3, 3]
    depth = radius - np.linalg.norm(world - centre, axis=-1)
    return (
        Volume.from_array(depth.transpose(2, 1, 0).astype(np.float32), affine=affine),
        radius,
        centre,
    )


def check_single_voxel(renderer: Renderer, grid="isotropic", projection="perspective") -> None:
    """A lone bright voxel is seen where its centre is: no half-voxel shift anywhere."""
    data = np.zeros((11, 13, 15), np.float32)
    data[3, 8, 4] = 1
    volume = Volume.from_array(data, affine=GRIDS[grid])
    camera = looking(volume, projection)
    transfer = TransferFunction(((0, 1, 1, 1),), ((0, 0.0), (1, 1.0)), 1.0)
    setup = Setup(volume, transfer, camera).with_raycast(mode="mip", step=0.1)
    size = (96, 96)
    drawn = light_of(renderer, setup, size)[..., 3].astype(np.float64)
    rows, columns = np.indices(drawn.shape)
    assert drawn.sum() > 0
    seen = np.array([(drawn * columns).sum(), (drawn * rows).sum()]) / drawn.sum()
    world = volume.affine @ (4, 8, 3, 1)
    assert np.abs(seen - pixel_of(camera, world[:3], size)).max() < 0.35


def pixel_of(camera: Camera, point, size) -> np.ndarray:
    """Where a world point is in the picture: column and row of pixel middles."""
    w, h = size
    forward = np.subtract(camera.target, camera.position)
    forward = forward / np.linalg.norm(forward)
    right = np.cross(forward, camera.up)
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    offset = np.subtract(point, camera.position)
    half = (
        math.tan(math.radians(camera.fov) / 2) * (offset @ forward)
        if camera.projection == "perspective"
        else camera.height / 2
    )
    scale = min(w, h) / 2 / half
    return np.array([w / 2 + offset @ right * scale, h / 2 - offset @ up * scale]) - 0.5


def check_mip_is_max(renderer: Renderer, axis=2, interpolation="nearest") -> None:
    """Along an index axis, a pixel a voxel: the maximum along that axis, value for value."""
    volume = noise_volume((16, 16, 16))
    name = ("right", "anterior", "inferior")[axis]
    camera = replace(standard_view(name), projection="orthographic")
    camera = camera.fitted(box_corners(volume), margin=1.0)
    ramp = TransferFunction(((0, 1, 1, 1),), ((0, 0.0), (1, 1.0)), 1.0)
    setup = Setup(volume, ramp, camera).with_raycast(
        mode="mip", step=1.0, interpolation=interpolation
    )
    drawn = light_of(renderer, setup, (16, 16))[..., 3]
    expected = volume.data.max(axis=2 - axis)
    if axis == 2:  # from below, anterior on top: rows are y, columns are x
        picture = expected
    elif axis == 1:  # from the front, superior on top: rows are z upwards, columns are x
        picture = expected[::-1]
    else:  # from the patient's right: rows are z upwards, columns are y backwards
        picture = expected[::-1, ::-1]
    assert np.abs(drawn - picture).max() < 3e-4


def sphere_normals(points, centre, affine, gradient: str) -> np.ndarray:
    """Outward, as the operator's differences of the distance to the centre give it."""
    steps = affine[:3, :3].T
    if gradient == "sobel":
        around = np.array(list(np.ndindex(3, 3, 3))) - 1
        weights = np.array([0, 6, 3, 1])[np.abs(around).sum(axis=1)]
        there = np.linalg.norm(points[..., None, :] + around @ steps - centre, axis=-1)
        differences = (there * weights) @ around / 44
    else:
        ahead = np.linalg.norm(points[..., None, :] + steps - centre, axis=-1)
        behind = np.linalg.norm(points[..., None, :] - steps - centre, axis=-1)
        here = np.linalg.norm(points - centre, axis=-1)[..., None]
        differences = {
            "central": (ahead - behind) / 2,
            "forward": ahead - here,
            "backward": here - behind,
        }[gradient]
    normals = differences @ np.linalg.inv(affine[:3, :3])
    return normals / np.linalg.norm(normals, axis=-1, keepdims=True)


def check_shaded_sphere(
    renderer: Renderer, grid="isotropic", shading="blinn-phong", gradient="central"
) -> None:
    """An opaque sphere lit by the formula, on every kind of grid."""
    volume, radius, centre = sphere_volume(grid, radius=9.0)
    color = (0.8, 0.5, 0.3)
    transfer = TransferFunction(((0, *color),), ((0, 0.0), (1e-3, 1.0)), 0.01)
    light = Light(0.2, 0.6, 0.3, 12.0, -40.0, 25.0)
    camera = looking(volume, "orthographic")
    setup = Setup(volume, transfer, camera, light=light)
    setup = setup.with_raycast(shading=shading, gradient=gradient, step=0.02)
    size = (33, 33)
    origin, direction = rays(camera, size)
    along = ((centre - origin) * direction).sum(-1)
    distance2 = ((centre - origin) ** 2).sum(-1) - along**2
    inside = distance2 < (0.85 * radius) ** 2
    hit = origin + direction * (along - np.sqrt(np.maximum(radius**2 - distance2, 0)))[..., None]
    normal = sphere_normals(hit, centre, volume.affine, gradient)
    normal = np.where(((normal * direction).sum(-1) > 0)[..., None], -normal, normal)
    view = -direction
    a, e = math.radians(-40), math.radians(25)
    right, up = np.cross(direction[0, 0], camera.up), np.array(camera.up)
    right /= np.linalg.norm(right)
    up = np.cross(right, direction[0, 0])
    lamp = (
        math.sin(a) * math.cos(e) * right
        + math.sin(e) * up
        - math.cos(a) * math.cos(e) * direction[0, 0]
    )
    diffuse = np.maximum(normal @ lamp, 0)
    if shading == "phong":
        mirrored = 2 * (normal @ lamp)[..., None] * normal - lamp
        shine = np.maximum((mirrored * view).sum(-1), 0)
    else:
        half = lamp + view
        half = half / np.linalg.norm(half, axis=-1, keepdims=True)
        shine = np.maximum((half * normal).sum(-1), 0)
    highlight = np.where(diffuse > 0, 0.3 * shine**12, 0)
    expected = srgb_to_linear(color) * (0.2 + 0.6 * diffuse)[..., None] + highlight[..., None]
    drawn = light_of(renderer, setup, size)
    assert inside.sum() > 100
    assert np.abs(drawn[..., 3][inside] - 1).max() < 1e-3
    assert np.abs(drawn[..., :3] - expected)[inside].max() < 0.05
    assert np.abs(drawn[..., :3] - expected)[inside].mean() < 0.008
