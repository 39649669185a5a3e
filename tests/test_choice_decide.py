"""Choosing: roads that agree, ties, limits met exactly, outcomes as values."""

from __future__ import annotations

import itertools
import math
import random
from dataclasses import replace
from fractions import Fraction

import pytest

from random_problems import random_problem, with_random_limits
from syncline_design.choice import decide
from syncline_design.choice.decide import best, choose
from syncline_design.choice.enumerate import all_designs
from syncline_design.choice.evaluate import broken, evaluate, rank, total_error_m
from syncline_design.choice.option import Resources
from syncline_design.choice.outcome import Choice, Infeasible, NoVerdict, TooLarge
from syncline_design.choice.ranked import iter_best
from syncline_design.choice.table import (
    ClockOption,
    Design,
    Infrastructure,
    Limits,
    Objective,
    Problem,
    with_limits,
)
from test_front import one_stage, option


def limited(seed: int, most: int = 80) -> Problem:
    rng = random.Random(seed)
    problem = random_problem(rng, most)
    errors = [found.error_m for _, found in all_designs(problem)]
    return with_random_limits(rng, problem, errors)


def sensors(problem: Problem, design: Design) -> list[str]:
    return [t.options[i].sensor for t, i in zip(problem.roles, design.options, strict=True)]


@pytest.mark.parametrize("seed", range(60))
def test_every_design_comes_in_the_documented_order(seed: int) -> None:
    problem = limited(seed + 2000)
    expected = sorted(
        (rank(problem, design, found), design)
        for design, found in all_designs(problem)
        if not broken(problem, found)
    )
    found = list(itertools.islice(iter_best(problem), len(expected) + 1))
    assert found == [design for _, design in expected]


@pytest.mark.parametrize("seed", range(30))
def test_methods_give_the_same_design(seed: int) -> None:
    problem = limited(seed + 3000)
    outcomes = [choose(problem, method) for method in ("auto", "front", "enumerate")]
    designs = [o.design if isinstance(o, Choice) else None for o in outcomes]
    assert designs[0] == designs[1] == designs[2]
    assert all(o.proof.optimal and o.proof.rechecked for o in outcomes)


def exact_problem(limit: float) -> Problem:
    """0.1 + 0.2 + 0.3 m: in binary not 0.6, in the exact sum once rounded 0.6."""
    roles = [[option("a", 0.1, 0.0, 1)], [option("b", 0.2, 0.0, 1)], [option("c", 0.3, 0.0, 1)]]
    exact = [
        [replace(o, exact_error_m=Fraction(k + 1, 10)) for o in options]
        for k, options in enumerate(roles)
    ]
    return one_stage(exact, Limits(limit, 1.0), 1.0, 1.0)


def test_limit_met_exactly_passes() -> None:
    assert 0.1 + 0.2 + 0.3 > 0.6  # the trap: a float sum misses the printed limit
    for method in ("auto", "front", "milp", "enumerate"):
        assert isinstance(choose(exact_problem(0.6), method), Choice)


def test_limit_missed_by_one_part_in_1e12_fails() -> None:
    for method in ("auto", "front", "milp", "enumerate"):
        assert isinstance(choose(exact_problem(0.6 * (1.0 - 1e-12)), method), Infeasible)


def test_budget_missed_by_one_part_in_1e12_fails() -> None:
    price = Fraction(10**12 + 1, 3)
    roles = [[option(name, 0.1, 0.0, price)] for name in "abc"]
    for budget, expected in ((3 * price, Choice), (3 * price - Fraction(1, 10), Infeasible)):
        problem = one_stage(roles, Limits(None, 1.0, cost=budget), 1.0, 1.0)
        for method in ("auto", "front", "enumerate"):
            assert isinstance(choose(problem, method), expected)


def test_sync_limit_is_strict() -> None:
    """tau_sys = tau_crit exactly: 2 m/s * 0.75 s against 1.5 m does not stay below."""
    roles = [[option(name, 0.5, 0.375, 1)] for name in "abc"]
    problem = one_stage(roles, Limits(None, 1.0), 1.0, 1.0)
    assert isinstance(choose(problem), Infeasible)
    above = with_limits(problem, replace(problem.limits, sync=math.nextafter(1.0, 2.0)))
    assert isinstance(choose(above), Choice)


def test_nan_never_passes() -> None:
    roles = [[option(name, 0.5, 0.0, 1)] for name in "abc"]
    problem = one_stage(roles, Limits(math.nan, 1.0), 1.0, 1.0)
    design = Design((0, 0, 0), (0,))
    assert "accuracy" in broken(problem, evaluate(problem, design))


@pytest.mark.parametrize(
    ("objective", "expected"),
    [("cost", "cheap"), ("mass", "light"), ("power", "thrifty"), ("error", "fine")],
)
def test_each_objective_has_its_own_best(objective: Objective, expected: str) -> None:
    def one(name: str, error: float, cost: int, mass: int, power: int) -> object:
        resources = Resources(Fraction(cost), Fraction(mass), Fraction(power))
        return replace(option(name, error, 0.0, 0), resources=resources)

    position = [
        one("cheap", 0.9, 1, 9, 9),
        one("light", 0.8, 9, 1, 9),
        one("thrifty", 0.7, 9, 9, 1),
        one("fine", 0.1, 9, 9, 9),
    ]
    fixed = [one("fixed", 0.1, 1, 1, 1)]
    problem = one_stage([position, fixed, fixed], Limits(None, 1.0), 1.0, 1.0)
    problem = replace(problem, objective=objective)
    for method in ("auto", "milp", "enumerate"):
        found = choose(problem, method)
        assert isinstance(found, Choice)
        assert sensors(problem, found.design)[0] == expected


def test_ties_go_by_error_cost_mass_power_then_name() -> None:
    def one(name: str, error: float, mass: int) -> object:
        return replace(
            option(name, error, 0.0, 5),
            resources=Resources(Fraction(5), Fraction(mass), Fraction(0)),
        )

    fixed = [one("fixed", 0.5, 1)]
    for tied, expected in (
        ([one("b", 0.5, 1), one("a", 0.75, 1)], "b"),  # error before name
        ([one("b", 0.5, 1), one("a", 0.5, 2)], "b"),  # mass before name
        ([one("b", 0.5, 1), one("a", 0.5, 1)], "a"),  # name at last
    ):
        problem = one_stage([tied, fixed, fixed], Limits(None, 1.0), 1.0, 1.0)
        found = choose(problem)
        assert isinstance(found, Choice)
        assert sensors(problem, found.design)[0] == expected


def with_boards(cost: int, channels: int) -> Problem:
    """Capture needs a channel of a board; gpio is free but poor."""
    needs = (("board", 1),)
    roles = [
        [
            replace(option(f"{name}_capture", 0.25, 0.0, 10, requires=needs), method="capture"),
            replace(option(f"{name}_gpio", 0.25, 0.125, 10), method="gpio"),
        ]
        for name in "abc"
    ]
    problem = one_stage(roles, Limits(0.75, 8.0), 1.0, 1.0)
    board = Infrastructure("board", channels, Resources(Fraction(cost)))
    return replace(problem, infrastructure=(board,))


@pytest.mark.parametrize(("channels", "boards"), [(8, 1), (3, 1), (2, 2), (1, 3)])
def test_shared_hardware_is_bought_per_full_set_of_channels(channels: int, boards: int) -> None:
    problem = with_boards(100, channels)
    for method in ("auto", "milp", "enumerate"):
        found = choose(problem, method)
        assert isinstance(found, Choice)
        sums = evaluate(problem, found.design)
        assert sums.cost == 30 + 100 * boards
        assert [units.count for units in sums.units] == [boards]


def test_clock_is_bought_only_when_timelines_meet() -> None:
    """A disciplined clock is worth its price only if a UTC stamp meets a host stamp."""
    clocks = (
        ClockOption("free", 0.5, Resources(Fraction(0))),
        ClockOption("good", 0.0, Resources(Fraction(50))),
    )
    utc = replace(option("utc", 0.25, 0.0, 1), timeline="utc")
    host = option("host", 0.25, 0.0, 5)
    other = [option("x", 0.25, 0.0, 1)]
    problem = one_stage([[utc, host], other, other], Limits(1.0, 8.0), 1.0, 1.0)
    vehicles = tuple(replace(v, clocks=clocks) for v in problem.vehicles)
    problem = replace(problem, vehicles=vehicles)
    for method in ("auto", "milp", "enumerate"):
        found = choose(problem, method)
        assert isinstance(found, Choice)
        assert sensors(problem, found.design)[0] == "host"
        assert clocks[found.design.clocks[0]].id == "free"


def test_role_without_options_is_infeasible_at_once() -> None:
    problem = one_stage([[], [option("a", 1.0, 0.0, 1)], []], Limits(None, 1.0), 1.0, 1.0)
    found = choose(problem)
    assert isinstance(found, Infeasible)
    assert (found.proof.method, found.proof.optimal) == ("tables", True)


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_roads_that_differ_in_the_last_figures_agree(
    monkeypatch: pytest.MonkeyPatch, order: tuple[int, int]
) -> None:
    """Two errors either side of where the 12th figure rounds: one verdict, the smaller error."""
    near = [0.5 + 4.99e-12, 0.5 + 5.01e-12]
    roles = [[option(f"a{k}", near[i], 0.0, 1) for k, i in enumerate(order)]]
    roles += [[option("b", 0.25, 0.0, 1)], [option("c", 0.25, 0.0, 1)]]
    problem = one_stage(roles, Limits(None, 1.0), 1.0, 1.0)
    better = order.index(0)
    for place in (0, 1):
        other = Design((place, 0, 0), (0,))
        monkeypatch.setattr(decide, "iter_best", lambda *_, d=other: iter((d,)))
        found = choose(problem)
        assert isinstance(found, Choice)
        assert found.design.options[0] == better


def test_roads_that_disagree_are_no_verdict(monkeypatch: pytest.MonkeyPatch) -> None:
    roles = [[option(f"{n}{k}", 0.5, 0.0, k) for k in range(2)] for n in "abc"]
    problem = one_stage(roles, Limits(None, 1.0), 1.0, 1.0)
    monkeypatch.setattr(decide, "best_by_enumeration", lambda *_: Design((1, 1, 1), (0,)))
    with pytest.raises(NoVerdict, match="disagree on the best design"):
        choose(problem)
    monkeypatch.setattr(decide, "best_by_enumeration", lambda *_: None)
    with pytest.raises(NoVerdict, match="disagree on whether"):
        choose(problem)


def test_design_that_fails_its_recheck_is_no_verdict(monkeypatch: pytest.MonkeyPatch) -> None:
    roles = [[option(n, 0.5, 0.0, 1)] for n in "abc"]
    problem = one_stage(roles, Limits(1.0, 1.0), 1.0, 1.0)
    monkeypatch.setattr(decide, "best_by_front", lambda *_: Design((0, 0, 0), (0,)))
    with pytest.raises(NoVerdict, match="recheck"):
        choose(problem, "front")


def test_auto_takes_the_milp_where_merging_gives_up(monkeypatch: pytest.MonkeyPatch) -> None:
    roles = [[option(f"{n}{k}", 0.5, 0.0, k + 1) for k in range(3)] for n in "abc"]
    problem = one_stage(roles, Limits(2.0, 1.0), 1.0, 1.0)

    def gives_up(*_: object, **__: object) -> None:
        raise TooLarge("too many")

    monkeypatch.setattr(decide, "merged_front", gives_up)
    found = choose(problem)
    assert isinstance(found, Choice)
    assert found.proof.method == "milp"
    assert sensors(problem, found.design) == ["a0", "b0", "c0"]


def test_unknown_method_is_refused() -> None:
    problem = one_stage([[option("a", 1.0, 0.0, 1)]] * 3, Limits(None, 1.0), 1.0, 1.0)
    with pytest.raises(ValueError, match="unknown road 'fastest'"):
        choose(problem, "fastest")  # type: ignore[arg-type]


def test_best_designs_differ_in_more_than_a_primitive() -> None:
    twice = [
        replace(option("gnss", 0.5, 0.0, 1), primitive=primitive) for primitive in ("pps", "tov")
    ]
    others = [option("x", 0.5, 0.0, 1), option("y", 0.5, 0.0, 2)]
    problem = one_stage([twice, others, others], Limits(None, 1.0), 1.0, 1.0)
    found = list(best(problem, 10))
    assert len(found) == 4
    shown = [tuple(sensors(problem, design)) for design in found]
    assert len(set(shown)) == 4
    costs = [evaluate(problem, design).cost for design in found]
    assert costs == sorted(costs)


def test_too_many_combinations_are_not_enumerated() -> None:
    many = [option(f"s{i}", 0.5, 0.0, 1) for i in range(100)]
    problem = one_stage([many, many, many], Limits(None, 1.0), 1.0, 1.0)
    with pytest.raises(NoVerdict, match="too many to enumerate"):
        choose(problem, "enumerate")


@pytest.mark.parametrize("seed", range(40))
def test_total_alone_is_rounded_once_too(seed: int) -> None:
    """One rounded sum against fractions, to the last bit."""
    problem = limited(seed + 5000)
    designs = list(itertools.islice(all_designs(problem), 60))
    expected = [float(found.total_m) for _, found in designs]
    assert [total_error_m(problem, design) for design, _ in designs] == expected


@pytest.mark.parametrize("seed", range(25))
def test_evaluation_against_floats_worked_out_by_hand(seed: int) -> None:
    """Sums once more in plain floats, pair by pair, as one would on paper."""
    problem = limited(seed + 4000)
    rng = random.Random(seed)
    for _ in range(10):
        design = Design(
            tuple(rng.randrange(len(t.options)) for t in problem.roles),
            tuple(rng.randrange(len(v.clocks)) for v in problem.vehicles),
        )
        chosen = [t.options[i] for t, i in zip(problem.roles, design.options, strict=True)]
        worst, weighted = 0.0, 0.0
        for pair in problem.pairs:
            a = chosen[pair.role]
            bound = a.tau_s
            if pair.reference is not None:
                b = chosen[pair.reference]
                bound += b.tau_s
                va, vb = (problem.roles[r].vehicle for r in (pair.role, pair.reference))
                lines = {
                    ("utc",) if o.timeline == "utc" else ("host", v) for o, v in ((a, va), (b, vb))
                }
                if len(lines) == 2:
                    for line in lines:
                        if line[0] == "host":
                            v = line[1]
                            bound += problem.vehicles[v].clocks[design.clocks[v]].offset_bound_s
            worst = max(worst, bound)
            weighted += pair.rate_mps * bound
        sync = weighted if problem.sync_model == "per_sensor" else problem.sync_rate_mps * worst
        total = sum(o.sensor_error_m for o in chosen) + sync + problem.fixed_error_m
        found = evaluate(problem, design)
        assert found.error_m == pytest.approx(total, rel=1e-12)
        assert float(found.tau_sys_s) == pytest.approx(worst, rel=1e-12)
