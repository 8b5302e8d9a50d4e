"""Bookmarks: views that are kept with the scene, as pictures, and their keys."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from volviz.model.scene import Bookmark, SceneState
from volviz.ui import gallery, widgets
from volviz.ui.asking import Asking, Question
from volviz.ui.facts import Facts
from volviz.ui.im import icons, imgui
from volviz.ui.shelf import Shelf
from volviz.ui.thumbnails import Wish

if TYPE_CHECKING:
    from volviz.ui.shell import Shell

KEYS = 9
"""So many bookmarks have keys."""
MENU = "###bookmarks.menu"


@dataclass
class State:
    """menu: index of the bookmark whose menu is open. renamed: index and new name, to be taken
    over with the next frame."""

    menu: int = 0
    renamed: tuple[int, str] | None = None
    asking: Asking = field(default_factory=lambda: Asking("bookmarks"))


# --- scene in, scene out -------------------------------------------------------------------------


def added(scene: SceneState) -> SceneState:
    """The scene with its view kept under the first free of "View 1", "View 2", …"""
    taken = {b.name for b in scene.bookmarks}
    name = next(n for i in range(len(taken) + 1) if (n := f"View {i + 1}") not in taken)
    return scene.with_bookmarks((*scene.bookmarks, Bookmark(name, scene.camera)))


def changed(scene: SceneState, index: int, **values: object) -> SceneState:
    """The scene with another name or camera of a bookmark."""
    kept = list(scene.bookmarks)
    kept[index] = replace(kept[index], **values)  # type: ignore[arg-type]
    return scene.with_bookmarks(kept)


def without(scene: SceneState, index: int) -> SceneState:
    """The scene without a bookmark."""
    return scene.with_bookmarks((*scene.bookmarks[:index], *scene.bookmarks[index + 1 :]))


def set_at(scene: SceneState, index: int) -> SceneState:
    """The scene with its view as the bookmark with this index; a new one if there are fewer."""
    if index >= len(scene.bookmarks):
        return added(scene)
    return changed(scene, index, camera=scene.camera)


# --- commands ------------------------------------------------------------------------------------


def add(shell: Shell) -> None:
    """Keep the present view."""
    scene = shell.app.scene
    assert scene is not None
    after = added(scene)
    shell.app.change(after, f"Bookmark: {after.bookmarks[-1].name}")
    shell.app.messages.add(f"kept as '{after.bookmarks[-1].name}' (panel View)")


def going(index: int) -> Callable[[Shell], None]:
    """A command that goes to a bookmark."""

    def go(shell: Shell) -> None:
        scene = shell.app.scene
        assert scene is not None
        kept = scene.bookmarks[index]
        if kept.camera != scene.camera:
            shell.app.change(scene.with_camera(kept.camera), f"View: {kept.name}")

    return go


def setting(index: int) -> Callable[[Shell], None]:
    """A command that keeps the present view as a bookmark."""

    def keep(shell: Shell) -> None:
        scene = shell.app.scene
        assert scene is not None
        if index >= len(scene.bookmarks):
            add(shell)
        else:
            name = scene.bookmarks[index].name
            shell.app.change(set_at(scene, index), f"Bookmark: {name}")
            shell.app.messages.add(f"'{name}' is this view now")

    return keep


def has(index: int) -> Callable[[Shell], bool]:
    """True while there is a bookmark with this index."""
    return lambda shell: shell.app.scene is not None and index < len(shell.app.scene.bookmarks)


# --- the panel's part ----------------------------------------------------------------------------


def section(scene: SceneState, facts: Facts) -> SceneState:
    """The bookmarks of a scene as pictures, and the button that adds one."""
    state, shelf = facts.local.of(State), facts.local.of(Shelf)
    text = (
        f"Keep this view with the scene (Ctrl+D). Alt+1 … Alt+{KEYS} go to the first ones, "
        f"Alt+Shift+1 … Alt+Shift+{KEYS} set them to the present view."
    )
    if widgets.button("bookmarks.add", f"{icons.ICON_FA_BOOKMARK}  Add bookmark", text):
        return added(scene)
    grid = gallery.Grid()
    for index, kept in enumerate(scene.bookmarks):
        hit = _cell(grid, scene, index, shelf)
        if hit.clicked:
            return scene.with_camera(kept.camera)
        if hit.menu:
            state.menu = index
            imgui.open_popup(MENU)
    scene = _menu(scene, state)
    state.asking.draw()
    if state.renamed is not None:
        (index, name), state.renamed = state.renamed, None
        scene = changed(scene, index, name=name) if index < len(scene.bookmarks) else scene
    return scene


def _cell(grid: gallery.Grid, scene: SceneState, index: int, shelf: Shelf) -> gallery.Hit:
    kept = scene.bookmarks[index]
    small = _wish(scene, index, gallery.pixels(grid.side))
    number = str(index + 1) if index < KEYS else ""
    about = f"Go there: click or Alt+{number}." if number else "Click to go there."
    hit = grid.cell(
        f"bookmarks.{index}",
        kept.name,
        about,
        shelf.texture(small.key),
        active=kept.camera == scene.camera,
        badge=number,
    )
    if hit.seen:
        shelf.wish([small])
    if hit.asked and not imgui.is_popup_open(MENU):
        large = _wish(scene, index, gallery.large_pixels())
        shelf.wish([large])
        lines = [about, "Right click to rename, set or delete it."]
        gallery.preview(shelf.texture(large.key, small.key), kept.name, lines, None)
    return hit


def _menu(scene: SceneState, state: State) -> SceneState:
    index = state.menu
    if not imgui.begin_popup(MENU):
        return scene
    if index < len(scene.bookmarks):
        kept = scene.bookmarks[index]
        if widgets.row("bookmarks.menu.go", "Go there", "Look from there.", False):
            scene = scene.with_camera(kept.camera)
        text = "Keep the present view instead."
        if widgets.row("bookmarks.menu.set", "Set to this view", text, False):
            scene = set_at(scene, index)
        if widgets.row("bookmarks.menu.rename", "Rename…", "Another name.", False):

            def rename(name: str) -> None:
                Bookmark(name, kept.camera)  # or says what is wrong
                state.renamed = (index, name)

            state.asking.ask(Question(f"Rename '{kept.name}'", "Rename", rename, kept.name))
        if widgets.row("bookmarks.menu.delete", "Delete", "Undo brings it back.", False):
            scene = without(scene, index)
    imgui.end_popup()
    return scene


def _wish(scene: SceneState, index: int, pixels: int) -> Wish:
    kept = scene.bookmarks[index].camera
    stamp = (kept, scene.transfer, scene.raycast, scene.light, scene.background)

    def make(copy: SceneState) -> SceneState:
        return replace(copy, camera=kept, raycast=replace(copy.raycast, step=1.0))

    return Wish(("bookmark", index, pixels), stamp, make, pixels)
