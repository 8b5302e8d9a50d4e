"""Boxes over the 3D view, where they are in the volume: nodes of a tree, marked cells.

Panels show and hide them; they stay while a surface of the scene has the isovalue that they belong
to. They are drawn on a picture of their own, anew only when the camera or they change.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from volviz.gpu.checked import colour_texture
from volviz.gpu.passes import boxes as boxes_pass
from volviz.model.scene import SceneState
from volviz.model.volume import Volume
from volviz.ui.im import ImVec2, imgui

if TYPE_CHECKING:
    import moderngl

    from volviz.ui.viewport import Viewport

WIDTH = 0.075
"""Of a line, in font sizes."""


@dataclass(frozen=True, eq=False)
class Boxes:
    """Some boxes. ends: float32[n, 2, 3], least and greatest corner (x, y, z) in samples.

    colors: uint8[n, 4], sRGB with straight opacity. isovalue: of the surface they belong to.
    panel: that shows them; with it they are hidden.
    """

    volume: Volume
    isovalue: float
    ends: NDArray[np.float32]
    colors: NDArray[np.uint8]
    panel: str


class Marks:
    """The boxes of one window, by who shows them; without a window they are not drawn."""

    def __init__(self) -> None:
        self._shown: dict[str, Boxes] = {}
        self._asked: set[str] = set()
        self._view: Viewport | None = None
        self._content: moderngl.Buffer | None = None
        self._target: moderngl.Framebuffer | None = None
        self._held: tuple[Boxes, ...] = ()
        self._drawn: object = None

    def connect(self, view: Viewport) -> Marks:
        """Belong to a view from now on; what was drawn for another is gone with it."""
        self._content = self._target = self._drawn = None
        self._held, self._view, view.marks = (), view, self
        return self

    def show(self, name: str, boxes: Boxes | None) -> None:
        """These instead of those before; None: none."""
        self._shown.pop(name, None)
        if boxes is not None and len(boxes.ends):
            self._shown[name] = boxes
            self._asked.add(name)

    def shown(self, name: str) -> Boxes | None:
        """What stands over the view by this name."""
        return self._shown.get(name)

    def paint(self, scene: SceneState, corner: Any, extent: Any) -> None:
        """Over the picture of a scene, in the current window. corner, extent: on the screen."""
        view = self._view
        wanted = self._wanted(scene)
        if view is None or view.app.scene is None or not wanted:
            self.release()
            return
        if wanted != self._held:
            self._fill(view, wanted)
        size = view.size
        depth = self._depth(view, scene)
        deep = None if depth is None else view.picture.depths
        state = (scene.camera, size, self._content, imgui.get_font_size(), deep)
        if state != self._drawn:
            self._draw(view, scene, size, depth)
            self._drawn = state
        assert self._target is not None
        draw = imgui.get_window_draw_list()
        end = ImVec2(corner.x + extent.x, corner.y + extent.y)
        texture = imgui.ImTextureRef(int(colour_texture(self._target).glo))
        draw.add_image(texture, corner, end, ImVec2(0, 1), ImVec2(1, 0))

    def release(self) -> None:
        """Free what it has on the GPU."""
        if self._view is not None and self._target is not None:
            self._view.gpu.release_framebuffer(self._target)
        if self._content is not None:
            self._content.release()
        self._content = self._target = self._drawn = None
        self._held = ()

    def _wanted(self, scene: SceneState) -> tuple[Boxes, ...]:
        """Those of this volume that a panel has just asked for, or whose surface is still there."""
        now = scene if self._view is None else self._view.app.scene or scene
        values = {s.surface.isovalue for s in now.surfaces}
        hidden = () if self._view is None else self._view.app.settings.hidden
        asked, self._asked = self._asked, set()
        for name in [n for n, b in self._shown.items() if b.volume is not now.volume]:
            del self._shown[name]
        return tuple(
            b
            for name, b in self._shown.items()
            if b.volume is scene.volume
            and b.panel not in hidden
            and (name in asked or b.isovalue in values)
        )

    def _fill(self, view: Viewport, wanted: tuple[Boxes, ...]) -> None:
        if self._content is not None:
            self._content.release()
        ends = np.concatenate([b.ends for b in wanted])
        colors = np.concatenate([b.colors for b in wanted])
        self._content = view.gpu.buffer(boxes_pass.packed(ends, colors))
        self._held = wanted

    @staticmethod
    def _depth(view: Viewport, scene: SceneState) -> moderngl.Texture | None:
        """Of the surfaces in the picture; none of another camera's, nor under the wipe."""
        frame = view.frame
        seen = frame is not None and frame.camera == scene.camera and view.trials.wipe is None
        return view.picture.depth if seen else None

    def _draw(
        self,
        view: Viewport,
        scene: SceneState,
        size: tuple[int, int],
        depth: moderngl.Texture | None,
    ) -> None:
        gpu = view.gpu
        if self._target is None or self._target.size != size:
            if self._target is not None:
                gpu.release_framebuffer(self._target)
            self._target = gpu.framebuffer(size)
        self._target.use()
        self._target.clear()
        gpu.ctx.viewport = (0, 0, *size)
        assert self._content is not None
        width = max(WIDTH * imgui.get_font_size(), 1.0)
        boxes_pass.draw(
            gpu,
            self._content,
            scene.volume,
            scene.camera,
            size=size,
            width=width,
            depth=depth,
        )
