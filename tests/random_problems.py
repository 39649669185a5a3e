"""Random design problems, small enough to enumerate, with every coupling the choice knows."""

from __future__ import annotations

import random
from fractions import Fraction

from syncline_design.choice.option import Option, Resources
from syncline_design.choice.table import (
    NO_CLOCK,
    ClockOption,
    Infrastructure,
    Limits,
    Pair,
    Problem,
    RoleTable,
    VehicleTable,
)

BOARD, SWITCH = "board", "switch"


def random_problem(rng: random.Random, most: int = 400) -> Problem:
    """One problem with at most `most` combinations before clocks are counted."""
    stages = rng.choice([1, 1, 1, 2, 2, 3])
    alone = stages == 1 and rng.random() < 0.1
    vehicles = _vehicles_of(rng, stages)
    names = _role_names(stages, alone)
    counts = _counts(rng, len(names), most)
    style = rng.choice(["binary", "decimal", "real", "wild"])
    methods = _methods(rng, style)
    speed, turn = rng.choice([0.0, 0.5, 2.0, 20.0]), rng.choice([0.0, 1.0, 8.0, 100.0])
    roles = tuple(
        _role(rng, stage, role, vehicles[stage], count, methods, style)
        for (stage, role), count in zip(names, counts, strict=True)
    )
    pairs = _pairs(names, speed, turn)
    rate = sum(pair.rate_mps for pair in pairs)
    tables = tuple(
        VehicleTable(
            f"v{v}", tuple(s for s in range(stages) if vehicles[s] == v), _clocks(rng, style)
        )
        for v in range(max(vehicles) + 1)
    )
    return Problem(
        roles=roles,
        pairs=pairs,
        vehicles=tables,
        infrastructure=_infrastructure(rng),
        sync_rate_mps=rate,
        fixed_error_m=rng.choice([0.0, 0.0, 0.25]),
        limits=Limits(None, rng.choice([0.3, 1.0, 1.0, 4.0])),
        sync_model=rng.choice(["syncline", "per_sensor"]),
        objective=rng.choice(["cost", "cost", "mass", "power", "error"]),
    )


def with_random_limits(rng: random.Random, problem: Problem, errors: list[float]) -> Problem:
    """The problem with limits near figures that designs do reach (equality included)."""
    from dataclasses import replace

    accuracy = rng.choice(errors) if errors and rng.random() < 0.8 else None
    if accuracy is not None:
        accuracy *= rng.choice([1.0, 1.0, 1.0 - 1e-12, 1.0 + 1e-12, 1.3])
    budgets = {
        name: Fraction(rng.randint(0, 40 * len(problem.roles)), rng.choice([1, 2]))
        for name in ("cost", "mass", "power")
        if rng.random() < 0.3
    }
    limits = replace(problem.limits, accuracy_m=accuracy, **budgets)
    return replace(problem, limits=limits)


def _vehicles_of(rng: random.Random, stages: int) -> list[int]:
    vehicles = [0]
    for _ in range(stages - 1):
        vehicles.append(rng.randint(0, max(vehicles) + 1))
    return vehicles


def _role_names(stages: int, alone: bool) -> list[tuple[int, str]]:
    if alone:
        return [(0, "position"), (0, "attitude")]
    names = [(0, "position")]
    for stage in range(stages):
        names += [(stage, "attitude"), (stage, "ranging")]
    return names


def _counts(rng: random.Random, roles: int, most: int) -> list[int]:
    counts = [1] * roles
    for _ in range(30):
        r = rng.randrange(roles)
        product = 1
        for i, count in enumerate(counts):
            product *= count + (i == r)
        if product <= most:
            counts[r] += 1
    return counts


def _methods(rng: random.Random, style: str) -> list[tuple[str, float, str, tuple, int]]:
    scale = 1e-10 if style == "wild" else 0.03125
    out = []
    for m in range(rng.randint(1, 5)):
        if style in ("binary", "decimal"):
            tau = scale * rng.randint(0, 8)
        else:
            tau = scale * 10 ** rng.uniform(-3, 1 if style == "real" else 8)
        timeline = rng.choice(["host", "host", "utc"])
        needs = rng.choice([(), (), ((BOARD, 1),), ((BOARD, 2),), ((BOARD, 1), (SWITCH, 1))])
        out.append((f"m{m}", tau, timeline, needs, rng.randint(0, 3)))
    return out


def _role(
    rng: random.Random,
    stage: int,
    role: str,
    vehicle: int,
    count: int,
    methods: list[tuple[str, float, str, tuple, int]],
    style: str,
) -> RoleTable:
    options = []
    for i in range(count):
        name, tau, timeline, needs, price = rng.choice(methods)
        resources = Resources(*(Fraction(n + price) for n in _amounts(rng, style)))
        options.append(
            Option(
                f"s{rng.randint(0, 9)}_{i}", "pps", name, _error(rng, style), tau, float("inf"),
                timeline, resources, needs,
            )
        )  # fmt: skip
    return RoleTable(stage, f"stage{stage}", role, vehicle, tuple(options))


def _error(rng: random.Random, style: str) -> float:
    if style == "binary":
        return rng.randint(1, 12) / 16
    if style == "decimal":
        return rng.randint(1, 12) / 10
    return 10 ** rng.uniform(-2, 1) if style == "real" else 10 ** rng.uniform(-9, 1)


def _amounts(rng: random.Random, style: str) -> list[Fraction | int]:
    if style == "wild":
        return [Fraction(rng.randint(0, 10**8), 100) for _ in range(3)]
    return [rng.choice([0, rng.randint(0, 20)]) for _ in range(3)]


def _pairs(names: list[tuple[int, str]], speed: float, turn: float) -> tuple[Pair, ...]:
    place = {name: r for r, name in enumerate(names)}
    if (0, "ranging") not in place:
        return (Pair(0, None, speed),)
    pairs = []
    for stage in range(max(s for s, _ in names) + 1):
        reference = place[stage, "ranging"]
        before = place[0, "position"] if stage == 0 else place[stage - 1, "ranging"]
        pairs.append(Pair(before, reference, speed))
        pairs.append(Pair(place[stage, "attitude"], reference, turn))
    return tuple(pairs)


def _clocks(rng: random.Random, style: str) -> tuple[ClockOption, ...]:
    if rng.random() < 0.4:
        return (NO_CLOCK,)
    scale = 1e-9 if style == "wild" else 0.03125
    return tuple(
        ClockOption(
            f"c{i}",
            scale * rng.randint(0, 4),
            Resources(*(Fraction(rng.randint(0, 6)) for _ in range(3))),
            rng.choice([(), ((BOARD, 1),)]),
        )
        for i in range(rng.randint(1, 3))
    )


def _infrastructure(rng: random.Random) -> tuple[Infrastructure, ...]:
    return tuple(
        Infrastructure(
            name, rng.choice([1, 2, 8]), Resources(*(Fraction(rng.randint(0, 9)) for _ in range(3)))
        )
        for name in (BOARD, SWITCH)
    )
