"""Designs that agree in amount and error: the documented order decides, whatever is limited."""

from __future__ import annotations

import itertools
import random
from collections.abc import Iterator
from fractions import Fraction
from typing import Any

import pytest

from syncline_design.choice.front import front
from syncline_design.choice.table import (
    NO_CLOCK,
    RESOURCES,
    Limits,
    Option,
    Pair,
    Problem,
    Resources,
    RoleTable,
    VehicleTable,
)

ROLES = ("position", "attitude", "ranging")
SPEED, TURN = 2, 3  # m/s
Plain = dict[str, Any]


def coarse_options(rng: random.Random, count: int, steps: list[Fraction]) -> list[Plain]:
    """Figures on a coarse grid, so that many designs agree in them."""
    return [
        {
            "name": f"s{i}",
            "error": rng.choice(steps),
            "tau": Fraction(rng.choice([0, 1, 1, 2]), 64),
            **{name: Fraction(rng.randint(0, 3)) for name in RESOURCES},
        }
        for i in range(count)
    ]


def as_problem(tables: list[list[Plain]], limits: dict[str, Fraction | None]) -> Problem:
    roles = []
    for role, table in zip(ROLES, tables, strict=True):
        options = tuple(
            Option(
                o["name"], "pps", "m", float(o["error"]), float(o["tau"]), float("inf"), "host",
                Resources(*(o[name] for name in RESOURCES)),
                exact_error_m=o["error"], exact_tau_s=o["tau"],
            )
            for o in table
        )  # fmt: skip
        roles.append(RoleTable(0, "s", role, 0, options))
    return Problem(
        roles=tuple(roles),
        pairs=(Pair(0, 2, SPEED), Pair(1, 2, TURN)),
        vehicles=(VehicleTable("s", (0,), (NO_CLOCK,)),),
        infrastructure=(),
        sync_rate_mps=SPEED + TURN,
        fixed_error_m=0.0,
        limits=Limits(None, float("inf"), limits["cost"], limits["mass"], limits["power"]),
        sync_model="syncline",
        objective="cost",
    )


def plain_designs(tables: list[list[Plain]]) -> Iterator[tuple[Plain, tuple[str, ...]]]:
    """Every design with its sums and its total error, written out."""
    for position, attitude, ranging in itertools.product(*tables):
        chosen = (position, attitude, ranging)
        found = {name: sum(o[name] for o in chosen) for name in RESOURCES}
        tau = max(position["tau"], attitude["tau"]) + ranging["tau"]
        found["error"] = float(sum(o["error"] for o in chosen) + (SPEED + TURN) * tau)
        yield found, tuple(o["name"] for o in chosen)


def plain_front(
    tables: list[list[Plain]], limits: dict[str, Fraction | None], resource: str
) -> list[tuple[Fraction, float, tuple[str, ...]]]:
    """Sorted by amount, error, cost, mass, power, names; kept where the error falls."""
    within = [
        (found[resource], found["error"], found["cost"], found["mass"], found["power"], names)
        for found, names in plain_designs(tables)
        if all(limit is None or found[name] <= limit for name, limit in limits.items())
    ]
    out: list[tuple[Fraction, float, tuple[str, ...]]] = []
    for amount, error, *_, names in sorted(within):
        if not out or error < out[-1][1]:
            out.append((amount, error, names))
    return out


@pytest.mark.parametrize("limited", [("power",), ("mass",), ("mass", "power"), ("cost", "power")])
@pytest.mark.parametrize("resource", RESOURCES)
def test_ties_follow_the_documented_order(limited: tuple[str, ...], resource: Any) -> None:
    """120 draws each; fixed seeds and exact figures, so no error rate."""
    rng = random.Random(7)
    steps = [Fraction(n, 16) for n in (1, 2, 2, 3)]
    for _ in range(120):
        tables = [coarse_options(rng, rng.randint(2, 5), steps) for _ in ROLES]
        limits = {name: Fraction(rng.randint(3, 7)) if name in limited else None
                  for name in RESOURCES}  # fmt: skip
        problem = as_problem(tables, limits)
        found = [
            (point.amount, point.error_m,
             tuple(t.options[i].sensor for t, i in
                   zip(problem.roles, point.design.options, strict=True)))
            for point in front(problem, resource)
        ]  # fmt: skip
        assert found == plain_front(tables, limits, resource)
