"""Time peers in turn, each in a process of its own: their OpenGL contexts do not get on in one."""

from __future__ import annotations

import argparse
import multiprocessing
import os
import statistics
import time
from pathlib import Path
from typing import Any

import numpy as np


def serve(pipe: Any, peer: str, case_name: str, size: int, threads: int) -> None:
    """One peer in its process: answer 'draw' with seconds and pixels, 'reference' with pixels."""
    from tests.bench.peers import PEERS
    from tests.bench.scenes import CASES

    case = CASES[case_name]
    made = PEERS[peer](case, case.scene(), size, threads)
    made.draw(case.sample_mm)  # compile, upload
    pipe.send("ready")
    while (order := pipe.recv()) is not None:
        start = time.perf_counter()
        pixels = made.draw(case.sample_mm) if order == "draw" else made.reference()
        pipe.send((time.perf_counter() - start, pixels))


def measure(case: str, chosen: argparse.Namespace, threads: int) -> dict[str, dict[str, float]]:
    """Medians and errors of all peers on one case."""
    from tests.bench.peers import PEERS

    # llvmpipe and VTK read these when they start
    os.environ["LP_NUM_THREADS"] = str(threads)
    os.environ["VTK_DEFAULT_OPENGL_WINDOW"] = "vtkEGLRenderWindow"
    context = multiprocessing.get_context("spawn")
    pipes, children = {}, []
    for peer in PEERS:
        here, there = context.Pipe()
        child = context.Process(target=serve, args=(there, peer, case, chosen.size, threads))
        child.start()
        there.close()  # so that a child that dies is an error here, not a wait
        assert here.recv() == "ready"
        pipes[peer] = here
        children.append(child)
    times: dict[str, list[float]] = {peer: [] for peer in PEERS}
    pictures: dict[str, np.ndarray] = {}
    for _ in range(chosen.runs):
        for peer, pipe in pipes.items():
            pipe.send("draw")
            seconds, pictures[peer] = pipe.recv()
            times[peer].append(seconds)
    found = {}
    for peer, pipe in pipes.items():
        pipe.send("reference")
        fine = pipe.recv()[1].astype(float)
        pipe.send(None)
        error = float(np.sqrt(((pictures[peer] - fine) ** 2).mean()))
        found[peer] = {"ms": 1000 * statistics.median(times[peer]), "error": error}
        if chosen.keep:
            _keep(chosen.keep / f"{case}-{peer.replace(' ', '-').lower()}.png", pictures[peer])
    for child in children:
        child.join()
    return found


def _keep(path: Path, pixels: np.ndarray) -> None:
    from PIL import Image

    Image.fromarray(pixels).save(path)
