"""What folds out in a panel, and what is shown while an answer is worked out."""

from __future__ import annotations

from volviz.app.answers import Answer, Answers
from volviz.ui import tips, widgets
from volviz.ui.im import ImVec2, icons, imgui


def fold(id_: str, label: str, text: str) -> bool:
    """A line that unfolds what is drawn next; True while it is unfolded."""
    flags = imgui.TreeNodeFlags_.span_avail_width | imgui.TreeNodeFlags_.no_tree_push_on_open
    unfolded = bool(imgui.tree_node_ex(f"{label}###{id_}", flags))
    tips.tip(id_, text)
    return unfolded


def waiting(answers: Answers, name: str, answer: Answer) -> None:
    """How far it is, and a button to stop; or what went wrong, and one to try again."""
    if answer.job is not None:
        job = answer.job
        if widgets.button(f"{name}.stop", icons.ICON_FA_STOP, f"Stop: {job.title}."):
            answers.stop(name)
        imgui.same_line()
        told = job.message or job.title
        fraction = -1.0 * float(imgui.get_time()) if job.fraction is None else job.fraction
        imgui.progress_bar(fraction, ImVec2(widgets.FILL, 0), told)
    elif answer.error or answer.stopped:
        text = "Work it out once more."
        if widgets.button(f"{name}.again", f"{icons.ICON_FA_ROTATE_RIGHT}  Try again", text):
            answers.again(name)
        if answer.error:
            widgets.wrapped(answer.error, widgets.error_color())
        else:
            widgets.beside("Stopped.")
            widgets.faint("Stopped.")
