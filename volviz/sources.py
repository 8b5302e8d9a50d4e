"""Volumes by name: a path, or `sample:name`; and fingerprints, to know the same one again."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from volviz.errors import OutputError, UsageError
from volviz.io.options import ReadOptions
from volviz.model.scene import SceneState, Source
from volviz.model.surface_look import FIELDS
from volviz.model.volume import Volume, VolumeInfo

SAMPLE = "sample:"
S = TypeVar("S", bound=SceneState)


def open_volume(name: str | Path, options: ReadOptions | None = None) -> Volume:
    """The volume of a file, a folder, or of `sample:name`. Raises VolvizError."""
    if is_sample(name):
        from volviz.samples import sample

        if options is not None and options.chosen():
            chosen = options.chosen()[0][0]
            raise UsageError("a sample has no such choice", field=f"--{chosen}", fix="leave it out")
        return sample(
            str(name).removeprefix(SAMPLE), progress=None if options is None else options.progress
        )
    from volviz.io import load

    if not str(name):
        raise UsageError("the name of the file is empty", fix="give a file, a folder or a sample")
    return load(name, options)


def open_info(name: str | Path, options: ReadOptions | None = None) -> VolumeInfo:
    """What `open_volume` would give, without its voxels (samples are made)."""
    if is_sample(name):
        return open_volume(name, options).info
    from volviz.io import probe

    if not str(name):
        raise UsageError("the name of the file is empty", fix="give a file, a folder or a sample")
    return probe(name, options)


def is_sample(name: str | Path) -> bool:
    """True for `sample:…`."""
    return str(name).startswith(SAMPLE)


def source_of(volume: Volume) -> Source | None:
    """Where a volume came from, without fingerprint; None for arrays."""
    if volume.info.source is None:
        return None
    return Source(str(volume.info.source), "", volume.info.choices)


def fingerprint(volume: Volume) -> str:
    """SHA-256 over type, shape, affine and voxels: the same for the same volume in any format."""
    digest = hashlib.sha256()
    digest.update(f"{volume.data.dtype.str} {volume.data.shape} ".encode())
    digest.update(np.round(volume.affine, 6).astype("<f8").tobytes())
    for plane in volume.data:
        digest.update(np.ascontiguousarray(plane).view(np.uint8).data)
    return digest.hexdigest()


def relative_to(source: Source, scene_file: Path) -> Source:
    """The source as seen from the folder of a scene file, with forward slashes."""
    if is_sample(source.path):
        return source
    path = os.path.relpath(Path(source.path).absolute(), scene_file.absolute().parent)
    try:
        return replace(source, path=os.fsencode(Path(path).as_posix()).decode())
    except UnicodeDecodeError as error:
        raise OutputError(
            "a scene file cannot name the volume, whose name is not UTF-8",
            file=scene_file,
            fix="rename the volume",
        ) from error


def absolute_from(source: Source, scene_file: Path) -> str:
    """Where a scene file's volume is, from where we stand."""
    if is_sample(source.path):
        return source.path
    named = os.fsdecode(source.path.encode("utf-8", "surrogatepass"))
    near = os.path.normpath(scene_file.parent / named)
    if scene_file.is_symlink() and not os.path.exists(near):
        return os.path.normpath(Path(os.path.realpath(scene_file)).parent / named)
    return near


def fields_relative_to(scene: S, scene_file: Path) -> S:
    """The scene as its file holds it: files that colour its surfaces named as `relative_to` does.

    Raises OutputError for a name that is not UTF-8.
    """

    def near(path: str) -> str:
        found = relative_to(Source(path), scene_file).path
        return f"./{found}" if found in FIELDS or is_sample(found) else found

    return _with_fields(scene, near)


def fields_absolute_from(scene: S, scene_file: Path) -> S:
    """The scene of a file, where those files are from where we stand."""
    return _with_fields(scene, lambda path: absolute_from(Source(path), scene_file))


def _with_fields(scene: S, change: Callable[[str], str]) -> S:
    def changed(field: str) -> str:
        if field in FIELDS or is_sample(field):
            return field
        path, mark, choices = field.rpartition("?")
        return change(path) + mark + choices if mark and "=" in choices else change(field)

    looks = [replace(s.look, color_field=changed(s.look.color_field)) for s in scene.surfaces]
    surfaces = zip(scene.surfaces, looks, strict=True)
    return replace(scene, surfaces=tuple(replace(s, look=look) for s, look in surfaces))
