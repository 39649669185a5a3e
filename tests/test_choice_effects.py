"""Known effects in the choice: charged to the sensor they hang on, judged anew for every what-if.

Expected figures are worked out here: the Syncline of one stage, E + (v + d w) 2 tau, with each
effect's own term, and plain enumeration in fractions for random tables.
"""

from __future__ import annotations

import itertools
import math
import random
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import pytest

from random_problems import random_problem
from syncline_design.choice.effect_tables import problem_of
from syncline_design.choice.front import front
from syncline_design.choice.option import Option
from syncline_design.choice.table import Design, Problem
from syncline_design.spec.case import Case
from syncline_design.spec.load import load_text
from syncline_design.verdict.optimize import Optimization, OptimizeSettings, optimize
from syncline_design.verdict.verify import CheckSettings, check_loaded

SIGMA = {"fine": 0.05, "coarse": 0.20}  # m per axis
PRICE = {"fine": 9000, "coarse": 1000}
SPEC = """\
syncline: 1
name: Understated noise
requirements:
{requirements}
stages:
  - name: uav
    platform: {{v_max: {speed}, omega_max: 10 deg/s, distance: {distance}, baseline: 1 m}}
    position: {{candidates: [fine, coarse]}}
    attitude:
      sensor: {{modality: attitude, sigma_attitude: 0.1 deg, primitives: [pps], cost: 10 EUR}}
      timestamping: {{error: {{distribution: constant, value: 1 ms}}}}
    ranging:
      sensor: {{modality: ranging, sigma_range: 1 cm, sigma_bearing: 0.1 deg, primitives: [pps],
               cost: 10 EUR}}
      timestamping: {{error: {{distribution: constant, value: 1 ms}}}}
timestamping: {{candidates: [arrival_bench]}}
catalogs: [own.yaml]
effects:
{effects}
"""
OWN = """\
sensors:
  fine: {modality: position, sigma_position: 5 cm, primitives: [pps], cost: 9000 EUR}
  coarse: {modality: position, sigma_position: 20 cm, primitives: [pps], cost: 1000 EUR}
timestamping:
  arrival_bench:
    {primitives: [arrival], timeline: host, cost: 0 EUR,
     error: {distribution: constant, value: 1 ms}}
"""
UNDERSTATED = "  - {{effect: noise_understated, sensor: position, parameters: {{factor: {0}}}}}"


def spec(
    folder: Path,
    requirements: list[str],
    effects: list[str],
    speed: str = "2 m/s",
    distance: str = "10 m",
) -> Case:
    (folder / "own.yaml").write_text(OWN)
    text = SPEC.format(
        requirements="\n".join(f"  - {one}" for one in requirements),
        effects="\n".join(effects),
        speed=speed,
        distance=distance,
    )
    return load_text(text, folder / "spec.yaml")


def total_m(sensor: str, factor: float, speed: float = 2.0, distance: float = 10.0) -> float:
    """By hand: position noise times factor, both pairs 2 ms apart."""
    angles = (math.sqrt(3) + math.sqrt(2)) * math.radians(0.1) * distance
    rate = speed + distance * math.radians(10)
    return math.sqrt(3) * SIGMA[sensor] * factor + angles + 0.01 + rate * 2e-3


def found(loaded: Case) -> Optimization:
    return optimize(loaded, OptimizeSettings(pareto=True, count=2)).result


@pytest.mark.parametrize("factor", [1.5, 4.0, 11.0])
def test_front_and_designs_carry_an_effect_of_the_sensor(tmp_path: Path, factor: float) -> None:
    loaded = spec(tmp_path, ["{id: S, kind: sync, limit: 4}"], [UNDERSTATED.format(factor)])
    result = found(loaded)
    assert result.front is not None
    assert [(p.cost, p.error_m) for p in result.front] == [
        (PRICE[name] + 20, pytest.approx(total_m(name, factor), rel=1e-12))
        for name in ("coarse", "fine")
    ]
    verdict = check_loaded(loaded, CheckSettings(monte_carlo=False)).to_json()
    assert verdict["syncline"]["total_m"] == pytest.approx(total_m("coarse", factor), rel=1e-12)
    assert verdict["choice"]["next_best"][0]["error_m"] == pytest.approx(
        total_m("fine", factor), rel=1e-12
    )


def test_the_choice_is_made_with_the_effect(tmp_path: Path) -> None:
    """Without the effect the cheap sensor would do; with it only the dear one keeps the limit."""
    limit = total_m("coarse", 1.0) * 1.01
    assert total_m("fine", 3.0) < limit
    assert limit < total_m("coarse", 3.0)
    requirements = [f"{{id: A, kind: accuracy, limit: {limit!r} m}}"]
    loaded = spec(tmp_path, requirements, [UNDERSTATED.format(3)])
    verdict = check_loaded(loaded, CheckSettings(monte_carlo=False)).to_json()
    assert verdict["verdict"] == "meets"
    assert verdict["design"]["stages"][0]["roles"]["position"]["sensor"] == "fine"


def test_a_printed_accuracy_fix_holds_when_it_is_written(tmp_path: Path) -> None:
    loaded = spec(tmp_path, ["{id: A, kind: accuracy, limit: 10 cm}"], [UNDERSTATED.format(4.0)])
    verdict = check_loaded(loaded, CheckSettings(monte_carlo=False)).to_json()
    assert verdict["verdict"] == "infeasible"
    (fix,) = [f for f in verdict["infeasibility"]["fixes"] if f["kind"] == "accuracy"]
    assert total_m("fine", 4.0) <= fix["to"] < total_m("fine", 4.0) * 1.01
    for limit, word in ((fix["to"], "meets"), (total_m("fine", 4.0) * 0.999, "infeasible")):
        again = spec(
            tmp_path,
            [f"{{id: A, kind: accuracy, limit: {limit!r} m}}"],
            [UNDERSTATED.format(4.0)],
        )
        assert check_loaded(again, CheckSettings(monte_carlo=False)).to_json()["verdict"] == word


def test_more_failing_designs_than_a_hundred_still_end_in_a_verdict(tmp_path: Path) -> None:
    """Every design fails by the understated noise: infeasible, however many there are."""
    own = OWN.replace("timestamping:\n", "")
    methods = "".join(
        f"  m{k}: {{primitives: [arrival], timeline: host, cost: {k} EUR, "
        f"error: {{distribution: constant, value: {k + 1} us}}}}\n"
        for k in range(150)
    )
    loaded = spec(tmp_path, ["{id: A, kind: accuracy, limit: 0.5 m}"], [UNDERSTATED.format(9)])
    (tmp_path / "own.yaml").write_text(
        own[: own.index("  arrival_bench")] + "timestamping:\n" + methods
    )
    names = ", ".join(f"m{k}" for k in range(150))
    loaded = load_text(loaded.text.replace("arrival_bench", names), tmp_path / "spec.yaml")
    verdict = check_loaded(loaded, CheckSettings(monte_carlo=False)).to_json()
    assert verdict["verdict"] == "infeasible"
    assert [m["id"] for m in verdict["infeasibility"]["conflict"]["requirements"]] == ["A"]


def test_an_effect_grows_with_the_distance_in_fixes_and_ledger(tmp_path: Path) -> None:
    """A range scale of 1 % adds 1 % of the distance, at the distance that is asked about."""
    effects = ["  - {effect: range_scale, sensor: ranging, parameters: {scale: 0.01}}"]
    rigid = total_m("coarse", 1.0, distance=0.0)
    slope = (total_m("coarse", 1.0) - rigid) / 10.0 + 0.01
    limit = rigid + slope * 16.0
    loaded = spec(tmp_path, [f"{{id: A, kind: accuracy, limit: {limit!r} m}}"], effects)
    slack = found(loaded).slack
    assert slack is not None
    (row,) = [row for row in slack if row.term == "distance"]
    assert row.fails_at == pytest.approx(16.0, rel=2e-4)


@pytest.mark.parametrize("factors", [(1.0,), (2.5,), (4.0,), (1.7, 2.2)])
def test_understated_noise_grows_with_the_sensor_error_in_the_ledger(
    tmp_path: Path, factors: tuple[float, ...]
) -> None:
    """By hand: a position noise s adds s (1 + sum of (factor - 1)), so room / that."""
    share = 1.0 + sum(factor - 1.0 for factor in factors)
    sigma = math.sqrt(3) * SIGMA["coarse"]
    rest = total_m("coarse", 1.0) - sigma
    limit = rest + 1.4 * sigma * share
    effects = [UNDERSTATED.format(factor) for factor in factors]
    loaded = spec(tmp_path, [f"{{id: A, kind: accuracy, limit: {limit!r} m}}"], effects)
    result = found(loaded)
    assert result.slack is not None
    (row,) = [row for row in result.slack if row.term == "position sensor error"]
    assert row.fails_at == pytest.approx(1.4 * sigma, rel=1e-9)
    assert row.payload_changes_at == pytest.approx(1.4 * sigma, rel=1e-5)
    assert row.limited_by == "accuracy"


def test_a_distance_fix_takes_the_effect_at_the_new_distance(tmp_path: Path) -> None:
    effects = ["  - {effect: range_scale, sensor: ranging, parameters: {scale: 0.05}}"]
    rigid = total_m("fine", 1.0, distance=0.0)
    slope = (total_m("fine", 1.0) - rigid) / 10.0 + 0.05
    limit = rigid + slope * 4.0
    loaded = spec(tmp_path, [f"{{id: A, kind: accuracy, limit: {limit!r} m}}"], effects)
    fixes = check_loaded(loaded, CheckSettings(monte_carlo=False)).to_json()["infeasibility"][
        "fixes"
    ]
    (fix,) = [f for f in fixes if f["text"].startswith("distance")]
    assert 3.98 <= fix["to"] <= 4.0


def with_systematic(rng: random.Random, problem: Problem) -> Problem:
    """The problem with systematic parts on some options."""

    def charged(option: Option) -> Option:
        return replace(option, systematic_m=rng.choice([0.0, 0.25, 0.5, 3.0]))

    roles = tuple(replace(t, options=tuple(map(charged, t.options))) for t in problem.roles)
    return replace(problem, roles=roles)


def plain_front(problem: Problem) -> list[tuple[Fraction, float]]:
    """(cost, error) of designs that keep sync and budgets, by the definitions, in fractions."""
    outcomes = []
    for options in itertools.product(*(range(len(t.options)) for t in problem.roles)):
        for clocks in itertools.product(*(range(len(v.clocks)) for v in problem.vehicles)):
            one = plain_figures(problem, Design(options, clocks))
            if one is not None:
                outcomes.append(one)
    points: list[tuple[Fraction, float]] = []
    for cost, error in sorted(outcomes):
        if not points or float(f"{error:.12g}") < float(f"{points[-1][1]:.12g}"):
            points.append((cost, error))
    return points


def plain_figures(problem: Problem, design: Design) -> tuple[Fraction, float] | None:
    chosen = [t.options[i] for t, i in zip(problem.roles, design.options, strict=True)]
    clocks = [v.clocks[i] for v, i in zip(problem.vehicles, design.clocks, strict=True)]
    taus = []
    for pair in problem.pairs:
        sides = [r for r in (pair.role, pair.reference) if r is not None]
        tau = sum((Fraction(chosen[r].tau_s) for r in sides), Fraction(0))
        lines = {
            "utc" if chosen[r].timeline == "utc" else str(problem.roles[r].vehicle) for r in sides
        }
        lines |= {"utc"} if pair.reference is None else set()
        if len(lines) > 1:
            tau += sum(Fraction(clocks[int(n)].offset_bound_s) for n in lines if n != "utc")
        taus.append(tau)
    noise = sum(Fraction(o.sensor_error_m) for o in chosen)
    rate = Fraction(problem.sync_rate_mps)
    if rate * max(taus) != 0 and not float(rate * max(taus) / noise) < problem.limits.sync:
        return None
    sync = rate * max(taus)
    if problem.sync_model == "per_sensor":
        sync = sum(Fraction(p.rate_mps) * t for p, t in zip(problem.pairs, taus, strict=True))
    error = noise + sync + sum(Fraction(o.systematic_m) for o in chosen)
    cost = sum((o.resources.cost or Fraction(0) for o in chosen), Fraction(0))
    cost += sum((c.resources.cost or Fraction(0) for c in clocks), Fraction(0))
    used: dict[tuple[int, str], int] = {}
    for r, option in enumerate(chosen):
        for name, count in option.requires:
            key = (problem.roles[r].vehicle, name)
            used[key] = used.get(key, 0) + count
    for v, clock in enumerate(clocks):
        for name, count in clock.requires:
            used[v, name] = used.get((v, name), 0) + count
    for (_, name), count in used.items():
        item = next(i for i in problem.infrastructure if i.id == name)
        cost += math.ceil(count / item.channels) * (item.resources.cost or 0)
    return cost, float(error + Fraction(problem.fixed_error_m))


@pytest.mark.parametrize("seed", range(40))
def test_the_front_of_random_tables_with_systematic_parts(seed: int) -> None:
    """A systematic part counts in the total and not for tau_crit, which noise alone decides."""
    rng = random.Random(seed + 7000)
    problem = with_systematic(rng, random_problem(rng, 120))
    assert [(p.amount, p.error_m) for p in front(problem)] == plain_front(problem)


def test_tables_hold_what_verification_finds_for_every_design(tmp_path: Path) -> None:
    effects = [
        UNDERSTATED.format(2.5),
        "  - {effect: latency, sensor: position, parameters: {latency_s: 3 ms}}",
        "  - {effect: range_bias, sensor: ranging, parameters: {bias_m: 0.1}}",
    ]
    loaded = spec(tmp_path, ["{id: S, kind: sync, limit: 40}"], effects)
    table = problem_of(loaded).roles[0]
    assert {o.sensor: o.systematic_m for o in table.options} == {
        name: pytest.approx(1.5 * math.sqrt(3) * sigma, rel=1e-14) for name, sigma in SIGMA.items()
    }
    assert all(o.tau_s == pytest.approx(4e-3, rel=1e-14) for o in table.options)
