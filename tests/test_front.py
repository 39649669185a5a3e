"""The merged front against enumeration, and the shapes that break such merges."""

from __future__ import annotations

import random
import subprocess
import sys
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from random_problems import random_problem, with_random_limits
from syncline_design.choice import merged_front as front_module
from syncline_design.choice.enumerate import all_designs, best_by_enumeration
from syncline_design.choice.evaluate import broken, error_key, evaluate, rank
from syncline_design.choice.front import front
from syncline_design.choice.merged_front import merged_front
from syncline_design.choice.option import Option, Resources
from syncline_design.choice.outcome import FrontPoint
from syncline_design.choice.pareto import Columns, undominated
from syncline_design.choice.parts import is_feasible
from syncline_design.choice.table import NO_CLOCK, Limits, Pair, Problem, RoleTable, VehicleTable
from tests.plain_front import front_by_enumeration


def option(name: str, error: float, tau: float, cost: float | Fraction, **more: object) -> Option:
    return Option(
        name, "pps", "m", error, tau, float("inf"), "host", Resources(Fraction(cost)), **more
    )  # type: ignore[arg-type]


def one_stage(roles: list[list[Option]], limits: Limits, speed: float, turn: float) -> Problem:
    """Position, attitude, ranging of one vehicle."""
    names = ("position", "attitude", "ranging")
    return Problem(
        roles=tuple(
            RoleTable(0, "s", name, 0, tuple(options))
            for name, options in zip(names, roles, strict=True)
        ),
        pairs=(Pair(0, 2, speed), Pair(1, 2, turn)),
        vehicles=(VehicleTable("s", (0,), (NO_CLOCK,)),),
        infrastructure=(),
        sync_rate_mps=speed + turn,
        fixed_error_m=0.0,
        limits=limits,
        sync_model="syncline",
        objective="cost",
    )


def keys(points: tuple[FrontPoint, ...]) -> list[tuple[Fraction, float]]:
    return [(point.amount, error_key(point.error_m)) for point in points]


def limited(seed: int, most: int = 120) -> Problem:
    rng = random.Random(seed)
    problem = random_problem(rng, most)
    errors = [found.error_m for _, found in all_designs(problem)]
    return with_random_limits(rng, problem, errors)


@pytest.mark.parametrize("seed", range(120))
def test_front_equals_enumeration(seed: int) -> None:
    # Fixed seeds, exact comparison: no statistical error rate.
    problem = limited(seed)
    for resource in ("cost", "mass"):
        merged = front(problem, resource)
        assert keys(merged) == keys(front_by_enumeration(problem, resource))
        for point in merged:
            found = evaluate(problem, point.design)
            assert found.amount(resource) == point.amount
            assert not broken(problem, found, accuracy=False)


@pytest.mark.parametrize("seed", range(1000, 1120))
def test_optimum_equals_enumeration(seed: int) -> None:
    from syncline_design.choice.decide import best_by_front
    from syncline_design.choice.outcome import Deadline

    problem = limited(seed)
    expected = best_by_enumeration(problem)
    assert best_by_front(problem, Deadline()) == expected
    assert is_feasible(problem) is (expected is not None)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.integers(0, 2**32), st.integers(2, 80), st.booleans())
def test_shapes_nobody_thought_of(seed: int, most: int, tight: bool) -> None:
    problem = limited(seed, most)
    if tight:
        problem = replace(problem, limits=replace(problem.limits, sync=0.05))
    assert keys(front(problem)) == keys(front_by_enumeration(problem))


def test_both_merges_are_exercised(monkeypatch: pytest.MonkeyPatch) -> None:
    """A good share of the random problems needs the guarded merge: the tests above cover it."""
    guarded = []
    merge_all = front_module._merge_all

    def spy(*args: object, **more: object) -> object:
        guarded.append(more["guarded"])
        return merge_all(*args, **more)  # type: ignore[arg-type]

    monkeypatch.setattr(front_module, "_merge_all", spy)
    for seed in range(30):
        front(limited(seed))
    assert sum(guarded) > 5
    assert guarded.count(False) - sum(guarded) > 5


def test_better_sensor_that_breaks_sync_is_not_preferred() -> None:
    """tau_sys * rate < E bounds E from below: the cheaper, better attitude makes the pair fail."""
    position = [option("gnss", 2.0, 0.1, 10)]
    attitude = [option("fine", 0.1, 0.0, 5), option("coarse", 2.0, 0.0, 7)]
    ranging = [option("lidar", 0.1, 0.0, 3)]
    problem = one_stage([position, attitude, ranging], Limits(None, 1.0), 5.0, 25.0)
    # 30 m/s * 0.1 s = 3 m against E = 2.2 m (fails) and 4.1 m (holds).
    points = front(problem)
    assert [problem.roles[1].options[p.design.options[1]].sensor for p in points] == ["coarse"]
    assert keys(points) == [(Fraction(20), error_key(4.1 + 3.0))]


def test_plain_dominance_would_miss_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """The test above fails without its cure: the unguarded merge alone finds nothing there."""
    merge_all = front_module._merge_all

    def unguarded(tables: object, accuracy: bool, deadline: object, **more: object) -> object:
        more = {"guarded": False, "ceiling": None}
        return merge_all(front_module._reduced(tables), accuracy, deadline, **more)  # type: ignore[arg-type]

    monkeypatch.setattr(front_module, "_merge_all", unguarded)
    with pytest.raises(AssertionError):
        test_better_sensor_that_breaks_sync_is_not_preferred()


def test_thousand_equal_options_give_the_first_name() -> None:
    many = [option(f"s{i:04d}", 0.5, 1e-3, 7) for i in range(1000)]
    random.Random(3).shuffle(many)
    problem = one_stage([many, list(many), list(many)], Limits(2.0, 4.0), 1.0, 1.0)
    points = merged_front(problem, "cost", accuracy=True)
    names = [problem.roles[r].options[i].sensor for r, i in enumerate(points[0].design.options)]
    assert len(points) == 1
    assert names == ["s0000"] * 3


def test_options_that_cost_nothing() -> None:
    free = [option("a", 0.5, 0.0, 0), option("b", 0.25, 0.0, 0), option("c", 0.125, 0.0, 0)]
    problem = one_stage([free, free, free], Limits(None, 1.0), 1.0, 1.0)
    assert keys(front(problem)) == [(Fraction(0), 0.375)]


def test_one_option_per_role() -> None:
    roles = [[option("only", 0.5, 0.01, 2)] for _ in range(3)]
    points = front(one_stage(roles, Limits(None, 4.0), 1.0, 1.0))
    assert keys(points) == [(Fraction(6), error_key(1.5 + 2.0 * 0.02))]


def test_role_without_options_gives_no_front() -> None:
    roles = [[], [option("a", 1.0, 0.0, 1)], [option("b", 1.0, 0.0, 1)]]
    assert front(one_stage(roles, Limits(None, 1.0), 1.0, 1.0)) == ()


@pytest.mark.parametrize("seed", range(20))
def test_order_of_options_does_not_matter(seed: int) -> None:
    problem = limited(seed)
    shuffled = []
    for table in problem.roles:
        options = list(table.options)
        random.Random(seed).shuffle(options)
        shuffled.append(replace(table, options=tuple(options)))
    other = replace(problem, roles=tuple(shuffled))
    ranks = [
        [rank(p, point.design, evaluate(p, point.design)) for point in front(p)]
        for p in (problem, other)
    ]
    assert ranks[0] == ranks[1]


@pytest.mark.parametrize("factor", [Fraction(1, 10**6), Fraction(10**12), Fraction(1, 3)])
def test_scale_of_costs_does_not_matter(factor: Fraction) -> None:
    """Cents, euros or thirds of one, and amounts beyond 64 bits, lead to the same designs."""
    for seed in range(15):
        problem = replace(limited(seed), infrastructure=())
        roles = tuple(
            replace(
                table,
                options=tuple(
                    replace(
                        o,
                        requires=(),
                        resources=Resources(o.resources.cost and o.resources.cost * factor),
                    )
                    for o in table.options
                ),
            )
            for table in problem.roles
        )
        plain = tuple(
            replace(
                table,
                options=tuple(
                    replace(o, requires=(), resources=Resources(o.resources.cost))
                    for o in table.options
                ),
            )
            for table in problem.roles
        )
        free = tuple(replace(v, clocks=(NO_CLOCK,)) for v in problem.vehicles)
        limits = replace(problem.limits, cost=None, mass=None, power=None)
        one = replace(problem, roles=plain, vehicles=free, limits=limits)
        other = replace(problem, roles=roles, vehicles=free, limits=limits)
        assert [(p.amount * factor, p.design) for p in front(one)] == [
            (p.amount, p.design) for p in front(other)
        ]


def test_amounts_beyond_64_bits() -> None:
    huge = Fraction(10**30 + 1, 7)
    roles = [
        [option("dear", 0.1, 0.0, huge), option("cheap", 0.2, 0.0, huge - Fraction(1, 7))]
        for _ in range(3)
    ]
    points = front(one_stage(roles, Limits(None, 1.0), 1.0, 1.0))
    assert [p.amount for p in points] == [3 * huge - Fraction(k, 7) for k in (3, 2, 1, 0)]


@pytest.mark.parametrize("count", [5, 700, 3500])
def test_filter_equals_the_definition(count: int) -> None:
    """Every way through the filter (staircases, blocks, thinning) against pairwise comparison."""
    rng = np.random.default_rng(count)
    cost = rng.integers(0, 200, count)
    error = rng.integers(0, 40, count) / 8.0
    weak = error + rng.integers(0, 30, count) / 8.0
    flag = rng.integers(0, 3, count)
    for extra in ((), (flag,), (flag, rng.integers(0, 60, count))):
        columns = Columns((cost, error), (weak, *extra))
        kept = set(undominated(columns).tolist())
        table = np.column_stack([cost, error, weak, *extra])
        for row in range(0, count, 1 + count // 500):
            rivals = (table <= table[row]).all(axis=1)
            settled = (cost < cost[row]) | (error < error[row]) | (np.arange(count) < row)
            dominated = bool((rivals & settled).any())
            if row in kept:
                # The filter may keep a row that only loses a tie of names.
                clear = rivals & ((cost < cost[row]) | (error < error[row]))
                assert not clear.any()
            else:
                assert dominated


def test_merging_loads_no_solver() -> None:
    code = (
        "import sys, syncline_design.choice.decide as d; "
        "sys.exit(any(m in sys.modules for m in ('cvxpy', 'highspy', 'scipy', 'matplotlib')))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
