"""By how much designs with an entry miss a limit, against all designs that hold it."""

from __future__ import annotations

import itertools
import math
import random
from dataclasses import replace
from types import SimpleNamespace

import pytest

from random_problems import random_problem
from syncline_design.choice.evaluate import broken, evaluate
from syncline_design.choice.holding import best_with, parts_with
from syncline_design.choice.missed import nearest_miss
from syncline_design.choice.options import Options
from syncline_design.choice.table import Design, Problem, with_limits

CASE = SimpleNamespace(spec=SimpleNamespace(currency="EUR", requirements=()))


def drawn(seed: int) -> Problem:
    """A random system of whose options some break their own tau_crit."""
    rng = random.Random(seed)
    made = random_problem(rng, 12)
    roles = []
    for table in made.roles:
        own = [
            replace(o, tau_crit_s=o.sensor_error_m / made.sync_rate_mps * rng.choice([0.2, 1, 3]))
            for o in table.options
        ]
        options = Options.of(sorted(own, key=lambda one: one.names))
        roles.append(replace(table, options=options).with_pool(options, made.limits.sync))
    return replace(made, roles=tuple(roles))


def least_ratio(problem: Problem, sensor: str) -> float:
    """Of designs that hold the sensor and keep all else, the least tau / tau_crit of the worst."""
    every, least = with_limits(problem, replace(problem.limits, sync=math.inf)), math.inf
    tables = [range(len(table.options)) for table in every.roles]
    clocks = [range(len(vehicle.clocks)) for vehicle in every.vehicles]
    for chosen in itertools.product(*tables):
        options = [table.options[i] for table, i in zip(every.roles, chosen, strict=True)]
        if sensor not in {option.sensor for option in options}:
            continue
        own = [option.tau_s / option.tau_crit_s for option in options]
        for clock in itertools.product(*clocks):
            found = evaluate(every, Design(chosen, clock))
            if not broken(every, found):
                error, rate = found.tightest
                least = min(least, max(*own, float(rate * found.tau_sys_s / error)))
    return least


def test_a_relaxed_sync_limit_lets_in_only_designs_with_the_entry() -> None:
    problem, compared = drawn(39), 0
    for sensor in sorted({option.sensor for table in problem.roles for option in table.options}):
        if best_with(problem, "sensor", sensor) is not None:
            continue
        parts = [one.problem for one in parts_with(problem, "sensor", sensor)]
        missed = nearest_miss(CASE, parts)  # type: ignore[arg-type]
        if missed.kind == "sync":
            assert missed.value == pytest.approx(least_ratio(problem, sensor), rel=3e-4)
            compared += 1
    assert compared >= 2
