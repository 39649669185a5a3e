"""The MILP road against enumeration, and HiGHS's traps with the cure each of them has."""

from __future__ import annotations

import builtins
import random
from dataclasses import replace
from typing import Any

import cvxpy as cp
import numpy as np
import pytest

from random_problems import random_problem, with_random_limits
from syncline_design.choice import milp, solver
from syncline_design.choice.decide import choose
from syncline_design.choice.enumerate import all_designs, best_by_enumeration
from syncline_design.choice.evaluate import evaluate, rank
from syncline_design.choice.milp import best_by_milp
from syncline_design.choice.outcome import Choice, Deadline, Infeasible, NoVerdict
from syncline_design.choice.solver import is_recent
from syncline_design.choice.table import Limits, Problem
from syncline_design.machine.deadline import within_s
from test_front import one_stage, option

pytestmark = pytest.mark.filterwarnings("ignore::UserWarning", "ignore::FutureWarning")


@pytest.mark.parametrize("seed", range(40))
def test_milp_equals_enumeration(seed: int) -> None:
    rng = random.Random(seed + 50_000)
    problem = random_problem(rng, 60)
    errors = [found.error_m for _, found in all_designs(problem)]
    problem = with_random_limits(rng, problem, errors)
    ranks = [
        design and rank(problem, design, evaluate(problem, design))[:2]
        for design in (best_by_milp(problem, Deadline()), best_by_enumeration(problem))
    ]
    assert ranks[0] == ranks[1]


def chosen_sensors(problem: Problem) -> list[str] | None:
    design = best_by_milp(problem, Deadline())
    if design is None:
        return None
    return [t.options[i].sensor for t, i in zip(problem.roles, design.options, strict=True)]


def naive_pick(figures: list[float], costs: list[float], limit: float, **options: Any) -> int:
    """The cheapest option with figure <= limit, as one would write it down first."""
    x = cp.Variable(len(figures), boolean=True)
    rows = [cp.sum(x) == 1, np.array(figures) @ x <= limit]
    program = cp.Problem(cp.Minimize(np.array(costs) @ x), rows)
    program.solve(solver=cp.HIGHS, **options)
    assert program.status == "optimal"
    return int(np.argmax(x.value))


def two_options(error: float, tau: float, better: float, limit: float) -> Problem:
    """Cheap but over the limit, or dear and within it."""
    cheap, dear = option("cheap", error, tau, 1), option("dear", error, better, 100)
    fixed = option("fixed", error, 0.0, 1)
    return one_stage([[cheap, dear], [fixed], [fixed]], Limits(limit, 1e12), 1.0, 0.0)


def test_times_in_seconds_are_dropped_by_the_solver_but_not_here() -> None:
    """8e-10 s against 6e-10 s: coefficients at or below 1e-9 vanish, the limit with them."""
    assert naive_pick([8e-10, 1e-10], [1.0, 100.0], 6e-10) == 0  # the trap: 8e-10 > 6e-10
    problem = two_options(1e-11, 8e-10, 1e-10, 6e-10)
    assert chosen_sensors(problem) == ["dear", "fixed", "fixed"]


def test_variances_in_square_metres_are_within_its_tolerance_but_not_here() -> None:
    """A pick 90 times over its target passes where violations up to 1e-6 count as none."""
    assert naive_pick([9e-7, 1e-9], [1.0, 100.0], 1e-8) == 0  # the trap: 90 times the target
    cheap, dear = option("cheap", 9e-7, 0.0, 1), option("dear", 1e-9, 0.0, 100)
    fixed = option("fixed", 1e-9, 0.0, 1)
    problem = one_stage([[cheap, dear], [fixed], [fixed]], Limits(1e-8, 1.0), 1.0, 0.0)
    assert chosen_sensors(problem) == ["dear", "fixed", "fixed"]


def test_what_lies_within_the_solvers_tolerance_is_cut_off(monkeypatch: pytest.MonkeyPatch) -> None:
    """Over the limit by 1e-10: HiGHS takes it; the exact recheck does not, and cuts it off."""
    cheap, dear = option("cheap", 1.0 + 1e-10, 0.0, 1), option("dear", 0.5, 0.0, 9)
    fixed = option("fixed", 0.5, 0.0, 1)
    limits = Limits(2.0, 1.0)
    problem = one_stage([[cheap, dear], [fixed], [fixed]], limits, 1.0, 0.0)
    assert chosen_sensors(problem) == ["dear", "fixed", "fixed"]
    monkeypatch.setattr(milp, "broken", lambda *_: ())  # without the cure
    assert chosen_sensors(problem) == ["cheap", "fixed", "fixed"]


def test_default_gaps_are_not_used() -> None:
    """A gap of 1e-4 is 100 EUR in a million; ours are 0, one thread, a fixed seed."""
    assert solver.OPTIONS["mip_rel_gap"] == 0.0
    assert solver.OPTIONS["mip_abs_gap"] == 0.0
    assert solver.OPTIONS["threads"] == 1
    cheap, dear = option("cheap", 1.0, 0.0, 10**6), option("dear", 1.0, 0.0, 10**6 + 1)
    fixed = option("fixed", 1.0, 0.0, 1)
    problem = one_stage([[dear, cheap], [fixed], [fixed]], Limits(None, 1.0), 1.0, 0.0)
    assert chosen_sensors(problem) == ["cheap", "fixed", "fixed"]


def test_version_that_gives_wrong_optima_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    assert not is_recent("1.14.0")
    assert is_recent("1.15.0")
    assert is_recent("2.0")
    monkeypatch.setattr(solver.metadata, "version", lambda _: "1.14.0")
    with pytest.raises(NoVerdict, match=r"1\.14\.0 is too old"):
        best_by_milp(two_options(0.1, 0.0, 0.0, 1.0), Deadline())


def test_canary_stops_a_wrong_solver(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(solver, "_SUNG", [])

    def wrong(self: Any, *_: Any, **__: Any) -> None:
        """Claims the optimum that HiGHS 1.14 claims: x = 0, z = 5."""
        x, z = sorted(self.variables(), key=lambda v: v.attributes["integer"])
        x.save_value(np.array(0.0))
        z.save_value(np.array(5.0))
        self._status, self._value = "optimal", 15.0

    monkeypatch.setattr(cp.Problem, "solve", wrong)
    with pytest.raises(NoVerdict, match="canary"):
        best_by_milp(two_options(0.1, 0.0, 0.0, 1.0), Deadline())


def test_missing_solver_is_no_verdict(monkeypatch: pytest.MonkeyPatch) -> None:
    real = builtins.__import__

    def without(name: str, *args: Any, **more: Any) -> Any:
        if name == "highspy":
            raise ImportError("No module named 'highspy'")
        return real(name, *args, **more)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(NoVerdict, match="needs cvxpy and highspy"):
        best_by_milp(two_options(0.1, 0.0, 0.0, 1.0), Deadline())


def test_time_limit_is_no_proof() -> None:
    rng = random.Random(1)
    roles = [
        [option(f"s{i}", 10 ** rng.uniform(-2, 1), 1e-4 * (i % 6), rng.randint(1, 10**6))
         for i in range(400)]
        for _ in range(3)
    ]  # fmt: skip
    problem = one_stage(roles, Limits(1.0, 4.0), 1.0, 1.0)
    try:
        with within_s(0.05):
            found = choose(problem, "milp")
    except NoVerdict:  # not even a design in hand by then
        found = None
    assert found is None or (isinstance(found, Choice) and not found.proof.optimal)
    with within_s(0.0), pytest.raises(NoVerdict, match="time limit"):
        choose(problem, "front")


def test_too_many_timestamp_errors_are_refused_at_once() -> None:
    roles = [[option(f"s{i}", 1.0, 1e-6 * i, i) for i in range(150)] for _ in range(3)]
    problem = one_stage(roles, Limits(3.0, 4.0), 1.0, 1.0)
    with pytest.raises(NoVerdict, match="too many for the MILP"):
        best_by_milp(problem, Deadline())


def test_presolve_that_undoes_itself_wrongly_is_left_out() -> None:
    """HiGHS 1.15.1 ends in an error here ("untransformed violations"), without presolve not."""
    rng = random.Random(200466)
    problem = random_problem(rng, 30)
    errors = [found.error_m for _, found in all_designs(problem)]
    problem = with_random_limits(rng, problem, errors)
    found, expected = best_by_milp(problem, Deadline()), best_by_enumeration(problem)
    assert found is not None
    assert expected is not None
    totals = [evaluate(problem, design).error_m for design in (found, expected)]
    assert totals[0] == totals[1]


def test_values_left_by_an_unfinished_solve_are_not_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    """On a time limit cvxpy may leave values in the variables: only `optimal` counts."""
    monkeypatch.setattr(solver, "_SUNG", [])
    real = cp.Problem.solve
    calls = []

    def unfinished(self: Any, **options: Any) -> Any:
        real(self, **options)
        calls.append(self.status)
        if len(calls) > 1:  # the canary may finish
            self._status = "user_limit"

    monkeypatch.setattr(cp.Problem, "solve", unfinished)
    with pytest.raises(NoVerdict, match="user_limit"):
        best_by_milp(two_options(0.1, 0.0, 0.0, 1.0), Deadline())
    assert calls == ["optimal", "optimal"]


def test_infeasible_is_proven_by_the_milp_too() -> None:
    problem = two_options(1.0, 0.0, 0.0, 0.5)
    assert isinstance(choose(problem, "milp"), Infeasible)


def test_milp_names_the_same_design_as_the_front() -> None:
    for seed in range(8):
        problem = random_problem(random.Random(seed), 200)
        problem = replace(problem, limits=replace(problem.limits, sync=4.0))
        one, other = choose(problem, "milp"), choose(problem, "front")
        assert isinstance(one, Choice) == isinstance(other, Choice)
        if isinstance(one, Choice) and isinstance(other, Choice):
            assert one.design == other.design
