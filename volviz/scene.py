"""The public scene: suggested, opened, saved, drawn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self, SupportsIndex

from volviz._version import __version__
from volviz.errors import InputError, LimitError, UsageError
from volviz.files import check_writable, write_atomically
from volviz.image import Image, check_size
from volviz.io.options import ReadOptions
from volviz.model import scenefile
from volviz.model.camera import Camera
from volviz.model.frame import Frame
from volviz.model.knobs import knobs_of
from volviz.model.scene import Light, Raycast, SceneState, Source
from volviz.model.transfer import TransferFunction
from volviz.model.views import volume_camera
from volviz.model.volume import Volume
from volviz.progress import Progress, silent
from volviz.resolve import MEMO, TextureLimits, known_statistics, resolve
from volviz.sources import (
    absolute_from,
    fields_absolute_from,
    fields_relative_to,
    fingerprint,
    open_volume,
    relative_to,
    source_of,
)

if TYPE_CHECKING:
    from volviz.gpu.checked import Gpu
    from volviz.gpu.renderer import Renderer

MAX_SCENE_BYTES = 16 << 20
SOFTWARE_TEXTURE = 1 << 30
HARDWARE_TEXTURE = 4 << 30
_renderers: dict[Gpu, Renderer] = {}


@dataclass(frozen=True)
class Scene(SceneState):
    """What you want to see. Frozen: every `with_…` gives a new scene.

    >>> scene = Scene.of(volviz.load("head.nrrd"), preset="ct-bone")
    >>> volviz.render(scene.with_raycast(mode="mip"), size=(800, 600)).save("mip.png")
    """

    @classmethod
    def of(
        cls,
        volume: Volume,
        *,
        preset: str | None = None,
        view: str | None = None,
        azimuth: float | None = None,
        elevation: float | None = None,
        aspect: float = 1.0,
        **knobs: Any,
    ) -> Self:
        """A scene that shows this volume well without being told how.

        preset: name of a transfer function (see `volviz.presets()`) instead of the suggested one.
        view, azimuth, elevation (degrees): standard view and turn from it. aspect: width / height
        of the picture it is for. knobs: fields of `Raycast`, `Light` and `Camera` by name.
        """
        if not isinstance(volume, Volume):
            raise UsageError(
                f"a scene is of a Volume, not of {type(volume).__name__}",
                fix="use volviz.load(path) or volviz.Volume.from_array(array)",
            )
        transfer, suggested, warning = _classified(volume, preset, knobs.get("mode"))
        if warning:
            plain = volume
            volume = replace(plain, info=plain.info.warn(warning))
            MEMO.share(plain, volume)
        lens = {k.name: knobs.pop(k.name) for k in knobs_of(Camera) if k.name in knobs}
        camera = volume_camera(
            volume, view, azimuth=azimuth, elevation=elevation, aspect=aspect, **lens
        )
        scene = cls(volume, transfer, camera, Raycast(), Light(), source=source_of(volume))
        return scene.with_knobs(**{**suggested, **knobs})

    @classmethod
    def open(
        cls,
        path: str | Path,
        *,
        volume: Volume | None = None,
        options: ReadOptions | None = None,
    ) -> Self:
        """The scene of a `.volviz.json` file, with its volume.

        volume: take this one instead of the file's own. Raises InputError naming the place in
        the JSON, or the volume that is missing.
        """
        file = Path(path)
        document = scenefile.decode(read_scene(file), str(file))
        source = scenefile.source_of(document)
        if volume is None:
            if source is None:
                raise _nameless(file)
            volume, others = _volume_of(source, file, options or ReadOptions())
            if source.sha256 and not others and fingerprint(volume) != source.sha256:
                changed = f"'{source.path}' has changed since the scene was saved"
                volume = replace(volume, info=volume.info.warn(changed))
        scene = fields_absolute_from(scenefile.to_scene(document, volume, cls, str(file)), file)
        return replace(scene, source=source_of(volume))

    def save(self, path: str | Path, *, overwrite: bool = True) -> None:
        """Write a `.volviz.json` file, atomically. The volume is named, not copied.

        Raises OutputError if it cannot be written or, with overwrite=False, is there.
        """
        check_writable(path, overwrite=overwrite)
        write_atomically(path, self.encoded(path), overwrite=overwrite)

    def encoded(self, path: str | Path) -> bytes:
        """The text of a scene file that will lie at `path`: its volume is named from there."""
        source = self.source or source_of(self.volume)
        if source is not None:
            source = relative_to(replace(source, sha256=fingerprint(self.volume)), Path(path))
        return scenefile.encode(fields_relative_to(self, Path(path)), source)

    def _repr_png_(self) -> bytes:
        return render(self, size=(480, 480)).encoded()


def render(
    scene: SceneState | Volume,
    size: Sequence[SupportsIndex] = (800, 600),
    *,
    samples: int | None = None,
    backend: str | None = None,
    progress: Progress | None = None,
) -> Image:
    """Draw a scene (or a volume, as suggested) without a window.

    size: width, height. samples: jittered pictures averaged (default: the scene's). backend: see
    `volviz doctor`. A volume too large for the graphics is reduced and the image's notes say so.
    Raises GraphicsError without usable OpenGL.
    """
    return drawn(scene, size, samples=samples, backend=backend, progress=progress)[0]


def drawn(
    scene: SceneState | Volume,
    size: Sequence[SupportsIndex] = (800, 600),
    *,
    samples: int | None = None,
    backend: str | None = None,
    progress: Progress | None = None,
) -> tuple[Image, Frame]:
    """As `render`, and the frame that was drawn in the end, for who draws it again."""
    from volviz.gpu.contexts import shared_gpu

    width, height = check_size(size)
    if not isinstance(scene, SceneState):
        scene = Scene.of(scene, aspect=width / height)
    gpu = shared_gpu(backend)
    renderer = renderer_of(gpu)
    limits = texture_limits(gpu)
    progress = progress or silent()
    while True:
        frame = resolve(
            scene, limits=limits, progress=progress.part(0.0, 0.1), size=(width, height)
        )
        try:
            pixels = renderer.image(
                frame, (width, height), samples=samples, progress=progress.part(0.1, 1.0)
            )
            break
        except LimitError:
            smaller = min(frame.voxels.nbytes, limits.max_bytes) // 2
            if smaller < 1 << 20:
                raise
            limits = replace(limits, max_bytes=smaller)
    facts = {"Software": f"volviz {__version__}", "Renderer": gpu.renderer}
    return Image(pixels, gpu.renderer, frame.notes, facts), frame


def renderer_of(gpu: Gpu) -> Renderer:
    """The one renderer of a context."""
    from volviz.gpu.renderer import Renderer

    if gpu not in _renderers:
        _renderers[gpu] = Renderer(gpu)
        # a renderer knows its context, so the dictionary alone would keep both for ever
        gpu.owned.on_release.append(lambda: _forget(gpu))
    return _renderers[gpu]


def _forget(gpu: Gpu) -> None:
    _renderers.pop(gpu, None)


def texture_limits(gpu: Gpu) -> TextureLimits:
    """How large a volume texture may be on this OpenGL."""
    return TextureLimits(
        max_dim=gpu.limits.max_texture_3d,
        max_bytes=SOFTWARE_TEXTURE if gpu.software else HARDWARE_TEXTURE,
        promote8=gpu.software,
    )


def _classified(
    volume: Volume, preset: str | None, mode: str | None
) -> tuple[TransferFunction, dict[str, Any], str | None]:
    """Transfer function, knobs that go with it, and what a person should know about the fit."""
    facts = known_statistics(volume)
    if preset is not None:
        from volviz.classify import presets

        chosen = presets.preset(preset)
        transfer, suggested = presets.apply(chosen, volume, facts)
        return transfer, suggested, presets.fit_warning(chosen, volume, facts)
    from volviz.classify.suggest import mip_transfer, suggest

    found = MEMO.get(volume, "suggestion", lambda: suggest(volume, facts))
    suggested = found.knobs()
    if mode == "mip" and found.mode != "mip" and found.interpolation == "linear":
        return mip_transfer(volume, facts), suggested, None
    return found.transfer, suggested, None


def _volume_of(source: Source, file: Path, options: ReadOptions) -> tuple[Volume, bool]:
    """The volume that a scene file names, and whether `options` ask for another one of its."""
    chosen = dict(options.chosen())
    where, told = _named(source, file, options)
    try:
        volume = open_volume(where, told)
    except UsageError as error:
        if chosen:
            raise
        where = f"source.choices.{error.field}" if error.field else "source"
        raise InputError(error.what, file=file, field=where, fix=error.fix) from error
    return volume, any(dict(source.choices).get(k) != v for k, v in chosen.items())


def _named(source: Source, file: Path, options: ReadOptions) -> tuple[str, ReadOptions]:
    """Where the volume is, and how to read it: as the scene says unless `options` do."""
    told = replace(options, **{**dict(source.choices), **dict(options.chosen())})
    return absolute_from(source, file), told


def volume_of_scene(path: str | Path, options: ReadOptions) -> tuple[str, ReadOptions]:
    """Where the volume of a scene file is, and how to read it. Raises InputError."""
    file = Path(path)
    source = scenefile.source_of(scenefile.decode(read_scene(file), str(file)))
    if source is None:
        raise _nameless(file)
    return _named(source, file, options)


def _nameless(file: Path) -> InputError:
    return InputError("the scene names no volume", file=file, field="source", fix="give one")


def read_scene(file: Path) -> bytes:
    """The bytes of a scene file, or of a part of one. Raises InputError."""
    from volviz.io import check_readable

    check_readable(file)
    try:
        size = file.stat().st_size
        if size > MAX_SCENE_BYTES:
            raise InputError(f"{size} bytes are too many for a scene file", file=file)
        return file.read_bytes()
    except OSError as error:
        raise InputError(error.strerror or str(error), file=file) from error
