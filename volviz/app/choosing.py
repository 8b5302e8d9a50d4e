"""Which of several volumes of one file or folder: the question, and the change to another one.

A series of a DICOM folder or an array of an archive is a volume of its own. Times and channels
are the same thing once more: the camera and the transfer function stay, and the one that is open
is shown until the other is there.
"""

from __future__ import annotations

import time
from collections import OrderedDict
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from volviz.app import opening
from volviz.app.jobs import Job
from volviz.app.opening import Offer, offer_of
from volviz.io.choice import choice_note
from volviz.io.options import ReadOptions
from volviz.io.parts import Choices, Part
from volviz.model.scene import SceneState
from volviz.model.volume import Volume, VolumeInfo
from volviz.progress import Progress
from volviz.sources import is_sample, open_volume, source_of

if TYPE_CHECKING:
    from volviz.app.viewer import App

KEPT_BYTES = 512 << 20
"""Times that were shown are kept up to so many bytes: a film need not be read twice."""
INTERVAL = 1 / 6
"""Seconds from one time to the next while a film plays."""
SERIES = ("series", "array")


def told(info: VolumeInfo) -> tuple[str, ...]:
    """A volume's warnings but that it is one of several: the window shows which."""
    shown = (
        *choice_note(info.times, info.time, what="time"),
        *choice_note(info.channels, info.channel, what="channel"),
    )
    return tuple(w for w in info.warnings if w not in shown)


def channel_titles(info: VolumeInfo) -> tuple[str, ...]:
    """What each channel is called: by its number, and by the file's own name if it has one."""
    numbers = [f"{k + 1} of {info.channels}" for k in range(info.channels)]
    if len(info.channel_names) != info.channels:
        return tuple(numbers)
    return tuple(
        f"{k + 1}: {name}" if name.strip() else numbers[k]
        for k, name in enumerate(info.channel_names)
    )


def may_have_parts(scene: SceneState | None) -> bool:
    """False where there is surely nothing to choose: samples, arrays in memory, single images."""
    if scene is None or scene.source is None or is_sample(scene.source.path):
        return False
    info = scene.volume.info
    several = info.times * info.channels > 1 or "series" in dict(scene.source.choices)
    return several or info.format in ("DICOM", "NumPy")


def asking(scene: SceneState, **choices: int | str) -> SceneState:
    """The scene with the wish for another part of its source: what `App.change` understands."""
    if scene.source is None:
        return scene
    return replace(scene, source=replace(scene.source, choices=merged(scene, **choices)))


def is_wish(before: SceneState, after: SceneState) -> bool:
    """True if `after` is what `asking` makes of `before`."""
    return after.volume is before.volume and after.source not in (None, before.source)


def merged(scene: SceneState, **choices: int | str) -> Choices:
    """The source's choices with these instead of their own; defaults are left out."""
    assert scene.source is not None
    known: dict[str, Any] = {**dict(scene.source.choices), **choices}
    return ReadOptions(**known).chosen()


class Choosing:
    """The question of one window, and the part that is wanted. Only the main thread calls it."""

    def __init__(self, app: App) -> None:
        self.app = app
        self.offer: Offer | None = None
        self.series: Offer | None = None
        self.wanted: Choices | None = None
        self.playing = False
        self._job: Job | None = None
        self._shown = 0.0
        self._kept: OrderedDict[Choices, Volume] = OrderedDict()
        self._path = ""

    # --- the question ------------------------------------------------------------------------

    def ask(self, offer: Offer) -> None:
        """Put a question; it stands until `take` or `decline`."""
        if offer.parts and offer.parts[0].kind in SERIES:
            self.series = offer
        self.offer = offer

    def decline(self) -> None:
        """Nothing is opened; what is open stays."""
        self.offer = None

    def take(self, part: Part) -> None:
        """The answer."""
        offer, self.offer = self.offer, None
        if offer is None:
            return
        if part.kind not in SERIES and self._is_open(offer.name):
            self.want({"time": 0, "channel": 0, **dict(part.choices)})
        elif offer.again is not None:
            self.app.load(offer.name, offer.again(dict(part.choices)))
        elif part.choices != offer.present:
            self.app.open(offer.name, **dict(part.choices))

    def list_parts(self) -> None:
        """Ask which part of the open source, once a worker has listed them."""
        scene = self.app.scene
        if scene is None or scene.source is None or not may_have_parts(scene):
            return
        name, present = scene.source.path, scene.source.choices

        def done(offer: Offer) -> None:
            if len(offer.parts) < 2:
                self.app.messages.add(f"{opening.title_of(name)} holds nothing else to open")
            else:
                self.ask(replace(offer, present=present))

        title = f"Looking into {opening.title_of(name)}"
        self.app.run(title, lambda progress: offer_of(name, progress), done)

    @property
    def listed(self) -> tuple[Part, ...]:
        """The series or arrays beside the open one, as far as they were listed."""
        if self.series is None or not self._is_open(self.series.name):
            return ()
        return self.series.parts

    def _is_open(self, name: str) -> bool:
        scene = self.app.scene
        return scene is not None and scene.source is not None and scene.source.path == name

    # --- another part ------------------------------------------------------------------------

    def asked(self, wish: SceneState) -> None:
        """Grant the wish of `asking`."""
        if wish.source is not None:
            self._ask_for(wish.source.choices)

    def _ask_for(self, choices: Choices) -> None:
        """Read this part of the open source: a time or channel of it, or another series."""
        scene = self.app.scene
        if scene is None or scene.source is None:
            return
        if dict(choices).get("series") != dict(scene.source.choices).get("series"):
            self.app.open(scene.source.path, **dict(choices))
        else:
            self.wanted = choices
            self.poll()

    def want(self, choices: dict[str, int | str]) -> None:
        """The same by what differs, e.g. `{"time": 3}`."""
        if self.app.scene is not None and self.app.scene.source is not None:
            self._ask_for(merged(self.app.scene, **choices))

    def step(self, by: int) -> None:
        """So many times on, around the ends."""
        scene = self.app.scene
        if scene is not None and scene.volume.info.times > 1:
            at = dict(self.wanted or ()).get("time", 0) if self.wanted else scene.volume.info.time
            self.want({"time": (at + by) % scene.volume.info.times})

    def play(self, on: bool) -> None:
        """Show one time after the other, or stop."""
        scene = self.app.scene
        self.playing = on and scene is not None and scene.volume.info.times > 1

    @property
    def wait(self) -> float | None:
        """Seconds until `poll` has something to do, None if never."""
        if not self.playing or self._job is not None:
            return None
        return max(self._shown + INTERVAL - time.monotonic(), 0.0)

    def poll(self) -> bool:
        """Goes on with what is wanted; True if the picture changed."""
        self._look_after_job()
        scene = self.app.scene
        if scene is None or scene.source is None:
            self.wanted, self.playing = None, False
            return False
        if self.playing and self.wanted is None and self.wait == 0:
            self.step(1)
            return self.wanted is None
        if self.wanted is None or self.app.job not in (None, self._job):
            return False
        known = self._known(scene, self.wanted)
        present = self.wanted == scene.source.choices
        if self._job is not None:
            if present or known is not None or self._job.title != self._title(self.wanted):
                self._job.cancel()  # `poll` starts the wanted one when this one has ended
        elif not present and known is None:
            self._read(scene, self.wanted)
        if present:
            self.wanted = None
        elif known is not None:
            self._show(known)
            return True
        return False

    def _look_after_job(self) -> None:
        job = self._job
        if job is None or self.app.job is job:
            return
        self._job = None
        if not job.finished or (job.error is not None and not job.cancelled):
            self.wanted, self.playing = None, False  # stopped by the user, or it cannot be read

    def _known(self, scene: SceneState, choices: Choices) -> Volume | None:
        assert scene.source is not None
        if scene.source.path != self._path:
            self._kept.clear()
            self._path = scene.source.path
        return self._kept.get(choices)

    def _title(self, choices: Choices) -> str:
        assert self.app.scene is not None
        info, chosen = self.app.scene.volume.info, dict(choices)
        words = [
            f"{what} {chosen.get(what, 0) + 1}"
            for what, count in (("time", info.times), ("channel", info.channels))
            if count > 1
        ]
        return f"Reading {', '.join(words) or 'another part'}"

    def _read(self, scene: SceneState, choices: Choices) -> None:
        assert scene.source is not None
        path, app = scene.source.path, self.app
        options: dict[str, Any] = dict(choices)

        def work(progress: Progress) -> Volume:
            reading = ReadOptions(progress=progress.part(0.0, opening.READING), **options)
            volume = open_volume(path, reading)
            drawn = replace(scene, volume=volume)
            opening.prepared(drawn, app.limits, progress.part(opening.READING, 1.0))
            return volume

        app.run(self._title(choices), work, self._show)
        self._job = app.job

    def _show(self, volume: Volume) -> None:
        """The volume that was read takes the place of the one that is open."""
        scene, source = self.app.scene, source_of(volume)
        if scene is None or scene.source is None or source is None:
            return
        path = opening.absolute(source.path)
        if path != scene.source.path:
            return
        before = scene.volume.info
        self._keep(scene.source.choices, scene.volume)
        self._keep(source.choices, volume)
        self._shown = time.monotonic()
        if self.wanted == source.choices:
            self.wanted = None
        what = "channel" if volume.info.channel != before.channel else "time"
        label = f"{what.capitalize()} {getattr(volume.info, what) + 1}"
        new = replace(scene, volume=volume, source=replace(source, path=path))
        self.app.show_part(new, label)
        for warning in told(volume.info):
            if warning not in before.warnings:
                self.app.messages.once(f"{opening.title_of(path)}: {warning}")

    def _keep(self, choices: Choices, volume: Volume) -> None:
        self._kept[choices] = volume
        self._kept.move_to_end(choices)
        while len(self._kept) > 1 and sum(map(held_bytes, self._kept.values())) > KEPT_BYTES:
            self._kept.popitem(last=False)

    def forget(self) -> None:
        """Another source is open: what was kept of the last one goes."""
        self._kept.clear()
        self._path = ""
        self.wanted, self.playing = None, False


def held_bytes(volume: Volume) -> int:
    """What a volume takes in memory with what is remembered of it: voxels and texture."""
    texel = 2 if volume.data.dtype.itemsize <= 2 else 4
    return int(volume.info.nbytes + texel * np.prod(volume.dims, dtype=np.int64))
