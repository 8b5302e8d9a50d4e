"""`python -m tests.bench stills OUT`: surfaces of a real CT beside the same scene in VTK.


One PNG a scene: ours on the left, VTK on the right (Flying Edges, Phong, dual depth peeling, its
GPU mapper for the volume), from the same voxels, camera, isovalues, colours and lamp. VTK blends
and lights what it is given as it is; so it is given linear light, and its picture is encoded as
ours is. Printed: overlap of what is covered (IoU), root mean square of the difference in grey
levels and in the depth of the nearest surface (mm), median of that, where both have something.
The ends of the highlights differ: VTK's are Phong's, ours Blinn's.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import volviz
from volviz.model.surface import METHODS
from volviz.model.surface_look import COLORS, SceneSurface
from volviz.model.transfer import TransferFunction
from volviz.model.views import volume_camera

DATA = Path(__file__).resolve().parents[2].parent / "shared" / "data"
FILE = "ct/cranium_head_ct.nrrd"
BONE, SKIN = 300.0, -300.0
SIZE = (480, 480)
TISSUE = TransferFunction(
    ((-300, 0.88, 0.62, 0.50), (300, 0.93, 0.88, 0.76)),
    ((-400, 0.0), (-200, 0.004), (250, 0.012), (900, 0.05)),
)
_BONE, _SKIN = {"color": COLORS[0]}, {"color": COLORS[1]}


@dataclass(frozen=True)
class Still:
    """surfaces: isovalue and knobs of each. volume: also cast. view: azimuth, elevation, zoom."""

    surfaces: tuple[tuple[float, dict[str, Any]], ...]
    volume: bool = False
    view: tuple[float, float, float] = (-30.0, 5.0, 1.7)

    def scene(self, volume: volviz.Volume) -> volviz.Scene:
        """The scene, with the lamp at the camera, on black."""
        azimuth, elevation, zoom = self.view
        camera = volume_camera(volume, azimuth=azimuth, elevation=elevation, zoom=zoom)
        scene = volviz.Scene.of(volume).with_camera(camera)
        scene = scene.with_surfaces([SceneSurface.at(v, **knobs) for v, knobs in self.surfaces])
        scene = replace(scene, transfer=TISSUE) if self.volume else scene
        scene = scene.with_knobs(
            show_volume=self.volume, light_azimuth=0.0, light_elevation=0.0, shading="none"
        )
        return scene.with_background(0, 0, 0, 0)


STILLS: dict[str, Still] = {
    **{f"{m}": Still(((SKIN, {"method": m, **_SKIN}),)) for m in METHODS},
    **{f"{m}-bone": Still(((BONE, {"method": m, **_BONE}),)) for m in METHODS},
    "flat": Still(((BONE, {"shading": "flat", **_BONE}),)),
    "gouraud": Still(((BONE, {"shading": "gouraud", **_BONE}),)),
    "phong": Still(((BONE, {"shading": "phong", **_BONE}),)),
    "bone-in-skin": Still(((BONE, _BONE), (SKIN, {"opacity": 0.35, **_SKIN}))),
    "skin-in-bone": Still(((BONE, {"opacity": 0.5, **_BONE}), (SKIN, {"opacity": 0.3, **_SKIN}))),
    "wire-overlay": Still(((BONE, {"wireframe": "overlay", **_BONE}),), view=(-30, 5, 6.0)),
    "wire-only": Still(((BONE, {"wireframe": "only", **_BONE}),), view=(-30, 5, 6.0)),
    "back-faces": Still(((SKIN, {"sides": "back", **_SKIN}),)),
    "front-faces": Still(((SKIN, {"sides": "front", **_SKIN}),)),
    "near": Still(((SKIN, _SKIN),), view=(-20, 0, 5.0)),
    "in-volume": Still(((BONE, _BONE),), volume=True),
    "translucent-in-volume": Still(((BONE, {"opacity": 0.5, **_BONE}),), volume=True),
}


@dataclass(frozen=True, eq=False)
class Picture:
    """pixels: uint8[h, w, 3], sRGB over black. covered: float32[h, w], opacity. depth: float32[h,
    w], mm along the ray to the nearest surface, inf where there is none."""

    pixels: NDArray[np.uint8]
    covered: NDArray[np.float32]
    depth: NDArray[np.float32] = field(default_factory=lambda: np.zeros((0, 0), np.float32))


def ours(scene: volviz.Scene, size: tuple[int, int] = SIZE, samples: int = 4) -> Picture:
    """By the headless renderer."""
    image = volviz.render(scene, size, samples=samples)
    straight, alpha = image.pixels[..., :3], image.pixels[..., 3:] / np.float32(255)
    over = encoded(linear(straight) * alpha)
    return Picture(over, alpha[..., 0], our_depth(scene, size))


def our_depth(scene: volviz.Scene, size: tuple[int, int]) -> NDArray[np.float32]:
    """Of the nearest surface, opaque or not, as `Picture.depth`."""
    from volviz.gpu.contexts import shared_gpu
    from volviz.gpu.pace import Pace
    from volviz.gpu.passes import surface
    from volviz.gpu.passes.view import View
    from volviz.resolve import resolve
    from volviz.scene import renderer_of, texture_limits

    gpu = shared_gpu()
    gpu.activate()
    frame = resolve(scene, limits=texture_limits(gpu), size=size)
    solid = tuple(replace(m, look=replace(m.look, opacity=1.0)) for m in frame.meshes)
    frame, meshes = replace(frame, meshes=solid), renderer_of(gpu).resident.meshes
    target = gpu.framebuffer((size[0] + 1, size[1] + 1), "f4", depth=True, number=True)
    target.scissor = (0, 0, *size)
    target.use()
    target.clear(depth=1.0)
    keys = surface.keys_of(frame, meshes)
    view = View.whole(size, antialias=False)
    pace = Pace(1e6)
    for _ in surface.draw(gpu, meshes, frame, view, target=target, keys=keys, pace=pace):
        pass
    raw = np.frombuffer(target.read(components=1, attachment=1, dtype="f4"), np.float32)
    gpu.release_framebuffer(target)
    key = raw.reshape(size[1] + 1, size[0] + 1)[: size[1], : size[0]][::-1]
    slope, start = keys.place
    return np.where(key > 0, (key * slope + start) * frame.spacing, np.inf).astype(np.float32)


def linear(pixels: NDArray[np.uint8]) -> NDArray[np.float32]:
    """sRGB to linear light (IEC 61966-2-1)."""
    s = pixels.astype(np.float32) / 255
    return np.where(s <= 0.04045, s / 12.92, ((s + 0.055) / 1.055) ** 2.4).astype(np.float32)


def encoded(light: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Linear light to sRGB."""
    light = np.clip(light, 0, 1)
    s = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    return np.round(255 * s).astype(np.uint8)


def theirs(scene: volviz.Scene, size: tuple[int, int] = SIZE) -> Picture:
    """By VTK, in a process of its own: the OpenGL contexts of the two do not get on in one."""
    before = os.environ.get("VTK_DEFAULT_OPENGL_WINDOW")
    os.environ["VTK_DEFAULT_OPENGL_WINDOW"] = "vtkEGLRenderWindow"
    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe()
    child = context.Process(target=_serve, args=(there, scene, size))
    try:
        child.start()
        there.close()  # so that a child that dies is an error here, not a wait
        return Picture(*here.recv())
    finally:
        child.join()
        if before is None:
            del os.environ["VTK_DEFAULT_OPENGL_WINDOW"]


def _serve(pipe: Any, scene: volviz.Scene, size: tuple[int, int]) -> None:
    from tests.bench.peer_stills import draw

    pipe.send(draw(scene, size))


def agreement(a: Picture, b: Picture) -> dict[str, float]:
    """IoU of what is covered; RMS of grey levels where either is; RMS and median of depth, mm."""
    here, there = a.covered > 0.5 / 255, b.covered > 0.5 / 255
    either = here | there
    gray = [p.pixels.astype(np.float64).mean(axis=2)[either] for p in (a, b)]
    both = np.isfinite(a.depth) & np.isfinite(b.depth)
    apart = (a.depth[both] - b.depth[both]).astype(np.float64)
    either_deep = (np.isfinite(a.depth) | np.isfinite(b.depth)).sum()
    return {
        "covered": float((here & there).sum() / max(either.sum(), 1)),
        "silhouette": float(both.sum() / max(either_deep, 1)),
        "gray": float(np.sqrt(np.mean((gray[0] - gray[1]) ** 2))) if either.any() else 0.0,
        "depth": float(np.sqrt(np.mean(apart**2))) if both.any() else 0.0,
        "depth_median": float(np.median(np.abs(apart))) if both.any() else 0.0,
    }


def main(arguments: list[str]) -> None:
    """Draw the chosen stills into a folder and print how they agree."""
    parser = argparse.ArgumentParser(prog="python -m tests.bench stills")
    parser.add_argument("out", type=Path, help="folder for the pictures")
    parser.add_argument("stills", nargs="*", help=f"any of {', '.join(STILLS)}")
    parser.add_argument("--file", default=str(DATA / FILE))
    parser.add_argument("--size", type=int, default=SIZE[0])
    chosen = parser.parse_args(arguments)
    from PIL import Image

    chosen.out.mkdir(parents=True, exist_ok=True)
    volume, size = volviz.load(chosen.file), (chosen.size, chosen.size)
    print("| still | covered | silhouette | gray RMS | depth RMS | median |\n" + "|---" * 6 + "|")
    for name in chosen.stills or STILLS:
        scene = STILLS[name].scene(volume)
        left, right = ours(scene, size), theirs(scene, size)
        both = np.concatenate([left.pixels, right.pixels], axis=1)
        Image.fromarray(both).save(chosen.out / f"{name}.png")
        found = agreement(left, right)
        print(f"| {name} | " + " | ".join(f"{v:.3f}" for v in found.values()) + " |", flush=True)
