"""The clipboard where there is none, and pictures that are too large for it."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest

from volviz.errors import OutputError, UsageError
from volviz.image import Image
from volviz.ui import clipboard


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="elsewhere there always is one")
def test_without_a_display_there_is_one_clear_message():
    code = (
        "import numpy as np\n"
        "from volviz.errors import OutputError\n"
        "from volviz.image import Image\n"
        "from volviz.ui import clipboard\n"
        "for _ in range(2):\n"
        "    try:\n"
        "        clipboard.put_picture(Image(np.zeros((4, 4, 4), np.uint8)))\n"
        "    except OutputError as error:\n"
        "        print(error)\n"
    )
    env = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY")}
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, env=env, check=True
    )
    lines = done.stdout.splitlines()
    assert len(lines) == 2
    assert all("cannot be copied" in line and "save it instead" in line for line in lines)
    assert done.stderr == ""


def test_without_its_library_the_rest_lives(monkeypatch):
    monkeypatch.setitem(sys.modules, "copykitten", None)
    with pytest.raises(OutputError, match="install copykitten"):
        clipboard.put_picture(Image(np.zeros((4, 4, 4), np.uint8)))


def test_a_picture_too_large_for_x11_says_so(monkeypatch):
    monkeypatch.setattr(clipboard, "_through_x11", lambda: True)
    monkeypatch.setattr(clipboard, "X11_BYTES", 4000)
    noise = np.random.default_rng(1).integers(0, 256, (40, 40, 4), np.uint8)
    with pytest.raises(UsageError, match=r"40×40 is too large .* save it instead"):
        clipboard.put_picture(Image(noise))


def test_text_that_is_no_unicode_is_refused():
    with pytest.raises(OutputError, match="not UTF-8"):
        clipboard.put_text("a\udcff")
