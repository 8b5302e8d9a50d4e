"""Every way to make a surface, as a picture: golden ones of the sample head, and a real CT.

`--regenerate-golden` writes the golden pictures anew; look at tests/artefacts/surfaces-*.png, which
these tests write, before committing. Pictures of real data stay there: their licences say no more.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from PIL import Image

import volviz
from tests.test_golden import ARTEFACTS, GOLDEN
from volviz.fields.reduce import reduced
from volviz.isosurface.extractors import EXTRACTORS
from volviz.model.surface import METHODS
from volviz.model.surface_look import COLORS, SceneSurface

FOLDER = GOLDEN / "surfaces"
SIZE, LARGE = (128, 96), (240, 200)
BONE, SKIN = 300.0, -300.0
LOOKS = {
    "skin-and-bone": ((BONE, {}), (SKIN, {"color": COLORS[1], "opacity": 0.35})),
    "skin": ((SKIN, {"color": COLORS[1]}),),
    "flat": ((BONE, {"shading": "flat"}),),
    "gouraud": ((BONE, {"shading": "gouraud"}),),
    "phong": ((BONE, {"shading": "phong"}),),
    "wireframe": ((BONE, {"wireframe": "overlay"}),),
}
"""Of the real CT: isovalues and knobs of a look."""
ALIKE = {"dividing-cubes": (0.95, 0.70), "cuberille": (0.94, 0.75)}
"""Least overlap of the silhouettes with marching cubes', and least correlation of the light."""
LEAST = (0.97, 0.72)
BLOCKS = {"cuberille", "discretized-marching-cubes"}
"""Their triangles do not lie as the surface does: flat light shows that, and is not compared."""


@cache
def head() -> volviz.Volume:
    return volviz.sample("ct-head", size=80)


def shown(volume, method, look, size, **knobs) -> volviz.Image:
    surfaces = [SceneSurface.at(v, method=method, **more) for v, more in look]
    scene = volviz.Scene.of(volume, aspect=size[0] / size[1], elevation=5, **knobs)
    scene = scene.with_surfaces(surfaces).with_knobs(show_volume=False)
    return volviz.render(scene.with_background(0, 0, 0, 0), size, samples=2)


def test_all_methods_are_drawn():
    assert set(METHODS) == set(EXTRACTORS)
    assert {p.stem for p in FOLDER.glob("*.png")} == set(METHODS)


@pytest.mark.parametrize("method", METHODS)
def test_golden(method, request):
    image = shown(head(), method, LOOKS["skin-and-bone"], SIZE, azimuth=35)
    file = FOLDER / f"{method}.png"
    if request.config.getoption("--regenerate-golden"):
        FOLDER.mkdir(exist_ok=True)
        image.save(file)
        return
    golden = np.asarray(Image.open(file).convert("RGBA")).astype(int)
    difference = np.abs(image.pixels.astype(int) - golden)
    assert image.pixels[..., 3].mean() > 30, "nothing is to be seen"
    if "llvmpipe" in image.renderer:
        within = float((difference.max(axis=-1) <= 1).mean())
        assert within >= 0.995, f"{within:.2%} within 1, max {difference.max()}"
        assert difference.mean() < 0.1
    else:
        assert difference.mean() < 5


@pytest.fixture(scope="module")
def sheet():
    """Rows of pictures, written for people when all are there."""
    rows: dict[str, list[np.ndarray]] = {}
    yield rows
    if rows:
        ARTEFACTS.mkdir(exist_ok=True)
        full = [np.concatenate(r, axis=1) for r in rows.values() if len(r) == len(METHODS)]
        if full:
            Image.fromarray(np.concatenate(full)).save(ARTEFACTS / "surfaces-real-ct.png")


@cache
def real(path) -> volviz.Volume:
    return reduced(volviz.load(path), (3, 3, 2))


@cache
def of_real(path, look: str, method: str) -> np.ndarray:
    return shown(real(path), method, LOOKS[look], LARGE, azimuth=-30).pixels


@pytest.mark.parametrize("look", LOOKS)
def test_methods_agree_on_a_real_ct(look, data, sheet):
    """Silhouette, coverage and light beside marching cubes'."""
    path = data / "ct" / "cranium_head_ct.nrrd"
    pictures = {m: of_real(path, look, m) for m in METHODS}
    sheet[look] = [_over_gray(p) for p in pictures.values()]
    first = pictures["marching-cubes"].astype(float)
    seen = first[..., 3] > 40
    assert 0.1 < seen.mean() < 0.9
    for method, pixels in pictures.items():
        there = pixels[..., 3] > 40
        overlap, alike = ALIKE.get(method, LEAST)
        assert (seen & there).sum() / (seen | there).sum() > overlap, method
        assert there.sum() == pytest.approx(seen.sum(), rel=0.10), method
        both = seen & there
        light = [p[both][:, :3].mean(axis=1) for p in (first, pixels.astype(float))]
        if look == "flat" and method in BLOCKS:
            continue
        assert np.corrcoef(light)[0, 1] > alike, method
        assert light[1].mean() == pytest.approx(light[0].mean(), rel=0.12), method


def _over_gray(pixels: np.ndarray) -> np.ndarray:
    alpha = pixels[..., 3:].astype(float) / 255
    return (pixels[..., :3] * alpha + 60 * (1 - alpha)).astype(np.uint8)
