"""Play scenarios, one window after the other; "driven NAME" is printed for each that held."""

from __future__ import annotations

import sys
from pathlib import Path

from tests.ui.driver import drive
from tests.ui.scenarios import SCENARIOS
from tests.ui.scenarios.things import make_files


def main(folder: Path, names: list[str]) -> None:
    make_files(folder)
    for name in names:
        own = folder / ("crash" if name == "recovered" else name)
        own.mkdir(exist_ok=True)
        scenario = SCENARIOS[name]
        drive(scenario.script, own, **scenario.settings)
        print("driven", name, flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:])
