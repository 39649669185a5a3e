"""Choice under figures of the error against the closed form of the root mean square.

Random problems (`tests/figure_problems.py`): isotropic sensors on a level vehicle, for which the
worst situation's root mean square is known by hand, so that plain enumeration costs nothing.

    python benchmarks/figure_choice.py [COUNT] [SEED]
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

from figure_problems import drawn, written
from syncline_design.choice.decide import choose
from syncline_design.spec.load import load_text
from syncline_design.verdict.acceptance import Simulations
from test_figure_choice import cheapest_by_hand, cost_of


def main(count: int, seed: int) -> None:
    wrong, none, spent = 0, 0, 0.0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for number in range(seed, seed + count):
            raw = drawn(number, ("rmse",))
            wanted = cheapest_by_hand(raw)
            problem = Simulations().problem_of(load_text(written(raw, folder), folder / "s.yaml"))
            start = time.process_time()
            found = cost_of(problem, choose(problem))
            spent += time.process_time() - start
            none += wanted is None
            if found != wanted:
                wrong += 1
                print(f"seed {number}: {found} instead of {wanted}")
    print(f"{count} problems from seed {seed}: {wrong} differ, {none} without a design, "
          f"{1e3 * spent / count:.1f} ms of processor time each")  # fmt: skip


if __name__ == "__main__":
    arguments = [int(one) for one in sys.argv[1:]]
    main(*(arguments + [1000, 0][len(arguments) :]))
