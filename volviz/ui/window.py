"""The desktop window, from outside: show a scene, or files, until it is closed."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from volviz.app import App
from volviz.app.opening import Making
from volviz.model.scene import SceneState
from volviz.model.volume import Volume


def view(scene: SceneState | Volume) -> None:
    """Show a scene (or a volume, as suggested) in a window until it is closed."""
    from volviz.scene import Scene

    show(Scene.of(scene) if isinstance(scene, Volume) else scene)


def show(
    scene: SceneState | None = None,
    *,
    names: Sequence[str] = (),
    load: tuple[str, Making] | None = None,
    app: App | None = None,
    started: Callable[[object], None] = lambda shell: None,
) -> None:
    """Open the window: with a scene, with files to load, or with the welcome.

    load: a name and what makes its scene on a worker. app: instead of a new one. started: called
    with the shell before its first frame. Raises GraphicsError where no window can be opened.
    """
    from volviz.ui.shell import Shell

    app = app or App()
    shells: list[Shell] = []
    app.wake = lambda: shells[0].app.wake() if shells else None
    if load is not None:  # before the window is there, so that it is read while that is made
        app.load(*load)
    elif names:
        app.open(names)
    try:
        shells.append(shell := Shell(app))
    except BaseException:
        app.cancel()
        raise
    if scene is not None:
        app.show(scene, f"Open {scene.volume.name or 'volume'}")
    if load is None:
        shell.keep_folder(names)
    started(shell)
    shell.run()
