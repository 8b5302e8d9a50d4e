"""History: every step so far; a click goes there."""

from __future__ import annotations

from volviz.model.scene import SceneState
from volviz.ui import widgets
from volviz.ui.facts import Facts
from volviz.ui.im import imgui


class _Seen:
    """Which step was in view last, so that the list follows the present and nothing else."""

    present: int = -1


def panel(scene: SceneState, facts: Facts) -> SceneState:
    """Returns the state of the step that was clicked: the shell finds it in its history."""
    seen = facts.local.of(_Seen)
    if not facts.history:
        widgets.dim("Nothing was changed yet.")
    for index, step in enumerate(facts.history):
        undone = index > facts.present
        if undone:
            quiet = imgui.get_style_color_vec4(imgui.Col_.text_disabled)
            imgui.push_style_color(imgui.Col_.text, quiet)
        text = "Do again up to here" if undone else "Go back to this step"
        label = f"{index + 1}  {step.label}"
        if widgets.row(f"history.{index}", label, text, index == facts.present):
            scene = step.state
        if undone:
            imgui.pop_style_color()
        if index == facts.present != seen.present:
            imgui.set_scroll_here_y()
            seen.present = index
    return scene
