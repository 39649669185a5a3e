"""Front, MILP, best-first search and enumeration on random problems: disagreements counted.

    python benchmarks/choice_agreement.py [--count 10000] [--seed 0] [--most 60] [--no-milp]

Each problem is small enough to enumerate and has every coupling: clocks, shared hardware with
channels, chains, stages that share a vehicle, both sync models, all objectives, budgets, accuracy
and sync limits that some design meets exactly or misses by 1e-12; coefficients span 1e-10 s to
1e6 EUR.  Compared are feasibility and the optimum (objective exact, error to 12 figures), also with
an enumeration that knows nothing but the options, the front of cost and of mass, and the full order
of all designs.  Prints one line per disagreement and a summary; exit code 1 if there is any.
"""

from __future__ import annotations

import argparse
import itertools
import math
import random
import sys
import time
import warnings
from dataclasses import replace
from fractions import Fraction
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
from syncline_design.choice.option import Option
from syncline_design.choice.outcome import Deadline, FrontPoint, NoVerdict
from syncline_design.choice.ranked import iter_best
from syncline_design.choice.table import ClockOption, Design, Pair, Problem, with_limits


def drawn(seed: int, most: int) -> Problem:
    """One random problem with limits near what its designs reach."""
    rng = random.Random(seed)
    problem = random_problem(rng, most)
    found = [one for _, one in all_designs(problem)]
    problem = with_random_limits(rng, problem, [one.error_m for one in found])
    ratios = [one.sync_ratio for one in found if 0.0 < one.sync_ratio < math.inf]
    if ratios and rng.random() < 0.4:  # a limit that some design meets exactly, or just misses
        sync = rng.choice(ratios) * rng.choice([1.0, 1.0, 1.0 - 1e-12, 1.0 + 1e-12, 0.3])
        problem = with_limits(problem, replace(problem.limits, sync=sync))
    return problem


def plainly(problem: Problem) -> tuple[Fraction | float, float] | None:
    """Objective and error of the best design, from the options alone: no table, no evaluation.

    total = sum of errors + rate * max over pairs of (tau_a + tau_b + offsets) (per_sensor: the sum
    of rate * bound), sync: rate * tau_sys / sum of sensor errors below the limit.
    """
    best: tuple[Fraction | float, float] | None = None
    roles = [list(table.options) for table in problem.roles]
    for options in itertools.product(*roles):
        for clocks in itertools.product(*(vehicle.clocks for vehicle in problem.vehicles)):
            found = _plain_figures(problem, options, clocks)
            if found is not None and (best is None or found < best):
                best = found
    return best


def _plain_figures(
    problem: Problem, options: tuple[Option, ...], clocks: tuple[ClockOption, ...]
) -> tuple[Fraction | float, float] | None:
    """Objective and error of one design; None where it breaks a limit."""
    limits = problem.limits
    bounds = [_plain_bound(problem, options, clocks, pair) for pair in problem.pairs]
    noise = sum(Fraction(o.sensor_error_m) for o in options)
    rate, worst = Fraction(problem.sync_rate_mps), max(bounds, default=Fraction(0))
    caused = rate * worst
    if problem.sync_model == "per_sensor":
        caused = sum(Fraction(p.rate_mps) * b for p, b in zip(problem.pairs, bounds, strict=True))
    error = float(noise + caused + Fraction(problem.fixed_error_m))
    if limits.accuracy_m is not None and error > limits.accuracy_m:
        return None
    if rate * worst and not float(rate * worst / noise) < limits.sync:
        return None
    sums = {name: _plain_sum(problem, options, clocks, name) for name in ("cost", "mass", "power")}
    for name, amount in sums.items():
        limit = getattr(limits, name)
        if limit is not None and amount > limit:
            return None
    shown = float(f"{error:.12g}")
    return (shown if problem.objective == "error" else sums[problem.objective], shown)


def _plain_bound(
    problem: Problem, options: tuple[Option, ...], clocks: tuple[ClockOption, ...], pair: Pair
) -> Fraction:
    met = [pair.role] if pair.reference is None else [pair.role, pair.reference]
    lines = []
    for r in met:
        vehicle = problem.roles[r].vehicle
        lines.append("utc" if options[r].timeline == "utc" else vehicle)
    bound = sum((Fraction(options[r].tau_s) for r in met), Fraction(0))
    if len(met) == 2 and lines[0] == lines[1]:
        return bound
    return bound + sum(Fraction(clocks[v].offset_bound_s) for v in lines if v != "utc")


def _plain_sum(
    problem: Problem, options: tuple[Option, ...], clocks: tuple[ClockOption, ...], name: str
) -> Fraction:
    total = sum(getattr(one.resources, name) for one in (*options, *clocks))
    for item in problem.infrastructure:
        for v, clock in enumerate(clocks):
            needs = [clock.requires]
            needs += [
                o.requires for o, t in zip(options, problem.roles, strict=True) if t.vehicle == v
            ]
            used = sum(count for kind in needs for one, count in kind if one == item.id)
            total += -(-used // item.channels) * getattr(item.resources, name)
    return total


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
    out = [] if plainly(problem) == (best and best[0][:2]) else ["plain enumeration"]
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
