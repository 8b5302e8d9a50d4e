"""The README's pictures: `python -m tests.gallery.pictures`. From samples and free data only."""

import sys
from pathlib import Path

import volviz
from tests.conftest import DATA
from volviz.cli.render import surface_color
from volviz.model.surface_words import parse
from volviz.sources import open_volume

HERE = Path(__file__).parent
SIZE = (440, 380)

# name: (volume, look); stroke and heptane: MIT, bonsai: MIT (Open SciVis data sets)
PICTURES = {
    "head": ("sample:ct-head", {"azimuth": 30, "elevation": 8}),
    "skin": ("sample:ct-head", {"preset": "ct-skin", "azimuth": 35, "elevation": 5}),
    "bone": ("sample:ct-head", {"preset": "ct-bone", "azimuth": -40, "elevation": 12}),
    "mip": ("sample:ct-head", {"mode": "mip", "view": "left"}),
    "brain": ("mri/stroke_T1_oblique.nii.gz", {"view": "left", "azimuth": -25, "elevation": 15}),
    "heptane": ("simulation/heptane_302.nii.gz", {"azimuth": 15, "elevation": 10}),
    "bonsai": ("classics/bonsai_256.nii.gz", {"azimuth": 20, "elevation": 12}),
    "plume": ("sample:plume", {}),
}
# name: (volume, look, isosurfaces as --isosurface takes them), without the volume
SURFACES = {
    "inside": (
        "sample:ct-head",
        {"azimuth": 30, "elevation": 8},
        ("300,ivory", "-300,tan,0.35"),
    ),
    "edges": (
        "sample:ct-head",
        {"azimuth": -35, "elevation": 10},
        ("300,ivory,keep_largest=yes,decimate=0.96,wireframe=overlay,shading=flat",),
    ),
    "flame": (
        "simulation/heptane_302.nii.gz",
        {},
        ("60,coloring=field,color_field=gradient-magnitude,colormap=inferno",),
    ),
    "vessel": ("sample:vessel", {}, ("200,method=contour-tracing",)),
}


def main() -> None:
    """Draw what can be drawn here, or the pictures whose names are given."""
    every = {name: (*row, ()) for name, row in PICTURES.items()} | SURFACES
    for name in sys.argv[1:] or every:
        where, look, words = every[name]
        if not where.startswith("sample:"):
            where = str(DATA / where)
        scene = volviz.Scene.of(open_volume(where), aspect=SIZE[0] / SIZE[1], **look)
        if words:
            surfaces = [parse(word, i, surface_color) for i, word in enumerate(words)]
            scene = scene.with_surfaces(surfaces).with_knobs(show_volume=False)
        volviz.render(scene, SIZE, samples=16).save(HERE / f"{name}.png")


if __name__ == "__main__":
    main()
