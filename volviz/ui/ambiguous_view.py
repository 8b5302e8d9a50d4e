"""Ambiguous cells of a surface: marked in the 3D view, one by one, with what each rule does there.

The fold-out of the Surfaces panel.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from volviz.app.answers import Answers
from volviz.model.camera import Camera
from volviz.model.mesh import Mesh
from volviz.model.scene import SceneState
from volviz.model.surface import AMBIGUITIES, Surface
from volviz.model.volume import Volume
from volviz.progress import Progress
from volviz.ui import cell_picture, edit, folds, theme, tips, widgets
from volviz.ui.facts import Facts
from volviz.ui.im import ImVec2, icons, imgui
from volviz.ui.marks import Boxes, Marks

if TYPE_CHECKING:
    from volviz.isosurface.ambiguous import AmbiguousCells

MOST = 6000
"""Cells that are marked at once."""
AWAY = 9.0
"""Distance from which a cell is looked at, in diagonals of a cell."""
COLORS = {"faces": (1.0, 0.7, 0.2), "interior": (0.95, 0.35, 0.85), "here": (1.0, 1.0, 1.0)}
KINDS = (
    ("faces", "Face", "Cells with a face whose corners can be joined in two ways."),
    ("interior", "Inside", "Cells in which two pieces of the surface may be one tube."),
)


@dataclass
class Look:
    """on: cells are marked. disputed: only those where the rules differ. at: number of the cell
    that is looked at, −1 for none. made: what the boxes were made of."""

    on: bool = False
    disputed: bool = False
    at: int = -1
    made: tuple[object, ...] = ()


@dataclass
class State:
    """Per surface."""

    looks: dict[str, Look] = field(default_factory=dict)


def section(scene: SceneState, number: int, id_: str, facts: Facts) -> SceneState:
    """The fold-out of one surface; the scene with another camera or rule where that is asked."""
    id_ = f"{id_}.cells"
    look = facts.local.of(State).looks.setdefault(id_, Look())
    marks = facts.local.of(Marks)
    about = "Cells whose corners can be joined in several ways, and what each rule makes of them."
    if not folds.fold(id_, "Ambiguous cells", about):
        marks.show(id_, None)
        return scene
    answers, surface, volume = facts.local.of(Answers), scene.surfaces[number].surface, scene.volume

    def work(progress: Progress) -> AmbiguousCells:
        from volviz.isosurface.ambiguous import ambiguous_cells  # brings the compiler with it

        return ambiguous_cells(volume, surface.isovalue, progress)

    title = "Looking for ambiguous cells"
    answer = answers.ask(id_, volume, surface.isovalue, work, title=title, follow=True)
    found: AmbiguousCells | None = answer.value
    if found is None or answer.error or answer.stopped:
        folds.waiting(answers, id_, answer)
        return scene
    _switches(id_, look, found)
    chosen = np.flatnonzero(found.disputed) if look.disputed else np.arange(found.ids.size)
    look.at = min(look.at, len(chosen) - 1)
    step = _steps(id_, look, len(chosen))
    if step and len(chosen):
        look.at = (look.at + step) % len(chosen) if look.at >= 0 else 0
        cell = int(found.ids[chosen[look.at]])
        scene = scene.with_camera(looking_at(scene.camera, volume, cell))
    _mark(id_, volume, found, chosen, look=look, marks=marks)
    if look.at >= 0 and len(chosen):
        scene = _rules(id_, scene, number, found, int(chosen[look.at]), answers=answers)
    return scene


def looking_at(camera: Camera, volume: Volume, cell: int) -> Camera:
    """The same direction, with the middle of a cell as the target; no farther than `AWAY`."""
    start = _starts(volume, np.array([cell]))[0]
    middle = volume.affine[:3, :3] @ (start + 0.5) + volume.affine[:3, 3]
    diagonal = float(np.linalg.norm(volume.affine[:3, :3] @ np.ones(3)))
    distance = min(camera.distance, AWAY * diagonal)
    _, _, back = camera.axes()
    x, y, z = (float(v) for v in middle)
    a, b, c = (float(v) for v in middle + distance * back)
    height = camera.height * distance / camera.distance
    return replace(camera, position=(a, b, c), target=(x, y, z), height=height)


def _starts(volume: Volume, cells: NDArray[np.int64]) -> NDArray[np.float64]:
    """float64[n, 3]: the least samples of cells."""
    x, y, _ = (max(n - 1, 1) for n in volume.dims)
    return np.stack([cells % x, cells // x % y, cells // (x * y)], axis=1).astype(np.float64)


def _switches(id_: str, look: Look, found: AmbiguousCells) -> None:
    counts = found.as_dict()
    text = "Draw these cells as boxes over the 3D view."
    look.on = widgets.toggle(f"{id_}.on", "Mark them", text, look.on)
    label = "Only disputed"
    widgets.beside(label, box=True)
    text = "Only cells where the rules make different surfaces."
    look.disputed = widgets.toggle(f"{id_}.disputed", label, text, look.disputed)
    for kind, name, about in KINDS:
        _swatch(COLORS[kind])
        imgui.text_unformatted(f"{name}: {counts[kind]:,}")
        tips.tip(f"{id_}.count.{kind}", about)
        if kind == "faces":
            widgets.beside(f"Inside: {counts['interior']:,}", box=True)
    rules = counts["differ_from_trilinear"]
    told = ", ".join(f"{edit.choice_title(r).lower()} in {n:,}" for r, n in rules.items())
    widgets.wrapped(
        f"{counts['cells']:,} ambiguous cells; other than trilinear: {told}."
        if counts["cells"]
        else "No cell is ambiguous at this isovalue."
    )


def _swatch(color: tuple[float, float, float]) -> None:
    size, line = widgets.em(0.8), imgui.get_text_line_height()
    corner = imgui.get_cursor_screen_pos()
    low = ImVec2(corner.x, corner.y + (line - size) / 2)
    high = ImVec2(low.x + size, low.y + size)
    imgui.get_window_draw_list().add_rect_filled(low, high, theme.packed(color), size / 5)
    imgui.dummy(ImVec2(size, line))
    imgui.same_line()


def _steps(id_: str, look: Look, count: int) -> int:
    """Which way to the next cell: −1, 0, 1."""
    step = 0
    if widgets.button(
        f"{id_}.back", icons.ICON_FA_ARROW_LEFT, "The cell before; the camera goes there.",
        enabled=count > 0,
    ):  # fmt: skip
        step = -1
    imgui.same_line()
    if widgets.button(
        f"{id_}.next", icons.ICON_FA_ARROW_RIGHT, "The next cell; the camera goes there.",
        enabled=count > 0,
    ):  # fmt: skip
        step = 1
    imgui.same_line()
    widgets.faint(f"{look.at + 1:,} of {count:,}" if look.at >= 0 else f"{count:,} to look at")
    return step


def _mark(
    id_: str,
    volume: Volume,
    found: AmbiguousCells,
    chosen: NDArray[np.int64],
    *,
    look: Look,
    marks: Marks,
) -> None:
    """Boxes round the cells; disputed ones first, if there are too many."""
    if not (look.on or look.at >= 0):
        marks.show(id_, None)
        return
    key = (found, look.on, look.disputed, look.at)
    before = marks.shown(id_)
    if before is None or key != look.made:
        look.made = key
        order = chosen[np.argsort(~found.disputed[chosen], kind="stable")][: MOST if look.on else 0]
        here = chosen[look.at : look.at + 1] if look.at >= 0 else chosen[:0]
        before = _boxes(volume, found, order, here)
    marks.show(id_, before)
    if look.on and len(chosen) > MOST:
        told = f"{MOST:,} of {len(chosen):,} are marked: more cannot be told apart."
        widgets.wrapped(told, widgets.warning_color())


def _boxes(
    volume: Volume, found: AmbiguousCells, order: NDArray[np.int64], here: NDArray[np.int64]
) -> Boxes:
    rows = np.concatenate([order, here])
    starts = _starts(volume, found.ids[rows])
    colors = np.zeros((len(rows), 4))
    interior = found.kinds[rows] & 2 > 0
    colors[:, :3] = np.where(interior[:, None], COLORS["interior"], COLORS["faces"])
    colors[:, 3] = np.where(found.disputed[rows], 1.0, 0.6)
    colors[len(order) :] = (*COLORS["here"], 1.0)
    ends = np.stack([starts, starts + 1], axis=1).astype(np.float32)
    paint = np.rint(255 * colors).astype(np.uint8)
    return Boxes(volume, found.isovalue, ends, paint, "surfaces")


def _rules(
    id_: str,
    scene: SceneState,
    number: int,
    found: AmbiguousCells,
    row: int,
    *,
    answers: Answers,
) -> SceneState:
    """The three variants of a cell; the one that is clicked becomes the surface's rule."""
    volume, cell = scene.volume, int(found.ids[row])

    def work(progress: Progress) -> dict[str, Mesh]:
        from volviz.isosurface.ambiguous import cell_mesh

        return {rule: cell_mesh(volume, cell, found.isovalue, rule) for rule in AMBIGUITIES}

    name = f"{id_}.variants"
    answer = answers.ask(name, volume, (cell, found.isovalue), work, title="One cell")
    if not answer.fresh:
        folds.waiting(answers, name, answer)
        return scene
    x, y, z = _starts(volume, np.array([cell]))[0].astype(int).tolist()
    kind = " and ".join(t for b, t in ((1, "face"), (2, "inside")) if found.kinds[row] & b)
    widgets.dim(f"Cell {x}, {y}, {z}: {kind} ambiguous")
    now = scene.surfaces[number]
    gap = imgui.get_style().item_spacing.x
    side = min((imgui.get_content_region_avail().x - 2 * gap) / 3, widgets.em(11))
    picked = now.surface.ambiguity
    for i, rule in enumerate(AMBIGUITIES):
        if i:
            imgui.same_line()
        same = i == 0 or not found.differ(rule)[row]
        view = cell_picture.View(volume, scene.camera, (x, y, z), found.isovalue)
        note = "" if i == 0 else "same" if same else "differs"
        active = rule == now.surface.ambiguity
        mesh, name = answer.value[rule], f"{id_}.{rule}"
        if cell_picture.draw(name, view, mesh, rule, note=note, side=side, active=active):
            picked = rule
    surface: Surface = edit.changed(now.surface, ambiguity=picked)
    if surface is now.surface:
        return scene
    new = replace(now, surface=surface)
    return scene.with_surfaces(new if i == number else s for i, s in enumerate(scene.surfaces))
