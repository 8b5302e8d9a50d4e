"""The README's pictures: `python -m tests.gallery.pictures`. From samples and free data only."""

from pathlib import Path

import volviz
from tests.conftest import DATA
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


def main() -> None:
    """Draw what can be drawn here."""
    for name, (where, look) in PICTURES.items():
        if not where.startswith("sample:"):
            where = str(DATA / where)
        scene = volviz.Scene.of(open_volume(where), aspect=SIZE[0] / SIZE[1], **look)
        volviz.render(scene, SIZE, samples=16).save(HERE / f"{name}.png")


if __name__ == "__main__":
    main()
