"""Front, MILP, best-first search and enumeration on random problems: disagreements counted.

    python benchmarks/choice_agreement.py [--count 10000] [--seed 0] [--most 60] [--no-milp]

Each problem is small enough to enumerate and has every coupling: clocks, shared hardware with
channels, chains, stages that share a vehicle, both sync models, all objectives, budgets and
accuracy limits that some design meets exactly or misses by 1e-12; coefficients span 1e-10 s to
1e6 EUR.  Compared are feasibility, the optimum (objective exact, error to 12 figures), the front
of cost and of mass, and the full order of all designs.  Prints one line per disagreement and a
summary; exit code 1 if there is any.
"""

from __future__ import annotations

import argparse
import itertools
import random
import sys
import time
import warnings
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

from plain_front import front_by_enumeration
from random_problems import random_problem, with_random_limits
from syncline_design import __version__
from syncline_design.choice.decide import best_by_front
from syncline_design.choice.enumerate import all_designs
from syncline_design.choice.evaluate import broken, error_key, evaluate, rank
from syncline_design.choice.front import front
from syncline_design.choice.milp import best_by_milp
from syncline_design.choice.outcome import Deadline, FrontPoint, NoVerdict
from syncline_design.choice.ranked import iter_best
from syncline_design.choice.table import Design, Problem


def drawn(seed: int, most: int) -> Problem:
    """One random problem with limits near what its designs reach."""
    rng = random.Random(seed)
    problem = random_problem(rng, most)
    return with_random_limits(rng, problem, [found.error_m for _, found in all_designs(problem)])


def keys(points: tuple[FrontPoint, ...]) -> list[tuple[object, float]]:
    """What two fronts must have in common."""
    return [(point.amount, error_key(point.error_m)) for point in points]


def disagreements(problem: Problem, with_milp: bool) -> list[str]:
    """Names of what differs from enumeration."""
    ranked = sorted(
        (
            (rank(problem, d, found), d)
            for d, found in all_designs(problem)
            if not broken(problem, found)
        ),
        key=lambda entry: entry[0],
    )
    best = ranked[0] if ranked else None
    out = []
    if best_by_front(problem, Deadline()) != (best and best[1]):
        out.append("optimum")
    if list(itertools.islice(iter_best(problem), len(ranked) + 1)) != [d for _, d in ranked]:
        out.append("order")
    out += [
        f"front of {resource}"
        for resource in ("cost", "mass")
        if keys(front(problem, resource)) != keys(front_by_enumeration(problem, resource))
    ]
    if with_milp:
        out += _of_milp(problem, best and best[0])
    return out


def _of_milp(problem: Problem, best: tuple | None) -> list[str]:
    try:
        found: Design | None = best_by_milp(problem, Deadline())
    except NoVerdict:
        return ["milp: no verdict"]
    if (found is None) != (best is None):
        return ["milp: feasibility"]
    if found is None or best is None:
        return []
    ranked = rank(problem, found, evaluate(problem, found))
    return [] if ranked[:2] == best[:2] else ["milp: optimum"]


def main() -> int:
    """Run, print, count."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--count", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--most", type=int, default=60)
    parser.add_argument("--no-milp", action="store_true")
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    started, wrong, feasible = time.time(), {}, 0
    for seed in range(options.seed, options.seed + options.count):
        problem = drawn(seed, options.most)
        feasible += next(iter_best(problem), None) is not None
        for name in disagreements(problem, not options.no_milp):
            wrong[name] = wrong.get(name, 0) + 1
            print(f"seed {seed}: {name}", flush=True)
        done = seed - options.seed + 1
        if done % 500 == 0:
            print(f"{done} done, {sum(wrong.values())} disagreements", file=sys.stderr, flush=True)
    print(
        f"{options.count} problems (seeds {options.seed} to {options.seed + options.count - 1}, "
        f"version {__version__}): {feasible} feasible; disagreements: {wrong or 0}; "
        f"{time.time() - started:.0f} s"
    )
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
