"""The copy that thumbnails are drawn of: few samples, the same place, the same values."""

from __future__ import annotations

import numpy as np
import pytest

import volviz
from volviz.model.scene import box_corners
from volviz.ui import thumbnails
from volviz.ui.desktop import hovering
from volviz.ui.panels import view


@pytest.mark.parametrize("shape", [(600, 70, 20), (150, 150, 150), (5, 6, 7), (1, 700, 300)])
def test_few_samples_of_the_same_place(shape):
    z, y, x = np.ogrid[: shape[0], : shape[1], : shape[2]]
    ramp = (x + 2.0 * y + 3.0 * z).astype(np.float32)
    spacing, origin = (0.5, 1.0, 2.0), (-7.0, 3.0, 11.0)
    whole = volviz.Volume.from_array(ramp, spacing, origin=origin)
    few = thumbnails.few_samples(whole)
    assert max(few.dims) <= thumbnails.EDGE
    shrunk = [-(-n // m) for n, m in zip(whole.dims, few.dims, strict=True)]
    reach = 1.5 * np.array(spacing) * shrunk
    assert (np.abs(box_corners(few) - box_corners(whole)) <= reach + 1e-9).all()
    # a value says where its sample is: inside, block means of a ramp stand where the affine says
    inner = tuple(slice(0, max(n - 1, 1)) for n in few.data.shape)
    index = np.argwhere(np.ones(few.data[inner].shape, bool))[:, ::-1]
    place = index @ few.affine[:3, :3].T + few.affine[:3, 3]
    at = (place - origin) / spacing
    expected = at @ (1.0, 2.0, 3.0)
    off = np.abs(few.data[inner].reshape(-1) - expected)
    assert off.max() <= 3.0, "more than a sample off"


def test_labels_stay_labels(rng):
    labels = rng.choice([0, 7, 900], (140, 150, 160)).astype(np.uint16)
    few = thumbnails.few_samples(volviz.Volume.from_array(labels, kind="labels"))
    assert set(np.unique(few.data)) == {0, 7, 900}


def test_the_loop_stays_awake_until_a_tooltip_is_there(stage, scene):
    one = stage(view.panel, scene)
    assert not hovering()
    one.mouse = one.middle("view.reset")
    one.frame(3)
    assert hovering()
    one.frame(60)
    assert not hovering()
