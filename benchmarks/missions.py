"""One payload for several missions: agreement with plain enumeration, and time at full size.

python benchmarks/missions.py agree FIRST COUNT     random families against every design tried
python benchmarks/missions.py time MISSIONS SENSORS METHODS [ROLES]
"""

from __future__ import annotations

import itertools
import math
import random
import sys
import time
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))

from random_families import plain_front, plain_order, random_family
from syncline_design.choice.evaluate import error_key
from syncline_design.choice.family import Family, family_of
from syncline_design.choice.family_best import best_of_family, family_front, iter_family
from syncline_design.choice.options import Option, Resources
from syncline_design.choice.table import NO_CLOCK, Limits, Pair, Problem, RoleTable, VehicleTable


def agree(first: int, count: int) -> int:
    """How many families the product and plain enumeration see differently."""
    wrong, started, last = 0, time.process_time(), time.monotonic()
    for seed in range(first, first + count):
        rng = random.Random(seed)
        family = random_family(rng, 30)
        resource = rng.choice(["cost", "mass", "power"])
        found = [(p.amount, error_key(p.error_m)) for p in family_front(family, resource)]
        ranked = [one.rank[:2] for one in itertools.islice(iter_family(family), 2)]
        if found != plain_front(family, resource) or ranked != plain_order(family)[:2]:
            wrong += 1
            print(f"family {seed} disagrees", flush=True)
        if time.monotonic() - last > 60.0:
            print(f"{seed + 1 - first} families, {wrong} wrong", flush=True)
            last = time.monotonic()
    spent = time.process_time() - started
    print(f"{count} families from {first}: {wrong} disagree, {spent:.0f} s of processor time")
    return wrong


def large_family(missions: int, sensors: int, methods: int, roles: int = 5) -> Family:
    """Two stages (position, then attitude and ranging of each) flown at several distances."""
    rng = random.Random(1)
    names = [(0, "position"), (0, "attitude"), (0, "ranging"), (1, "attitude"), (1, "ranging")]
    stamps = [(f"m{k}", 10.0 ** rng.uniform(-8, -2.5), rng.randint(0, 400)) for k in range(methods)]
    sheets = {slot: [_sheet(rng, i) for i in range(sensors)] for slot in names[:roles]}
    problems = []
    for _ in range(missions):
        distances = (rng.uniform(20.0, 120.0), rng.uniform(10.0, 60.0))
        speeds, turns = (rng.uniform(1.0, 20.0), rng.uniform(0.5, 3.0)), (0.3, 0.2)
        problems.append(_problem(sheets, stamps, distances, speeds, turns))
    limits = [replace(p.limits, accuracy_m=_reachable(p)) for p in problems]
    problems = [replace(p, limits=own) for p, own in zip(problems, limits, strict=True)]
    return family_of([f"mission {m}" for m in range(missions)], problems)


def _sheet(rng: random.Random, i: int) -> tuple[str, float, float, Fraction]:
    """A sensor: error alone [m], error per metre, price that falls with both."""
    fixed, turned = 10.0 ** rng.uniform(-2.3, -0.3), 10.0 ** rng.uniform(-4.0, -2.3)
    price = 150.0 / math.sqrt(fixed) * rng.uniform(0.7, 2.0) + 8.0 / math.sqrt(turned)
    return f"s{i:04d}", fixed, turned, Fraction(round(price * 100 * rng.uniform(0.8, 1.6)), 100)


def _problem(sheets, stamps, distances, speeds, turns) -> Problem:
    tables, place = [], {}
    for slot, sensors in sheets.items():
        stage, role = slot
        options = []
        for name, fixed, turned, price in sensors:
            d = distances[stage]
            error = fixed if role == "position" else turned * d + fixed * (role == "ranging") / 4
            options += [
                Option(name, "pps", method, error, tau, math.inf, "utc",
                       Resources(price + cost, Fraction(1), Fraction(1)))
                for method, tau, cost in stamps
            ]  # fmt: skip
        place[slot] = len(tables)
        tables.append(RoleTable(stage, f"stage{stage}", role, stage, tuple(options)))
    pairs = []
    for stage in sorted({stage for stage, _ in sheets}):
        before = place[0, "position"] if stage == 0 else place[stage - 1, "ranging"]
        reference = place[stage, "ranging"]
        pairs.append(Pair(before, reference, speeds[stage]))
        pairs.append(Pair(place[stage, "attitude"], reference, turns[stage] * distances[stage]))
    vehicles = tuple(
        VehicleTable(f"v{s}", (s,), (NO_CLOCK,)) for s in sorted({s for s, _ in sheets})
    )
    rate = math.fsum(pair.rate_mps for pair in pairs)
    limits = Limits(None, 1.0)
    return Problem(tuple(tables), tuple(pairs), vehicles, (), rate, 0.0, limits, "syncline", "cost")


def _reachable(problem: Problem) -> float:
    """A limit that good sensors keep."""
    return 3.0 * sum(float(table.options.error.min()) for table in problem.roles)


def timed(missions: int, sensors: int, methods: int, roles: int) -> None:
    family = large_family(missions, sensors, methods, roles)
    start = time.process_time()
    found = best_of_family(family)
    chosen = time.process_time()
    points = family_front(family)
    end = time.process_time()
    least = "none" if found is None else f"{float(found.sums.cost or 0):.2f}"
    print(
        f"{missions} missions, {family.combinations:.2g} combinations: cheapest {least} in "
        f"{chosen - start:.2f} s, front of {len(points)} points in {end - chosen:.2f} s"
    )


def main() -> None:
    numbers = [int(text) for text in sys.argv[2:]]
    if sys.argv[1] == "agree":
        sys.exit(1 if agree(*numbers) else 0)
    timed(*(numbers if len(numbers) > 3 else (*numbers, 5)))


if __name__ == "__main__":
    main()
