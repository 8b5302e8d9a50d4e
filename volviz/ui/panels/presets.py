"""Presets: ready-made looks as small pictures of this volume, favourites, the user's own."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from volviz.classify import own_presets
from volviz.classify.presets import captured, presets
from volviz.errors import VolvizError
from volviz.fields.statistics import Statistics
from volviz.model.scene import Background, Raycast, SceneState
from volviz.model.views import volume_camera
from volviz.model.volume import Volume
from volviz.ui import gallery, looks, widgets
from volviz.ui.asking import Asking, Question
from volviz.ui.facts import Facts
from volviz.ui.im import icons, imgui
from volviz.ui.looks import Choice
from volviz.ui.shelf import Shelf
from volviz.ui.thumbnails import Wish

FIRST = "First choice"
CLOSER = 1.05
"""How much nearer than the view of the whole volume a thumbnail is."""


@dataclass
class State:
    """filter: what is typed. others: those made for other data are shown, too. menu: the preset
    whose menu is open. chosen: what a question decided, to be worn with the next frame."""

    filter: str = ""
    others: bool = False
    menu: Choice | None = None
    chosen: str | None = None
    asking: Asking = field(default_factory=lambda: Asking("presets"))


def panel(scene: SceneState, facts: Facts) -> SceneState:
    """One click puts a look on; everything else here is kept beside the scene."""
    statistics = facts.statistics
    if statistics is None:
        widgets.dim("Counting the values …")
        return scene
    state, shelf = facts.local.of(State), facts.local.of(Shelf)
    _top(scene, state, statistics)
    found = looks.catalogue(scene.volume, statistics, shelf.favourites)
    wanted = [c for c in found if _matches(c, state.filter)]
    picked = _shelves(scene, wanted, state, shelf, statistics)
    picked = _menu(state, shelf) or picked
    state.asking.draw()
    if state.chosen is not None:
        picked, state.chosen = state.chosen, None
    if picked is None or looks.worn(scene, picked, statistics):
        return scene
    look = _look(picked, scene, shelf, statistics)
    return scene if look is None else looks.dressed(scene, look)


def _look(name: str, scene: SceneState, shelf: Shelf, statistics: Statistics) -> looks.Look | None:
    """The look of this name on this volume; one that does not fit into numbers is told."""
    try:
        return looks.named_look(name, scene.volume, statistics)
    except VolvizError as error:
        shelf.tell(error)
        return None


def _top(scene: SceneState, state: State, statistics: Statistics) -> None:
    """The filter, and the button that saves."""
    label = f"{icons.ICON_FA_FLOPPY_DISK}  Save as preset…"
    style = imgui.get_style()
    width = imgui.calc_text_size(label).x + 2 * style.frame_padding.x
    room = imgui.get_content_region_avail().x - width - style.item_spacing.x
    beside = room > widgets.em(6)
    imgui.set_next_item_width(room if beside else widgets.FILL)
    text = "Words of the name or of what it shows."
    state.filter = widgets.search("presets.filter", "Filter", text, state.filter)
    if beside:
        imgui.same_line()
    if widgets.button(
        "presets.save",
        label,
        "Keep the transfer function, the mode and the light under a name. The preset is a file in "
        f"{own_presets.folder()}; 'volviz render --preset NAME' knows it too.",
    ):
        title = _title(scene)

        def save(name: str) -> None:
            preset = captured(name, scene, statistics)
            own_presets.save(preset, overwrite=own_presets.existing(name) is not None)
            state.chosen = own_presets.existing(name)

        state.asking.ask(Question("Save as preset", "Save", save, title, doubt=_doubt))


def _title(scene: SceneState) -> str:
    """The name of the user's preset that is worn, changed or not; else nothing."""
    name = scene.transfer.name
    return presets()[name].title if name in own_presets.own().presets else ""


def _doubt(name: str) -> str:
    taken = own_presets.existing(name)
    return "" if taken is None else f"You have a preset '{taken}' already."


def _matches(choice: Choice, query: str) -> bool:
    text = f"{choice.name} {choice.title} {choice.about} {choice.section}".casefold()
    return all(word in text for word in query.casefold().split())


def _shelves(
    scene: SceneState, choices: list[Choice], state: State, shelf: Shelf, statistics: Statistics
) -> str | None:
    """All pictures under their headings; the name of the one that was clicked."""
    if not choices:
        widgets.dim("No preset has these words.")
    grid, picked, heading = gallery.Grid(), None, ""
    seen: list[Choice] = []
    rest: list[Choice] = []
    for choice in choices:
        if _heading(choice) != heading:
            heading = _heading(choice)
            grid.begin_row()
            if heading != looks.OTHERS:
                imgui.separator_text(heading)
            elif not _others(sum(c.section == heading for c in choices), state):
                break
        hit = _cell(grid, scene, choice, shelf, statistics)
        (seen if hit.seen else rest).append(choice)
        picked = choice.name if hit.clicked else picked
        if hit.menu:
            state.menu = choice
            imgui.open_popup("###presets.menu")
        if hit.starred:
            shelf.star(choice.name, choice.name not in shelf.favourites)
    pixels = gallery.pixels(grid.side)
    volume = scene.volume
    shelf.wish(_wish(c, volume, statistics, pixels) for c in (*seen, *rest))
    return picked


def _heading(choice: Choice) -> str:
    """Few pictures share a heading, so that they share a row; marks tell them apart."""
    return FIRST if choice.section in looks.SECTIONS else choice.section


def _others(count: int, state: State) -> bool:
    """The line that unfolds those made for other data; True while they are shown."""
    if state.filter:
        imgui.separator_text(looks.OTHERS)
        return True
    imgui.spacing()
    mark = icons.ICON_FA_CHEVRON_DOWN if state.others else icons.ICON_FA_CHEVRON_RIGHT
    text = "Presets for other kinds of data, fitted to these values by guess."
    if widgets.row("presets.others", f"{mark}  {looks.OTHERS} ({count})", text, False):
        state.others = not state.others
    return state.others


def _cell(
    grid: gallery.Grid, scene: SceneState, choice: Choice, shelf: Shelf, statistics: Statistics
) -> gallery.Hit:
    """The picture of one choice, and what is told of it while the mouse is there."""
    key = (choice.name, gallery.pixels(grid.side))
    hit = grid.cell(
        f"presets.{choice.name}",
        _caption(choice),
        choice.about,
        shelf.texture(key),
        active=looks.worn(scene, choice.name, statistics),
        star=choice.name in shelf.favourites if choice.preset is not None else None,
        badge=_badge(choice),
    )
    if hit.asked and not imgui.is_popup_open("###presets.menu"):
        volume = scene.volume
        large = _wish(choice, volume, statistics, gallery.large_pixels())
        shelf.wish([large])
        look = _look(choice.name, scene, shelf, statistics)
        lines = [choice.about] + (["Right click to rename or delete it."] if choice.own else [])
        warning = None if look is None else look.warning
        gallery.preview(shelf.texture(large.key, key), choice.title, lines, warning)
    return hit


def _badge(choice: Choice) -> str:
    if choice.section == looks.SECTIONS[0] and choice.name != looks.SUGGESTED:
        return "Suggested"
    return icons.ICON_FA_USER if choice.own else ""


def _caption(choice: Choice) -> str:
    """The title, without what the heading says already."""
    rest = choice.title.removeprefix(f"{choice.section} ")
    return rest[:1].upper() + rest[1:]


def _menu(state: State, shelf: Shelf) -> str | None:
    """What else can be done with a preset; its name if it is to be worn."""
    choice, picked = state.menu, None
    if choice is None or not imgui.begin_popup("###presets.menu"):
        return None
    if widgets.row("presets.menu.use", "Use it", choice.about, False):
        picked = choice.name
    if choice.preset is not None:
        on = choice.name in shelf.favourites
        text = "Favourites stand above the others."
        label = "No longer a favourite" if on else "Make it a favourite"
        if widgets.row("presets.menu.star", label, text, False):
            shelf.star(choice.name, not on)
        text = "The name that --preset and Scene.of(preset=…) take."
        if widgets.row("presets.menu.copy", f"Copy the name '{choice.name}'", text, False):
            imgui.set_clipboard_text(choice.name)
    if choice.own:
        imgui.separator()
        if widgets.row("presets.menu.rename", "Rename…", "Another name for its file.", False):
            state.asking.ask(_renaming(choice, shelf))
        if widgets.row("presets.menu.delete", "Delete…", "Remove its file.", False):
            state.asking.ask(_deleting(choice, shelf))
    imgui.end_popup()
    return picked


def _renaming(choice: Choice, shelf: Shelf) -> Question:
    def rename(title: str) -> None:
        shelf.renamed(choice.name, own_presets.rename(choice.name, title))

    return Question(f"Rename '{choice.title}'", "Rename", rename, choice.title)


def _deleting(choice: Choice, shelf: Shelf) -> Question:
    def delete(_: str) -> None:
        own_presets.delete(choice.name)
        shelf.star(choice.name, on=False)

    about = "Its file is removed for good; pictures that wear it stay as they are."
    return Question(f"Delete '{choice.title}'?", "Delete", delete, about=about)


def _wish(choice: Choice, volume: Volume, statistics: Statistics, pixels: int) -> Wish:

    def make(scene: SceneState) -> SceneState:
        look = looks.named_look(choice.name, volume, statistics)
        camera = volume_camera(volume, zoom=CLOSER)
        plain = replace(scene, camera=camera, background=Background(), raycast=Raycast(step=1.0))
        return plain if look is None else looks.dressed(plain, look)

    return Wish((choice.name, pixels), choice.preset, make, pixels)
