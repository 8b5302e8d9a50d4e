"""What leaves the window: pictures for files and for the clipboard, and what is copied as text."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from volviz import recipe
from volviz.app.jobs import Job
from volviz.app.pasting import paste
from volviz.errors import Cancelled, OutputError, UsageError, VolvizError
from volviz.files import check_writable, write_atomically
from volviz.gpu.checked import ContextLost
from volviz.gpu.still import Still
from volviz.image import Image, image_format
from volviz.model import scenefile
from volviz.model.frame import Frame
from volviz.model.mesh import Mesh
from volviz.model.scene import Background, SceneState
from volviz.progress import Progress
from volviz.resolve import resolve
from volviz.ui import clipboard

if TYPE_CHECKING:
    from volviz.ui.shell import Shell

DRAW_SECONDS = 0.05
CLOSING_SECONDS = 30.0


class Picture:
    """A picture that is being drawn, a little with every frame, once a worker has prepared it.

    title: said while it is. still: None until then.
    """

    def __init__(
        self,
        shell: Shell,
        title: str,
        scene: SceneState,
        size: tuple[int, int],
        take: Callable[[Image], None],
    ) -> None:
        self.title, self.take = title, take
        self.started = time.monotonic()
        self.still: Still | None = None
        limits = shell.app.limits

        def work(progress: Progress) -> Frame:
            return resolve(scene, limits=limits, progress=progress, size=size)

        def prepared(frame: Frame) -> None:
            self.started = time.monotonic()
            self.still = Still(shell.gpu, shell.viewport.resident, frame, size)

        self._preparing = Job(title, work, prepared, shell.app.wake)

    @property
    def fraction(self) -> float | None:
        """The part that is drawn; None while it is prepared."""
        return None if self.still is None else self.still.fraction

    @property
    def remaining(self) -> float | None:
        """Estimated seconds to go, None while nobody can know."""
        elapsed, done = time.monotonic() - self.started, self.fraction or 0.0
        return elapsed * (1 - done) / done if elapsed > 0.7 and done > 1e-4 else None

    def advance(self, seconds: float) -> Still | None:
        """Draw for about so long; the picture once it is whole. Raises what went wrong."""
        if self.still is None and self._preparing.finished:
            self._preparing.deliver()
        whole = self.still is not None and self.still.advance(seconds)
        return self.still if whole else None

    def release(self) -> None:
        """Give it up; what is drawn stays."""
        self._preparing.cancel()
        if self.still is not None:
            self.still.release()


class Exports:
    """The pictures and the clipboard of a shell; one thing at a time."""

    def __init__(self, shell: Shell) -> None:
        self.shell = shell
        self.picture: Picture | None = None
        self.job: Job | None = None

    @property
    def busy(self) -> bool:
        """True while something is drawn, written or put together."""
        return self.picture is not None or self.job is not None

    @property
    def drawing(self) -> bool:
        """True while every frame is to draw a part of a picture."""
        return self.picture is not None and self.picture.still is not None

    # --- pictures --------------------------------------------------------------------------------

    def picture_name(self) -> Path:
        """The first free name for a picture of this scene."""
        shell = self.shell
        folder = Path(shell.app.settings.folder or Path.cwd())
        if not folder.is_dir():
            folder = Path.cwd()
        number = 1
        while (path := folder / f"{shell.stem()}-{number:03d}.png").exists():
            number += 1
        return path

    def quick_picture(self) -> None:
        """What is shown, at full quality, to the next free name."""
        self.take_picture(self.picture_name(), self.shell.viewport.size)

    def take_picture(
        self,
        path: Path,
        size: tuple[int, int],
        transparent: bool = False,
        samples: int | None = None,
        *,
        overwrite: bool = False,
    ) -> None:
        """Begin to draw a picture for a file. samples: None for the scene's own number."""
        form = image_format(path, size)
        check_writable(path, overwrite=overwrite)

        def take(image: Image) -> None:
            def work(progress: Progress) -> None:
                progress(None, "writing")
                content = image.encoded(form)
                progress(None, "writing")
                write_atomically(path, content, overwrite=overwrite)

            told = f"saved {path} ({size[0]} × {size[1]})"
            self._run(f"Writing {path.name}", work, lambda _: self._tell(told))

        self._begin(f"Drawing {path.name}", size, take, transparent, samples)

    def copy_picture(self) -> None:
        """What is shown, at full quality, to the clipboard."""
        width, height = self.shell.viewport.size
        told = f"copied the picture ({width} × {height})"

        def take(image: Image) -> None:
            self._run(
                "Copying the picture",
                lambda _: clipboard.put_picture(image),
                lambda _: self._tell(told),
            )

        self._begin("Drawing the picture", (width, height), take)

    def _begin(
        self,
        title: str,
        size: tuple[int, int],
        take: Callable[[Image], None],
        transparent: bool = False,
        samples: int | None = None,
    ) -> None:
        scene = self._scene()
        if transparent:
            scene = replace(scene, background=Background.plain((0.0, 0.0, 0.0, 0.0)))
        if samples is not None:
            scene = scene.with_raycast(samples=samples)
        self._free()
        self.picture = Picture(self.shell, title, scene, size, take)

    def advance(self) -> None:
        """Once per frame: draw on, take over what a worker finished."""
        self._deliver()
        taken = self.picture
        if taken is None:
            return
        try:
            still = taken.advance(DRAW_SECONDS)
        except ContextLost:
            raise
        except Exception as error:
            self._failed(taken.title, error)
            self.drop()
            return
        if still is None:
            return
        self.drop()
        taken.take(Image(still.pixels, self.shell.gpu.renderer, still.frame.notes))

    def cancel(self) -> None:
        """Stop what is drawn or written."""
        title = self.picture.title if self.picture else self.job.title if self.job else ""
        self.drop()
        if self.job is not None:
            self.job.cancel()
        if title:
            self._tell(f"{title}: cancelled")

    def drop(self) -> None:
        """Forget the picture that is being drawn."""
        if self.picture is not None:
            self.picture.release()
            self.picture = None

    def close(self) -> None:
        """The window closes: what is drawn is given up, what is being written is finished."""
        self.drop()
        end = time.monotonic() + CLOSING_SECONDS
        while self.job is not None and not self.job.finished and time.monotonic() < end:
            time.sleep(0.02)

    def write_surface(self, path: Path, work: Callable[[Progress], Mesh]) -> None:
        """Begin to write a surface; `work` makes and writes it, on a worker."""
        self._free()

        def done(mesh: Mesh) -> None:
            count, what = len(mesh.faces), "triangles"
            if not count:
                count, what = len(mesh.vertices), "points"
            self._tell(f"saved {path} ({count:,} {what})")

        self._run(f"Writing {path.name}", work, done)

    # --- text ------------------------------------------------------------------------------------

    def copy_scene(self) -> None:
        """The scene's text to the clipboard."""
        try:
            text = scenefile.encode(self._scene()).decode()
        except UnicodeEncodeError as error:
            raise OutputError(
                "the scene cannot be copied: the volume's name is not UTF-8", fix="rename it"
            ) from error
        clipboard.put_text(text)
        self._tell("copied the scene as JSON")

    def copy_command(self) -> None:
        """The command line that makes the same picture."""
        self._copy(recipe.command, "the command line")

    def copy_python(self) -> None:
        """The Python code that makes the same picture."""
        self._copy(recipe.python, "the Python code")

    def _copy(self, write: Callable[..., str], what: str) -> None:
        scene, size = self._scene(), self.shell.viewport.size
        output = f"{self.shell.stem()}.png"
        self._free()

        def done(text: str) -> None:
            clipboard.put_text(text)
            self._tell(f"copied {what} that makes this picture")

        # what volviz would suggest has to be worked out first, which can take a while
        self._run(f"Writing {what}", lambda _: write(scene, size, output), done)

    def paste(self) -> None:
        """Take over a scene that was copied as JSON; open what was copied as a path."""
        paste(self.shell.app, clipboard.text())

    # --- both ------------------------------------------------------------------------------------

    def _scene(self) -> SceneState:
        scene = self.shell.app.scene
        if scene is None:
            raise UsageError("nothing is open", fix="open a file first")
        return scene

    def _free(self) -> None:
        if self.busy:
            raise OutputError("something is drawn or copied already", fix="wait for it, or cancel")

    def _run(
        self, title: str, work: Callable[[Progress], Any], done: Callable[[Any], None]
    ) -> None:
        self.job = Job(title, work, done, self.shell.app.wake)

    def _deliver(self) -> None:
        job = self.job
        if job is None or not job.finished:
            return
        self.job = None
        try:
            job.deliver()
        except Exception as error:
            self._failed(job.title, error)

    def _failed(self, title: str, error: Exception) -> None:
        messages = self.shell.app.messages
        if isinstance(error, Cancelled):
            return
        if isinstance(error, VolvizError):
            messages.add(error, "error")
        else:
            kind = type(error).__name__
            messages.add(f"{title}: a bug in volviz: {kind}: {error}", "error")

    def _tell(self, text: str) -> None:
        self.shell.app.messages.add(text)
