"""`optimize --pareto` against its peer, whole processes in turns: a table of ratios.

    python benchmarks/whole_process.py [--runs 7] [--quick]

The product's process reads the spec, chooses, proves, draws the whole front with its prices, works
out slack, tolerances, what to measure next, alternatives and bargains, and prints them.  The peer's
process (`peer_process.py`) reads the same files and finds one point of that front, the cheapest
design at the error of its middle point, with cvxpy and HiGHS, plainly or with dominated options
dropped first (fair); that both find the same price is checked.  Processor time (user and system),
medians, and the least of each; the bytecode of both is compiled before.
"""

from __future__ import annotations

import argparse
import json
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from datetime import date
from importlib import metadata
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from choice_instances import write_spec
from startup import compiled_once, spent

from syncline_design import __version__

SIZES = {
    "3 roles x 4 x 4": (1, 4, 4),
    "3 roles x 50 x 8": (1, 50, 8),
    "5 roles x 1 000 x 8": (2, 1000, 8),
}
WANTED = "wanted: 0.5 / 0.5 / 0.3 of the plain peer's process, 0.7 of the fair one's"
Commands = Mapping[str, tuple[str, ...]]


def commands_of(spec: Path, environment: Mapping[str, str]) -> Commands:
    """The product's command and both peers', which have to find the price of its middle point."""
    product = (sys.executable, "-m", "syncline_design.cli", "optimize", "--pareto", str(spec))
    front = json.loads(_said((*product, "--quiet", "--output", "json:-"), environment))["front"]
    middle = front[len(front) // 2]
    peer = (sys.executable, str(Path(__file__).with_name("peer_process.py")))
    asked = (*peer, str(spec), repr(middle["error_m"] * (1.0 + 1e-9)))
    found = {"product": product, "plain": asked, "fair": (*asked, "--fair")}
    for name in ("plain", "fair"):
        price = float(_said(found[name], environment).splitlines()[-1])  # HiGHS greets first
        if abs(price - middle["cost"]) > 0.01:
            raise SystemExit(f"{name}: {price} instead of {middle['cost']}")
    return found


def _said(command: Sequence[str], environment: Mapping[str, str]) -> str:
    done = subprocess.run(command, env=environment, check=True, capture_output=True, text=True)
    return done.stdout


def line(name: str, found: Mapping[str, list[float]]) -> str:
    """One line of the table: medians and leasts, then their ratios."""
    cells = [name]
    for kind in (statistics.median, min):
        each = {which: kind(times) for which, times in found.items()}
        cells += [f"{seconds:.2f}" for seconds in each.values()]
        cells += [f"{each['product'] / each[peer]:.2f}" for peer in ("plain", "fair")]
    return "| " + " | ".join(cells) + " |"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=7)
    parser.add_argument("--quick", action="store_true", help="the small instances only")
    options = parser.parse_args()
    versions = ", ".join(f"{n} {metadata.version(n)}" for n in ("cvxpy", "highspy"))
    print(f"syncline-design {__version__}, {versions}, {date.today().isoformat()}\n")
    heads = ["product [s]", "plain peer [s]", "fair peer [s]", "of plain", "of fair"]
    print("| spec | " + " | ".join([*heads, *(f"least: {h}" for h in heads)]) + " |")
    print("|" + "---|" * 11)
    with tempfile.TemporaryDirectory() as folder, compiled_once() as environment:
        for name, size in list(SIZES.items())[: 2 if options.quick else 3]:
            place = Path(folder) / "x".join(map(str, size))
            place.mkdir()
            commands = commands_of(write_spec(place, *size), environment)
            found: dict[str, list[float]] = {which: [] for which in commands}
            for _ in range(options.runs):
                for which, command in commands.items():
                    found[which].append(spent(command, environment)[0])
            print(line(name, found), flush=True)
    print(WANTED)


if __name__ == "__main__":
    main()
