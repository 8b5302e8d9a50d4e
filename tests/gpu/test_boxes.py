"""Boxes over a picture: lines where a projection by hand puts their edges, and nowhere else."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from volviz.gpu.checked import Gpu, colour_texture
from volviz.gpu.passes import boxes
from volviz.model.camera import Camera
from volviz.model.volume import Volume

SIZE = (200, 150)
OBLIQUE = np.array(
    [[1.5, 0.4, -0.2, 10.0], [-0.3, 0.9, 0.5, -20.0], [0.2, -0.6, 2.0, 5.0], [0, 0, 0, 1.0]]
)
CORNERS = list(product((0, 1), repeat=3))
EDGES = [(a, b) for a in CORNERS for b in CORNERS if a < b and np.abs(np.subtract(a, b)).sum() == 1]


def drawn(gpu: Gpu, ends, colors, camera: Camera, width: float = 2.0) -> np.ndarray:
    """float[h, w, 4], row 0 below."""
    content = gpu.buffer(boxes.packed(np.float32(ends), np.uint8(colors)))
    target = gpu.framebuffer(SIZE)
    target.use()
    gpu.ctx.viewport = (0, 0, *SIZE)
    volume = Volume.from_array(np.zeros((10, 10, 10), np.uint8), affine=OBLIQUE)
    boxes.draw(gpu, content, volume, camera, size=SIZE, width=width)
    taken = np.frombuffer(colour_texture(target).read(), np.uint8).reshape(SIZE[1], SIZE[0], 4)
    gpu.release_framebuffer(target)
    content.release()
    return taken / 255.0


def pixel(camera: Camera, sample) -> tuple[float, float]:
    """Where a sample is in the picture, from rays: the (x, y) whose ray goes through it."""
    point = OBLIQUE[:3, :3] @ np.array(sample, float) + OBLIQUE[:3, 3]
    right, up, back = camera.axes()
    away = point - np.array(camera.position)
    depth = -away @ back if camera.projection == "perspective" else 1.0
    half = camera.half(SIZE[0] / SIZE[1])
    x, y = away @ right / depth / half[0], away @ up / depth / half[1]
    return (x + 1) / 2 * SIZE[0], (y + 1) / 2 * SIZE[1]


@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
def test_edges_are_where_the_oblique_grid_puts_them(gpu, projection):
    middle = OBLIQUE[:3, :3] @ (4.5, 4.5, 4.5) + OBLIQUE[:3, 3]
    position = tuple(middle + np.array([30.0, -25.0, 40.0]))
    camera = Camera(position, tuple(middle), height=26.0, projection=projection)
    low, high = np.array([1, 2, 3]), np.array([7, 6, 8])
    seen = drawn(gpu, [[low, high]], [[255, 128, 0, 255]], camera)
    lit, near = seen[..., 3] > 0.1, np.zeros(SIZE[::-1], bool)
    grid = np.stack(np.meshgrid(np.arange(SIZE[0]) + 0.5, np.arange(SIZE[1]) + 0.5), axis=-1)
    for a, b in EDGES:
        start, end = (np.where(e, high, low) for e in (a, b))
        for t in np.linspace(0.03, 0.97, 100):  # lines end without caps
            x, y = pixel(camera, start + t * (end - start))
            assert lit[int(y), int(x)]
            near |= np.linalg.norm(grid - (x, y), axis=2) < 3
    assert not lit[~near].any()
    assert 24 * 5 < lit.sum() < near.sum()
    np.testing.assert_allclose(seen[lit][:, :3], [[1, 128 / 255, 0]] * lit.sum(), atol=0.01)


def test_many_boxes_with_colours_and_what_is_behind(gpu):
    """A box behind the viewer is not seen, one around the viewer is cut where he stands."""
    inside = OBLIQUE[:3, :3] @ (4.5, 4.5, 4.5) + OBLIQUE[:3, 3]
    ahead = OBLIQUE[:3, :3] @ (4.5, 4.5, 12.0) + OBLIQUE[:3, 3]
    camera = Camera(position=tuple(inside), target=tuple(ahead), up=(0.0, 1.0, 0.0), fov=110.0)
    ends = [[[0, 0, 0], [9, 9, 9]], [[4, 4, 7], [5, 5, 8]], [[4, 4, 0], [5, 5, 1]]]
    colors = [[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255]]
    seen = drawn(gpu, ends, colors, camera)
    counts = [(seen[..., k] > 0.9).sum() for k in range(3)]
    assert counts[0] > 40
    assert counts[1] > 100
    assert counts[2] == 0
