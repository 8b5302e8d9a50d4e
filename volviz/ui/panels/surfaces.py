"""Surfaces: isosurfaces in the volume, each with a live isovalue, a colour and its knobs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from volviz.app.answers import Answers
from volviz.classify.isovalues import suggested_surface
from volviz.fields.statistics import Statistics
from volviz.model.knobs import knobs_of
from volviz.model.lens import Lens
from volviz.model.refining import Refining
from volviz.model.scene import SceneState
from volviz.model.surface import Surface
from volviz.model.surface_look import MAX_SURFACES, SceneSurface, SurfaceLook
from volviz.model.wanted import done_to, only_turned
from volviz.resolve_surfaces import Extracted
from volviz.ui import (
    ambiguous_view,
    edit,
    field_rows,
    folds,
    isovalue_slider,
    lens_tool,
    surface_report,
    widgets,
)
from volviz.ui.facts import Facts
from volviz.ui.im import icons, imgui
from volviz.ui.surface_dialog import Wish
from volviz.ui.value_axis import Span

BY_HAND = ("isovalue", "opacity", "visible", *field_rows.KNOBS)
"""Knobs that have a place of their own in the panel."""


@dataclass
class State:
    """span: of the values under the sliders, kept while one is dragged."""

    span: Span | None = None
    volume: object = None


def panel(scene: SceneState, facts: Facts) -> SceneState:
    """Adds, turns and removes isosurfaces, and shows what they cost."""
    statistics = facts.statistics
    if statistics is None:
        widgets.dim("Counting the values …")
        return scene
    before = scene
    scene = _top(scene, statistics)
    if scene is not before:
        return scene
    if not scene.surfaces:
        widgets.wrapped("No surface yet. A surface is where the values cross an isovalue.")
        return scene
    state = facts.local.of(State)
    if state.volume is not scene.volume or state.span is None or not imgui.is_any_mouse_down():
        values = [s.surface.isovalue for s in scene.surfaces]
        state.span, state.volume = isovalue_slider.span_of(statistics, values), scene.volume
    after = lens_tool.section(scene, facts.aspect)
    if after is not scene:
        return after
    for number in range(len(scene.surfaces)):
        after = _entry(scene, number, facts, state.span)
        if after is not scene:
            return after
    return scene


def _top(scene: SceneState, statistics: Statistics) -> SceneState:
    """What is about all surfaces."""
    label = f"{icons.ICON_FA_PLUS}  Add surface"
    full = len(scene.surfaces) >= MAX_SURFACES
    text = "One more isosurface, at a value worth seeing (I)."
    if widgets.button("surfaces.add", label, text, enabled=not full):
        more = suggested_surface(scene.volume, statistics, scene.surfaces)
        return scene.with_surfaces((*scene.surfaces, more))
    widgets.beside("Volume", box=True)
    shown = widgets.toggle(
        "surfaces.volume",
        "Volume",
        "Cast rays through the volume around the surfaces; without it they stand alone.",
        scene.raycast.show_volume,
    )
    if shown != scene.raycast.show_volume:
        return scene.with_raycast(show_volume=shown)
    return scene


def _entry(scene: SceneState, number: int, facts: Facts, span: Span) -> SceneState:
    """One surface: its line, its slider, and what folds out."""
    now = scene.surfaces[number]
    id_ = f"surfaces.{number}"
    imgui.separator()
    new = _line(now, id_, number)
    if new is None:
        rest = (*scene.surfaces[:number], *scene.surfaces[number + 1 :])
        return scene.with_surfaces(rest)
    assert facts.statistics is not None
    others = [s.surface.isovalue for i, s in enumerate(scene.surfaces) if i != number]
    value = isovalue_slider.slider(
        f"{id_}.slider",
        new.surface.isovalue,
        facts.statistics,
        span,
        color=new.look.color,
        others=others,
    )
    new = _with_isovalue(new, value)
    new = replace(new, look=edit.knob_rows(new.look, id_, ["opacity"], beside=_labels()))
    found = facts.surfaces[number] if number < len(facts.surfaces) else None
    widgets.quiet(_told(new, found, scene.lens))
    if lens_tool.spared(found):
        widgets.wrapped(lens_tool.spared(found))
    about = "How the surface is made, and how it takes the light."
    if folds.fold(f"{id_}.more", "Method and look", about):
        new = _knobs(new, id_)
        look = field_rows.rows(new.look, f"{id_}.look", facts, found)
        new = new if look is new.look else replace(new, look=look)
    new = _after(new, id_, scene)
    surface_report.section(id_, scene.volume, found, facts.local.of(Answers))
    looked = ambiguous_view.section(scene, number, id_, facts)
    text = "Write this surface, as it is drawn, as STL, PLY, OBJ or GLB."
    if widgets.button(f"{id_}.save", f"{icons.ICON_FA_FLOPPY_DISK}  Save…", text):
        facts.local.of(Wish).number = number
    if new == now:
        return looked
    return scene.with_surfaces(new if i == number else s for i, s in enumerate(scene.surfaces))


def _line(now: SceneSurface, id_: str, number: int) -> SceneSurface | None:
    """Visible, colour, isovalue; None where it is to be removed."""
    text = f"Show surface {number + 1}."
    visible = widgets.toggle(f"{id_}.visible", "", text, now.look.visible)
    imgui.same_line()
    side = imgui.get_frame_height() + imgui.get_style().item_spacing.x
    room, gap = imgui.get_content_region_avail().x - side, imgui.get_style().item_spacing.x
    half, narrow = room / 2, room < widgets.em(13)  # no place for the colour's number
    imgui.set_next_item_width((room - side if narrow else half) - gap)
    value = widgets.number(
        f"{id_}.isovalue", "Isovalue: samples at least as high are inside.", now.surface.isovalue
    )
    imgui.same_line()
    imgui.set_next_item_width(half)
    about = "Colour of the surface."
    color = widgets.color(f"{id_}.color", about, now.look.color, bare=narrow)
    imgui.same_line()
    if widgets.delete_button(f"{id_}.delete", f"Remove surface {number + 1}."):
        return None
    look = edit.changed(now.look, visible=visible, color=color)
    return _with_isovalue(now if look is now.look else replace(now, look=look), value)


def _with_isovalue(now: SceneSurface, value: float) -> SceneSurface:
    surface = edit.changed(now.surface, isovalue=value)
    return now if surface is now.surface else replace(now, surface=surface)


def _knobs(now: SceneSurface, id_: str) -> SceneSurface:
    """Everything else that can be turned."""
    made, look = (
        [k.name for k in knobs_of(o) if k.name not in BY_HAND] for o in (Surface, SurfaceLook)
    )
    surface = edit.knob_rows(now.surface, f"{id_}.surface", made, beside=_labels())
    given = {"method": surface.method}
    dressed = edit.knob_rows(now.look, f"{id_}.look", look, beside=_labels(), given=given)
    return replace(now, surface=surface, look=dressed)


def _after(now: SceneSurface, id_: str, scene: SceneState) -> SceneSurface:
    """What is done to the mesh once it is extracted; only the steps that act where it is drawn."""
    steps = now.refining
    label = f"After extraction: {steps.text}" if steps.text else "After extraction"
    about = "Weld, keep the largest part, drop islands, smooth and decimate: drawn, and in files."
    if not folds.fold(f"{id_}.after", label, about):
        return now
    left = only_turned(now.surface, scene.lens)
    names = [k.name for k in knobs_of(Refining)]
    if left:
        names = ["flip"]
        widgets.wrapped(f"{left[:1].upper()}{left[1:]}: nothing else is done to it.")
    elif not steps.moves and steps.boundary == "fixed":
        names.remove("boundary")
    given = {"method": now.surface.method}
    spacing = float(min(scene.volume.info.spacing))
    new = edit.knob_rows(
        steps, f"{id_}.after", names, beside=_labels(), given=given, spacing=spacing
    )
    return now if new is steps else replace(now, refining=new)


def _labels() -> Sequence[str]:
    return [edit.title(k) for owner in (Surface, SurfaceLook, Refining) for k in knobs_of(owner)]


def _told(now: SceneSurface, found: Extracted | None, lens: Lens) -> str:
    """What the surface is made of, or that it is being made."""
    if not now.look.visible and found is None:
        return "hidden"
    if found is None:
        return "extracting …"
    mesh, before = found.mesh, found.before
    there = found.surface == now.surface and found.refining == done_to(now, lens)
    if mesh.empty and there and before is not None and not before.mesh.empty:
        return f"empty: nothing is left of its {len(before.mesh.faces):,} triangles"
    if mesh.empty:
        return "empty: no value crosses it" if there else "extracting …"
    skipped = f", {mesh.skipped:,} cells without value" if mesh.skipped else ""
    counts = f"{len(mesh.faces):,} triangles, {len(mesh.vertices):,} vertices"
    if not len(mesh.faces):
        counts = f"{len(mesh.vertices):,} points"
    elif before is not None and len(before.mesh.faces) != len(mesh.faces):
        counts = f"{len(mesh.faces):,} of {len(before.mesh.faces):,} triangles"
    more = "" if before is None else f" + {1000 * found.refined:.0f}"
    wait = "" if there else "  …"
    return f"{counts}, {1000 * found.seconds:.0f}{more} ms{skipped}{wait}"
