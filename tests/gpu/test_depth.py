"""How far the surfaces in a picture are, and the lines of boxes that they cover."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.gpu import oracles
from tests.gpu import surface_oracles as so
from volviz.gpu.checked import colour_texture
from volviz.gpu.passes import boxes
from volviz.gpu.passes import view as view_module
from volviz.gpu.renderer import Renderer
from volviz.model.volume import Volume

SIZE = (90, 70)


@pytest.fixture(scope="module")
def renderer(gpu):
    made = Renderer(gpu)
    yield made
    made.release()


def scene(projection, **look):
    setup = so.medium(light=so.LAMP)
    camera = replace(oracles.looking(setup.volume, projection), target=tuple(so.CENTRE))
    return so.frame_of(replace(setup, camera=camera), so.drawn(so.sphere(), **look)), camera


def read(texture):
    raw = np.frombuffer(texture.read(alignment=1), np.float32)
    return raw.reshape(texture.size[::-1])[::-1]


def whole(picture, frame):
    while not picture.refine(frame, SIZE, 1.0).done:
        pass


@pytest.mark.parametrize("projection", oracles.PROJECTIONS)
@pytest.mark.parametrize("blocks", [1, 4])
def test_depth_is_the_way_along_the_ray(renderer, projection, blocks, monkeypatch):
    monkeypatch.setattr(view_module, "BLOCK_PIXELS", SIZE[0] * SIZE[1] // blocks)
    frame, camera = scene(projection)
    picture = renderer.progressive()
    picture.coarse(frame, SIZE, 0.05)
    assert (read(picture.depth) > 0).any()
    before = picture.depths
    whole(picture, frame)
    assert picture.depths > before
    found = read(picture.depth)
    origin, direction = oracles.rays(camera, SIZE)
    with np.errstate(invalid="ignore"):
        near, _ = so.hit_sphere(origin, direction, 6.0)
        sure, _ = so.hit_sphere(origin, direction, 6.0 * 0.97)
        beyond, _ = so.hit_sphere(origin, direction, 6.0 * 1.02)
    inside = np.isfinite(sure)
    assert inside.sum() > 300
    np.testing.assert_allclose(found[inside], near[inside], atol=0.05)
    assert (found[~np.isfinite(beyond)] == 0).all()
    picture.release()


def test_what_is_seen_through_has_no_depth(renderer):
    picture = renderer.progressive()
    frame, _ = scene("perspective", opacity=0.5)
    whole(picture, frame)
    assert (read(picture.depth) == 0).all()
    solid, _ = scene("perspective")
    whole(picture, solid)
    assert (read(picture.depth) > 0).any()
    whole(picture, replace(solid, meshes=()))
    assert picture.depth is None
    picture.release()


@pytest.mark.parametrize("projection", oracles.PROJECTIONS)
def test_lines_behind_a_surface_are_faint(gpu, projection):
    """A box of eight samples' side, and surfaces before it, in it, behind it and beside it."""
    volume = Volume.from_array(np.zeros((10, 10, 10), np.uint8))
    camera = replace(
        oracles.looking(volume, projection),
        position=(24.5, -30.0, 24.5),
        target=(4.5, 4.5, 4.5),
        up=(0.0, 0.0, 1.0),
        height=16.0,
        fov=24.0,
    )
    content = gpu.buffer(boxes.packed(np.float32([[[1, 1, 1], [8, 8, 8]]]), np.uint8([[255] * 4])))
    target = gpu.framebuffer(SIZE)

    def lines(depth):
        target.use()
        target.clear()
        gpu.ctx.viewport = (0, 0, *SIZE)
        boxes.draw(gpu, content, volume, camera, size=SIZE, width=2.0, depth=depth)
        return np.frombuffer(colour_texture(target).read(), np.uint8).reshape(*SIZE[::-1], 4)[
            ..., 3
        ]

    free = lines(None).astype(float)
    lit = free > 40
    middle = float(np.linalg.norm(np.subtract(camera.position, camera.target)))
    assert lit.sum() > 100
    share = {}
    for name, way in {"before": -20, "inside": 0, "behind": 20, "none": -middle}.items():
        # other pixels than the picture has, as while things move
        depth = gpu.texture2d(
            (31, 23), 1, np.full((23, 31), middle + way, np.float32), "f4", linear=False
        )
        share[name] = lines(depth)[lit] / free[lit]
        depth.release()
    assert share["before"] == pytest.approx(boxes.COVERED, abs=0.03)
    assert share["behind"] == pytest.approx(1)
    assert share["none"] == pytest.approx(1)
    covered = share["inside"] < 0.3
    assert 0.2 < covered.mean() < 0.8  # the farther side and what goes there
    assert (covered | (share["inside"] == 1)).mean() > 0.95
    gpu.release_framebuffer(target)
    content.release()
