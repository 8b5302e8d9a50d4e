"""Draw surfaces: all opaque ones, or the next layer of translucent ones."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from volviz.gpu import shaders
from volviz.gpu.checked import Gpu
from volviz.gpu.meshes import MeshBuffers, Meshes
from volviz.gpu.pace import Pace
from volviz.gpu.passes.view import View, subpixel
from volviz.model.camera import Camera
from volviz.model.frame import DrawnMesh, Frame
from volviz.model.transfer import srgb_to_linear

KEYS = (1 << 22) - 256
"""Places along a ray that are told apart (surface.frag's LAST_KEY); the rest tells surfaces apart
that lie in the same place: each is drawn one key behind the one before."""
MARGIN = 32
"""Pixels around a tile in which the middle of a point may lie that reaches into it."""
SLACK = 256.0
"""Keys by which a box may be off: rounding, and the places of surfaces among each other."""
BLOCK = 16
"""Pixels across a block of `left_behind`."""
LINE, LINE_PART = 1.0, 1e-3
"""Width of an edge of a wireframe: pixels, or of the smaller side of large pictures, so that they
look as they do with fewer pixels."""
PART, PART_SECONDS = 3 << 17, 0.025
"""Indices (of whole triangles) that the processor draws at most at once, about so long."""
LEAST = 3 << 12
POINTS_THICK = 2.0
"""Smallest spacings behind a point in which others of its surface are the same layer."""
NEAR = 1e-4
"""Of the way to the farthest thing: nothing nearer to the camera is drawn."""
SHADINGS = {"flat": "flat", "gouraud": "gouraud", "phong": "phong"}
WIRES = {
    "off": "wire_off",
    "overlay": "wire_overlay",
    "only": "wire_only",
    "hidden-line": "wire_hidden",
}


@dataclass(frozen=True)
class Keys:
    """Places along the rays of a frame, t in its spacing: key = ⌊(t − start) · per⌋ + 1."""

    start: float
    per: float

    @property
    def place(self) -> tuple[float, float]:
        """t = key · x + y, for the middle of a key."""
        return 1.0 / self.per, self.start - 0.5 / self.per


@dataclass(frozen=True)
class Layer:
    """What peeling needs to know: the layer's number; keys of the one before and of the opaque; the
    light gathered down to the one before; the opacity behind which nothing is seen. left: as
    `left_behind` gives it, None where asking costs more than drawing."""

    number: int
    before: moderngl.Texture
    opaque: moderngl.Texture
    gathered: moderngl.Texture
    termination: float
    left: NDArray[np.float32] | None = None


def keys_of(frame: Frame, meshes: Meshes) -> Keys:
    """From the nearest to the farthest place where a surface of this frame may be."""
    spans = [
        _reach(frame.camera, meshes.buffers(m.mesh).bounds)
        for m in frame.meshes
        if not m.mesh.empty
    ]
    near = min(s[0] for s in spans) / frame.spacing
    far = max(s[1] for s in spans) / frame.spacing
    room = max(far - near, 1e-6 * max(abs(near), abs(far)), 1e-12)
    return Keys(near - 0.001 * room, KEYS / (1.002 * room))


def draw(
    gpu: Gpu,
    meshes: Meshes,
    frame: Frame,
    view: View,
    *,
    target: moderngl.Framebuffer,
    keys: Keys,
    pace: Pace,
    layer: Layer | None = None,
) -> Iterator[None]:
    """Draw the opaque surfaces, or those of a translucent layer, into a framebuffer.

    It has colour (premultiplied linear light), a number (the key) and depth, and is clear. Its
    corner is that of the view's tile. In parts, if the processor draws: between two of them
    anything else may be drawn. pace: of indices.
    """
    left = most = _most(gpu, pace)
    start = time.perf_counter()
    for number, drawn in enumerate(frame.meshes):
        if drawn.opaque is not (layer is None) or drawn.mesh.empty:
            continue
        buffers = meshes.buffers(drawn.mesh)
        target.use()
        behind = None if layer is None else layer.left
        runs = _seen(buffers, _common(gpu, frame, view, keys), keys, behind)
        while runs:
            if left <= 0:
                gpu.ctx.finish()
                pace.took(most, time.perf_counter() - start)
                yield
                left = most = _most(gpu, pace)
                start = time.perf_counter()
            part = _taken(runs, left)
            target.use()
            common = _common(gpu, frame, view, keys)
            _draw_one(gpu, buffers, drawn, (common, keys, number, part), layer)
            left -= sum(count for _, count in part)
    gpu.check("drawing surfaces")


def _most(gpu: Gpu, pace: Pace) -> int:
    """Indices to draw at once, of whole triangles."""
    if not gpu.software:
        return 1 << 62
    return min(max(pace.amount() // 3 * 3, LEAST), PART)


def _taken(runs: list[tuple[int, int]], most: int) -> list[tuple[int, int]]:
    """The next runs of so many indices, no longer in the list; a long run is cut."""
    part: list[tuple[int, int]] = []
    while runs and most > 0:
        first, count = runs.pop(0)
        now = min(count, most)
        part.append((first, now))
        if now < count:
            runs.insert(0, (first + now, count - now))
        most -= now
    return part


def _draw_one(
    gpu: Gpu,
    buffers: MeshBuffers,
    drawn: DrawnMesh,
    where: tuple[dict[str, Any], Keys, int, list[tuple[int, int]]],
    layer: Layer | None,
) -> None:
    common, keys, number, runs = where
    gpu.ctx.enable_only(moderngl.DEPTH_TEST | moderngl.PROGRAM_POINT_SIZE)
    if layer is not None:
        layer.before.use(0)
        layer.opaque.use(1)
        layer.gathered.use(2)
    look = drawn.look
    program = _program(gpu, buffers, drawn, peel=layer is not None)
    color = srgb_to_linear(look.color if drawn.color is None else drawn.color)
    values: dict[str, Any] = {
        **common,
        "u_keys": (keys.start, keys.per, 1.0 + number),
        "u_color": (*(float(c) for c in color), look.opacity),
        "u_painted": 1.0 if drawn.color is None else 0.0,
        "u_material": (*common["u_material"], look.highlight, look.gloss),
        "u_point": look.point_size,
        "u_apart": buffers.apart * float(np.linalg.norm(common["u_axes"][0])),
    }
    if buffers.points:
        values["u_round"] = 1.0 if look.point_size >= 3 else 0.0
    if look.wireframe != "off" and not buffers.points:
        values["u_line"] = max(LINE, LINE_PART * min(common["u_size"]))
    if layer is not None:
        values |= {"u_before": 0, "u_opaque": 1, "u_gathered": 2, "u_layer": layer.number}
        values["u_termination"] = layer.termination
        values["u_thick"] = POINTS_THICK * keys.per if buffers.points else 0.0
    shaders.set_uniforms(program, **values)
    if look.sides != "both" and not buffers.points:
        gpu.ctx.enable(moderngl.CULL_FACE)
        gpu.ctx.cull_face = "back" if look.sides == "front" else "front"
    kind = moderngl.POINTS if buffers.points else moderngl.TRIANGLES
    array = buffers.array(program)
    for first, count in runs:
        array.render(kind, vertices=count, first=first)
    array.release()
    gpu.ctx.enable_only(moderngl.NOTHING)


def _program(gpu: Gpu, buffers: MeshBuffers, drawn: DrawnMesh, *, peel: bool) -> moderngl.Program:
    look = drawn.look
    shading = look.shading if "normals" in buffers.buffers else "flat"
    wire = look.wireframe
    if buffers.points:
        shading, wire = "points", "off"
    vertex = "gouraud_vertex" if shading == "gouraud" else "pixel_vertex"
    return shaders.program(
        gpu,
        "surface/surface.vert",
        "surface/surface.frag",
        {
            "@shading": f"surface/{shading}.glsl",
            "@shading_vertex": f"surface/{vertex}.glsl",
            "@place": f"surface/{'on_disc' if buffers.points else 'on_triangle'}.glsl",
            "@wire": f"surface/{WIRES[wire]}.glsl",
            "@layer": f"surface/{'peel' if peel else 'nearest'}.glsl",
        },
        geometry=None if wire == "off" else "surface/wire.geom",
    )


def _common(gpu: Gpu, frame: Frame, view: View, keys: Keys) -> dict[str, Any]:
    """Uniforms that are the same for all surfaces."""
    camera, light = frame.camera, frame.light
    width, height = view.size
    perspective = camera.projection == "perspective"
    shift = subpixel(view.sample) if view.antialias else (0.0, 0.0)
    x, y, w, h = view.tile
    gpu.ctx.viewport = (-MARGIN, -MARGIN, w + 2 * MARGIN, h + 2 * MARGIN)
    far = keys.start + KEYS / keys.per
    half = camera.half(width / height)
    return {
        "u_eye": camera.position,
        "u_axes": np.stack(camera.axes()) / frame.spacing,
        "u_half": half if perspective else tuple(n / frame.spacing for n in half),
        "u_perspective": 1.0 if perspective else 0.0,
        "u_near": NEAR * far if perspective else 0.0,
        "u_size": (float(width), float(height)),
        "u_shift": shift,
        "u_tile": tuple(map(float, (x - MARGIN, y - MARGIN, w + 2 * MARGIN, h + 2 * MARGIN))),
        "u_material": (light.ambient, light.diffuse),
        "u_lamp": tuple(light.direction()),
    }


def left_behind(
    before: NDArray[np.float32] | None, opaque: NDArray[np.float32]
) -> NDArray[np.float32]:
    """float32[2, y, x]: of each BLOCK² pixels the keys between which something may be left, least
    and greatest; from infinity where nothing is. before: float32[h, w], keys of the layer before
    (0: rays had ended), None for the first. opaque: keys of what ends the rays, or 0."""
    after = np.zeros_like(opaque) if before is None else np.where(before > 0, before, np.inf)
    until = np.where(np.isinf(after), 0, np.where(opaque > 0, opaque, np.inf))
    h, w = opaque.shape
    room = -(-h // BLOCK) * BLOCK, -(-w // BLOCK) * BLOCK
    found = []
    for keys, fill, reduce in ((after, np.inf, np.min), (until, 0.0, np.max)):
        padded = np.full(room, fill, np.float32)
        padded[:h, :w] = keys
        found.append(reduce(padded.reshape(room[0] // BLOCK, BLOCK, -1, BLOCK), axis=(1, 3)))
    return np.stack(found)


def _seen(
    buffers: MeshBuffers,
    common: dict[str, Any],
    keys: Keys,
    left: NDArray[np.float32] | None,
) -> list[tuple[int, int]]:
    """(first, count) of the runs of pieces of which something may be seen in the tile."""
    low, high = buffers.boxes[:, 0], buffers.boxes[:, 1]
    picks = np.array(np.meshgrid([0, 1], [0, 1], [0, 1])).reshape(3, 8).T  # [8, 3]
    corners = np.where(picks[None], high[:, None], low[:, None]).astype(np.float64)
    eye = (corners - np.array(common["u_eye"])) @ common["u_axes"].T
    w = -eye[..., 2] if common["u_perspective"] else np.ones(eye.shape[:2])
    behind = (w <= common["u_near"]).any(axis=1)
    (x, y, wide, upright) = common["u_tile"]
    ndc = eye[..., :2] / np.array(common["u_half"]) / np.where(w > 0, w, 1.0)[..., None]
    pixel = 0.5 * np.array(common["u_size"]) * (ndc + 1.0) - (x, y)
    least, most = pixel.min(axis=1) - 1.0, pixel.max(axis=1) + 1.0
    shown = (most >= 0).all(axis=1) & (least <= (wide, upright)).all(axis=1)
    if left is not None:
        depth = np.linalg.norm(eye, axis=2) if common["u_perspective"] else -eye[..., 2]
        nearest = depth.min(axis=1)
        if common["u_perspective"]:  # a side of a box may be nearer than its corners
            eye_at = np.array(common["u_eye"])
            inside = (np.clip(eye_at, low, high) - eye_at) @ common["u_axes"].T
            nearest = np.linalg.norm(inside, axis=1)
        first = (nearest - keys.start) * keys.per - SLACK
        last = (depth.max(axis=1) - keys.start) * keys.per + SLACK
        for i in np.flatnonzero(shown & ~behind):
            a = np.maximum((least[i] - MARGIN) // BLOCK, 0).astype(int)
            b = np.maximum((most[i] - MARGIN) // BLOCK + 1, 0).astype(int)
            after, until = left[:, a[1] : b[1], a[0] : b[0]]
            shown[i] = bool(((after < last[i]) & (until > first[i])).any())
    seen = np.concatenate([[False], behind | shown, [False]])
    ends = np.flatnonzero(seen[1:] != seen[:-1])
    step, total = buffers.per_piece, buffers.count
    return [
        (int(a) * step, min(int(b) * step, total) - int(a) * step)
        for a, b in zip(ends[::2], ends[1::2], strict=True)
    ]


def _reach(camera: Camera, bounds: NDArray[np.float32]) -> tuple[float, float]:
    """Least and greatest way along a ray to a box, mm; bounds: float32[2, 3]."""
    position = np.array(camera.position)
    low, high = bounds.astype(np.float64)
    corners = np.array(
        [[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])]
    )
    if camera.projection == "perspective":
        nearest = float(np.linalg.norm(position - np.clip(position, low, high)))
        return nearest, float(np.linalg.norm(corners - position, axis=1).max())
    along = (position - corners) @ camera.axes()[2]
    return float(along.min()), float(along.max())
