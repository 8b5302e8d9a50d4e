"""Values stay what they are from the array to the pixel, whatever their type."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import volviz
from volviz.gpu.renderer import Renderer
from volviz.model.camera import standard_view
from volviz.model.scene import box_corners
from volviz.model.transfer import TransferFunction
from volviz.resolve import Memo, TextureLimits, resolve


@pytest.fixture(scope="module")
def renderer(gpu):
    made = Renderer(gpu)
    yield made
    made.release()


def seen(renderer, data, transfer, **more) -> np.ndarray:
    """float32[y, x, 4]: the slab data[1, y, x] a pixel a voxel, nearest value, from below."""
    volume = volviz.Volume.from_array(data, space="LPS", **more)
    camera = replace(standard_view("inferior"), projection="orthographic")
    camera = camera.fitted(box_corners(volume), margin=1.0)
    scene = volviz.Scene.of(volume).with_transfer(transfer).with_camera(camera)
    scene = scene.with_raycast(
        mode="mip", interpolation="nearest", samples=1, jitter=0.0, shading="none"
    )
    frame = resolve(scene, Memo())
    return renderer.light(frame, (data.shape[2], data.shape[1]), antialias=False)


def step_at(value) -> TransferFunction:
    """Opaque from `value` on; the step lies half a unit below it."""
    edge = value - 0.5
    opacities = ((edge - 2000, 0), (edge, 0), (edge, 1), (edge + 2000, 1))
    return TransferFunction(((edge, 1, 1, 1),), opacities)


@pytest.mark.parametrize("dtype", [np.int16, np.uint16, np.int32, np.float32, np.float64, np.int64])
def test_one_unit_apart_in_a_span_of_thousands(renderer, dtype):
    low = 0 if np.dtype(dtype).kind == "u" else -1024
    line = np.linspace(low, low + 4000, 64).astype(dtype)
    data = np.broadcast_to(line, (1, 64, 64)).copy()
    data[0, 10, :] = low + 1376
    data[0, 11, :] = low + 1377
    drawn = seen(renderer, data, step_at(low + 1377))[..., 3]
    assert (drawn[10] == 0).all()
    assert (drawn[11] == 1).all()


@pytest.mark.parametrize(
    ("dtype", "low", "high"),
    [
        (np.int8, -128, 127),
        (np.uint8, 0, 255),
        (np.int16, -32768, 32767),
        (np.uint16, 0, 65535),
        (np.int32, -70000, -69000),
        (np.uint32, 4_000_000_000, 4_000_000_500),
        (np.int64, 1 << 40, (1 << 40) + 300),
        (np.float32, -1.5, 2.5),
        (np.float32, 1e-12, 3e-12),
        (np.float64, 1e9, 1e9 + 100),
        (np.float32, -3e8, 3e8),
    ],
)
def test_values_come_out_as_they_went_in(renderer, dtype, low, high):
    """A ramp of opacity over the range reads every value back, negatives too."""
    rng = np.random.default_rng(1)
    values = low + rng.random((1, 24, 24)) * (high - low)
    data = (np.round(values) if np.dtype(dtype).kind in "iu" else values).astype(dtype)
    data[0, 0, :2] = low, high
    transfer = TransferFunction(((low, 1, 1, 1),), ((low, 0), (high, 1)))
    drawn = seen(renderer, data, transfer)[..., 3].astype(float)
    expected = (data[0].astype(float) - low) / (float(high) - low)
    assert np.abs(drawn - expected).max() < 2.5e-4


@pytest.mark.parametrize("order", [">i2", ">f4", "<u2"])
def test_byte_order_and_layout_do_not_show(renderer, order):
    rng = np.random.default_rng(2)
    native = rng.integers(0, 900, (1, 9, 11)).astype(np.dtype(order).newbyteorder("="))
    transfer = TransferFunction(((0, 1, 1, 1),), ((0, 0), (900, 1)))
    plain = seen(renderer, native, transfer)
    other = np.asfortranarray(native.astype(order))[:, ::-1][:, ::-1]
    assert np.array_equal(plain, seen(renderer, other, transfer))


def test_what_was_not_measured_is_transparent_and_does_not_bleed(renderer):
    data = np.full((1, 8, 8), 100.0, np.float32)
    data[0, 2:5, 2:5] = np.nan
    data[0, 6, 6] = np.inf
    data[0, 6, 1] = -np.inf
    opaque = TransferFunction(((0, 1, 1, 1),), ((0, 0), (99, 0), (99.5, 1), (200, 1)))
    drawn = seen(renderer, data, opaque)[..., 3]
    assert np.array_equal(drawn == 0, ~np.isfinite(data[0]))
    volume = volviz.Volume.from_array(data)
    scene = volviz.Scene.of(volume).with_transfer(opaque).with_raycast(shading="none")
    light = renderer.light(resolve(scene, Memo()), (64, 64))
    assert np.isfinite(light).all()


def test_padding_is_transparent(renderer):
    data = np.full((1, 8, 8), 50, np.int16)
    data[0, :4] = -2000
    everything = TransferFunction(((0, 1, 1, 1),), ((-3000, 1), (100, 1)))
    drawn = seen(renderer, data, everything, padding=-2000.0)[..., 3]
    assert (drawn[:4] == 0).all()
    assert (drawn[4:] == 1).all()


@pytest.mark.parametrize("shape", [(1, 1, 1), (1, 9, 7), (3, 5, 7), (40, 1, 1), (2, 2, 2)])
@pytest.mark.parametrize("fill", ["ramp", "constant", "nan"])
def test_small_and_empty_volumes_are_answers(shape, fill):
    data = np.arange(np.prod(shape), dtype=np.float32).reshape(shape)
    data = {"ramp": data, "constant": data * 0 + 7, "nan": data * np.nan}[fill]
    image = volviz.render(volviz.Scene.of(volviz.Volume.from_array(data)), (24, 24), samples=1)
    assert image.pixels.shape == (24, 24, 4)


def test_too_large_for_the_texture_is_reduced_and_told(renderer):
    rng = np.random.default_rng(3)
    data = rng.random((20, 30, 40), dtype=np.float32)
    data[:, :, :20] += 5
    scene = volviz.Scene.of(volviz.Volume.from_array(data))
    frame = resolve(scene, Memo(), limits=TextureLimits(max_dim=16))
    assert frame.voxels.dims == (14, 15, 10)
    assert any("resolution" in note for note in frame.notes)
    whole = renderer.light(resolve(scene, Memo()), (32, 32))
    part = renderer.light(frame, (32, 32))
    assert np.abs(whole[..., 3] - part[..., 3]).mean() < 0.08


def test_image_says_when_it_was_reduced(monkeypatch):
    monkeypatch.setattr("volviz.scene.SOFTWARE_TEXTURE", 4000)
    monkeypatch.setattr("volviz.scene.HARDWARE_TEXTURE", 4000)
    data = np.random.default_rng(0).random((16, 16, 16), dtype=np.float32)
    image = volviz.render(volviz.Scene.of(volviz.Volume.from_array(data)), (16, 16))
    assert any("resolution" in note for note in image.notes)


def test_cancel_takes_effect_at_once():
    from volviz.errors import Cancelled
    from volviz.progress import Progress

    def stop(fraction, _message):
        if fraction is not None and fraction > 0.3:
            progress.cancel()

    progress = Progress(stop)
    volume = volviz.Volume.from_array(np.random.default_rng(0).random((32, 32, 32)))
    with pytest.raises(Cancelled):
        volviz.render(volviz.Scene.of(volume), (64, 64), samples=50, progress=progress)
    assert volviz.render(volviz.Scene.of(volume), (16, 16)).pixels.any()


def test_notebooks_show_scenes_and_images():
    scene = volviz.Scene.of(volviz.Volume.from_array(np.eye(9)[None] * 5))
    assert scene._repr_png_().startswith(b"\x89PNG")
    image = volviz.render(scene, (16, 12), samples=1)
    assert image._repr_png_().startswith(b"\x89PNG")
    assert np.asarray(image).shape == (12, 16, 4)
    assert image.size == (16, 12)


@pytest.mark.parametrize("power", [-40, -31, -28, 28, 31, 37])
def test_the_unit_of_the_values_makes_no_difference(renderer, power):
    """1e-30 and 1e30 are seen as 1 is: mass per voxel in kg, numbers of particles."""
    z, y, x = np.mgrid[-1:1:12j, -1:1:12j, -1:1:12j]
    blob = np.exp(-3 * (x * x + y * y + z * z))

    def light(factor: float) -> np.ndarray:
        volume = volviz.Volume.from_array((blob * factor).astype(np.float32))
        ramp = ((0.2 * factor, 0), (0.9 * factor, 0.8))
        colors = ((0.2 * factor, 1, 0, 0), (0.9 * factor, 0, 1, 0))
        scene = volviz.Scene.of(volume).with_transfer(TransferFunction(colors, ramp))
        return renderer.light(resolve(scene.with_raycast(samples=1), Memo()), (24, 24))

    one = light(1.0)
    assert one[..., 3].max() > 0.5
    np.testing.assert_allclose(light(10.0**power), one, atol=1e-3)
