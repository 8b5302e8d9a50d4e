"""`volviz info`: what a file is, before its voxels are read."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer

from volviz.cli import show
from volviz.cli.flags import READ_FLAGS, is_scene, read_options, with_flags
from volviz.errors import UsageError
from volviz.fields.facts import header_facts, odd_counts, range_text
from volviz.fields.reduce import reduction
from volviz.fields.statistics import Statistics
from volviz.io.options import ReadOptions
from volviz.model.volume import Volume, VolumeInfo
from volviz.resolve import TextureLimits, known_statistics
from volviz.scene import volume_of_scene
from volviz.sources import open_info, open_volume
from volviz.text import binary_size

info = typer.Typer(add_completion=False)


@info.command()
@with_flags(READ_FLAGS)
def _info(
    *,
    file: Annotated[str, typer.Argument(metavar="FILE", help="file, folder, sample:NAME or scene")],
    given: dict[str, Any],
    scan: Annotated[
        bool, typer.Option("--scan", help="also read the voxels: range, NaN, percentiles")
    ] = False,
    header: Annotated[
        bool, typer.Option("--header", help="also print the file's own header")
    ] = False,
    json: Annotated[bool, typer.Option("--json", help="print JSON")] = False,
) -> None:
    several: list[dict[str, Any]] = []
    with show.progress_bar("reading", quiet=json) as progress:
        options = read_options(given, progress)
        try:
            facts, known, values = facts_of(file, options, scan=scan)
        except UsageError as error:
            if error.field != "series" or not Path(file).is_dir():
                raise
            several = _series(Path(file), options)
    if several:
        _print_series(file, several, as_json=json)
        return
    if header or json:
        facts["header"] = dict(facts["header"])
    else:
        del facts["header"]
    if json:
        show.print_json(facts)
    else:
        _print(facts, known, values)


def _series(folder: Path, options: ReadOptions) -> list[dict[str, Any]]:
    """What lies in a DICOM folder that holds several series, JSON-ready."""
    from volviz.io.dicom import list_series

    return [asdict(series) for series in list_series(folder, options)]


def _print_series(folder: str, series: list[dict[str, Any]], *, as_json: bool) -> None:
    if as_json:
        show.print_json({"file": folder, "format": "DICOM", "series": series})
        return
    rows = [
        (
            str(s["number"]),
            s["modality"] or "?",
            s["description"],
            str(s["images"]),
            f"{s['columns']} × {s['rows']}",
        )
        for s in series
    ]
    columns = ("--series", "modality", "description", "images", "size")
    show.table(f"{folder}: {len(series)} series, choose one with --series", columns, rows)


def facts_of(
    file: str, options: ReadOptions, *, scan: bool
) -> tuple[dict[str, Any], VolumeInfo, Statistics | None]:
    """Everything known of a file, JSON-ready, and what it was made from.

    scan: read the voxels too; without, the statistics are None.
    """
    scene = file if is_scene(file) else None
    if scene is not None:
        file, options = volume_of_scene(scene, options)
    volume: Volume | None = open_volume(file, options) if scan else None
    known: VolumeInfo = volume.info if volume is not None else open_info(file, options)
    facts: dict[str, Any] = {
        "file": file,
        "scene": scene,
        "format": known.format,
        "name": known.name,
        "grid": "uniform, oblique" if known.oblique else "uniform",
        "kind": known.kind,
        "modality": known.modality,
        "dims": list(known.dims),
        "times": known.times,
        "channels": known.channels,
        "dtype": str(known.dtype),
        "encoding": known.encoding,
        "spacing_mm": list(known.spacing),
        "length_unit": known.length_unit,
        "space": known.space,
        "orientation": known.orientation,
        "origin_mm": list(known.origin),
        "affine": known.affine.tolist(),
        "value_unit": known.value_unit,
        "padding": known.padding,
        "window": None if known.window is None else list(known.window),
        "stored_bytes": known.stored_bytes,
        "memory_bytes": known.nbytes,
        **_graphics(known, volume),
        "warnings": list(known.warnings),
        "header": known.fields,
    }
    statistics = None if volume is None else known_statistics(volume)
    if statistics is not None:
        facts["values"] = _values(statistics)
    return facts, known, statistics


def _graphics(known: VolumeInfo, volume: Volume | None) -> dict[str, Any]:
    """Texture memory and reduction for the least graphics volviz runs on, without opening any."""
    limits = TextureLimits()
    texel = 2 if known.dtype.itemsize <= 2 else 4
    factors = reduction(known.dims, texel, limits.max_dim, limits.max_bytes)
    shown = [-(-n // f) for n, f in zip(known.dims, factors, strict=True)]
    return {
        "texture_bytes": shown[0] * shown[1] * shown[2] * texel,
        "reduced_by": None if factors == (1, 1, 1) else list(factors),
    }


def _values(facts: Statistics) -> dict[str, Any]:
    empty = facts.count == 0
    return {
        "low": None if empty else facts.low,
        "high": None if empty else facts.high,
        "mean": None if empty else facts.mean,
        "std": None if empty else facts.std,
        "percentiles": None
        if empty
        else {str(p): facts.percentile(p) for p in (1, 5, 25, 50, 75, 95, 99)},
        "nan": facts.nan_count,
        "infinite": facts.inf_count,
        "padding": facts.padding_count,
    }


def _print(facts: dict[str, Any], known: VolumeInfo, values: Statistics | None) -> None:
    rows = [(name, text) for name, text in _lines(facts, known, values) if text]
    show.table("", ("", ""), rows)
    for name, value in facts.get("header", {}).items():
        show.table("", ("", ""), [(name, value)])


def _lines(
    facts: dict[str, Any], known: VolumeInfo, values: Statistics | None
) -> list[tuple[str, str]]:
    text = header_facts(known)
    several = [f"{facts[k]} {k}" for k in ("times", "channels") if facts[k] > 1]
    memory = binary_size(facts["memory_bytes"])
    text["samples"] = ", ".join([text["samples"], *several])
    order = ("name", "modality", "kind", "grid", "samples", "type", "spacing", "orientation")
    lines = [
        ("scene", facts["scene"] or ""),
        ("file", facts["file"]),
        ("format", text["format"]),
        *((name, text[name]) for name in (*order, "origin")),
        ("values", "not read (give --scan)" if values is None else _value_text(values, known)),
        ("memory", f"{memory}, texture {binary_size(facts['texture_bytes'])}"),
        ("reduced", _reduced_text(facts["reduced_by"])),
    ]
    return lines + [("warning", warning) for warning in facts["warnings"]]


def _value_text(values: Statistics, known: VolumeInfo) -> str:
    mean = f", mean {values.mean:.6g}" if values.count else ""
    odd = "".join(f", {n} {name.lower()}" for name, n in odd_counts(values).items())
    return range_text(values, known) + mean + odd


def _reduced_text(factors: list[int] | None) -> str:
    return "" if factors is None else "by " + " × ".join(map(str, factors)) + " for the texture"
