from __future__ import annotations

import ctypes
import gc
import threading
from collections.abc import Iterator
from typing import Any

import moderngl
import numpy as np
import pytest

from volviz.errors import Cancelled, GraphicsError, LimitError
from volviz.gpu import formats, texel
from volviz.gpu.checked import Gpu
from volviz.gpu.contexts import open_gpu
from volviz.gpu.texel import kept_texture3d, verify_last_texel
from volviz.progress import Progress


@pytest.fixture(scope="module")
def own() -> Iterator[Gpu]:
    """A context of this file's own, where nothing else is alive."""
    with open_gpu() as gpu:
        yield gpu


@pytest.fixture(autouse=True)
def _no_error_left_behind(own: Gpu) -> Iterator[None]:
    yield
    own.activate()
    assert own.ctx.error == "GL_NO_ERROR"


def values(shape: tuple[int, ...], dtype: str) -> Any:
    kind = formats.TEXEL_DTYPES[dtype]
    rng = np.random.default_rng(1)
    if kind.kind == "f":
        return rng.normal(size=shape).astype(kind)
    info = np.iinfo(kind)
    return rng.integers(info.min, info.max, shape, kind, endpoint=True)


# --- 3D textures -----------------------------------------------------------------------------


@pytest.mark.parametrize("dtype", sorted(formats.TEXEL_DTYPES))
@pytest.mark.parametrize("components", [1, 2, 4])
def test_npot_upload_reads_back_bit_for_bit(own: Gpu, dtype: str, components: int) -> None:
    shape = (7, 5, 3) if components == 1 else (7, 5, 3, components)
    array = values(shape, dtype)
    texture = own.texture3d((3, 5, 7), components, dtype, linear=dtype[0] not in "ui")
    own.upload3d(texture, array)
    got = np.frombuffer(texture.read(), array.dtype).reshape(shape)
    assert np.array_equal(got, array)
    texture.release()


def test_texture_is_clamped_and_filtered_as_asked(own: Gpu) -> None:
    for linear, kind in ((True, moderngl.LINEAR), (False, moderngl.NEAREST)):
        for texture in (
            own.texture3d((4, 4, 4), 1, "nu2", linear=linear),
            own.texture2d((4, 4), 1, None, "nu2", linear=linear),
        ):
            assert texture.filter == (kind, kind)
            assert not texture.repeat_x
            assert not texture.repeat_y
            assert not getattr(texture, "repeat_z", False)
            texture.release()


def test_size_over_the_limit_is_a_limit_error(own: Gpu) -> None:
    side = own.limits.max_texture_3d + 1
    with pytest.raises(LimitError, match=f"{side}×4×4.*{own.limits.max_texture_3d}") as caught:
        own.texture3d((side, 4, 4), 1, "f4", linear=True)
    assert caught.value.exit_code == 6
    with pytest.raises(LimitError):
        own.texture2d((own.limits.max_texture + 1, 1), 1, None, "f4", linear=True)
    with pytest.raises(LimitError):
        own.framebuffer((own.limits.max_viewport[0] + 1, 1))


def test_memory_that_is_not_there_is_a_limit_error(own: Gpu) -> None:
    if not own.software:
        pytest.skip("would fill the graphics card")
    side = own.limits.max_texture_3d
    with pytest.raises(LimitError, match="memory"):
        own.texture3d((side, side, side), 4, "f4", linear=True)
    assert own.live["textures"] == 0
    own.texture3d((8, 8, 8), 1, "f4", linear=True).release()


@pytest.mark.parametrize("dtype", ["nu1", "nu2", "f2", "f4", "u2", "i2", "u4", "i1"])
@pytest.mark.parametrize("components", [1, 2])
def test_last_texel_is_verified(own: Gpu, dtype: str, components: int) -> None:
    linear = dtype[0] not in "ui"
    texture = kept_texture3d(own, (9, 6, 5), components, dtype, linear=linear, always=True)
    got = np.frombuffer(texture.read(), formats.TEXEL_DTYPES[dtype])
    one = np.iinfo(got.dtype).max if dtype in ("nu1", "nu2") else 1
    assert (got[-components:] == one).all()
    texture.release()


def test_texture_that_does_not_keep_its_texel_is_a_limit_error(
    own: Gpu, monkeypatch: pytest.MonkeyPatch
) -> None:
    texture = own.texture3d((4, 4, 4), 1, "f4", linear=True)
    own.upload3d(texture, np.zeros((4, 4, 4), np.float32))
    monkeypatch.setattr(moderngl.Texture3D, "write", lambda *_, **__: None)
    with pytest.raises(LimitError, match="did not keep"):
        verify_last_texel(own, texture)
    texture.release()
    monkeypatch.setattr(texel, "VERIFY_BYTES", 1)
    with pytest.raises(LimitError):
        kept_texture3d(own, (4, 4, 4), 1, "f4", linear=True)
    assert own.live["textures"] == 0


@pytest.mark.parametrize(
    ("size", "components", "dtype", "linear"),
    [
        ((0, 4, 4), 1, "f4", True),
        ((4, 4, 4), 5, "f4", True),
        ((4, 4, 4), 1, "ni2", True),
        ((4, 4, 4), 1, "u2", True),
    ],
)
def test_format_that_does_not_exist_is_a_bug(
    own: Gpu, size: tuple[int, int, int], components: int, dtype: str, linear: bool
) -> None:
    with pytest.raises(ValueError, match=r"texel|format"):
        own.texture3d(size, components, dtype, linear=linear)


# --- upload ----------------------------------------------------------------------------------


def test_upload_goes_in_slabs_with_progress(
    own: Gpu, monkeypatch: pytest.MonkeyPatch, rng: np.random.Generator
) -> None:
    monkeypatch.setattr(formats, "SLAB_BYTES", 2 * 3 * 5 * 2)  # two slices
    seen: list[float | None] = []
    array = rng.integers(0, 65535, (7, 5, 3), np.uint16)
    texture = own.texture3d((3, 5, 7), 1, "nu2", linear=True)
    own.upload3d(texture, array, Progress(lambda fraction, _: seen.append(fraction)))
    assert np.array_equal(np.frombuffer(texture.read(), np.uint16), array.ravel())
    assert seen == [0, 2 / 7, 4 / 7, 6 / 7, 1.0]
    texture.release()


def test_slab_smaller_than_a_slice(
    own: Gpu, monkeypatch: pytest.MonkeyPatch, rng: np.random.Generator
) -> None:
    monkeypatch.setattr(formats, "SLAB_BYTES", 2 * 3 * 2)  # two rows
    array = rng.integers(0, 65535, (4, 5, 3), np.uint16)
    texture = own.texture3d((3, 5, 4), 1, "nu2", linear=True)
    own.upload3d(texture, array)
    assert np.array_equal(np.frombuffer(texture.read(), np.uint16), array.ravel())
    texture.release()


def test_slabs_stay_below_the_limit_and_cover_all() -> None:
    for shape in ((300, 300, 300), (3, 9000, 4000), (2, 2, 9_000_000)):
        array = np.broadcast_to(np.float32(0), shape)
        pieces = list(formats.slabs(array))
        rows = sum((z1 - z0) * (y1 - y0) for z0, z1, y0, y1 in pieces)
        assert rows == shape[0] * shape[1]
        row = shape[2] * 4
        largest = max((z1 - z0) * (y1 - y0) for z0, z1, y0, y1 in pieces) * row
        assert largest <= max(formats.SLAB_BYTES, row)


def test_upload_of_views_and_read_only_arrays(own: Gpu, rng: np.random.Generator) -> None:
    base = rng.integers(0, 255, (6, 10, 8), np.uint8)
    base.setflags(write=False)
    for view in (base[::-1, ::2, ::-1], base.transpose(2, 1, 0), np.asfortranarray(base)):
        nz, ny, nx = view.shape
        texture = own.texture3d((nx, ny, nz), 1, "nu1", linear=True)
        own.upload3d(texture, view)
        assert np.array_equal(np.frombuffer(texture.read(), np.uint8), view.ravel())
        texture.release()


def test_cancel_stops_the_upload_and_the_texture_can_be_released(
    own: Gpu, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(formats, "SLAB_BYTES", 1)
    calls = 0

    def report(fraction: float | None, _: str) -> None:
        nonlocal calls
        calls += 1
        if calls == 3:
            progress.cancel()

    progress = Progress(report)
    texture = own.texture3d((4, 4, 4), 1, "nu1", linear=True)
    with pytest.raises(Cancelled):
        own.upload3d(texture, np.zeros((4, 4, 4), np.uint8), progress)
    assert calls == 3
    texture.release()
    assert own.live["textures"] == 0


def test_upload_of_the_wrong_array_is_a_bug(own: Gpu) -> None:
    texture = own.texture3d((3, 5, 7), 1, "nu2", linear=True)
    for array in (
        np.zeros((3, 5, 7), np.uint16),  # x first
        np.zeros((7, 5, 3), np.int16),
        np.zeros((7, 5, 3, 2), np.uint16),
    ):
        with pytest.raises(ValueError, match=r"texture needs|filled from"):
            own.upload3d(texture, array)
    texture.release()
    pair = own.texture3d((3, 5, 7), 2, "nu2", linear=True)
    with pytest.raises(ValueError, match="texture needs"):
        own.upload3d(pair, np.zeros((7, 5, 3), np.uint16))
    pair.release()


# --- the other makers ------------------------------------------------------------------------


def test_texture2d_keeps_rows(own: Gpu) -> None:
    array = values((5, 3, 4), "f4")
    texture = own.texture2d((3, 5), 4, array, "f4", linear=True)
    assert np.array_equal(np.frombuffer(texture.read(), np.float32), array.ravel())
    with pytest.raises(ValueError, match="texture needs"):
        own.texture2d((5, 3), 4, array, "f4", linear=True)
    texture.release()


def test_buffer(own: Gpu) -> None:
    array = np.arange(12, dtype=np.float32).reshape(3, 4)[:, ::2]
    buffer = own.buffer(array)
    assert buffer.read() == np.ascontiguousarray(array).tobytes()
    with pytest.raises(ValueError, match="empty"):
        own.buffer(b"")
    buffer.release()


def test_framebuffer_starts_clear_and_goes_with_its_textures(own: Gpu) -> None:
    target = own.framebuffer((5, 3), "f4", depth=True)
    assert target.size == (5, 3)
    assert target.depth_attachment is not None
    assert not np.frombuffer(target.read(components=4, dtype="f4"), np.float32).any()
    assert own.live == {**own.live, "textures": 2, "framebuffers": 1}
    own.release_framebuffer(target)
    own.release_framebuffer(target)
    assert own.live == {**own.live, "textures": 0, "framebuffers": 0}


def test_framebuffer_that_cannot_be_made_leaves_nothing(
    own: Gpu, monkeypatch: pytest.MonkeyPatch
) -> None:
    def incomplete(*_: object) -> None:
        raise moderngl.Error("the framebuffer is not complete")

    with monkeypatch.context() as patch:
        patch.setattr(moderngl.Context, "framebuffer", incomplete)
        with pytest.raises(GraphicsError, match=r"framebuffer of 4×4 failed: .*not complete"):
            own.framebuffer((4, 4), depth=True)
    assert own.live == {**own.live, "textures": 0, "framebuffers": 0}


# --- errors ----------------------------------------------------------------------------------


def test_pending_error_is_reported_and_names_the_call(own: Gpu) -> None:
    own.ctx.enable_direct(0xDEAD)
    with pytest.raises(GraphicsError, match=r"drawing cubes failed: GL_INVALID_ENUM") as caught:
        own.check("drawing cubes")
    assert caught.value.exit_code == 5
    own.check("drawing cubes")


def test_error_of_an_earlier_call_is_not_swallowed_by_a_maker(own: Gpu) -> None:
    own.ctx.enable_direct(0xDEAD)
    with pytest.raises(GraphicsError, match=r"a call before buffer.*GL_INVALID_ENUM"):
        own.buffer(b"abcd")


def test_error_inside_guarded(own: Gpu) -> None:
    with (
        pytest.raises(GraphicsError, match=r"blending failed: GL_INVALID_ENUM"),
        own.guarded("blending"),
    ):
        own.ctx.enable_direct(0xDEAD)
    with (
        pytest.raises(GraphicsError, match=r"odd buffer failed: .*size"),
        own.guarded("odd buffer"),
    ):
        own.ctx.buffer(b"abcd").write(b"12345678")


def test_out_of_memory_wins_over_other_errors(own: Gpu) -> None:
    with pytest.raises(LimitError, match="upload"):
        own._raise_for(["GL_INVALID_VALUE", "GL_OUT_OF_MEMORY"], "upload")
    with pytest.raises(GraphicsError, match="2× GL_INVALID_VALUE"):
        own._raise_for(["GL_INVALID_VALUE", "GL_INVALID_VALUE"], "upload")


def test_errors_without_end_are_drained_to_a_bound(monkeypatch: pytest.MonkeyPatch) -> None:
    with open_gpu() as gpu, monkeypatch.context() as patch:
        patch.setattr(moderngl.Context, "error", property(lambda _: "GL_INVALID_OPERATION"))
        with pytest.raises(GraphicsError, match="16× GL_INVALID_OPERATION"):
            gpu.check("a lost context")


def test_other_thread_is_refused(own: Gpu) -> None:
    caught: list[Exception] = []

    def work() -> None:
        try:
            own.buffer(b"abcd")
        except GraphicsError as error:
            caught.append(error)

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert "another thread" in str(caught[0])


def test_closed_context_is_refused() -> None:
    gpu = open_gpu()
    gpu.release()
    with pytest.raises(GraphicsError, match="closed"):
        gpu.buffer(b"abcd")


# --- what is alive ---------------------------------------------------------------------------


def test_live_counts_makes_releases_and_drops(own: Gpu) -> None:
    gc.collect()
    start = own.live
    texture = own.texture3d((2, 2, 2), 1, "f4", linear=True)
    buffer = own.buffer(b"abcd")
    assert own.live == {
        **start,
        "textures": start["textures"] + 1,
        "buffers": start["buffers"] + 1,
    }
    texture.release()
    del buffer
    assert own.live == start
    own.activate()
    assert not own.ctx.objects


def test_dropped_textures_give_their_memory_back(own: Gpu) -> None:
    address = own.ctx.mglo._context.load_opengl_function("glIsTexture")
    is_texture = ctypes.CFUNCTYPE(ctypes.c_ubyte, ctypes.c_uint)(address)
    names = [own.texture3d((16, 16, 16), 1, "f4", linear=True).glo for _ in range(20)]
    own.activate()
    assert not any(is_texture(name) for name in names)


def test_vertex_arrays_and_programs_go_with_the_context() -> None:
    with open_gpu() as gpu:
        kept_texture3d(gpu, (4, 4, 4), 1, "f4", linear=True, always=True)
        assert gpu.live["programs"] == 1
    assert gpu.live == {"textures": 0, "buffers": 0, "framebuffers": 0, "programs": 0}
