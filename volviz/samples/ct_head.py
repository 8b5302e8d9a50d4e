"""A head as computed tomography shows it, modelled by code: known anatomy, known Hounsfield units.

The world is LPS millimetres with the origin between the ear canals and the Frankfurt plane at
z = 0. Blur and noise are those of a scanner; the anatomy never changes, the noise has a seed.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from volviz.model.volume import Dims, Volume, affine_of
from volviz.samples.head.bones import relief, skull, tables
from volviz.samples.head.brain import CANAL, CORD, paint_brain
from volviz.samples.head.canvas import MATERIALS, Canvas
from volviz.samples.head.skin import SKIN_PARTS, VAULT_PARTS
from volviz.samples.head.soft import paint_soft
from volviz.samples.head.teeth import filling, paint_teeth
from volviz.samples.noise import Lattice, blur, gaussian_taps
from volviz.samples.shapes import Array, Grid, carve
