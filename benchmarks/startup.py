"""Cold `check` against `import cvxpy`, in turns in one run: `python benchmarks/startup.py`.

Targets: a pinned spec takes at most half of the import's time, an open one with three roles at
most half of it plus 0.3 s, and neither more than 300 MB.  Medians of whole processes.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import time
from pathlib import Path

SPECS = Path(__file__).parent.parent / "specs"
CHECK = (sys.executable, "-m", "syncline_design.cli", "check")
COMMANDS = {
    "import cvxpy": (sys.executable, "-c", "import cvxpy"),
    "check, pinned, one stage": (*CHECK, str(SPECS / "usv_mapping.yaml")),
    "check, pinned, two stages": (*CHECK, str(SPECS / "subsea_survey_large_sv.yaml")),
    "check, open, three roles": (*CHECK, str(SPECS / "uav_corridor.yaml")),
}


def timed(command: tuple[str, ...]) -> tuple[float, float]:
    """Wall time [s] and peak memory [MB] of one process."""
    start = time.perf_counter()
    with subprocess.Popen(command, stdout=subprocess.DEVNULL) as process:
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    elapsed = time.perf_counter() - start
    if process.returncode != 0:
        raise SystemExit(f"{' '.join(command)} ended with {process.returncode}")
    scale = 1024 if sys.platform != "darwin" else 1024**2
    return elapsed, usage.ru_maxrss / scale


def main() -> None:
    """Print a table of medians and ratios."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=7)
    runs = parser.parse_args().runs
    for command in COMMANDS.values():  # fills the caches of the file system and of bytecode
        timed(command)
    found: dict[str, list[tuple[float, float]]] = {name: [] for name in COMMANDS}
    for _ in range(runs):
        for name, command in COMMANDS.items():
            found[name].append(timed(command))
    base = statistics.median(t for t, _ in found["import cvxpy"])
    print(f"{'command':28} {'median':>8} {'of import cvxpy':>16} {'peak memory':>12}")
    for name, pairs in found.items():
        seconds = statistics.median(t for t, _ in pairs)
        peak = max(m for _, m in pairs)
        print(f"{name:28} {seconds:6.3f} s {seconds / base:16.2f} {peak:9.0f} MB")
    print(f"limits: pinned 0.50, open {0.5 + 0.3 / base:.2f} of the import, 300 MB")


if __name__ == "__main__":
    main()
