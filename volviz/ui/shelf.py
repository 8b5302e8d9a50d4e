"""What the gallery and the bookmarks have besides the scene: pictures, favourites, messages.

Panels find it in `Facts.local`; the window connects it. Without a window there are no pictures,
and favourites last as long as the panel.
"""

from __future__ import annotations

import threading
from collections.abc import Iterable
from dataclasses import replace
from typing import TYPE_CHECKING

from volviz.classify import own_presets, presets
from volviz.ui.thumbnails import Thumbnails, Wish

if TYPE_CHECKING:
    from volviz.app import App
    from volviz.gpu.checked import Gpu


class Shelf:
    """One per window."""

    def __init__(self) -> None:
        self.app: App | None = None
        self.thumbnails: Thumbnails | None = None
        self.eager = False
        self._favourites: tuple[str, ...] = ()
        self._told: own_presets.Own | None = None
        self._reader: threading.Thread | None = None

    def connect(self, app: App, gpu: Gpu) -> Shelf:
        """Belong to a window from now on."""
        self.app = app
        # all files once, so that the window's thread finds them read
        self._reader = threading.Thread(target=presets.presets, name="presets", daemon=True)
        self._reader.start()
        self.thumbnails = Thumbnails(gpu, app.wake, app.messages.once)
        return self

    # --- pictures --------------------------------------------------------------------------------

    def wish(self, wishes: Iterable[Wish]) -> None:
        """These pictures are wanted, the most urgent first."""
        if self.thumbnails is not None:
            self.thumbnails.wish(wishes)

    def texture(self, *keys: object) -> int | None:
        """OpenGL's name of the first of these pictures that there is."""
        for key in keys if self.thumbnails is not None else ():
            assert self.thumbnails is not None
            found = self.thumbnails.texture(key)
            if found is not None:
                return found
        return None

    def advance(self, *, free: bool) -> None:
        """At the end of a frame: draw a little, if nothing moves; tell which files are broken."""
        if self.app is None or self.thumbnails is None:
            return
        if self._reader is not None and not self._reader.is_alive():
            self._tell_broken()
        scene = self.app.scene
        self.eager = self.thumbnails.advance(scene, free=free, limits=self.app.limits)

    def _tell_broken(self) -> None:
        """Say which of the user's files are wrong, once for each state of their folder."""
        mine = own_presets.recent()
        if mine is not self._told:
            self._told = mine
            for error in mine.broken.values():
                self.tell(error)

    def tell(self, error: Exception) -> None:
        """Say once what is wrong with a file."""
        if self.app is not None:
            self.app.messages.once(error, "warning")

    def release(self) -> None:
        """Free what is on the GPU."""
        if self.thumbnails is not None:
            self.thumbnails.release()

    # --- favourites ------------------------------------------------------------------------------

    @property
    def favourites(self) -> tuple[str, ...]:
        """Names of presets, in the order in which they were chosen."""
        return self._favourites if self.app is None else self.app.settings.favourites

    def star(self, name: str, on: bool) -> None:
        """Make a preset a favourite, or no longer; kept in the settings."""
        rest = tuple(n for n in self.favourites if n != name)
        self._keep((*rest, name) if on else rest)

    def renamed(self, name: str, new: str) -> None:
        """A favourite has another name now."""
        self._keep(tuple(new if n == name else n for n in self.favourites))

    def _keep(self, names: tuple[str, ...]) -> None:
        self._favourites = names
        if self.app is not None:
            self.app.keep(replace(self.app.settings, favourites=names))
