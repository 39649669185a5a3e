"""Payloads that cannot exist, on random specs: what the product says against plain enumeration.

    python benchmarks/existence.py [--count 1000] [--seed 0] [--fixes 300]

Specs have chains, clocks, shared hardware, cables and a catalog of their own in which reach,
medium, GNSS, field of view, rate, depth, temperature and lifecycle are told or not. Compared
with an oracle that reads the same text: the verdict and its cost on all three roads, the front,
every row of `excluded` with its strongest reason, the recheck on selections that may be
impossible, for specs without a design every fix, and distances of a grid that would help and
lie nearer than what is said. Prints one line per disagreement and a summary; exit code 1 if
there is any.
"""

from __future__ import annotations

import argparse
import random
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

from existence_oracle import disagreements, fix_disagreements, has_design
from existence_specs import drawn
from syncline_design import __version__


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--fixes", type=int, default=300, help="specs of which fixes are compared")
    asked = parser.parse_args()
    start, wrong, without, remedied = time.process_time(), 0, 0, 0
    for seed in range(asked.seed, asked.seed + asked.count):
        spec, parts = drawn(seed)
        with tempfile.TemporaryDirectory() as folder:
            found = disagreements(spec, parts, Path(folder), random.Random(seed))
            if not has_design(spec, parts):
                without += 1
                if remedied < asked.fixes:
                    remedied += 1
                    found += fix_disagreements(spec, parts, Path(folder))
        for line in found:
            print(f"seed {seed}: {line}")
        wrong += bool(found)
    seconds = time.process_time() - start
    print(
        f"{__version__}: {asked.count} specs from seed {asked.seed}, {without} without a design, "
        f"fixes of {remedied}: {wrong} disagree; {seconds:.0f} s of processor time"
    )
    return 1 if wrong else 0


if __name__ == "__main__":
    raise SystemExit(main())
