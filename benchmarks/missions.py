"""One payload for several missions: agreement with plain enumeration, and time at full size.

python benchmarks/missions.py agree FIRST COUNT     random families against every design tried
python benchmarks/missions.py specs FIRST COUNT     random specs, each mission tried by itself
python benchmarks/missions.py hinges FIRST COUNT    slack ledger and what to measure next, likewise
python benchmarks/missions.py time MISSIONS SENSORS ROAD_NAMES [ROLES]
"""

from __future__ import annotations

import itertools
import math
import random
import sys
import tempfile
import time
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import yaml

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))

from checked import check_file
from family_specs import Tried, drawn, is_tied
from plain_enumeration import Enumeration, number, read_catalog
from random_families import all_tried, plain_front, plain_order, random_family
from syncline_design.choice.evaluate import error_key
from syncline_design.choice.family import Family, family_of
from syncline_design.choice.family_best import best_of_family, family_front, iter_family
from syncline_design.choice.family_roads import choose_by_road, front_by_road
from syncline_design.choice.option import Option, Resources
from syncline_design.choice.outcome import TooLarge
from syncline_design.choice.table import NO_CLOCK, Limits, Pair, Problem, RoleTable, VehicleTable
from syncline_design.verdict.verify import CheckSettings
from test_missions import written_out
from test_missions_slack import Family as SaidAndTried
from test_missions_slack import compare_measurements, compare_slack


def agree(first: int, count: int) -> int:
    """How many families the product and plain enumeration see differently."""
    wrong, started, last = 0, time.process_time(), time.monotonic()
    for seed in range(first, first + count):
        rng = random.Random(seed)
        family = random_family(rng, 30)
        resource = rng.choice(["cost", "mass", "power"])
        found = [(p.amount, error_key(p.error_m)) for p in front_by_road(family, resource)]
        ranked, tried = _first_two(family), list(all_tried(family))
        wanted = plain_order(family, tried)[: len(ranked) or 1]
        if found != plain_front(family, resource, tried) or ranked != wanted:
            wrong += 1
            print(f"family {seed} disagrees", flush=True)
        if time.monotonic() - last > 60.0:
            print(f"{seed + 1 - first} families, {wrong} wrong", flush=True)
            last = time.monotonic()
    spent = time.process_time() - started
    print(f"{count} families from {first}: {wrong} disagree, {spent:.0f} s of processor time")
    return wrong


def _first_two(family: Family) -> list[tuple[Any, float]]:
    """The first two designs, the first alone where the search gives up."""
    try:
        return [one.rank[:2] for one in itertools.islice(iter_family(family), 2)]
    except TooLarge:
        best = choose_by_road(family).found
        return [] if best is None else [best.rank[:2]]


def specs(first: int, count: int) -> int:
    """How many specs `check` and plain enumeration of every mission by itself see differently."""
    wrong = met = 0
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(first, first + count):
            spec = _random_spec(random.Random(seed))
            path = Path(folder) / "spec.yaml"
            path.write_text(yaml.safe_dump(spec, sort_keys=False), "utf-8")
            found = check_file(path, CheckSettings(monte_carlo=False))
            cost = None if found.design is None else found.design.cost
            cheapest = _cheapest(spec)
            met += cheapest is not None
            same = cost is None if cheapest is None else cost == round(cheapest, 2)
            if not same or (found.verdict == "meets") != (cheapest is not None):
                wrong += 1
                print(f"spec {seed} disagrees: {found.verdict} {cost}, enumeration {cheapest}")
    print(f"{count} specs from {first}, {met} with a payload: {wrong} disagree")
    return wrong


def hinges(first: int, count: int) -> int:
    """How many small families' slack and figures to measure trying every payload sees otherwise."""
    wrong = met = compared = 0
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(first, first + count):
            if is_tied(Tried(*drawn(seed))):
                continue  # no payload, or two that nothing tells apart
            met += 1
            try:
                one = SaidAndTried(Path(folder), seed)
                compared += compare_slack(one) + compare_measurements(one)
            except AssertionError as error:
                wrong += 1
                print(f"family {seed} disagrees: {error}")
    print(f"{met} families from {first}, {compared} figures: {wrong} disagree")
    return wrong


def _random_spec(rng: random.Random) -> dict[str, Any]:
    """A vehicle with candidates of the catalogs, and missions of other distances and speeds."""
    sensors = read_catalog(families=True)["sensors"]

    def some(role: str, count: int) -> list[str]:
        fits = [n for n, one in sensors.items() if one["modality"] == role and "cost" in one]
        kinds = ("lidar", "radar", "camera") if role == "ranging" else ()
        fits = [n for n in fits if not kinds or sensors[n]["type"] in kinds]
        fits = [n for n in fits if str(sensors[n]["cost"]).endswith(" EUR")]
        return rng.sample(sorted(fits), count)

    stage: dict[str, Any] = {"name": "uav", "platform": "uav_fixed_wing"}
    for role in ("position", "attitude", "ranging"):
        stage[role] = {"candidates": some(role, rng.randint(2, 4))}
    if rng.random() < 0.4:
        stage["clock"] = {"candidates": rng.sample(["pps_gpio", "ntp_chrony", "ptp_host"], 2)}
    stage = {key: value for key, value in stage.items() if key != "clock" or _has_clocks(value)}
    missions = []
    for m in range(rng.randint(2, 4)):
        figures = {"distance": f"{rng.randint(10, 150)} m"}
        if rng.random() < 0.5:
            figures["v_max"] = f"{rng.randint(3, 25)} m/s"
        limits = {"ACC": f"{rng.choice([0.15, 0.3, 0.6, 1.5, 3.0])} m"}
        missions.append({"name": f"m{m}", "stages": {"uav": figures}, "requirements": limits})
    methods = rng.sample(["hardware", "gpio", "ptp", "ntp", "arrival"], 3)
    return {
        "syncline": 1, "name": "random",
        "requirements": [{"id": "ACC", "kind": "accuracy", "limit": "1 m"}],
        "stages": [stage], "timestamping": {"candidates": methods}, "missions": missions,
    }  # fmt: skip


def _has_clocks(choice: dict[str, Any]) -> bool:
    return set(choice["candidates"]) <= set(read_catalog(families=True)["clocks"])


def _cheapest(spec: dict[str, Any]) -> float | None:
    """The cheapest payload that meets every mission, each mission tried out by itself."""
    kept: list[dict[Any, float]] = []
    for own in written_out(spec).values():
        limit = number(own["requirements"][0]["limit"])
        kept.append({
            (*((o.sensor, o.primitive, o.method) for o in one.options), one.clocks): one.cost
            for one in Enumeration(own)
            if one.total_m <= limit and one.sync < 1.0
        })  # fmt: skip
    shared = set.intersection(*map(set, kept))
    return min((kept[0][key] for key in shared), default=None)


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
    studies = {"agree": agree, "specs": specs, "hinges": hinges}
    if sys.argv[1] in studies:
        sys.exit(1 if studies[sys.argv[1]](*numbers) else 0)
    timed(*(numbers if len(numbers) > 3 else (*numbers, 5)))


if __name__ == "__main__":
    main()
