"""Flags that several commands share, and those that the knobs make."""

from __future__ import annotations

import functools
import inspect
import math
import re
from collections.abc import Callable, Mapping, Sequence
from copy import copy
from pathlib import Path
from typing import Annotated, Any

import typer

from volviz.errors import UsageError
from volviz.io.options import GIB, Limits, ReadOptions
from volviz.model.camera import Camera
from volviz.model.knobs import Knob, exacts_of, knobs_of
from volviz.model.lens import Lens
from volviz.model.scene import Light, Raycast
from volviz.model.scenefile import decode_transfer
from volviz.model.transfer import TransferFunction
from volviz.progress import Progress
from volviz.scene import read_scene
from volviz.sources import is_sample

SCENE_SUFFIX = ".json"
CAMERA = "camera_"
ALIASES = {"show_volume": ("--volume/--no-volume",)}
"""Further spellings of a knob's flag."""
PANELS: dict[type, str] = {Raycast: "Rays", Light: "Light", Camera: "Camera", Lens: "Lens"}
Flag = inspect.Parameter


def flag(name: str, kind: Any, help_text: str, panel: str, *more: str) -> Flag:
    """A keyword `name` that becomes `--name` (and the further spellings), None if not given."""
    plain = name.replace("_", "-")
    spelled = [f"--{plain}/--no-{plain}" if kind is bool else f"--{plain}", *more]
    option = typer.Option(*spelled, help=help_text, rich_help_panel=panel, show_default=False)
    return Flag(name, Flag.KEYWORD_ONLY, default=None, annotation=Annotated[kind | None, option])


def knob_flags(panels: Mapping[type, str] = PANELS) -> list[Flag]:
    """One flag for every knob of a scene, or of other dataclasses; with the panel of the help."""
    return [
        flag(k.name, str if k.choices else k.type, _help(k), panel, *ALIASES.get(k.name, ()))
        for owner, panel in panels.items()
        for k in knobs_of(owner)
    ]


def several(name: str, flags: Sequence[Flag]) -> list[Flag]:
    """The flags; every value of the number of this name arrives, not the last one alone."""
    made = []
    for one in flags:
        if one.name == name:
            option = copy(one.annotation.__metadata__[0])
            option.metavar = "<float>"  # one is what is asked for
            one = one.replace(annotation=Annotated[list[float] | None, option])
        made.append(one)
    return made


def camera_flags() -> list[Flag]:
    """One flag for every number of a camera that no view and no turn can give exactly."""
    return [
        flag(CAMERA + k.name, float if k.type is float else str, k.help, PANELS[Camera])
        for k in exacts_of(Camera)
    ]


def exact_camera(given: dict[str, Any]) -> dict[str, Any]:
    """Fields of a camera from the values of `camera_flags`."""
    return {
        k.name: value
        if k.type is float
        else tuple(numbers(value, (3,), f"--camera-{k.name}", "X,Y,Z"))
        for k in exacts_of(Camera)
        if (value := given.get(CAMERA + k.name)) is not None
    }


READING = "Reading"
READ_FLAGS = [
    flag("series", str, "DICOM series (number, UID or description), or array in an .npz", READING),
    flag("time", int, "which time point of a file that has several, from 0", READING),
    flag("channel", int, "which channel of a file that has several, from 0", READING),
    flag("shape", str, "samples of a RAW file: XxYxZ", READING),
    flag("dtype", str, "type of a RAW file's voxels, e.g. uint16", READING),
    flag("endian", str, "byte order of a RAW file: little or big", READING),
    flag("offset", int, "bytes before the voxels of a RAW file", READING),
    flag("spacing", str, "mm between samples, X,Y,Z; instead of the file's own", READING),
    flag("allow_outside", Path, "a further folder from which detached data may be read", READING),
    flag("max_memory", float, "GiB that the voxels may take", READING),
]


def with_flags(flags: Sequence[Flag]) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Add flags to a command; their values that were given arrive in its `given` dict."""

    def decorate(function: Callable[..., Any]) -> Callable[..., Any]:
        own = inspect.signature(function, eval_str=True)
        named = [p for p in own.parameters.values() if p.name != "given"]
        added = {f.name for f in flags}

        @functools.wraps(function)
        def command(**values: Any) -> Any:
            given = {k: values.pop(k) for k in list(values) if k in added}
            return function(**values, given={k: v for k, v in given.items() if v is not None})

        everything = [*named, *flags]
        command.__signature__ = inspect.Signature(everything)  # type: ignore[attr-defined]
        command.__annotations__ = {p.name: p.annotation for p in everything}
        return command

    return decorate


def read_options(given: dict[str, Any], progress: Progress | None = None) -> ReadOptions:
    """ReadOptions from the flags in `given`, which are taken out of it."""
    chosen = {f.name: given.pop(f.name) for f in READ_FLAGS if f.name in given}
    if "shape" in chosen:
        chosen["shape"] = whole_numbers(chosen["shape"], 3, "--shape", "XxYxZ")
    if "spacing" in chosen:
        steps = numbers(chosen["spacing"], (3,), "--spacing", "X,Y,Z in mm")
        if not all(1e-50 < s < 1e50 for s in steps):
            raise UsageError(f"'{chosen['spacing']}' are no lengths in mm", field="--spacing")
        chosen["spacing"] = tuple(steps)
    memory = chosen.pop("max_memory", None)
    if memory is not None:
        if not 0 < memory < math.inf:
            raise UsageError(f"{memory} GiB is no limit", field="--max-memory")
        chosen["limits"] = Limits(max_bytes=int(memory * GIB))
    if progress is not None:
        chosen["progress"] = progress
    return ReadOptions(**chosen)


def picture_size(text: str, field: str = "--size") -> tuple[int, int]:
    """`800x600` (or 800,600; or 512 for a square)."""
    if re.fullmatch(r"\d+", text):
        text = f"{text}x{text}"
    width, height = whole_numbers(text, 2, field, "WIDTHxHEIGHT")
    return width, height


def whole_numbers(text: str, count: int, field: str, form: str) -> tuple[int, ...]:
    """Positive whole numbers separated by x, × or commas."""
    parts = re.split(r"\s*[x×X,*]\s*", text.strip())
    if len(parts) != count or not all(re.fullmatch(r"\d{1,9}", p) for p in parts):
        raise UsageError(f"'{text}' is not {form}", field=field, fix=f"give {form}")
    return tuple(int(p) for p in parts)


def numbers(text: str, counts: tuple[int, ...], field: str, form: str) -> list[float]:
    """Numbers separated by commas or spaces."""
    parts = re.split(r"[,\s]+", text.strip())
    try:
        found = [float(p) for p in parts]
    except ValueError:
        found = []
    if len(found) not in counts or not all(map(math.isfinite, found)):
        raise UsageError(f"'{text}' is not {form}", field=field, fix=f"give {form}")
    return found


def color(text: str, field: str) -> tuple[float, ...]:
    """`r,g,b` or `r,g,b,a` from 0 to 1, `#rrggbb`, `#rrggbbaa`, or a name that Pillow knows."""
    if re.fullmatch(r"[-+\d.,e\s]+", text):
        return tuple(numbers(text, (3, 4), field, "red,green,blue[,opacity] from 0 to 1"))
    from PIL import ImageColor

    if text.strip().lower() in ("transparent", "none"):
        return (0.0, 0.0, 0.0, 0.0)
    try:
        return tuple(c / 255 for c in ImageColor.getrgb(text))
    except ValueError as error:
        raise UsageError(
            f"'{text}' is no colour",
            field=field,
            fix="give r,g,b[,a] from 0 to 1, #rrggbb or a name",
        ) from error


def transfer_of(text: str) -> TransferFunction:
    """A transfer function from JSON text, or from a file that has it."""
    if text.lstrip().startswith("{"):
        return decode_transfer(text.encode("utf-8", "replace"), "--transfer")
    return decode_transfer(read_scene(Path(text)), text)


def is_scene(file: str) -> bool:
    """A .json that is no scene may still describe a volume for some reader."""
    if is_sample(file) or not file.lower().endswith(SCENE_SUFFIX):
        return False
    if file.lower().endswith(".volviz.json"):
        return True
    try:
        if not Path(file).is_file():
            return False
        with open(file, "rb") as opened:
            return b'"volviz-scene"' in opened.read(4096)
    except OSError:
        return False


def _help(knob: Knob) -> str:
    span = ""
    if knob.choices:
        span = f" ({', '.join(knob.choices)})"
    elif knob.low is not None and knob.high is not None:
        span = f" ({knob.low:g} to {knob.high:g})"
    unit = f", {knob.unit}" if knob.unit else ""
    if knob.type is bool:
        return f"{knob.help}{span}{unit}"
    default = knob.default if isinstance(knob.default, str) else f"{knob.default:.4g}"
    return f"{knob.help}{unit}{span}; default {default}"
