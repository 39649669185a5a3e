"""The exact front against its peers on the same instances, in one run: a table of ratios.

    python benchmarks/choice.py [--quick] [--limit SECONDS] [--repeat 7] [--peers 7]

front: all points of cost against error, the columns made from the options each time (cold) or kept
(warm), medians.  The peers find one point of it, the cheapest design at the error of the middle
point: cvxpy with HiGHS (a plain model, scaled by its limits, gap 0, one thread), OR-tools CP-SAT
(whole nanometres and cents, one worker; `pip install syncline-design[bench]`), each also with the
options dropped first that another one of the role makes superfluous (fair), the MILP road of the
product (0/1 rows, two solves and a canary), and enumeration where it can end.  Building every model
is counted, imports are not.  Seconds are processor time, so that other work on the machine counts
little; the ratios are what counts.
"""

from __future__ import annotations

import argparse
import os
import statistics
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from datetime import date
from importlib import metadata
from multiprocessing import get_context
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))
sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

from choice_instances import instance, write_spec

from plain_front import front_by_enumeration
from syncline_design import __version__
from syncline_design.choice.evaluate import evaluate
from syncline_design.choice.front import front
from syncline_design.choice.milp import best_by_milp
from syncline_design.choice.outcome import Deadline, FrontPoint, NoVerdict
from syncline_design.choice.problem import build_problem
from syncline_design.choice.table import Problem, with_limits
from syncline_design.spec.load import load
from syncline_design.verdict.optimize import OptimizeSettings, optimize

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


def fair(problem: Problem) -> Problem:
    """The problem without options that another of the role makes superfluous in all figures."""
    roles = []
    for role in problem.roles:
        own = role.options
        cost = np.array([float(o.resources.cost or 0) for o in own])
        order = np.lexsort((own.tau, own.error, cost))
        kept: list[int] = []
        for row in order.tolist():
            better = (own.error[kept] <= own.error[row]) & (own.tau[kept] <= own.tau[row])
            if not better.any():
                kept.append(row)
        roles.append(replace(role, options=own.take(kept)))
    return replace(problem, roles=tuple(roles))


def plain_model_fair(problem: Problem, limit_s: float) -> Timed:
    """cvxpy and HiGHS without superfluous options."""
    started = time.process_time()
    smaller = fair(problem)
    spent = time.process_time() - started
    taken, cost = plain_model(smaller, limit_s)
    return taken + spent, cost


def cp_sat_fair(problem: Problem, limit_s: float) -> Timed:
    """CP-SAT without superfluous options."""
    started = time.process_time()
    smaller = fair(problem)
    spent = time.process_time() - started
    taken, cost = cp_sat(smaller, limit_s)
    return taken + spent, cost


def renewed(problem: Problem) -> Problem:
    """The problem before any column is made of its options."""
    given = [tuple(role.options) for role in problem.roles]
    roles = (replace(r, options=own) for r, own in zip(problem.roles, given, strict=True))
    return replace(problem, roles=tuple(roles))


def timed_front(problem: Problem, repeat: int) -> tuple[float, float, Sequence[FrontPoint]]:
    """Median times of the whole front, cold and warm."""
    cold, warm = [], []
    for _ in range(repeat):
        started = time.process_time()
        fresh = renewed(problem)
        points = front(fresh)
        cold.append(time.process_time() - started)
        started = time.process_time()
        points = front(fresh)
        warm.append(time.process_time() - started)
    return statistics.median(cold), statistics.median(warm), points


Peer = Callable[[Problem, float], Timed]
Peers = dict[str, Peer | None]


def repeated(peer: Peer, problem: Problem, limit_s: float, repeat: int) -> Timed:
    """The median of several runs, the first one left out as its imports' warming up."""
    peer(problem, limit_s)
    found = [peer(problem, limit_s) for _ in range(repeat)]
    return statistics.median(seconds for seconds, _ in found), found[0][1]


def in_own_process(peer: Peer, problem: Problem, limit_s: float, repeat: int) -> Timed:
    """A peer in a fresh process: OR-tools and highspy bring clashing copies of HiGHS."""
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        return pool.submit(repeated, peer, problem, limit_s, repeat).result()


def row(name: str, problem: Problem, peers: Peers, options: argparse.Namespace) -> None:
    """One line of the table: the front, then each peer and how many times longer it took."""
    cold, warm, points = timed_front(problem, options.repeat)
    middle = points[len(points) // 2]
    limited = replace(problem, limits=replace(problem.limits, accuracy_m=middle.error_m))
    cells = [name, f"{problem.combinations:.2g}", str(len(points))]
    cells += [f"{cold * 1e3:.2f}", f"{warm * 1e3:.2f}"]
    for peer in peers.values():
        if peer is None:
            cells.append("")
            continue
        taken, cost = in_own_process(peer, limited, options.limit, options.peers)
        if cost is None:
            cells.append(f"> {taken * 1e3:.0f} (> {taken / cold:.0f})")
            continue
        same = abs(cost - float(middle.amount)) <= 1e-6 * max(1.0, cost)
        cells.append(f"{taken * 1e3:.1f} ({taken / cold:.1f})" + ("" if same else " OTHER RESULT"))
    print("| " + " | ".join(cells) + " |", flush=True)


def from_spec(repeat: int, *, quick: bool) -> None:
    """From a loaded spec to its front, and the whole of `optimize --pareto` in one process."""
    print("\n| spec | reading [ms] | tables | tables and front | optimize --pareto |")
    print("|---|---|---|---|---|")
    for stages, sensors, methods in ((1, 4, 4), (1, 50, 8), (2, 1000, 8))[: 2 if quick else 3]:
        with tempfile.TemporaryDirectory() as folder:
            steps = _steps(write_spec(Path(folder), stages, sensors, methods, SEED), repeat)
        name = f"{2 * stages + 1} roles x {sensors} x {methods}"
        shown = " | ".join(f"{seconds * 1e3:.2f}" for seconds in steps)
        print(f"| {name} | {shown} |", flush=True)


def _steps(path: Path, repeat: int) -> list[float]:
    """Seconds to read a spec, to make its tables, its front too, and of a whole optimization."""
    started = time.process_time()
    case = load(path)
    steps = [time.process_time() - started]
    steps += [
        statistics.median(_spent(run) for _ in range(repeat))
        for run in (lambda: build_problem(case), lambda: front(build_problem(case)))
    ]
    return [*steps, _spent(lambda: optimize(case, OptimizeSettings(pareto=True)))]


def _spent(run: Callable[[], object]) -> float:
    started = time.process_time()
    run()
    return time.process_time() - started


def hard(*, quick: bool) -> None:
    """Tight sync limits, and clocks and shared hardware on several vehicles."""
    print("\n| instance | points | front [s] |")
    print("|---|---|---|")
    for limit in (1.0, 0.3, 0.1):
        problem = instance(2, 50, seed=SEED)
        tight = with_limits(problem, replace(problem.limits, sync=limit))
        _hard_row(f"5 roles x 50 x 8, sync limit {limit}", tight)
    per_sensor = replace(instance(2, 50, seed=SEED), sync_model="per_sensor")
    _hard_row("5 roles x 50 x 8, per_sensor", per_sensor)
    for vehicles in (2, 3, 4) if quick else (2, 3, 4, 5, 6, 8):
        for boards in (False, True):
            problem = instance(vehicles, 10, seed=SEED, vehicles=vehicles, clocks=3, boards=boards)
            name = f"{vehicles} vehicles x 3 clocks, 10 x 8" + (", boards" if boards else "")
            _hard_row(name, problem)


def _hard_row(name: str, problem: Problem) -> None:
    started = time.process_time()
    points = front(problem)
    print(f"| {name} | {len(points)} | {time.process_time() - started:.3f} |", flush=True)


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
        _, seconds, _ = timed_front(problem, repeat)
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
    parser.add_argument("--repeat", type=int, default=7)
    parser.add_argument("--peers", type=int, default=7, help="runs of each peer")
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    versions = ", ".join(f"{n} {metadata.version(n)}" for n in ("cvxpy", "highspy", "ortools"))
    print(
        f"syncline-design {__version__}, {versions}, {os.cpu_count()} processors, seed {SEED}, "
        f"{date.today().isoformat()}\n"
    )
    peers: Peers = {
        "cvxpy + HiGHS": plain_model, "the same, fair": plain_model_fair, "CP-SAT": cp_sat,
        "CP-SAT, fair": cp_sat_fair, "MILP road": None if options.quick else milp_road,
        "enumeration": None,
    }  # fmt: skip
    print(
        "| instance | combinations | points | cold [ms] | warm [ms] | " + " | ".join(peers) + " |"
    )
    print("|" + "---|" * (5 + len(peers)))
    small = instance(1, 4, methods=4, seed=SEED)
    row("3 roles x 4 sensors x 4 methods", small, peers | {"enumeration": by_enumeration}, options)
    row("3 roles x 50 x 8", instance(1, 50, seed=SEED), peers, options)
    coupled = instance(2, 50, seed=SEED, vehicles=2, clocks=3, boards=True)
    own = dict.fromkeys(peers) | {"MILP road": peers["MILP road"]}
    row("5 roles x 50 x 8, 2 boards, 3 clocks, 2 vehicles", coupled, own, options)
    if not options.quick:
        row("5 roles x 1 000 x 8", instance(2, 1000, seed=SEED), peers, options)
        row("7 roles x 1 000 x 8", instance(3, 1000, seed=SEED), dict.fromkeys(peers), options)
    from_spec(options.repeat, quick=options.quick)
    hard(quick=options.quick)
    growth(options.repeat)
    return 0


if __name__ == "__main__":
    sys.exit(main())
