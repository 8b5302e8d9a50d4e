"""Surfaces against closed forms: where they are, how they are lit, what shines through them."""

from __future__ import annotations

import gc
from dataclasses import replace

import numpy as np
import pytest

from tests.gpu import oracles
from tests.gpu import surface_oracles as so
from volviz.gpu.gathering import Gathering
from volviz.gpu.passes import surface
from volviz.gpu.passes import view as view_module
from volviz.gpu.passes.view import View
from volviz.gpu.renderer import Renderer
from volviz.gpu.still import Still
from volviz.model.mesh import Mesh
from volviz.model.scene import Background
from volviz.model.surface_look import SurfaceLook


@pytest.fixture(scope="module")
def renderer(gpu):
    made = Renderer(gpu)
    yield made
    made.release()


@pytest.mark.parametrize("projection", oracles.PROJECTIONS)
@pytest.mark.parametrize("shading", ["flat", "gouraud", "phong"])
def test_a_sphere_is_where_and_as_it_should_be(renderer, projection, shading):
    so.check_sphere(renderer, projection, shading)


@pytest.mark.parametrize("projection", oracles.PROJECTIONS)
@pytest.mark.parametrize("grid", oracles.GRIDS)
def test_rays_end_at_an_opaque_surface(renderer, grid, projection):
    so.check_plane_in_medium(renderer, grid, projection)


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("volume", [True, False])
@pytest.mark.parametrize("count", [1, 2, 3, 20])
def test_translucent_layers_are_in_order_from_both_sides(renderer, side, count, volume):
    so.check_layers(renderer, side, count, volume)


def plate_of_points() -> Mesh:
    x, z = np.meshgrid(np.arange(12.0), np.arange(12.0))
    at = np.stack([x.ravel() + 4, np.full(144, 8.0), z.ravel() + 2], axis=1)
    return Mesh(at, normals=np.tile([0.0, -1.0, 0.0], (144, 1)))


@pytest.mark.parametrize("projection", oracles.PROJECTIONS)
@pytest.mark.parametrize("side", [12, 60, 150])
def test_points_leave_no_holes_however_near(renderer, projection, side):
    setup = so.medium(light=replace(so.DARK, ambient=1.0))
    camera = replace(setup.camera, position=(9.5, -40, 7.5), target=(9.5, 8, 7.5), up=(0, 0, 1))
    camera = replace(camera, projection=projection, height=20.0, fov=24.0)
    plate = so.drawn(plate_of_points(), (1, 1, 1), point_size=1, highlight=0)
    frame = so.frame_of(replace(setup, camera=camera), plate, volume=False)
    alpha = so.light_of(renderer, frame, (side, side))[..., 3]
    middle = slice(side // 3, side - side // 3)
    assert (alpha[middle, middle] == 1).all()
    assert (alpha == 0).mean() > 0.3


def test_points_beside_each_other_are_one_translucent_layer(renderer):
    setup = so.medium(light=replace(so.DARK, ambient=1.0))
    camera = replace(setup.camera, position=(-10, -40, 20), target=(9.5, 8, 7.5), up=(0, 0, 1))
    plate = so.drawn(plate_of_points(), (1, 1, 1), opacity=0.4, highlight=0)
    frame = so.frame_of(replace(setup, camera=camera), plate, volume=False)
    alpha = so.light_of(renderer, frame, (50, 50))[..., 3]
    assert (alpha > 0).sum() > 100
    np.testing.assert_allclose(alpha[alpha > 0], 0.4, atol=1e-3)


@pytest.mark.parametrize("projection", oracles.PROJECTIONS)
@pytest.mark.parametrize("opaque", [True, False])
def test_a_maximum_lies_whole_behind_translucent_layers(renderer, projection, opaque):
    so.check_maximum(renderer, projection, opaque)


def test_layers_beyond_the_most_are_left_out_from_behind(renderer):
    setup = so.medium(light=replace(so.DARK, ambient=1.0))
    camera = replace(setup.camera, position=(9.5, -60, 7.5), target=(9.5, 8.5, 7.5))
    setup = replace(setup, camera=camera)
    many = [
        so.drawn(so.quad((9.5, y, 7.5), (30, 0, 0), (0, 0, 30)), (1, 1, 1), opacity=0.01)
        for y in np.linspace(0, 16, 50)
    ]
    shown = so.light_of(renderer, so.frame_of(setup, *many, volume=False), (5, 5))[2, 2]
    assert shown[3] == pytest.approx(1 - 0.99**32, abs=1e-4)


def test_what_is_opaque_hides_and_what_is_in_front_shines_on_it(renderer):
    setup = so.medium(light=replace(so.DARK, ambient=1.0))
    camera = replace(setup.camera, position=(9.5, -60, 7.5), target=(9.5, 8.5, 7.5))
    setup = replace(setup, camera=camera)
    quads = {y: so.quad((9.5, y, 7.5), (30, 0, 0), (0, 0, 30)) for y in (2.0, 6.0, 9.0)}
    red = so.drawn(quads[2.0], (1, 0, 0), opacity=0.25, highlight=0)
    green = so.drawn(quads[6.0], (0, 1, 0), highlight=0)
    blue = so.drawn(quads[9.0], (0, 0, 1), opacity=0.5, highlight=0)
    shown = so.light_of(renderer, so.frame_of(setup, blue, green, red, volume=False), (5, 5))
    assert shown[2, 2] == pytest.approx([0.25, 0.75, 0, 1], abs=1e-5)


def test_surfaces_in_the_same_place_are_all_there(renderer):
    """One field, one isovalue, twice: neither swallows the other."""
    setup = so.medium(light=replace(so.DARK, ambient=1.0))
    ball = so.sphere()
    both = [so.drawn(ball, (1, 1, 1), opacity=0.5, highlight=0, sides="front") for _ in range(2)]
    camera = replace(setup.camera, target=tuple(so.CENTRE))
    frame = so.frame_of(replace(setup, camera=camera), *both, volume=False)
    middle = so.light_of(renderer, frame, (31, 31))[15, 15]
    assert middle[3] == pytest.approx(0.75, abs=1e-6)


def test_both_sides_are_lit_alike(renderer):
    setup = so.medium(light=so.LAMP)
    axes = so.eye_of(setup.camera)
    front = so.quad((9, 8, 7), 4 * axes[0], 4 * axes[1])
    back = so.quad((9, 8, 7), -4 * axes[0], 4 * axes[1])
    pictures = [
        so.light_of(renderer, so.frame_of(setup, so.drawn(m, shading=s, highlight=0), volume=False))
        for m in (front, back)
        for s in ("flat", "gouraud", "phong")
    ]
    for picture in pictures[1:]:
        assert np.abs(picture - pictures[0]).max() < 1e-3
    assert pictures[0][20, 20, :3].min() > 0.05
    for sides, wanted in (("front", 1.0), ("back", 0.0)):
        shown = so.light_of(renderer, so.frame_of(setup, so.drawn(front, sides=sides)))
        alone = so.light_of(
            renderer, so.frame_of(setup, so.drawn(front, sides=sides), volume=False)
        )
        assert alone[20, 20, 3] == wanted
        assert shown[20, 20, 3] > 0.4


def test_wireframes_are_seen(renderer):
    setup = so.medium(light=replace(so.DARK, ambient=1.0))
    axes = so.eye_of(setup.camera)
    wall = so.quad((9, 8, 7), 6 * axes[0], 6 * axes[1])
    off, overlay, only = (
        so.light_of(
            renderer,
            so.frame_of(setup, so.drawn(wall, (1, 1, 1), wireframe=w, highlight=0), volume=False),
            (80, 80),
        )
        for w in ("off", "overlay", "only")
    )
    inside = off[..., 3] == 1
    ink = inside & (overlay[..., 0] < 0.5)
    lines = only[..., 3] == 1
    assert 0.01 < ink.sum() / inside.sum() < 0.25
    assert 0.01 < lines.sum() / inside.sum() < 0.25
    assert (lines & ink).sum() > 0.5 * lines.sum()


def lines_of(renderer, mesh, wireframe, *, turn=0.0, size=90, **look):
    """Light of white edges seen straight on, the mesh turned about the way to the viewer."""
    setup = so.medium(light=replace(so.DARK, ambient=1.0))
    setup = replace(setup, camera=oracles.looking(setup.volume, "orthographic"))
    right, up, _ = so.eye_of(setup.camera)
    c, s = np.cos(turn), np.sin(turn)
    made = mesh(setup.camera.target, c * right + s * up, c * up - s * right)
    one = so.drawn(made, (1, 1, 1), wireframe=wireframe, highlight=0, **look)
    frame = so.frame_of(setup, one, volume=False)
    return renderer.light(frame, (size, size), samples=32), setup.camera.height / size


@pytest.mark.parametrize("wireframe", ["only", "hidden-line", "overlay"])
@pytest.mark.parametrize("turn", [0.0, 0.4, 1.2])
def test_lines_are_a_pixel_wide_whichever_way_they_go(renderer, wireframe, turn):
    """By their area: a diagonal between two triangles, four edges that one triangle has."""

    def wall(middle, across, up):
        return so.quad(middle, 6 * across, 4 * up)

    light, pixel = lines_of(renderer, wall, wireframe, turn=turn)
    length = (np.hypot(12, 8) + 0.5 * 2 * (12 + 8)) / pixel
    filled = {"only": 0.0, "hidden-line": 0.07, "overlay": 1.0}[wireframe]
    if wireframe == "overlay":
        area = (light[..., 3] - light[..., 0]).sum() / (0.7 * 0.92)
    else:
        area = (light[..., 3] - filled).clip(0).sum() / (1 - filled)
    assert area == pytest.approx(length, rel=0.1)


def test_lines_are_wider_in_pictures_of_more_pixels(renderer, monkeypatch):
    """As large as on paper or on a screen with smaller pixels."""

    def wall(middle, across, up):
        return so.quad(middle, 6 * across, 4 * up)

    monkeypatch.setattr(surface, "LINE_PART", 1 / 60)
    areas = []
    for size in (60, 120):
        light, pixel = lines_of(renderer, wall, "only", size=size)
        areas.append(light[..., 3].sum() * pixel)
    assert areas[1] == pytest.approx(2 * areas[0], rel=0.1)


@pytest.mark.parametrize(
    ("wireframe", "least", "most"), [("only", 0.5, 0.9), ("hidden-line", 0.4, 0.7)]
)
def test_lines_of_small_triangles_leave_something_between_them(renderer, wireframe, least, most):
    light, _ = lines_of(renderer, lambda *_: so.sphere(rows=60, columns=120), wireframe, size=80)
    inside = light[..., 3] > 0
    assert inside.sum() > 500
    assert least < light[inside][:, 3].mean() < most


def test_hidden_lines_are_hidden(renderer):
    setup = so.medium(light=replace(so.DARK, ambient=1.0))
    setup = replace(setup, camera=oracles.looking(setup.volume, "orthographic"))
    right, up, back = so.eye_of(setup.camera)
    front = so.quad(setup.camera.target, 6 * right, 6 * up)
    behind = so.quad(setup.camera.target - 2 * back, 3 * right, 3 * up)
    for opacity in (1.0, 0.4):  # faint lines hide as well
        walls = [
            so.drawn(front, (1, 0, 0), wireframe="hidden-line", highlight=0, opacity=opacity),
            so.drawn(behind, (0, 1, 0), highlight=0),
        ]
        light = so.light_of(renderer, so.frame_of(setup, *walls, volume=False), (60, 60))
        assert (light[..., 1] == 0).all()
        assert light[22, 34] == pytest.approx(0.07 * opacity * np.array([1, 0, 0, 1]), abs=1e-6)
        assert (light[..., 0] > 0.5 * opacity).sum() > 15
        assert light[..., 3].max() <= opacity + 1e-6


@pytest.mark.parametrize("opacity", [1.0, 0.5])
def test_points_are_drawn_where_they_are(renderer, opacity):
    setup = so.medium(light=replace(so.DARK, ambient=1.0))
    setup = replace(setup, camera=oracles.looking(setup.volume, "orthographic"))
    axes = so.eye_of(setup.camera)
    at = np.array(setup.camera.target) + 3 * axes[0] + 2 * axes[1]
    cloud = so.drawn(Mesh(at[None]), (1, 1, 1), opacity=opacity, point_size=3, highlight=0)
    shown = so.light_of(renderer, so.frame_of(setup, cloud, volume=False), (60, 60))[..., 3]
    assert shown.max() == pytest.approx(opacity)
    row, column = (n.mean() for n in np.nonzero(shown))
    pixel = setup.camera.height / 60
    assert column == pytest.approx(29.5 + 3 / pixel, abs=0.7)
    assert row == pytest.approx(29.5 - 2 / pixel, abs=0.7)
    assert 4 <= np.count_nonzero(shown) <= 9


def test_nothing_and_less_than_nothing(renderer):
    """No vertices; triangles without an area; a corner behind the camera; inside a sphere."""
    setup = so.medium()
    bare = so.light_of(renderer, so.frame_of(setup))
    empty = so.drawn(Mesh(np.empty((0, 3))))
    thin = Mesh(np.array([[0, 0, 0], [5, 5, 5], [9, 9, 9], [1, 1, 1.0]]), [[0, 1, 2], [3, 3, 3]])
    for mesh in (
        empty,
        so.drawn(thin),
        so.drawn(thin, opacity=0.5),
        so.drawn(thin, shading="flat"),
    ):
        assert np.abs(so.light_of(renderer, so.frame_of(setup, mesh)) - bare).max() < 1e-6
    inside = replace(setup.camera, position=tuple(so.CENTRE), target=(20.0, 8.0, 9.0), up=(0, 0, 1))
    frame = so.frame_of(replace(setup, camera=inside), so.drawn(so.sphere()), volume=False)
    assert (so.light_of(renderer, frame)[..., 3] == 1).all()
    floor = so.quad((7, 8, 3), (900, 0, 0), (0, 900, 0))
    below = so.light_of(renderer, replace(frame, meshes=(so.drawn(floor, (1, 1, 1)),)), (21, 21))[
        ..., 3
    ]
    assert (below[12:] == 1).all()
    assert (below[:9] == 0).all()


def mixed() -> object:
    setup = so.medium(light=so.LAMP, alpha=0.03)
    meshes = (
        so.drawn(so.sphere(4.0)),
        so.drawn(so.sphere(6.0), (0.3, 0.6, 0.9), opacity=0.4),
        so.drawn(so.sphere(2.0, centre=so.CENTRE + 5), opacity=0.6, wireframe="overlay"),
    )
    frame = replace(so.frame_of(setup, *meshes), background=Background.plain((0.1, 0.2, 0.3)))
    return replace(frame, raycast=replace(frame.raycast, samples=2, jitter=1.0))


@pytest.mark.parametrize("block", [97 * 61, 97 * 20, 15 * 11])
def test_every_way_to_draw_gives_the_same_bits(gpu, renderer, monkeypatch, block):
    """However quick the draws are: a scene opened again is the same picture. Of several blocks,
    whose edges hang on the size alone, it may differ by a rounding from that of one."""
    frame, size = mixed(), (97, 61)
    whole = renderer.image(frame, size)
    monkeypatch.setattr(view_module, "BLOCK_PIXELS", block)
    monkeypatch.setattr(view_module, "BLOCK_WIDTH", max(block // 61, 15))
    wanted = renderer.image(frame, size)
    off = np.abs(wanted.astype(int) - whole)
    assert off.max() <= 1
    assert (off == 0).mean() > 0.999
    still = Still(gpu, renderer.resident, frame, size)
    while not still.advance(0.01):
        pass
    assert np.array_equal(still.pixels, wanted)
    for budget in (0.0, 0.05):
        progressive = renderer.progressive()
        progressive.coarse(frame, size, 0.05)
        while not progressive.refine(frame, size, budget).done:
            pass
        assert np.array_equal(progressive.pixels(), wanted)
        progressive.release()


def test_pictures_larger_than_the_part_before_and_smaller(renderer):
    frame = mixed()
    for size in ((30, 20), (64, 48), (1, 1), (300, 3)):
        shown = renderer.image(frame, size)
        assert shown.shape == (size[1], size[0], 4)


def test_software_leaves_nothing_out(renderer, monkeypatch):
    """Pieces that nothing can be seen of are left out, and only those."""
    frame = mixed()
    lean = renderer.light(frame, (120, 90))
    monkeypatch.setattr("volviz.gpu.layers.Layers._left", lambda *_: None)
    assert np.array_equal(renderer.light(frame, (120, 90)), lean)


def test_meshes_go_when_nobody_holds_them(gpu):
    renderer = Renderer(gpu)
    gc.collect()
    gpu.activate()
    before = gpu.live["buffers"]
    frame = mixed()
    renderer.image(frame, (20, 20))
    assert gpu.live["buffers"] == before + 9
    del frame
    gc.collect()
    gpu.activate()
    assert gpu.live["buffers"] == before
    renderer.release()


def test_meshes_come_in_pieces(gpu):
    renderer = Renderer(gpu)
    mesh = so.sphere(rows=500, columns=500)
    parts = []
    while (done := renderer.resident.meshes.upload([mesh], 0.0)) < 1:
        parts.append(done)
    assert len(parts) >= 4
    assert parts == sorted(parts)
    bounds = renderer.resident.meshes.buffers(mesh).bounds
    assert np.array_equal(bounds, mesh.bounds.astype(np.float32))
    renderer.release()


def test_colours_of_the_mesh(renderer):
    setup = so.medium(light=replace(so.DARK, ambient=1.0))
    axes = so.eye_of(setup.camera)
    wall = so.quad((9, 8, 7), 6 * axes[0], 6 * axes[1])
    painted = replace(wall, colors=np.tile(np.array([188, 0, 0, 128], np.uint8), (4, 1)))
    one = so.DrawnMesh(painted, SurfaceLook(highlight=0), None)
    assert not one.opaque
    shown = so.light_of(renderer, so.frame_of(setup, one, volume=False))[20, 20]
    half = 128 / 255
    red = float(oracles.srgb_to_linear(188 / 255))
    assert shown == pytest.approx([half * red, 0, 0, half], abs=1e-4)


@pytest.mark.parametrize("opacity", [1.0, 0.4])
def test_parts_of_very_many_triangles_do_not_show(renderer, monkeypatch, opacity):
    """Between two parts the window draws other things: here, a picture of something else."""
    setup = so.medium(light=replace(so.DARK, ambient=1.0))
    quads = [so.quad((9.5, y, 7.5), (12, y, 0), (0, 0, 12)) for y in (2.0, 6.0, 9.0)]
    meshes = [
        so.drawn(q, (y / 3, 1, 0.5), opacity=opacity, highlight=0) for y, q in enumerate(quads)
    ]
    frame, other = so.frame_of(setup, *meshes), so.frame_of(setup, meshes[1])
    wanted = renderer.image(frame, (30, 20), samples=1)
    monkeypatch.setattr(surface, "PART", 3)
    gathering = Gathering(renderer.gpu, renderer.resident, View.whole((30, 20)))
    steps = 1
    while not gathering.step(frame, 20):
        steps += 1
        renderer.image(other, (7, 5))
    target = renderer.gpu.framebuffer((30, 20), "f1")
    gathering.samples = 1
    gathering.show(target, frame.background)
    raw = np.frombuffer(target.read(components=4, alignment=1), np.uint8).reshape(20, 30, 4)
    renderer.gpu.release_framebuffer(target)
    gathering.release()
    assert steps >= 3
    assert np.array_equal(raw[::-1], wanted)
