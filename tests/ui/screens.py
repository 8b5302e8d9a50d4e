"""Pictures of the window to look at: `python -m tests.ui.screens OUT`, then open OUT/sheet.png.

The whole window at 1280 × 800 and at scale 2, every panel, dialogs and both themes, on the sample
head and on real CT, MRI and microscopy (../shared/data; what is missing is left out).
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

from PIL import Image, ImageDraw

from tests.conftest import DATA
from tests.ui.display import display
from tests.ui.driver import CTRL, SHIFT, Driver, Key, Script, drive
from volviz.model.surface_look import SceneSurface
from volviz.ui.im import glfw, internal
from volviz.ui.panels import PANELS

ROOT = Path(__file__).resolve().parents[2]
HEAD = "sample:ct-head"
REAL = {
    "ct-torso": "ct/totalseg_torso_ct.nii.gz",
    "ct-head": "ct/cranium_head_ct.nrrd",
    "mri": "mri/ch2_colin27_t1.nii.gz",
    "microscopy": "microscopy/*.tif",
}
THUMB = (640, 430)
CELLS = ("surfaces.0.cells", "surfaces.0.cells.next")


def real() -> dict[str, str]:
    """Name and path of the real volumes that are here."""
    found = {name: sorted(DATA.glob(pattern))[:1] for name, pattern in REAL.items()}
    return {name: str(paths[0]) for name, paths in found.items() if paths}


def opened(d: Driver, name: str) -> Script:
    """Open, and wait for three samples a pixel: on a busy machine eight take minutes."""
    d.drop(name)
    yield from d.until(lambda: d.app.job is None, 240)
    d.app.change(d.app.scene.with_raycast(samples=3), "Samples")
    yield from d.rest(400)
    yield from d.silence()


def window(d: Driver) -> Script:
    """The whole window: welcome, head, real volumes."""
    yield from d.rest()
    d.screen("welcome")
    yield from opened(d, HEAD)
    d.screen("head")
    for name, path in real().items():
        yield from opened(d, path)
        d.screen(name)
    yield from d.key(Key.b)
    yield from d.key(Key.f9)
    yield from d.rest()
    d.screen("no-panels")


def sharp(d: Driver) -> Script:
    """On a dense or small screen: the welcome, the head, help, real volumes."""
    yield from d.rest()
    d.screen("welcome")
    yield from opened(d, HEAD)
    d.screen("head")
    yield from d.key(Key.h)
    yield
    d.screen("help")
    yield from d.key(Key.escape)
    for name, path in real().items():
        yield from opened(d, path)
        d.screen(name)


def fronts(d: Driver) -> Script:
    """What comes in front."""
    yield from opened(d, HEAD)
    yield from d.key(Key.b)
    yield from d.drag(d.middle, (120, -60))
    yield from d.rest()
    for name, keys in {
        "help": (Key.h,),
        "palette": (Key.p, CTRL, SHIFT),
        "open": (Key.o, CTRL),
        "save-picture": (Key.f12, CTRL),
    }.items():
        yield from d.key(*keys)
        yield
        d.screen(name)
        yield from d.key(Key.escape)
        yield
    yield from d.type_in("raycast.step", 0.7)
    d.shell.window.closing = True
    for _ in range(4):
        yield
    d.screen("unsaved")
    yield from d.key(Key.escape)
    yield from d.do(lambda t: t.item_click("##MainMenuBar/##MenuBar/View"))
    yield
    d.screen("menu")
    yield from d.key(Key.escape)
    d.drop("/none/there.nrrd")
    yield from d.rest()
    d.screen("message")


def filled(d: Driver, name: str) -> Script:
    """What shows a panel at work."""
    if name == "presets":
        thumbnails = d.shell.shelf.thumbnails
        yield from d.rest(400)
        yield from d.until(lambda: not d.shell.shelf.eager and thumbnails._job is None, 400)
    elif name == "surfaces":
        for _ in range(2):
            yield from d.click("surfaces.add")
        yield from d.until(lambda: d.shell.viewport.frames.extracting is None, 240)
        yield from d.click("surfaces.1.more")
    elif name == "compare":
        yield from d.click("compare.run")
        yield from d.until(lambda: not d.shell.trials.running, 400)


def panels(d: Driver) -> Script:
    """Each panel alone, tall enough."""
    yield from opened(d, real().get("ct-head", HEAD))
    quick = d.scene.with_raycast(samples=1, step=2.0)  # the panels are looked at, not the picture
    d.app.change(quick, "Step")
    yield from d.drag(d.middle, (60, -30))
    yield from d.rest(400)
    for name, entry in PANELS.items():
        for other in PANELS:
            d.shell.show_panel(other, other == name)
        d.shell.layout.reset()
        for _ in range(6):
            yield
        yield from filled(d, name)
        yield
        yield
        place = internal.find_window_by_name(f"{entry.title}###{name}")
        x, y, w, h = place.pos.x, place.pos.y, place.size.x, place.size.y
        taken = Image.fromarray(d.screen())
        taken.crop((int(x), int(y), int(x + w), int(y + h))).save(d.folder / f"window-{name}.png")


def surfaces(d: Driver) -> Script:
    """What panels tell of surfaces: report, cells, colours; span space with nodes; Compare."""
    yield from opened(d, "sample:marschner-lobb")
    one = SceneSurface.at(0.35, finder="bono")
    dyed = SceneSurface.at(0.65, coloring="field", color_field="z")
    scene = d.app.scene.with_surfaces([one, dyed]).with_knobs(show_volume=False, samples=1)
    d.app.change(scene, "Surfaces")
    frames = d.shell.viewport.frames
    yield from d.until(lambda: len([f for f in frames.surfaces if f is not None]) == 2, 400)
    yield from d.until(lambda: bool(frames.surfaces[1].fields), 200)
    yield from d.rest(400)
    for name, clicks in {
        "surfaces": ("surfaces.0.report", "surfaces.1.more"),
        "cells": (
            "surfaces.0.report",
            "surfaces.1.more",
            "surfaces.0.cells",
            "surfaces.0.cells.next",
        ),
        "span": ("span.nodes",),
        "compare": (),
    }.items():
        panel = "surfaces" if name == "cells" else name
        for other in PANELS:
            d.shell.show_panel(other, other == panel)
        if name != "cells":
            d.shell.layout.reset()
        for _ in range(6):
            yield
        for widget in clicks:
            yield from d.until(lambda w=widget: w in d.seen.where, 200)
            yield from d.click(widget)
            yield from settled(d)
        yield from settled(d)
        yield from d.rest(400)
        yield from d.silence()
        d.screen(name)


def readme(d: Driver) -> Script:
    """The picture that heads the README (tests/gallery/window.png), on a quiet machine."""
    yield from opened(d, HEAD)
    skin = SceneSurface.at(-300.0, color=(0.82, 0.71, 0.55), opacity=0.3)
    scene = d.scene.with_surfaces([SceneSurface.at(300.0), skin])
    d.app.change(scene.with_knobs(show_volume=False, samples=8), "Surfaces")
    frames = d.shell.viewport.frames
    yield from d.until(lambda: len([f for f in frames.surfaces if f is not None]) == 2, 240)
    yield from d.panel("surfaces")
    yield from d.rest(400)
    yield from d.silence()
    d.screen("window")


def settled(d: Driver) -> Script:
    """Until nothing is worked out for the panels."""
    yield
    slots = d.shell.answers._slots
    yield from d.until(lambda: all(s.answer.job is None for s in slots.values()), 300)
    yield


def small(d: Driver) -> Script:
    """A small window with large text."""
    yield from d.rest()
    d.screen("welcome")
    yield from opened(d, HEAD)
    d.screen("head")
    yield from d.key(Key.h)
    yield
    d.screen("help")
    yield from d.key(Key.escape)
    yield from d.key(Key.o, CTRL)
    yield
    d.screen("open")


# name: script, settings, scale of the display
PLAYS = {
    "dark": (window, {"size": (1280, 800)}, 1),
    "light": (window, {"size": (1280, 800), "theme": "light"}, 1),
    "large": (sharp, {"size": (1280, 800)}, 2),
    "laptop": (sharp, {"size": (1024, 640)}, 1),
    "dark-front": (fronts, {"size": (1280, 800)}, 1),
    "light-front": (fronts, {"size": (1280, 800), "theme": "light"}, 1),
    "dark-panel": (panels, {"size": (1280, 1500)}, 1),
    "light-panel": (panels, {"size": (1280, 1500), "theme": "light"}, 1),
    "dark-surfaces": (surfaces, {"size": (1280, 1100)}, 1),
    "light-surfaces": (surfaces, {"size": (1280, 1100), "theme": "light"}, 1),
    "large-panel": (panels, {"size": (1280, 800)}, 2),
    "large-surfaces": (surfaces, {"size": (1280, 800)}, 2),
    "readme": (readme, {"size": (1280, 800)}, 1),
    "small": (small, {"size": (700, 500), "scale": 2.0}, 1),
}


def make(out: Path, names: list[str]) -> list[Path]:
    """Play these, each in a process and on a display of its own; the pictures' files."""
    out.mkdir(parents=True, exist_ok=True)
    made: list[Path] = []
    for name in names:
        scale = PLAYS[name][2]
        folder = out / name
        shutil.rmtree(folder, ignore_errors=True)  # settings of a play that failed
        folder.mkdir()
        with display(1300 * scale, (1520 if scale == 1 else 820 * scale), scale) as env:
            command = [sys.executable, "-m", "tests.ui.screens", "--play", name, str(folder)]
            subprocess.run(command, env=env, cwd=ROOT, timeout=900, check=True)
        for picture in sorted(folder.glob("window-*.png")):
            target = out / f"{name}-{picture.stem.removeprefix('window-')}.png"
            made.append(picture.replace(target))
    return made


def sheet(pictures: list[Path]) -> Image.Image:
    """All of them, small, with their names."""
    across = 4
    width, height = THUMB[0], THUMB[1] + 24
    down = -(-len(pictures) // across)
    whole = Image.new("RGB", (across * width, down * height), (32, 34, 38))
    draw = ImageDraw.Draw(whole)
    for i, path in enumerate(pictures):
        x, y = i % across * width, i // across * height
        with Image.open(path) as picture:
            thumb = picture.convert("RGB")
            thumb.thumbnail((width - 8, THUMB[1]))
        whole.paste(thumb, (x + 4, y + 22))
        draw.text((x + 4, y + 5), path.stem, fill=(220, 225, 230))
    return whole


def main(arguments: list[str]) -> None:
    if arguments[0] == "--play":
        script, settings, _ = PLAYS[arguments[1]]
        if not glfw.init():
            raise SystemExit("there is no display")
        drive(script, Path(arguments[2]), **settings)
        return
    out = Path(arguments[0])
    pictures = make(out, arguments[1:] or list(PLAYS))
    sheet(pictures).save(out / "sheet.png")
    print(f"{len(pictures)} pictures in {out}")


if __name__ == "__main__":
    main(sys.argv[1:])
