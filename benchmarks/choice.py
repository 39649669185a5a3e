"""The exact front against its peers on the same instances, in one run: a table of ratios.

    python benchmarks/choice.py [--quick] [--limit SECONDS] [--repeat 5]

front: all points of cost against error, from the tables of options to designs (median).  The peers
find one point of it, the cheapest design at the error of the middle point: cvxpy with HiGHS (a
plain model, scaled by its limits, gap 0, one thread), the MILP road of the product (0/1 rows, two
solves and a canary), OR-tools CP-SAT (whole nanometres and cents, one worker; `pip install
syncline-design[bench]`), and enumeration where it can end.  Seconds are processor time, so that
other work on the machine counts little; the ratios are what counts.
"""

from __future__ import annotations

import argparse
import os
import statistics
import sys
import time
import warnings
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from datetime import date
from importlib import metadata
from multiprocessing import get_context
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))

from choice_instances import instance

from syncline_design import __version__
from syncline_design.choice.enumerate import front_by_enumeration
from syncline_design.choice.evaluate import evaluate
from syncline_design.choice.front import front
from syncline_design.choice.milp import best_by_milp
from syncline_design.choice.outcome import Deadline, FrontPoint, NoVerdict
from syncline_design.choice.table import Problem

SEED = 0
NM = 1e9
Timed = tuple[float, float | None]  # seconds, cost found (None: not proven)


def plain_model(problem: Problem, limit_s: float) -> Timed:
    """The choice as one would write it in cvxpy: binaries, a continuous sync error, one solve."""
    import cvxpy as cp
    import highspy  # noqa: F401 - so that its import is not timed

    started = time.process_time()
    limit = problem.limits.accuracy_m or 1.0
    x = [cp.Variable(len(role.options), boolean=True) for role in problem.roles]
    tau = [
        _column(role, lambda o: problem.sync_rate_mps * o.tau_s / limit) for role in problem.roles
    ]
    error = [_column(role, lambda o: o.sensor_error_m / limit) for role in problem.roles]
    cost = [_column(role, lambda o: float(o.resources.cost or 0)) for role in problem.roles]
    sync = cp.Variable(nonneg=True)
    rows = [cp.sum(one) == 1 for one in x]
    rows += [
        tau[p.role] @ x[p.role] + tau[p.reference] @ x[p.reference] <= sync for p in problem.pairs
    ]
    total = sum(e @ one for e, one in zip(error, x, strict=True))
    rows += [total + sync <= 1.0, sync <= total]
    spent = sum(c @ one for c, one in zip(cost, x, strict=True))
    program = cp.Problem(cp.Minimize(spent), rows)
    try:
        program.solve(
            solver=cp.HIGHS, mip_rel_gap=0.0, mip_abs_gap=0.0, threads=1, time_limit=limit_s
        )
    except cp.error.SolverError:
        return time.process_time() - started, None
    proven = program.status == "optimal"
    return time.process_time() - started, float(program.value) if proven else None


def _column(role: object, figure: Callable) -> np.ndarray:
    return np.array([figure(option) for option in role.options])


def cp_sat(problem: Problem, limit_s: float) -> Timed:
    """The same for CP-SAT in whole nanometres and cents."""
    from ortools.sat.python import cp_model

    started = time.process_time()
    model = cp_model.CpModel()
    limit = int((problem.limits.accuracy_m or 1.0) * NM) + 10  # what rounding may add
    x = [[model.new_bool_var("") for _ in role.options] for role in problem.roles]
    for one in x:
        model.add_exactly_one(one)
    sync = model.new_int_var(0, limit, "sync")
    rate = problem.sync_rate_mps * NM
    moved = [
        sum(round(rate * o.tau_s) * v for o, v in zip(role.options, one, strict=True))
        for role, one in zip(problem.roles, x, strict=True)
    ]
    for pair in problem.pairs:
        model.add(moved[pair.role] + moved[pair.reference] <= sync)
    options = [(o, v) for role, one in zip(problem.roles, x, strict=True)
               for o, v in zip(role.options, one, strict=True)]  # fmt: skip
    total = sum(round(o.sensor_error_m * NM) * v for o, v in options)
    model.add(total + sync <= limit)
    model.add(sync <= total)
    model.minimize(sum(int(100 * (o.resources.cost or 0)) * v for o, v in options))
    solver = cp_model.CpSolver()
    solver.parameters.num_workers = 1
    solver.parameters.max_time_in_seconds = limit_s
    status = solver.solve(model)
    proven = status == cp_model.OPTIMAL
    return time.process_time() - started, solver.objective_value / 100 if proven else None


def milp_road(problem: Problem, limit_s: float) -> Timed:
    """The product's own MILP road."""
    import cvxpy  # noqa: F401 - so that its import is not timed

    started = time.process_time()
    try:
        found = best_by_milp(problem, Deadline(limit_s))
    except NoVerdict:
        return time.process_time() - started, None
    cost = None if found is None else evaluate(problem, found).cost
    return time.process_time() - started, None if cost is None else float(cost)


def timed_front(problem: Problem, repeat: int) -> tuple[float, tuple[FrontPoint, ...]]:
    """Median time of the whole front."""
    times, points = [], ()
    for _ in range(repeat):
        started = time.process_time()
        points = front(problem)
        times.append(time.process_time() - started)
    return statistics.median(times), points


Peers = dict[str, Callable[[Problem, float], Timed] | None]


def in_own_process(
    peer: Callable[[Problem, float], Timed], problem: Problem, limit_s: float
) -> Timed:
    """A peer in a fresh process: OR-tools and highspy bring clashing copies of HiGHS."""
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        return pool.submit(peer, problem, limit_s).result()


def row(name: str, problem: Problem, peers: Peers, options: argparse.Namespace) -> None:
    """One line of the table: the front, then each peer and how many times longer it took."""
    seconds, points = timed_front(problem, options.repeat)
    middle = points[len(points) // 2]
    limited = replace(problem, limits=replace(problem.limits, accuracy_m=middle.error_m))
    cells = [name, f"{problem.combinations:.2g}", str(len(points)), f"{seconds:.4f}"]
    for peer in peers.values():
        if peer is None:
            cells.append("")
            continue
        taken, cost = in_own_process(peer, limited, options.limit)
        if cost is None:
            cells.append(f"> {taken:.1f} (> {taken / seconds:.0f} x)")
            continue
        same = abs(cost - float(middle.amount)) <= 1e-6 * max(1.0, cost)
        cells.append(f"{taken:.2f} ({taken / seconds:.0f} x)" + ("" if same else " OTHER RESULT"))
    print("| " + " | ".join(cells) + " |", flush=True)


def by_enumeration(problem: Problem, _: float) -> Timed:
    """The oracle, whole front."""
    started = time.process_time()
    points = front_by_enumeration(problem)
    cheapest = [p for p in points if p.error_m <= (problem.limits.accuracy_m or 0.0)]
    return time.process_time() - started, float(cheapest[0].amount)


def growth(repeat: int) -> None:
    """How the time grows with the options per role."""
    print("\n| sensors per role | options per role | front [s] | per option [us] |")
    print("|---|---|---|---|")
    for sensors in (50, 200, 800, 3200):
        problem = instance(1, sensors, seed=SEED)
        seconds, _ = timed_front(problem, repeat)
        options = sum(len(role.options) for role in problem.roles)
        print(
            f"| {sensors} | {options // len(problem.roles)} | {seconds:.4f} "
            f"| {seconds / options * 1e6:.2f} |",
            flush=True,
        )


def main() -> int:
    """Print the tables."""
    parser = argparse.ArgumentParser(description="The exact front against its peers")
    parser.add_argument("--quick", action="store_true", help="the small instances only")
    parser.add_argument("--limit", type=float, default=120.0, help="seconds per peer")
    parser.add_argument("--repeat", type=int, default=5)
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    versions = ", ".join(f"{n} {metadata.version(n)}" for n in ("cvxpy", "highspy", "ortools"))
    print(
        f"syncline-design {__version__}, {versions}, {os.cpu_count()} processors, seed {SEED}, "
        f"{date.today().isoformat()}\n"
    )
    peers: Peers = {
        "cvxpy + HiGHS": plain_model, "MILP road": milp_road, "CP-SAT": cp_sat, "enumeration": None,
    }  # fmt: skip
    print("| instance | combinations | points | front [s] | " + " | ".join(peers) + " |")
    print("|" + "---|" * (4 + len(peers)))
    small = instance(1, 4, methods=4, seed=SEED)
    row("3 roles x 4 sensors x 4 methods", small, peers | {"enumeration": by_enumeration}, options)
    row("3 roles x 50 x 8", instance(1, 50, seed=SEED), peers, options)
    coupled = instance(2, 50, seed=SEED, vehicles=2, clocks=3, boards=True)
    own = dict.fromkeys(peers) | {"MILP road": milp_road}
    row("5 roles x 50 x 8, 2 boards, 3 clocks, 2 vehicles", coupled, own, options)
    if not options.quick:
        row("5 roles x 1 000 x 8", instance(2, 1000, seed=SEED), peers, options)
        row("7 roles x 1 000 x 8", instance(3, 1000, seed=SEED), dict.fromkeys(peers), options)
    growth(options.repeat)
    return 0


if __name__ == "__main__":
    sys.exit(main())
