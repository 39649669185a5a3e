"""Cold `check` against `import cvxpy`, in turns in one run: `python benchmarks/startup.py`.

Whole processes, processor time (user and system) and peak memory; medians, and the least of each,
which a busy machine disturbs least.  Every process finds its bytecode compiled, as it does on a
user's machine from the second call on: where Python is told to write none, the package, but not
the installed libraries, would be compiled anew in each, which is no part of what is asked.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

SPECS = Path(__file__).parent.parent / "specs"
COMMAND = (sys.executable, "-m", "syncline_design.cli")
COMMANDS = {
    "import cvxpy": (sys.executable, "-c", "import cvxpy"),
    "the libraries alone": (sys.executable, "-c", "import typer, yaml, numpy, pydantic"),
    "check, pinned, one stage": (*COMMAND, "check", str(SPECS / "usv_mapping.yaml")),
    "check, pinned, two stages": (*COMMAND, "check", str(SPECS / "subsea_survey_large_sv.yaml")),
    "check, open, three roles": (*COMMAND, "check", str(SPECS / "uav_corridor.yaml")),
}
WANTED = "wanted: pinned 0.30, open 0.36 of the import, 60 MB"


def spent(command: tuple[str, ...], environment: Mapping[str, str]) -> tuple[float, float]:
    """Processor time [s] and peak memory [MB] of one process."""
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, env=environment) as process:
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode != 0:
        raise SystemExit(f"{' '.join(command)} ended with {process.returncode}")
    scale = 1024 if sys.platform != "darwin" else 1024**2
    return usage.ru_utime + usage.ru_stime, usage.ru_maxrss / scale


@contextmanager
def compiled_once() -> Iterator[dict[str, str]]:
    """An environment in which the bytecode of a first run is there for all that follow."""
    with tempfile.TemporaryDirectory() as bytecode:
        environment = {**os.environ, "PYTHONPYCACHEPREFIX": bytecode}
        environment.pop("PYTHONDONTWRITEBYTECODE", None)
        yield environment


def table(found: Mapping[str, list[tuple[float, float]]]) -> list[str]:
    """Lines of medians and leasts with their ratios to the first command."""
    seconds = {name: [t for t, _ in pairs] for name, pairs in found.items()}
    base = next(iter(seconds.values()))
    lines = [
        "| command | median [s] | of import cvxpy | least [s] | of import cvxpy | peak [MB] |",
        "|---|---|---|---|---|---|",
    ]
    for name, times in seconds.items():
        cells = [name]
        for kind in (statistics.median, min):
            cells += [f"{kind(times):.2f}", f"{kind(times) / kind(base):.2f}"]
        lines.append("| " + " | ".join([*cells, f"{max(m for _, m in found[name]):.0f}"]) + " |")
    return lines


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=7)
    runs = parser.parse_args().runs
    with compiled_once() as environment:
        for command in COMMANDS.values():  # compiles, and fills the caches of the file system
            spent(command, environment)
        found: dict[str, list[tuple[float, float]]] = {name: [] for name in COMMANDS}
        for _ in range(runs):
            for name, command in COMMANDS.items():
                found[name].append(spent(command, environment))
    print("\n".join(table(found)))
    print(WANTED)


if __name__ == "__main__":
    main()
