"""What leaves the window: pictures for files, and what is copied."""

from __future__ import annotations

import shlex
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from volviz.errors import GraphicsError, LimitError, OutputError
from volviz.files import check_writable
from volviz.gpu.progressive import Progressive
from volviz.image import Image, image_format
from volviz.model import scenefile
from volviz.model.scene import Background
from volviz.progress import Progress
from volviz.resolve import resolve
from volviz.ui.im import imgui

if TYPE_CHECKING:
    from volviz.ui.shell import Shell


class Picture:
    """A picture that is being drawn for a file, a little with every frame."""

    def __init__(self, shell: Shell, path: Path, size: tuple[int, int], transparent: bool) -> None:
        scene = shell.app.scene
        assert scene is not None
        if transparent:
            scene = replace(scene, background=Background.plain((0.0, 0.0, 0.0, 0.0)))
        self.path, self.size = path, size
        self.frame = resolve(scene, limits=shell.app.limits)
        self.progressive = Progressive(shell.gpu, shell.viewport.resident)

    def advance(self) -> bool:
        """Draw on; True once it is whole."""
        return self.progressive.refine(self.frame, self.size, 0.05).done


class Exports:
    """The pictures and the clipboard of a shell."""

    def __init__(self, shell: Shell) -> None:
        self.shell = shell
        self.picture: Picture | None = None

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
        self.take_picture(self.picture_name(), self.shell.viewport.size, False)

    def take_picture(self, path: Path, size: tuple[int, int], transparent: bool) -> None:
        """Begin to draw a picture for a file."""
        image_format(path)
        check_writable(path)
        if self.picture is not None:
            raise OutputError("a picture is being drawn already", fix="wait for it")
        self.picture = Picture(self.shell, path, size, transparent)

    def advance(self) -> None:
        """Draw on what is being drawn; hand it to a worker once it is whole."""
        taken, app = self.picture, self.shell.app
        if taken is None:
            return
        try:
            if not taken.advance():
                return
            pixels = taken.progressive.pixels()
        except (GraphicsError, LimitError) as error:
            app.messages.add(error, "error")
            self.drop()
            return
        self.drop()
        image = Image(pixels, self.shell.gpu.renderer, taken.frame.notes)

        def work(_: Progress) -> None:
            image.save(taken.path)

        width, height = image.size
        told = f"saved {taken.path} ({width} × {height})"

        def done(_: None) -> None:
            app.messages.add(told)

        app.run(f"Writing {taken.path.name}", work, done)

    def drop(self) -> None:
        """Forget the picture that is being drawn."""
        if self.picture is not None:
            self.picture.progressive.release()
            self.picture = None

    def copy_scene(self) -> None:
        """The scene's text to the clipboard."""
        app = self.shell.app
        assert app.scene is not None
        imgui.set_clipboard_text(scenefile.encode(app.scene).decode())
        app.messages.add("copied the scene as JSON")

    def copy_command(self) -> None:
        """The command line that draws the saved scene as it is here."""
        app, stem = self.shell.app, self.shell.stem()
        width, height = self.shell.viewport.size
        name = str(app.file or f"{stem}.volviz.json")
        line = f"volviz render {shlex.quote(name)} --size {width}x{height} -o {stem}.png"
        imgui.set_clipboard_text(line)
        note = "" if app.file and not app.dirty else " (save the scene there first)"
        app.messages.add(f"copied: {line}{note}")
