"""`python -m tests.bench latency`: how soon the window answers, beside PyVista's and napari's.

Each measurement is a process of its own on a virtual screen of its own, peers in turn, the first
round thrown away (it warms the file cache). PyVista and napari are found by VOLVIZ_BENCH_PEERS,
the Python of an environment that has them:

    python3 -m venv peers && peers/bin/pip install pyvista 'napari[pyqt6]' nibabel pynrrd
    VOLVIZ_BENCH_PEERS=peers/bin/python python -m tests.bench latency --json latency.json

`python -m tests.bench latency stalls` asks instead how long the window ever stays away from its
events (stalls.py).
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from tests.bench import stalls
from tests.bench.scenes import DATA
from tests.bench.screen import MIDDLE, Screen, screen

ROOT = Path(__file__).resolve().parents[2]
VARIABLE = "VOLVIZ_BENCH_PEERS"
FILES = ("classics/bonsai_256.nii.gz", "ct/cranium_head_ct.nrrd")
OPENED = (
    "classics/bonsai_256.nii.gz",
    "mri/prostate_phantom.nrrd",
    "mri/stroke_T1_oblique.nii.gz",
    "ct/totalseg_torso_sm_ct.nii.gz",
    "mri/nifti_orientations/RAS.nii.gz",
    "ct/cranium_head_ct.nrrd",
    "mri/stroke_FLAIR_oblique.nrrd",
    "ct/totalseg_torso_ct.nii.gz",
)
SAMPLES = ("sample:ct-head", "sample:plume")
QUIET, LONGEST = 6.0, 90.0
FAMILIAR = 0.8
OURS = "volviz"


@dataclass(frozen=True)
class Peer:
    """Who is measured: its module, whose Python, and what the tasks are called there."""

    module: str
    tasks: dict[str, str]
    foreign: bool = True
    needs: str = ""


SAME = {t: t for t in ("start", "turn", "idle", "memory")}
PEERS = {
    OURS: Peer("tests.bench.window", SAME | {"points": "points"}, foreign=False),
    "volviz, panels hidden": Peer("tests.bench.window", {"turn": "turn_alone"}, foreign=False),
    "volviz, no undo": Peer("tests.bench.window", {"memory": "memory_no_undo"}, foreign=False),
    "PyVista": Peer("tests.bench.peer_pyvista", SAME, needs="pyvista"),
    "napari": Peer("tests.bench.peer_napari", SAME, needs="napari"),
}
TASKS = ("start", "points", "turn", "idle", "memory")
ROWS = {
    "first_picture_ms": "process start → the volume on screen, ms",
    "last_picture_ms": "process start → nothing changes any more, ms",
    "point_ms": "control point moved, at rest → frame, ms",
    "point_drag_frame_ms": "control point dragged: frame, ms",
    "point_drag_latency_ms": "control point dragged → frame, ms",
    "turn_frame_ms": "rotating: frame, ms",
    "turn_latency_ms": "rotating: mouse → frame, ms",
    "turn_per_second": "rotating: frames/s",
    "rays": "rotating: rays, of the pixels along a side",
    "step": "rotating: step, times the full picture's",
    "first_sample_ms": "mouse at rest → first full picture, ms",
    "whole_ms": "mouse at rest → all samples, ms",
    "idle_percent": "idle: % of a core",
    "idle_over_percent": "idle, mouse over the view: % of a core",
    "idle_frames": "idle: frames drawn",
    "idle_over_frames": "idle, mouse over the view: frames drawn",
    "at_5_mb": "RSS after 5 files, MB",
    "at_end_mb": "RSS after the last file, MB",
    "growth_mb": "growth per file after the 5th, MB",
}


@dataclass
class Found:
    """What one peer gave in one task on one file, over all runs."""

    task: str
    file: str
    peer: str
    numbers: dict[str, list[float]] = field(default_factory=dict)
    facts: dict[str, Any] = field(default_factory=dict)
    failure: str = ""


def main(arguments: list[str]) -> None:
    """Measure, print the table, write the JSON."""
    parser = argparse.ArgumentParser(prog="python -m tests.bench latency")
    parser.add_argument("tasks", nargs="*", help=f"any of {', '.join(TASKS)}; or stalls")
    parser.add_argument("--runs", type=int, default=5, help="1: a trial, without warming up")
    parser.add_argument("--seconds", type=float, default=4.0, help="of each drag")
    parser.add_argument("--opened", type=int, default=50, help="files to open in a row")
    parser.add_argument("--only", help="stalls: these actions, with ; between them")
    parser.add_argument("--json", type=Path, help="file for all figures")
    parser.add_argument("--keep", type=Path, help="folder for pictures of the screens")
    chosen = parser.parse_args(arguments)
    os.environ["PYTHONPATH"] = str(ROOT)
    if chosen.tasks == ["stalls"]:
        os.environ[stalls.ONLY] = chosen.only or ""
        _stalls(chosen.json)
        return
    unknown = set(chosen.tasks) - set(TASKS)
    if unknown:
        parser.error(f"no such task: {', '.join(sorted(unknown))}")
    os.environ["VOLVIZ_BENCH_SECONDS"] = str(chosen.seconds)
    machine = {"cores": os.cpu_count(), "load before": os.getloadavg(), **_peers()}
    with tempfile.TemporaryDirectory() as folder:
        found = measure(chosen, Path(folder), machine)
    machine["load after"] = os.getloadavg()
    _print(found, machine)
    if chosen.json:
        rows = [{**vars(f), "summary": summary(f)} for f in found]
        chosen.json.write_text(json.dumps({"machine": machine, "rows": rows}, indent=1))


def _stalls(file: Path | None) -> None:
    """Twice: where nothing was ever compiled, and the next time."""
    rows = {}
    with tempfile.TemporaryDirectory() as folder:
        for name in ("first start", "second start"):
            rows[name] = stalls.measured(Path(folder), str(DATA / FILES[1]), ask=_asked)
            print(f"{name}\n\n{stalls.table(rows[name])}\n", flush=True)
    if file:
        file.write_text(json.dumps(rows, indent=1))


def measure(chosen: argparse.Namespace, folder: Path, machine: dict[str, Any]) -> list[Found]:
    """All tasks, peers in turn within each run."""
    found = []
    for task in chosen.tasks or TASKS:
        once = task == "memory"
        for file in FILES[:1] if task in ("idle", "memory") else FILES:
            rows = [Found(task, Path(file).name, p) for p in PEERS if task in PEERS[p].tasks]
            found += rows
            trial = once or chosen.runs == 1
            for run in range(1 if trial else chosen.runs + 1):
                for row in rows:
                    missing = machine.get(PEERS[row.peer].needs, "")
                    if missing.startswith("not run"):
                        row.failure = missing
                    elif not row.failure:
                        _one(row, file, chosen, folder, warm=trial or run > 0)
                        print(f"{task} {row.file} {row.peer}: run {run}", file=sys.stderr)
    return found


def _one(row: Found, file: str, chosen: argparse.Namespace, folder: Path, *, warm: bool) -> None:
    names = [str(DATA / file)]
    if row.task == "memory":
        names = _list(folder, chosen.opened)
    environment = {
        **os.environ,
        "PYTHONPATH": str(ROOT),
        "VOLVIZ_CONFIG_DIR": str(folder / "volviz"),
        "NAPARI_CONFIG": str(folder / "napari.yaml"),
        "QT_QPA_PLATFORM": "xcb",
    }
    with screen() as display:
        try:
            command, environment = _command(row, names), {**environment, **display}
            if row.task == "start":
                numbers, last = _watched(command, environment)
            else:
                numbers, last = _asked(command, environment), None
        except (RuntimeError, subprocess.SubprocessError, ValueError) as error:
            row.failure = f"not run: {str(error).strip().splitlines()[-1]}"
            return
    if chosen.keep and last is not None:
        _keep(chosen.keep / f"{row.task}-{row.peer}-{Path(file).stem}.png", last)
    for name, values in numbers.items() if warm else ():
        if isinstance(values, list) and name != "view":
            row.numbers.setdefault(name, []).extend(values)
        else:
            row.facts[name] = values


def _command(row: Found, names: list[str]) -> list[str]:
    peer = PEERS[row.peer]
    python = os.environ[VARIABLE] if peer.foreign else sys.executable
    if row.peer == OURS and row.task == "start":
        return [python, "-m", "volviz", *names]
    return [python, "-m", peer.module, peer.tasks[row.task], *names]


def _asked(command: list[str], environment: dict[str, str]) -> dict[str, Any]:
    """What a measuring process says on its last line."""
    done = subprocess.run(
        command, env=environment, capture_output=True, text=True, timeout=900, check=False, cwd=ROOT
    )
    if done.returncode:
        raise RuntimeError(done.stderr or f"ended with {done.returncode}")
    answer: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return answer


def _watched(command: list[str], environment: dict[str, str]) -> tuple[dict[str, Any], np.ndarray]:
    """Times of a program that knows nothing of us, off the screen: until the middle looks for the
    first time much as it does in the end, and until it changes no more."""
    seen = Screen(environment["VOLVIZ_BENCH_SCREEN"])
    begun = time.perf_counter()
    with subprocess.Popen(
        command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, cwd=ROOT
    ) as program:
        try:
            looks = [(0.0, seen.look(MIDDLE))]
            while True:
                time.sleep(0.004)
                passed, now = time.perf_counter() - begun, seen.look(MIDDLE)
                if (now != looks[-1][1]).any():
                    looks.append((passed, now))
                if program.poll() is not None:
                    assert program.stderr is not None
                    raise RuntimeError(program.stderr.read().decode() or "it ended by itself")
                if passed > LONGEST or (_content(now) and passed - looks[-1][0] > QUIET):
                    break
            whole = seen.whole()
        finally:
            program.kill()
    first = next(t for t, look in looks if _alike(look, looks[-1][1]) > FAMILIAR)
    return {"first_picture_ms": [1e3 * first], "last_picture_ms": [1e3 * looks[-1][0]]}, whole


def _content(look: np.ndarray) -> bool:
    """True of a picture, False of an empty window or a few words."""
    return len(np.unique(look.reshape(-1, 3), axis=0)) > 200


def _alike(a: np.ndarray, b: np.ndarray) -> float:
    """Correlation, 0 where one is of one colour."""
    x, y = (n.mean(axis=2) - n.mean() for n in (a, b))
    size = np.sqrt((x * x).sum() * (y * y).sum())
    return float((x * y).sum() / size) if size else 0.0


def _list(folder: Path, count: int) -> list[str]:
    """Real files and samples in turn; a peer opens the samples as files of the same voxels."""
    names = [str(DATA / name) for name in OPENED]
    for sample in SAMPLES:
        path = folder / f"{sample.removeprefix('sample:')}.nrrd"
        if not path.exists():
            from volviz.io.write import save_volume
            from volviz.sources import open_volume

            save_volume(open_volume(sample), path)
        names.append(str(path))
    return [names[i % len(names)] for i in range(count)]


def _peers() -> dict[str, str]:
    """The versions of the peers, or why they are not run."""
    python = os.environ.get(VARIABLE)
    if not python:
        return dict.fromkeys(("pyvista", "napari"), f"not run: {VARIABLE} is not set")
    told = {}
    for name in ("pyvista", "napari"):
        script = f"from importlib.metadata import version; print(version({name!r}))"
        try:
            done = subprocess.run(
                [python, "-c", script], capture_output=True, text=True, check=True
            )
            told[name] = done.stdout.strip()
        except (OSError, subprocess.CalledProcessError):
            told[name] = f"not run: {python} has no {name}"
    return told


def summary(row: Found) -> dict[str, tuple[float, float, int]]:
    """Median, 95th percentile and count of each row of the table."""
    numbers = dict(row.numbers)
    used = numbers.pop("resident_mb", [])
    if len(used) > 5:
        numbers["at_5_mb"], numbers["at_end_mb"] = [used[4]], [used[-1]]
        numbers["growth_mb"] = [float(np.polyfit(range(5, len(used)), used[5:], 1)[0])]
    return {
        name: (float(np.median(numbers[name])), float(np.percentile(numbers[name], 95)), len(v))
        for name in ROWS
        if (v := numbers.get(name))
    }


def _print(found: list[Found], machine: dict[str, Any]) -> None:
    """The table as RESULTS.md wants it."""
    print("; ".join(f"{k}: {v}" for k, v in machine.items()))
    print("| what | file | peer | median | p95 | × ours | n |\n|---|---|---|---|---|---|---|")
    ours = {(f.task, f.file): summary(f) for f in found if f.peer == OURS}
    told = [(f, summary(f)) for f in found]
    for name, title in ROWS.items():
        for row, numbers in told:
            if name not in numbers:
                continue
            median, high, count = numbers[name]
            mine = ours.get((row.task, row.file), {}).get(name)
            ratio = f"{median / mine[0]:.2f}" if mine and mine[0] else ""
            print(
                f"| {title} | {row.file} | {row.peer} | {median:.4g} | {high:.4g} "
                f"| {ratio} | {count} |"
            )
    for row, _ in told:
        if row.failure:
            print(f"{row.task}, {row.file}: {row.peer} {row.failure}")
        elif row.facts:
            facts = ", ".join(f"{k} {v}" for k, v in row.facts.items())
            print(f"{row.task}, {row.file}: {row.peer}: {facts}")


def _keep(path: Path, pixels: np.ndarray) -> None:
    from PIL import Image

    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(pixels).save(path)
