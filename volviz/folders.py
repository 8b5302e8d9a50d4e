"""Where the user's own files are: settings, layout, presets; and what a crash left."""

from __future__ import annotations

import os
from pathlib import Path

VARIABLE = "VOLVIZ_CONFIG_DIR"


def config_folder() -> Path:
    """Of settings and presets: VOLVIZ_CONFIG_DIR, else the user's configuration folder."""
    given = os.environ.get(VARIABLE)
    if given:
        return Path(given)
    import platformdirs

    return platformdirs.user_config_path("volviz", appauthor=False)


def cache_folder() -> Path:
    """Of what can be made again at any time."""
    import platformdirs

    return platformdirs.user_cache_path("volviz", appauthor=False)


def state_folder() -> Path:
    """Where autosaved scenes are."""
    given = os.environ.get(VARIABLE)
    if given:
        return Path(given) / "autosave"
    import platformdirs

    return platformdirs.user_state_path("volviz", appauthor=False) / "autosave"
