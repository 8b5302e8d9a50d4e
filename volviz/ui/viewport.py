"""The 3D view: the picture at the exact pixels of its place, mouse, orientation cube, notes.

While something moves the picture is drawn with as few rays as the measured times ask for; at rest
it is refined to the scene's samples; then nothing is drawn at all. What takes long (preparing a
volume, bringing it to the graphics) goes on beside it, and the last good picture stays.
"""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from volviz import resources
from volviz.app import App
from volviz.app.frames import Frames
from volviz.errors import LimitError, VolvizError
from volviz.gpu import ahead, shaders
from volviz.gpu.checked import ContextLost, Gpu
from volviz.gpu.progressive import Progressed
from volviz.gpu.renderer import Renderer
from volviz.model.camera import IMAGE_VIEWS, PATIENT_VIEWS, Camera
from volviz.model.frame import Frame
from volviz.model.scene import SceneState
from volviz.model.views import default_view, view_names, volume_camera
from volviz.model.volume import Volume
from volviz.resolve import TextureLimits
from volviz.ui import navigate, overlay, pick, view_notes
from volviz.ui.im import ImVec2, imgui
from volviz.ui.lens_tool import LensTool
from volviz.ui.leveling import Leveling
from volviz.ui.marks import Marks
from volviz.ui.trials import Trials

MOVING_SECONDS = 0.044
"""From one moving picture to the next: above 20 pictures/s, panels and all."""
LEAST_SECONDS, MOST_SECONDS = 0.012, 0.036
RESTING_BUDGET = 0.035
SETTLE_SECONDS = 0.22
SMALLEST_TEXTURE = 1 << 20
BUSY_SECONDS = 0.2
WATCH_SECONDS = 0.5
COMPILING_SECONDS = 0.1
"""Between two looks at how far it is, if nothing wakes the window before."""
DEVELOPMENT = "VOLVIZ_DEV"


class Viewport:
    """One 3D view of the app's scene."""

    def __init__(self, app: App, gpu: Gpu, limits: TextureLimits) -> None:
        self.app = app
        self.gpu = gpu
        self.renderer = Renderer(gpu)
        self.resident = self.renderer.resident
        self.picture = self.renderer.progressive()
        self.frames = Frames(app.wake, detail=gpu.software)
        ahead.start(gpu, app.wake)
        self.size = (0, 0)
        self.state = Progressed()
        self.spent = 0.0
        self.others = 0.016
        app.limits = self._limits = limits
        self.out_of_memory: tuple[Volume, str] | None = None
        self._told: Frame | None = None
        self._refused: Frame | None = None
        self._watching = resources.checkout() is not None or DEVELOPMENT in os.environ
        self._watched = 0.0
        self._shown: tuple[Frame | None, tuple[int, int]] = (None, (0, 0))
        self._changed = 0.0
        self._failed: SceneState | None = None
        self._hovered_side: str | None = None
        self.trials = Trials()
        self.marks = Marks()
        self._leveling = Leveling()
        self.lens = LensTool()

    @property
    def frame(self) -> Frame | None:
        """What is drawn: the last good frame, None before the first."""
        return self.frames.frame

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
    def resting(self) -> bool:
        """True if it is drawn as well as it will be and nobody moves it."""
        return self._wait() is None and not imgui.is_any_mouse_down()

    @property
    def wait(self) -> float | None:
        """Seconds until it wants to be drawn again; None if never."""
        wait = 0.0 if self.trials.eager else self._wait()
        return WATCH_SECONDS if wait is None and self._watching else wait

    @property
    def refining(self) -> bool:
        """True if rays of a picture that nobody moves are all there is to do."""
        shown, size = self._shown
        same = shown is not None and shown is self.frame and size == self.size
        there = same and self.state.uploaded == 1.0 and self.frames.scene is self.app.scene
        wiped = self.trials.wipe is not None or self.trials.eager
        return there and not wiped and not imgui.is_any_mouse_down() and self._wait() == 0.0

    def refine(self) -> bool:
        """Between two frames: cast rays for a while; True if there is something else to show.

        To draw the panels each time would take a third of the time.
        """
        if not self.refining:
            return False
        before = (self.state.samples, self.state.rays)
        self._improve()
        return not self.refining or before != (self.state.samples, self.state.rays)

    def watch(self) -> bool:
        """In development, twice a second: True if shader files changed, so that it is drawn anew.

        The last good shaders stay where that fails; a badge and a message tell.
        """
        now = time.perf_counter()
        if not self._watching or now - self._watched < WATCH_SECONDS:
            return False
        self._watched = now
        try:
            if not shaders.reload(self.gpu):
                return False
        except ContextLost:
            return True  # the next frame tells
        for error in shaders.reload_errors(self.gpu):
            self.app.messages.once(error, "error")
        self._failed = None
        self._shown = (None, (0, 0))
        return True

    def _wait(self) -> float | None:
        if self.frame is None or min(self.size) < 1 or self._failed is self.app.scene:
            return None
        if self.frame is self._refused:
            return None  # the worker that prepares a smaller one wakes the window
        if self.state.uploaded < 1.0:
            return COMPILING_SECONDS if self.state.compiling else 0.0
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
        extent = ImVec2(self.size[0] / pixel.x, self.size[1] / pixel.y)
        if self.trials.wipe is not None:
            imgui.set_next_item_allow_overlap()
        imgui.invisible_button(
            "###view3d",
            extent,
            imgui.ButtonFlags_.mouse_button_left
            | imgui.ButtonFlags_.mouse_button_right
            | imgui.ButtonFlags_.mouse_button_middle,
        )
        self._mouse(corner, extent)  # first, so that this frame shows already what it does
        self._update()
        texture, wipe = self.picture.texture, self.trials.wipe
        if wipe is not None and wipe.paint(corner, extent):
            pass
        elif texture is not None:
            imgui.get_window_draw_list().add_image(
                imgui.ImTextureRef(texture),
                corner,
                ImVec2(corner.x + extent.x, corner.y + extent.y),
                ImVec2(0, 1),
                ImVec2(1, 0),
            )
        self._overlays(corner, extent)
        if wipe is not None:
            wipe.handle(corner, extent)

    def release(self) -> None:
        """Free what it has on the GPU."""
        self.frames.cancel()
        self.trials.clear()
        self.marks.release()
        self.picture.release()
        self.renderer.release()

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
        self.watch()
        if scene is self._failed:
            return
        if self.out_of_memory is not None and self.out_of_memory[0] is not scene.volume:
            self.out_of_memory, self.app.limits = None, self._limits
        try:
            frame = self.frames.follow(scene, self.app.limits, self.size)
            if frame is not None and frame is not self._refused:
                self._cast(frame)
        except ContextLost:
            raise
        except LimitError as error:
            self._reduce(scene, error)
        except VolvizError as error:
            self._failed = scene
            self.app.messages.once(error, "error")

    def _cast(self, frame: Frame) -> None:
        now = time.perf_counter()
        budget = min(max(MOVING_SECONDS - self.others, LEAST_SECONDS), MOST_SECONDS)
        wiped = self.trials.cast(self.size, (budget, RESTING_BUDGET))
        if wiped is not None and self.trials.wipe is not None:
            self.state, self._changed = wiped, self.trials.wipe.changed
            self._shown = (None, (0, 0))
        elif self._shown[0] is not frame or self._shown[1] != self.size:
            self.state = self.picture.coarse(frame, self.size, budget)
            self._changed = now
            if self.state.uploaded == 1.0:
                self._shown = (frame, self.size)
        elif now - self._changed >= SETTLE_SECONDS or self.state.samples:
            self.state = self.picture.refine(frame, self.size, RESTING_BUDGET)
        if self.state.uploaded == 1.0 and self._told is not frame:
            self._told = frame
            for note in frame.notes:
                self.app.messages.once(note)

    def _reduce(self, scene: SceneState, error: LimitError) -> None:
        """Not enough memory on the graphics: half of it, until it fits."""
        frame, limits = self.frame, self.app.limits
        held = limits.max_bytes if frame is None else frame.voxels.nbytes
        smaller = min(held, limits.max_bytes) // 2
        self._refused = frame
        if smaller < SMALLEST_TEXTURE:
            self._failed = scene
            self.app.messages.once(error, "error")
            return
        self.out_of_memory = (scene.volume, error.what)
        self.app.limits = replace(limits, max_bytes=smaller)

    def _overlays(self, corner: Any, extent: Any) -> None:
        # of what is seen, which may still be the scene before
        scene, settings = self.frames.scene or self.app.scene, self.app.settings
        assert scene is not None
        self.marks.paint(scene, corner, extent)
        self._notes(corner, extent)
        if settings.box:
            overlay.box(scene, (corner.x, corner.y), (extent.x, extent.y))
        self.lens.draw(self.app.scene or scene, corner, extent)
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

    def _notes(self, corner: Any, extent: Any) -> None:
        """Badges, and how far it is with what is prepared or uploaded."""
        scene, frame = self.frames.scene, self.frame
        found = [view_notes.broken_shaders(shaders.reload_errors(self.gpu))]
        if scene is not None and frame is not None:
            reason = self.out_of_memory[1] if self.out_of_memory is not None else None
            if not self.frames.lacking:
                found.append(view_notes.nothing_seen(scene, frame))
            found.append(view_notes.reduced(scene.volume, frame, self.app.limits, reason))
        view_notes.badges([b for b in found if b is not None], (corner.x, corner.y))
        height = 0.45 if self.picture.texture is None else 0.8
        place = (corner.x + extent.x / 2, corner.y + extent.y * height, extent.x)
        job = self.frames.job or self.frames.extracting or self.trials.preparing
        if job is not None:
            if job.elapsed > BUSY_SECONDS:
                left = job.remaining
                more = f", about {left:.0f} s left" if left is not None and left > 1 else ""
                title = job.message or job.title
                view_notes.progress(f"{title}{more}", job.fraction, place)
        elif self.state.compiling:
            view_notes.progress("compiling shaders for the first time", None, place)
        elif self.state.uploaded < 1.0:
            view_notes.progress("uploading to the graphics", self.state.uploaded, place)

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
        lensed = self.lens.mouse(scene, at, corner, extent)
        if lensed is not None:
            if lensed != scene:
                self.app.change(lensed, "Lens", "lens")
            return
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
        if not imgui.is_mouse_down(1):
            self._leveling.end()
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
        elif right and io.key_shift and scene.transfer.name != "labels":
            transfer = self._leveling.dragged(scene.transfer)
            self.app.change(scene.with_transfer(transfer), "Window and level", "level")
        elif right:
            self._move(navigate.dollied(camera, -dy / 20), "Zoom", "dolly")

    def _focus(self, at: tuple[float, float]) -> None:
        scene = self.app.scene
        assert scene is not None
        point = pick.hit(scene, at, self.aspect, self.frames.surfaces)
        if point is not None:
            self._move(navigate.focused(scene.camera, point), "Focus")

    def _move(self, camera: Camera, label: str, key: str = "") -> None:
        scene = self.app.scene
        if scene is not None and camera != scene.camera:
            self.app.change(scene.with_camera(camera), label, key)

    def _framed(self, scene: SceneState, name: str | None) -> Camera:
        lens: dict[str, Any] = {"projection": scene.camera.projection, "fov": scene.camera.fov}
        return volume_camera(scene.volume, name, aspect=self.aspect, **lens)
