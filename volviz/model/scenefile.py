"""Scenes as JSON documents: versioned, validated by msgspec against types made from the knobs.

`bookmarks`, the views that were kept (a name and a camera each), `surfaces` and `lens` are left
out where there are none, and what is done to a surface after extraction where that is nothing, so
that an older volviz opens such a scene too. The document never holds voxels: a source names its
volume by relative path and SHA-256 of the voxels. Nothing in it is run or imported.
"""

from __future__ import annotations

import dataclasses
from functools import cache
from typing import Annotated, Any, Literal, TypeVar

import msgspec

from volviz.errors import InputError, UnsupportedError, VolvizError
from volviz.model.camera import Camera
from volviz.model.knobs import Knob, knobs_of
from volviz.model.lens import Lens
from volviz.model.refining import Refining
from volviz.model.scene import (
    MAX_NAME,
    Background,
    Bookmark,
    Light,
    Raycast,
    SceneState,
    Source,
)
from volviz.model.surface import Surface
from volviz.model.surface_look import MAX_SURFACES, SceneSurface, SurfaceLook
from volviz.model.transfer import TransferFunction
from volviz.model.volume import Volume

VERSION = 1
KEY = "volviz-scene"
MAX_BOOKMARKS = 1000
S = TypeVar("S", bound=SceneState)

Numbers3 = tuple[float, float, float]
Numbers4 = tuple[float, float, float, float]


class _Choices(msgspec.Struct, forbid_unknown_fields=True, omit_defaults=True):
    """What a reader may be told by a file that nobody vouches for: no limits, no folders."""

    series: str | None = None
    time: int = 0
    channel: int = 0
    shape: tuple[int, int, int] | None = None
    dtype: str | None = None
    endian: str | None = None
    offset: int | None = None
    spacing: Numbers3 | None = None


class _Source(msgspec.Struct, forbid_unknown_fields=True):
    path: Annotated[str, msgspec.Meta(min_length=1, max_length=4096)]
    sha256: str = ""
    choices: _Choices = msgspec.field(default_factory=_Choices)


class _Transfer(msgspec.Struct, forbid_unknown_fields=True):
    colors: Annotated[list[Numbers4], msgspec.Meta(min_length=1, max_length=65536)]
    opacities: Annotated[list[tuple[float, float]], msgspec.Meta(min_length=1, max_length=65536)]
    unit_distance: Annotated[float, msgspec.Meta(gt=0)] = 1.0
    name: str = ""


class _Background(msgspec.Struct, forbid_unknown_fields=True):
    top: Numbers4
    bottom: Numbers4


@cache
def document_type() -> type[msgspec.Struct]:
    """The type of a whole document; `msgspec.json.schema` makes a JSON schema of it."""
    where: list[Any] = [("position", Numbers3), ("target", Numbers3), ("up", Numbers3)]
    lens: list[Any] = [("height", Annotated[float, msgspec.Meta(gt=0)])]
    camera = _struct("Camera", [*where, *_typed(Camera), *lens])
    name = Annotated[str, msgspec.Meta(min_length=1, max_length=MAX_NAME)]
    bookmark = _struct("Bookmark", [("name", name), ("camera", camera)])
    kept = Annotated[list[bookmark], msgspec.Meta(max_length=MAX_BOOKMARKS)]  # type: ignore[valid-type]
    parts: list[Any] = [
        (KEY, Literal[VERSION]),
        ("source", _Source | None, None),
        ("transfer", _Transfer),
        ("camera", camera),
        ("raycast", _struct("Raycast", _typed(Raycast))),
        ("light", _struct("Light", _typed(Light))),
        ("background", _Background),
        ("bookmarks", kept, msgspec.field(default_factory=list)),
        ("surfaces", _surfaces(), msgspec.field(default_factory=list)),
        ("lens", _struct("Lens", _typed(Lens)) | None, None),
    ]
    parts[0] = ("version", Literal[VERSION])
    return _struct("Scene", parts, rename={"version": KEY})


def _surfaces() -> Any:
    unit = Annotated[float, msgspec.Meta(ge=0, le=1)]
    color: Any = ("color", tuple[unit, unit, unit], SurfaceLook().color)
    surface = _struct("Surface", [*_typed(Surface), *_typed(SurfaceLook), color, *_typed(Refining)])
    return Annotated[list[surface], msgspec.Meta(max_length=MAX_SURFACES)]  # type: ignore[valid-type]


def to_document(scene: SceneState, source: Source | None = None) -> dict[str, Any]:
    """The JSON-ready dict of a scene. source: instead of the scene's own (path made relative)."""
    named = source or scene.source
    raycast = dataclasses.asdict(scene.raycast)
    if raycast["show_volume"]:
        del raycast["show_volume"]
    surfaces = [_surface_document(s) for s in scene.surfaces]
    kept = [{"name": b.name, "camera": dataclasses.asdict(b.camera)} for b in scene.bookmarks]
    return {
        KEY: VERSION,
        "source": None
        if named is None
        else {"path": named.path, "sha256": named.sha256, "choices": dict(named.choices)},
        "transfer": {
            "name": scene.transfer.name,
            "unit_distance": scene.transfer.unit_distance,
            "colors": scene.transfer.colors,
            "opacities": scene.transfer.opacities,
        },
        "camera": dataclasses.asdict(scene.camera),
        "raycast": raycast,
        "light": dataclasses.asdict(scene.light),
        "background": dataclasses.asdict(scene.background),
        **({"bookmarks": kept} if kept else {}),
        **({"surfaces": surfaces} if surfaces else {}),
        **({"lens": dataclasses.asdict(scene.lens)} if scene.lens != Lens() else {}),
    }


def _surface_document(surface: SceneSurface) -> dict[str, Any]:
    steps = dataclasses.asdict(surface.refining) if surface.refining != Refining() else {}
    return {**dataclasses.asdict(surface.surface), **dataclasses.asdict(surface.look), **steps}


def encode(scene: SceneState, source: Source | None = None) -> bytes:
    """The text of a scene file, UTF-8, indented, ending in a newline."""
    return msgspec.json.format(msgspec.json.encode(to_document(scene, source)), indent=2) + b"\n"


def decode(text: bytes, file: str) -> Any:
    """The validated document. Raises InputError with the JSON path; UnsupportedError if newer."""
    try:
        raw = msgspec.json.decode(text)
    except (msgspec.DecodeError, RecursionError) as error:
        raise InputError(f"not valid JSON: {error}", file=file) from error
    if not isinstance(raw, dict) or KEY not in raw:
        raise InputError(
            "this JSON file is no volviz scene", file=file, field=KEY, fix="open a .volviz.json"
        )
    version = raw[KEY]
    if isinstance(version, int) and version > VERSION:
        raise UnsupportedError(
            f"the scene is of version {version}, this volviz knows up to {VERSION}",
            file=file,
            field=KEY,
            fix="update volviz",
        )
    try:
        return msgspec.convert(raw, document_type())
    except msgspec.ValidationError as error:
        what, _, where = str(error).partition(" - at ")
        raise InputError(what, file=file, field=where.strip("`") or "$") from error


def source_of(document: Any) -> Source | None:
    """Where the document's volume is."""
    if document.source is None:
        return None
    given = document.source.choices
    choices = tuple(
        (name, getattr(given, name))
        for name, default in zip(given.__struct_fields__, given.__struct_defaults__, strict=True)
        if getattr(given, name) != default
    )
    return Source(document.source.path, document.source.sha256, choices)


def to_scene(document: Any, volume: Volume, cls: type[S], file: str) -> S:
    """The scene of a validated document, on its volume."""
    plain = msgspec.to_builtins(document)
    try:
        return cls(
            volume=volume,
            transfer=TransferFunction(**plain["transfer"]),
            camera=Camera(**plain["camera"]),
            raycast=Raycast(**plain["raycast"]),
            light=Light(**plain["light"]),
            background=Background(**plain["background"]),
            source=source_of(document),
            surfaces=tuple(_surface(s) for s in plain["surfaces"]),
            lens=Lens(**(plain["lens"] or {})),
            bookmarks=tuple(Bookmark(b["name"], Camera(**b["camera"])) for b in plain["bookmarks"]),
        )
    except VolvizError as error:
        raise InputError(error.what, file=file, field=error.field, fix=error.fix) from error


def _surface(plain: dict[str, Any]) -> SceneSurface:
    made, steps = (
        {k.name: plain.pop(k.name) for k in knobs_of(owner)} for owner in (Surface, Refining)
    )
    return SceneSurface(Surface(**made), SurfaceLook(**plain), Refining(**steps))


def transfer_text(transfer: TransferFunction) -> str:
    """A transfer function as one line of JSON, as under `transfer` in a scene file."""
    return msgspec.json.encode(dataclasses.asdict(transfer)).decode()


def decode_transfer(text: bytes, file: str | None = None) -> TransferFunction:
    """What `transfer_text` wrote, or the transfer function of a whole scene file.

    Raises InputError that names the place in the JSON.
    """
    try:
        raw = msgspec.json.decode(text)
        if isinstance(raw, dict) and KEY in raw:
            raw = raw.get("transfer")
        return TransferFunction(**msgspec.to_builtins(msgspec.convert(raw, _Transfer)))
    except (msgspec.DecodeError, RecursionError) as error:
        what, _, where = str(error).partition(" - at ")
        raise InputError(what, file=file, field=where.strip("`") or None) from error
    except VolvizError as error:
        raise InputError(error.what, file=file, field=error.field, fix=error.fix) from error


def _struct(name: str, fields: list[Any], **more: Any) -> type[msgspec.Struct]:
    return msgspec.defstruct(name, fields, forbid_unknown_fields=True, kw_only=True, **more)


def _typed(owner: type) -> list[tuple[str, Any, Any]]:
    return [(k.name, _type_of(k), k.default) for k in knobs_of(owner)]


def _type_of(knob: Knob) -> Any:
    if knob.choices:
        return Literal[knob.choices]
    return Annotated[knob.type, msgspec.Meta(ge=knob.low, le=knob.high, description=knob.help)]
