"""`make bench`: volviz beside VTK, one run, interleaved; medians, ratios, error of each picture.

Every peer gets the same voxels, camera, transfer function, light and sample distance, and a
process of its own (their OpenGL contexts do not get on in one); the parent asks them in turn.
Error is the root mean square difference, in grey levels, between a peer's picture and its own
finely sampled one: colour spaces differ between peers, convergence does not. Only ratios are
claims.

`python -m tests.bench latency` times the window instead (see latency.py), `python -m tests.bench
surfaces` isosurfaces, `stills`, `decimation`, `topology` and `finders` what their files say.
"""

from __future__ import annotations

import argparse
import sys
from importlib import import_module
from pathlib import Path

from tests.bench.measure import measure
from tests.bench.scenes import CASES


def main() -> None:
    """Run the chosen cases and print the table."""
    parser = argparse.ArgumentParser(prog="python -m tests.bench")
    parser.add_argument("cases", nargs="*", help=f"any of {', '.join(CASES)}")
    parser.add_argument("--size", type=int, default=512)
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--threads", type=int, nargs="*", default=[2, 1])
    parser.add_argument("--keep", type=Path, help="folder for the pictures")
    chosen = parser.parse_args()
    print(f"{'case':22}{'threads':>8}  {'peer':18}{'ms':>9}{'× ours':>8}{'error':>8}")
    for threads in chosen.threads:
        for case in chosen.cases or CASES:
            found = measure(case, chosen, threads)
            for peer, row in found.items():
                ratio = row["ms"] / found["volviz"]["ms"]
                line = f"{case:22}{threads:8d}  {peer:18}{row['ms']:9.0f}"
                print(f"{line}{ratio:8.2f}{row['error']:8.2f}", flush=True)


PARTS = ("latency", "surfaces", "stills", "decimation", "topology", "finders")

if sys.argv[1:2] and sys.argv[1] in PARTS:
    import_module(f"tests.bench.{sys.argv[1]}").main(sys.argv[2:])
else:
    main()
