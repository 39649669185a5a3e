"""What people ask after a choice, on random specs: the product against plain enumeration.

    python benchmarks/questions.py [--count 100] [--seed 0]

Why not this entry (every one that a spec lists), the design without each sensor, the range over
ways of stamping, bargains; and on as many specs with owned entries, in half of them with converted
prices: front, design, bill and recheck to the cent.  Prints one line per disagreement and a
summary; exit code 1 if there is any.
"""

from __future__ import annotations

import argparse
import random
import sys
import time
from collections import Counter
from collections.abc import Callable
from functools import partial
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

from questions_oracle import compare_alternatives, compare_why_not, drawn
from syncline_design import __version__
from test_owned import compare_money


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    start, wrong, seen = time.process_time(), 0, Counter[str]()
    for seed in range(asked.seed, asked.seed + asked.count):
        (spec,) = drawn(seed, 1)
        for compare in (compare_why_not, compare_alternatives):
            wrong += _failed(seed, seen, partial(compare, spec))
        wrong += _failed(seed, seen, partial(_with_money, random.Random(seed)))
    counts = ", ".join(f"{count} {name}" for name, count in sorted(seen.items()))
    seconds = time.process_time() - start
    print(
        f"{__version__}: {asked.count} specs from seed {asked.seed}, {counts}: {wrong} disagree; "
        f"{seconds:.0f} s of processor time"
    )
    return 1 if wrong else 0


def _with_money(rng: random.Random) -> Counter[str]:
    seen = Counter[str]()
    while not seen["specs"]:
        seen += compare_money(rng)
    return seen


def _failed(seed: int, seen: Counter[str], compare: Callable[[], Counter[str]]) -> bool:
    try:
        seen.update(compare())
    except AssertionError as error:
        print(f"seed {seed}: {str(error).splitlines()[:1]}")
        return True
    return False


if __name__ == "__main__":
    raise SystemExit(main())
