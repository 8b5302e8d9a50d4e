"""Performance: how long frames take, how fine they are, and what memory they need."""

from __future__ import annotations

import numpy as np

from volviz.errors import safe_text
from volviz.model.scene import SceneState
from volviz.text import binary_size
from volviz.ui import widgets
from volviz.ui.facts import Facts
from volviz.ui.im import ImVec2, imgui

LABELS = ("Frame time", "Rays", "Renderer")


def panel(scene: SceneState, facts: Facts) -> SceneState:
    """Numbers of the latest frame and the times of those before."""
    if facts.busy is not None:
        share = -0.3 * imgui.get_time() if facts.busy.fraction is None else facts.busy.fraction
        text = safe_text(facts.busy.message)
        imgui.progress_bar(float(share), ImVec2(widgets.FILL, 0), text)
    with widgets.facts("performance", LABELS) as shown:
        for name, text in rows(scene, facts) if shown else ():
            widgets.fact(name, text)
    if len(facts.frame_times) > 1:
        times = np.asarray(facts.frame_times, dtype=np.float32) * 1000
        size = ImVec2(widgets.FILL, widgets.em(4))
        most = max(float(times.max()), 1000 / 60)
        imgui.spacing()
        widgets.quiet(f"Latest {times.size} frames, up to {most:.0f} ms")
        imgui.plot_histogram("###performance.times", times, 0, "", 0.0, most, size)
        widgets.tip("performance.times", "Time of the latest frames, milliseconds, newest right.")
    return scene


def rows(scene: SceneState, facts: Facts) -> list[tuple[str, str]]:
    """Name and text of what is known."""
    step = scene.raycast.step if facts.step is None else facts.step
    found = [
        ("Frame time", f"{facts.frame_ms:.1f} ms" if facts.frame_ms else "–"),
        ("Rays", "1 per pixel" if facts.rays >= 1 else f"{facts.rays:.0%} per side"),
        ("Step", f"{step:.3g} × voxel"),
        ("Samples", f"{facts.samples} averaged"),
        ("Memory", "" if facts.cpu_bytes is None else binary_size(facts.cpu_bytes)),
        ("Graphics", "" if facts.gpu_bytes is None else binary_size(facts.gpu_bytes)),
        ("Renderer", safe_text(facts.renderer)),
    ]
    return [(name, text) for name, text in found if text]
