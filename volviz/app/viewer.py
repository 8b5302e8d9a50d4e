"""The running viewer: which scene is open, how it came to be, what is being loaded, what to tell.

The window draws it and calls it; nothing here knows of windows or OpenGL. One thread (the
window's) calls everything; workers only run `Job`s.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from volviz.app import choosing, opening, settings
from volviz.app.autosave import Autosave
from volviz.app.choosing import Choosing, told
from volviz.app.jobs import Job
from volviz.app.messages import Messages
from volviz.app.raw import RawQuestion, raw_question
from volviz.app.settings import Settings
from volviz.errors import Cancelled, VolvizError
from volviz.folders import config_folder, state_folder
from volviz.model.history import History
from volviz.model.scene import SceneState
from volviz.model.volume import Volume
from volviz.progress import Progress
from volviz.resolve import MEMO, TextureLimits
from volviz.scene import Scene
from volviz.sources import source_of

KEPT_BYTES = 2 << 30
"""Volumes that only undo can reach are dropped beyond this many bytes, oldest first."""


class App:
    """Everything the window shows but the window.

    wake: called from workers when there is news; it must be safe in any thread. folder: of the
    settings (default: the user's). limits: of the graphics, set once the window knows them.
    """

    settings: Settings
    history: History[SceneState] | None

    def __init__(
        self, *, folder: Path | None = None, wake: Callable[[], None] = lambda: None
    ) -> None:
        self.folder = folder or config_folder()
        self.settings, notice = settings.load(self.folder)
        self.wake = wake
        self.limits = TextureLimits()
        self.aspect = 4 / 3
        self.messages = Messages()
        self.history = None
        self.job: Job | None = None
        self.saved: SceneState | None = None
        self.file: Path | None = None
        self.choosing = Choosing(self)
        self.raw: RawQuestion | None = None
        self.autosave = Autosave(state_folder() if folder is None else self.folder / "autosave")
        if notice:
            self.messages.add(notice, "warning")

    # --- the scene ---------------------------------------------------------------------------

    @property
    def scene(self) -> SceneState | None:
        """The open scene, None before the first."""
        return None if self.history is None else self.history.state

    @property
    def dirty(self) -> bool:
        """True if something but camera, time and channel was changed since opened or saved."""
        scene, saved = self.scene, self.saved
        if scene is None or saved is None or scene == saved:
            return False
        scene = replace(scene, camera=saved.camera)
        if scene.source and saved.source and scene.source.path == saved.source.path:
            scene = replace(scene, volume=saved.volume, source=saved.source)
        return scene != saved

    def show(self, scene: SceneState, label: str) -> None:
        """A newly opened scene becomes the present; the one before is one undo away."""
        if self.history is None:
            self.history = History.of(scene, label)
        else:
            if scene.volume is not self.history.state.volume:
                MEMO.shed(self.history.state.volume)
            self.history = self._push(scene, label, "")
        self.saved, self.file = scene, None
        self.choosing.forget()

    def show_part(self, scene: SceneState, label: str) -> None:
        """The same scene with another time or channel; a film is one step of undo."""
        assert self.history is not None
        self.history = self._push(scene, label, "part")

    def change(self, scene: SceneState, label: str, key: str = "") -> None:
        """The user changed something. key: changes in a row with the same key are one step.

        Another source (see `choosing.asking`) is read first.
        """
        if self.history is None:
            self.show(scene, label)
        elif choosing.is_wish(self.history.state, scene):
            self.choosing.asked(scene)
        elif scene is not self.scene:
            self.history = self._push(scene, label, key)

    def settle(self) -> None:
        """The mouse button was released: the next change is a step of its own."""
        if self.history is not None and self.history.present.key and not self.choosing.playing:
            self.history = self.history.settled()

    def undo(self) -> None:
        """One step back."""
        if self.history is not None:
            self._move(self.history.undo())

    def redo(self) -> None:
        """One step forward."""
        if self.history is not None:
            self._move(self.history.redo())

    def go(self, index: int) -> None:
        """To the step with this index."""
        if self.history is not None:
            self._move(self.history.at(index))

    def _push(self, scene: SceneState, label: str, key: str) -> History[SceneState]:
        assert self.history is not None
        before = self.history
        after = before.push(scene, label, key)
        new_volume = scene.volume is not before.state.volume
        return _trimmed(after) if new_volume else after

    def _move(self, after: History[SceneState]) -> None:
        assert self.history is not None
        _shed(self.history.state, after.state)
        self.history = after

    # --- opening -----------------------------------------------------------------------------

    def open(self, names: str | Sequence[str], **choices: Any) -> None:
        """Open a file, folder, sample or scene on a worker; the open scene stays until then.

        choices: fields of `ReadOptions`. Several names: the first, or the folder they are slices
        of; the rest goes to the recent ones.
        """
        given = [names] if isinstance(names, str) else list(names)
        if not given:
            return
        given = [opening.absolute(n) for n in given]
        if len(given) == 1:
            self._open_one(given[0], choices)
            return
        title = f"Looking at {len(given)} files"

        def decided(found: tuple[str, str, list[str]]) -> None:
            name, note, others = found
            self.messages.add(note)
            for other in reversed(others):
                self.remember(other)
            self._open_one(name, choices)

        self.run(title, lambda _: opening.decided(given), decided)

    def _open_one(self, name: str, choices: dict[str, Any]) -> None:
        self.load(name, opening.maker(name, lambda: self.aspect, lambda: self.limits, **choices))

    def load(self, name: str, make: opening.Making) -> None:
        """Run `make` on a worker and show its scene. A load that still runs is cancelled."""
        self.cancel()
        title = f"Opening {opening.title_of(name)}"
        self.job = Job(title, make, lambda scene: self._opened(name, scene), self.wake)

    def open_volume(self, volume: Volume) -> None:
        """Show a volume that is in memory already."""
        self.load(volume.name or "volume", lambda _: Scene.of(volume, aspect=self.aspect))

    def cancel(self) -> None:
        """Stop what runs; it gives up at its next report, and its result is not shown."""
        if self.job is not None:
            self.job.cancel()
            self.job = None

    def poll(self) -> bool:
        """Take over what a worker finished; True if something changed."""
        notice = self.autosave.tick(self.scene, dirty=self.dirty)
        if notice:
            self.messages.once(notice)
        job = self.job
        if job is None or not job.finished:
            return self.choosing.poll()
        self.job = None
        try:
            job.deliver()
        except Cancelled:
            pass
        except VolvizError as error:
            self.raw = raw_question(error)
            if self.raw is None:
                self.messages.add(error, "error")
            self._forget_missing(error)
        except Exception as error:
            kind = type(error).__name__
            self.messages.add(f"{job.title}: a bug in volviz: {kind}: {error}", "error")
        self.choosing.poll()
        return True

    def _forget_missing(self, error: VolvizError) -> None:
        """What is not there any more goes from the recent ones."""
        gone = str(error.file)
        if error.file is not None and gone in self.settings.recent and not os.path.lexists(gone):
            rest = tuple(n for n in self.settings.recent if n != gone)
            self.keep(replace(self.settings, recent=rest))

    def remember(self, name: str) -> None:
        """Put a name on top of the recent ones."""
        self.keep(self.settings.opened(name))

    def _opened(self, name: str, scene: SceneState | opening.Offer) -> None:
        if isinstance(scene, opening.Offer):
            self.choosing.ask(scene)
            return
        self.show(opening.with_source(scene, name), f"Open {opening.title_of(name)}")
        if opening.is_scene_file(name):
            self.file = Path(name)
        if scene.source is not None or self.file is not None:
            self.remember(name)
        for warning in told(scene.volume.info):
            self.messages.add(f"{opening.title_of(name)}: {warning}", "warning")

    # --- saving ------------------------------------------------------------------------------

    def save(self, path: str | Path, then: Callable[[], None] | None = None) -> None:
        """Write the scene, on a worker (the voxels' fingerprint takes a while).

        then: done once it is written.
        """
        scene = self.scene
        if scene is None:
            return
        file = Path(path).expanduser()
        if not file.name.lower().endswith(".json"):
            file = file.with_name(file.name + ".volviz.json")
        whole = _public(scene)

        def work(_: Progress) -> None:
            whole.save(file)

        def saved(_: None) -> None:
            self.saved, self.file = scene, file
            self.remember(str(file.absolute()))
            self.messages.add(f"saved {file}")
            if then is not None:
                then()

        self.cancel()
        self.job = Job(f"Saving {file.name}", work, saved, self.wake)

    def run(self, title: str, work: Callable[[Progress], Any], done: Callable[[Any], None]) -> None:
        """Run other long work on the worker, e.g. writing a picture."""
        self.cancel()
        self.job = Job(title, work, done, self.wake)

    # --- settings ----------------------------------------------------------------------------

    def keep(self, new: Settings) -> None:
        """Use these settings and write them."""
        if new != self.settings:
            self.settings = new
            notice = settings.save(new, self.folder)
            if notice:
                self.messages.once(notice)

    def close(self) -> None:
        """A clean end."""
        self.cancel()
        self.autosave.discard()


def _public(scene: SceneState) -> Scene:
    if isinstance(scene, Scene):
        return scene
    parts = {name: getattr(scene, name) for name in SceneState.__dataclass_fields__}
    return Scene(**{**parts, "source": scene.source or source_of(scene.volume)})


def _shed(before: SceneState, after: SceneState) -> None:
    """Another file is shown: of the one before, only the voxels stay for undo.

    Times and channels of one file keep their textures: they are played in a loop.
    """
    paths = [scene.source.path for scene in (before, after) if scene.source]
    same = len(paths) == 2 and paths[0] == paths[1]
    if before.volume is not after.volume and not same:
        MEMO.shed(before.volume)


def _trimmed(history: History[SceneState]) -> History[SceneState]:
    """Without the oldest steps, if the volumes that undo reaches take too much memory."""
    volumes = {id(history.state.volume)}
    total = 0
    for count, step in enumerate(reversed(history.past)):
        volume = step.state.volume
        if id(volume) not in volumes:
            volumes.add(id(volume))
            total += volume.info.nbytes
        if total > KEPT_BYTES:
            return replace(history, past=history.past[len(history.past) - count :])
    return history
