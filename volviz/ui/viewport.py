"""The 3D view: the picture at the exact pixels of its place, mouse, orientation cube, notes.

While something moves the picture is drawn with as few rays as the measured times ask for; at rest
it is refined to the scene's samples; then nothing is drawn at all.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from volviz.app import App
from volviz.errors import GraphicsError, LimitError, VolvizError
from volviz.gpu.checked import Gpu
from volviz.gpu.progressive import Progressed, Progressive
from volviz.gpu.residency import Residency
from volviz.model.camera import IMAGE_VIEWS, PATIENT_VIEWS, Camera
from volviz.model.frame import Frame
from volviz.model.scene import SceneState
from volviz.model.views import default_view, view_names, volume_camera
from volviz.resolve import TextureLimits, resolve
from volviz.ui import navigate, overlay, pick
from volviz.ui.im import ImVec2, imgui

MOVING_SECONDS = 0.044
"""From one moving picture to the next: above 20 pictures/s, panels and all."""
LEAST_SECONDS, MOST_SECONDS = 0.012, 0.036
RESTING_BUDGET = 0.035
SETTLE_SECONDS = 0.22
SMALLEST_TEXTURE = 1 << 20


class Viewport:
    """One 3D view of the app's scene."""

    def __init__(self, app: App, gpu: Gpu, limits: TextureLimits) -> None:
        self.app = app
        self.gpu = gpu
        self.resident = Residency(gpu)
        self.picture = Progressive(gpu, self.resident)
        self.frame: Frame | None = None
        self.size = (0, 0)
        self.state = Progressed()
        self.spent = 0.0
        self.others = 0.016
        app.limits = limits
        self._scene: SceneState | None = None
        self._shown: tuple[Frame | None, tuple[int, int]] = (None, (0, 0))
        self._changed = 0.0
        self._failed: SceneState | None = None
        self._hovered_side: str | None = None

    # --- what commands do ----------------------------------------------------------------------

    def look_from(self, names: Sequence[str]) -> None:
        """A standard view, the first of the names that this volume has."""
        scene = self.app.scene
        if scene is None:
            return
        known = view_names(scene.volume)
        name = next((n for n in names if n in known), None)
        if name is not None:
            self._move(self._framed(scene, name), f"View: {name}")

    def reset(self) -> None:
        """The view in which the volume was opened."""
        if self.app.scene is not None:
            self._move(self._framed(self.app.scene, None), "Show all")

    def toggle_projection(self) -> None:
        """Perspective or orthographic."""
        scene = self.app.scene
        if scene is not None:
            other = "perspective" if scene.camera.projection != "perspective" else "orthographic"
            self._move(navigate.projected(scene.camera, other), f"Projection: {other}")

    @property
    def aspect(self) -> float:
        """Width / height of the view."""
        return self.size[0] / self.size[1] if min(self.size) > 0 else 4 / 3

    @property
    def wait(self) -> float | None:
        """Seconds until it wants to be drawn again; None if never."""
        if self.frame is None or min(self.size) < 1 or self._failed is self.app.scene:
            return None
        if not self.state.done:
            left = SETTLE_SECONDS - (time.perf_counter() - self._changed)
            return max(left, 0.0) if self.state.samples == 0 else 0.0
        return None

    # --- drawing -------------------------------------------------------------------------------

    def draw(self) -> None:
        """Into the current ImGui window, over all of it."""
        space = imgui.get_content_region_avail()
        pixel = imgui.get_io().display_framebuffer_scale
        self.size = (max(int(space.x * pixel.x), 0), max(int(space.y * pixel.y), 0))
        corner = imgui.get_cursor_screen_pos()
        if min(self.size) < 1 or self.app.scene is None:
            return
        self.app.aspect = self.aspect
        self._update()
        extent = ImVec2(self.size[0] / pixel.x, self.size[1] / pixel.y)
        texture = self.picture.texture
        if texture is not None:
            imgui.get_window_draw_list().add_image(
                imgui.ImTextureRef(texture),
                corner,
                ImVec2(corner.x + extent.x, corner.y + extent.y),
                ImVec2(0, 1),
                ImVec2(1, 0),
            )
        imgui.invisible_button(
            "###view3d",
            extent,
            imgui.ButtonFlags_.mouse_button_left
            | imgui.ButtonFlags_.mouse_button_right
            | imgui.ButtonFlags_.mouse_button_middle,
        )
        self._overlays(corner, extent)
        self._mouse(corner, extent)

    def release(self) -> None:
        """Free what it has on the GPU."""
        self.picture.release()
        self.resident.release()

    def took(self, seconds: float) -> None:
        """So long the whole frame took: what the panels and the window need is left out of it."""
        self.others = 0.8 * self.others + 0.2 * max(seconds - self.spent, 0.0)

    def _update(self) -> None:
        """Bring the picture nearer to the scene, without taking longer than a frame may."""
        start = time.perf_counter()
        self._improve()
        self.spent = time.perf_counter() - start

    def _improve(self) -> None:
        scene = self.app.scene
        assert scene is not None
        if scene is self._failed:
            return
        try:
            self._resolve(scene)
            self._cast()
        except LimitError as error:
            self._reduce(error)
        except GraphicsError as error:
            self._failed = scene
            self.app.messages.once(error, "error")
        except VolvizError as error:
            self._failed = scene
            self.app.messages.once(error, "error")

    def _resolve(self, scene: SceneState) -> None:
        if scene is not self._scene or self.frame is None:
            self.frame = resolve(scene, limits=self.app.limits)
            self._scene = scene
            for note in self.frame.notes:
                self.app.messages.once(note)

    def _cast(self) -> None:
        assert self.frame is not None
        now = time.perf_counter()
        wanted = (self.frame, self.size)
        if self._shown[0] is not self.frame or self._shown[1] != self.size:
            self._changed = now
            self._shown = wanted
            budget = min(max(MOVING_SECONDS - self.others, LEAST_SECONDS), MOST_SECONDS)
            self.state = self.picture.coarse(self.frame, self.size, budget)
        elif now - self._changed >= SETTLE_SECONDS or self.state.samples:
            self.state = self.picture.refine(self.frame, self.size, RESTING_BUDGET)

    def _reduce(self, error: LimitError) -> None:
        """Not enough memory on the graphics: half of it, until it fits."""
        held = self.frame.voxels.nbytes if self.frame is not None else self.app.limits.max_bytes
        smaller = min(held, self.app.limits.max_bytes) // 2
        if smaller < SMALLEST_TEXTURE:
            self._failed = self.app.scene
            self.app.messages.once(error, "error")
            return
        self.app.limits = replace(self.app.limits, max_bytes=smaller)
        self.frame = None

    def _overlays(self, corner: Any, extent: Any) -> None:
        scene, settings = self.app.scene, self.app.settings
        assert scene is not None
        if settings.box:
            overlay.box(scene, (corner.x, corner.y), (extent.x, extent.y))
        self._hovered_side = None
        if settings.axes and min(extent.x, extent.y) > 200:
            scale = min(imgui.get_font_size() / 15.0, min(extent.x, extent.y) / 320)
            away = 62.0 * scale
            center = (corner.x + away, corner.y + extent.y - away)
            free = imgui.is_item_hovered() and not imgui.is_item_active()
            mouse = imgui.get_mouse_pos() if free or imgui.is_mouse_clicked(0) else None
            if not imgui.is_item_hovered():
                mouse = None
            self._hovered_side = overlay.cube(scene, center, scale, mouse)

    # --- mouse ---------------------------------------------------------------------------------

    def _mouse(self, corner: Any, extent: Any) -> None:
        scene = self.app.scene
        assert scene is not None
        io = imgui.get_io()
        size = (max(int(extent.x), 1), max(int(extent.y), 1))
        at = (
            2 * (io.mouse_pos.x - corner.x) / extent.x - 1,
            1 - 2 * (io.mouse_pos.y - corner.y) / extent.y,
        )
        if imgui.is_item_hovered():
            if io.mouse_wheel:
                camera = navigate.dollied_to(scene.camera, io.mouse_wheel, at, self.aspect)
                self._move(camera, "Zoom", "wheel")
            if imgui.is_mouse_clicked(0) and self._hovered_side:
                self.look_from((self._hovered_side,))
                return
            if imgui.is_mouse_double_clicked(0):
                self._focus(at)
                return
        delta = io.mouse_delta
        if imgui.is_item_active() and (delta.x or delta.y):
            self._drag(scene, delta.x, delta.y, size)

    def _drag(self, scene: SceneState, dx: float, dy: float, size: tuple[int, int]) -> None:
        io, camera = imgui.get_io(), scene.camera
        left, right = imgui.is_mouse_down(0), imgui.is_mouse_down(1)
        if imgui.is_mouse_down(2) or (left and io.key_shift):
            self._move(navigate.panned(camera, dx, dy, size), "Pan", "pan")
        elif left and io.key_ctrl:
            self._move(navigate.rolled(camera, dx, size), "Roll", "roll")
        elif left and self.app.settings.turntable:
            patient = scene.volume.info.space is not None
            table = PATIENT_VIEWS if patient else IMAGE_VIEWS
            up = table[default_view(scene.volume)[0]][1]
            self._move(navigate.turned(camera, dx, dy, size, up), "Turn", "turn")
        elif left:
            self._move(navigate.rotated(camera, dx, dy, size), "Turn", "turn")
        elif right:
            self._move(navigate.dollied(camera, -dy / 20), "Zoom", "dolly")

    def _focus(self, at: tuple[float, float]) -> None:
        scene = self.app.scene
        assert scene is not None
        point = pick.hit(scene, at, self.aspect)
        if point is not None:
            self._move(navigate.focused(scene.camera, point), "Focus")

    def _move(self, camera: Camera, label: str, key: str = "") -> None:
        scene = self.app.scene
        if scene is not None and camera != scene.camera:
            self.app.change(scene.with_camera(camera), label, key)

    def _framed(self, scene: SceneState, name: str | None) -> Camera:
        lens: dict[str, Any] = {"projection": scene.camera.projection, "fov": scene.camera.fov}
        return volume_camera(scene.volume, name, aspect=self.aspect, **lens)
