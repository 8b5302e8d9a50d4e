"""The window, driven for real under Xvfb: it opens, draws what `render` draws, turns, closes."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import textwrap

import pytest

DRIVE = """
    import os
    import numpy as np
    from PIL import ImageGrab
    import volviz
    from volviz.gpu.contexts_glfw import import_glfw
    from volviz.ui import window

    glfw = import_glfw()
    scene = volviz.Scene.of(volviz.sample("marschner-lobb"))
    shots, turns = [], []
    draw = window._Viewer.draw

    def drive(viewer):
        busy = draw(viewer)
        viewer.gpu.ctx.finish()
        x, y = glfw.get_window_pos(viewer.window)
        taken = ImageGrab.grab(xdisplay=os.environ["DISPLAY"]).convert("RGB")
        shots.append(np.asarray(taken)[y : y + 150, x : x + 200].copy())
        turns.append(viewer.history.state.camera)
        if len(shots) == 4:
            viewer.change(viewer.history.state.with_camera(viewer.first.camera.orbited(40)))
        if len(shots) == 6:
            window._key(viewer, glfw.KEY_R, 0)
        if len(shots) == 8:
            window._key(viewer, glfw.KEY_ESCAPE, 0)
        return busy

    window.SIZE = (200, 150)
    window._Viewer.draw = drive
    volviz.view(scene)
    assert len(shots) >= 8
    assert turns[5] != turns[0] == turns[-1]
    assert np.abs(shots[3].astype(int) - shots[5]).mean() > 2
    still = volviz.render(scene, (200, 150), samples=4).pixels[..., :3].astype(int)
    assert shots[3].shape == still.shape
    assert np.abs(shots[3] - still).mean() < 0.5, np.abs(shots[3] - still).mean()
    print("driven")
"""


@pytest.mark.skipif(shutil.which("Xvfb") is None, reason="Xvfb is not installed")
def test_window_draws_turns_and_closes():
    done = subprocess.run(
        ["xvfb-run", "-a", sys.executable, "-c", textwrap.dedent(DRIVE)],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert "driven" in done.stdout, done.stderr


def test_no_display_is_one_line_that_says_what_to_do():
    env = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY")}
    command = [sys.executable, "-m", "volviz", "view", "sample:marschner-lobb"]
    done = subprocess.run(command, capture_output=True, text=True, env=env, timeout=60, check=False)
    assert done.returncode == 5
    assert done.stderr.count("\n") == 1
    assert "volviz render" in done.stderr
