"""Explanations of infeasible specs, each sentence tried on the spec as it would be written.

Random small specs with several requirements of a kind, over sensors and methods made here; a plain
enumeration of the Syncline's formulas says which designs meet a set of limits.
"""

from __future__ import annotations

import itertools
import math
import random
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
import yaml

from syncline_design.spec.load import load_text
from syncline_design.verdict.optimize import OptimizeSettings, optimize
from syncline_design.verdict.verify import CheckSettings, check_loaded

SPEED, TURN_DEG, DISTANCE = 4.0, 6.0, 30.0
UNIT = {"accuracy": "m", "sync": "", "cost": "EUR", "mass": "kg"}
FACTOR = {"m": 1.0, "cm": 0.01, "mm": 0.001, "EUR": 1.0, "kg": 1.0, "g": 0.001, "": 1.0}


@dataclass(frozen=True)
class World:
    """Sensors as (error figure, cost, mass) per role, methods as (tau, cost)."""

    sensors: dict[str, list[tuple[float, int, float]]]
    methods: list[tuple[float, int]]


@dataclass(frozen=True)
class Figures:
    accuracy: float
    sync: float
    cost: float
    mass: float


def random_world(rng: random.Random) -> World:
    def role(scale: float) -> list[tuple[float, int, float]]:
        return [
            (
                round(scale * 10 ** rng.uniform(-1, 0), 6),
                rng.randint(10, 900),
                rng.randint(1, 60) / 20,
            )
            for _ in range(rng.randint(1, 3))
        ]

    sensors = {"position": role(0.3), "attitude": role(1.0), "ranging": role(0.2)}
    taus = [round(0.02 * 10 ** rng.uniform(-2.5, 0), 6) for _ in range(rng.randint(1, 3))]
    return World(sensors, [(tau, rng.randint(0, 300)) for tau in taus])


def designs(world: World, distance: float = DISTANCE) -> list[Figures]:
    """Every design: E + rate 2 tau..., largest tau / tau_crit, sums."""
    rate = SPEED + distance * math.radians(TURN_DEG)
    angle = math.radians(1.0) * distance
    out = []
    roles = [itertools.product(world.sensors[r], world.methods) for r in world.sensors]
    for (p, pm), (a, am), (r, rm) in itertools.product(*roles):
        errors = (
            math.sqrt(3) * p[0],
            math.sqrt(3) * a[0] * angle,
            r[0] + math.sqrt(2) * 0.1 * angle,
        )
        tau = max(pm[0], am[0]) + rm[0]
        ratios = [rate * tau / sum(errors), SPEED * pm[0] / errors[0]]
        ratios += [rate * am[0] / errors[1], rate * rm[0] / errors[2]]
        cost = sum(one[1] for one in (p, a, r, pm, am, rm))
        mass = sum(one[2] for one in (p, a, r))
        out.append(Figures(sum(errors) + rate * tau, max(ratios), cost, mass))
    return out


Requirement = tuple[str, str, str]  # id, kind, limit as written


def value_of(limit: str) -> float:
    number, _, unit = limit.partition(" ")
    return float(number) * FACTOR[unit]


def feasible(found: list[Figures], requirements: list[Requirement]) -> bool:
    wanted = [(kind, value_of(limit)) for _, kind, limit in requirements]
    if "sync" not in {kind for kind, _ in wanted}:
        wanted.append(("sync", 1.0))
    return any(
        all(
            getattr(one, k) < limit if k == "sync" else getattr(one, k) <= limit * (1 + 1e-12)
            for k, limit in wanted
        )
        for one in found
    )


def text_of(world: World, requirements: list[Requirement], distance: str) -> tuple[str, str]:
    figure = {
        "position": lambda f: {"sigma_position": f"{f!r} m"},
        "attitude": lambda f: {"sigma_attitude": f"{f!r} deg"},
        "ranging": lambda f: {"sigma_range": f"{f!r} m", "sigma_bearing": "0.1 deg"},
    }
    sensors = {
        f"{role}{i}": {
            "modality": role,
            "primitives": [],
            "cost": f"{cost} EUR",
            "mass": f"{mass!r} kg",
            **figure[role](size),
        }
        for role, ones in world.sensors.items()
        for i, (size, cost, mass) in enumerate(ones)
    }
    methods = {
        f"m{i}": {
            "primitives": ["arrival"],
            "timeline": "host",
            "cost": f"{cost} EUR",
            "mass": "0 kg",
            "error": {"distribution": "constant", "value": f"{tau!r} s"},
        }
        for i, (tau, cost) in enumerate(world.methods)
    }
    stage: dict[str, Any] = {
        "name": "uav",
        "platform": {
            "v_max": f"{SPEED} m/s",
            "omega_max": f"{TURN_DEG} deg/s",
            "distance": distance,
            "baseline": "1 m",
        },
    }
    for role, ones in world.sensors.items():
        stage[role] = {"candidates": [f"{role}{i}" for i in range(len(ones))]}
    data = {
        "syncline": 1,
        "name": "conflict",
        "catalogs": ["own.yaml"],
        "requirements": [
            {"id": n, "kind": k, "limit": float(v) if k == "sync" else v}
            for n, k, v in requirements
        ],
        "stages": [stage],
        "timestamping": {"candidates": list(methods)},
    }
    own = {"sensors": sensors, "timestamping": methods}
    return yaml.safe_dump(data, sort_keys=False), yaml.safe_dump(own)


def check(
    folder: Path, world: World, requirements: list[Requirement], distance: str = f"{DISTANCE} m"
) -> dict[str, Any]:
    text, own = text_of(world, requirements, distance)
    (folder / "own.yaml").write_text(own)
    return check_loaded(
        load_text(text, folder / "spec.yaml"), CheckSettings(monte_carlo=False)
    ).to_json()


def random_requirements(rng: random.Random, found: list[Figures]) -> list[Requirement]:
    """Two to five requirements, kinds repeated, limits around what designs reach."""
    out: list[Requirement] = []
    for n in range(rng.randint(2, 5)):
        kind = rng.choice(["accuracy", "accuracy", "cost", "mass", "sync"])
        near = getattr(rng.choice(found), kind) * rng.uniform(0.2, 1.0)
        if kind == "accuracy":
            unit = rng.choice(["m", "cm", "mm"])
            limit = f"{near / FACTOR[unit]:.4g} {unit}"
        elif kind == "mass":
            unit = rng.choice(["kg", "g"])
            limit = f"{near / FACTOR[unit]:.4g} {unit}"
        else:
            limit = f"{max(1, round(near))} EUR" if kind == "cost" else f"{near:.3g}"
        out.append((f"R{n}-{kind}", kind, plain(limit)))
    return out


def plain(limit: str) -> str:
    """Without exponents, which only a machine would write."""
    number, _, unit = limit.partition(" ")
    return f"{float(number):.10f}".rstrip("0").rstrip(".") + (f" {unit}" if unit else "")


def moved(requirements: list[Requirement], fixes: list[dict[str, Any]]) -> list[Requirement]:
    """The requirements with each fix's limit as its text says."""
    out = list(requirements)
    for fix in fixes:
        after = str(fix["text"]).rsplit(" to ", 1)[1]
        if fix["kind"] == "cost":
            after = after.replace(" ", "").replace("EUR", " EUR")
        if fix["requirement"] is None:
            out.append(("implied", "sync", after.split(":")[0]))
            continue
        out = [(n, k, after if n == fix["requirement"] else v) for n, k, v in out]
    return out


def tightened(requirements: list[Requirement], name: str | None) -> list[Requirement]:
    """One limit 2 % tighter (money: by 2 %, at least one unit)."""
    out = []
    for n, k, v in requirements:
        if n != (name or "implied"):
            out.append((n, k, v))
            continue
        number, _, unit = v.partition(" ")
        less = float(number) * 0.98 - (1.0 if k == "cost" else 0.0)
        out.append((n, k, plain(f"{less!r} {unit}".strip())))
    return out


def infeasible_cases(count: int, start: int) -> list[tuple[int, World, list[Requirement]]]:
    out = []
    for seed in itertools.count(start):
        rng = random.Random(seed)
        world = random_world(rng)
        requirements = random_requirements(rng, designs(world))
        if not feasible(designs(world), requirements):
            out.append((seed, world, requirements))
        if len(out) == count:
            return out
    return out


CASES = infeasible_cases(25, 0)


@pytest.mark.parametrize("case", CASES, ids=lambda c: str(c[0]))
def test_every_printed_statement_is_true(
    case: tuple[int, World, list[Requirement]], tmp_path: Path
) -> None:
    _, world, requirements = case
    found = designs(world)
    verdict = check(tmp_path, world, requirements)
    assert verdict["verdict"] == "infeasible"
    why = verdict["infeasibility"]
    conflict = [m["id"] for m in why["conflict"]["requirements"]]
    lines = "\n".join(why["text"])
    if "without any one of them a design exists" in lines:
        for name in conflict:
            rest = [one for one in requirements if one[0] != name]
            if name is None:
                rest = [*requirements, ("S", "sync", "1000000000")]
            assert feasible(found, rest), (name, lines)
    offered = [[f] for f in why["fixes"] if f["kind"] not in ("platform", "timestamping")]
    for fixes in [*offered, *why["joint_fixes"]]:
        after = moved(requirements, fixes)
        assert feasible(found, after), (fixes, requirements)
        for fix in fixes:
            assert not feasible(found, tightened(after, fix["requirement"])), (fix, after)
    for fixes in [*offered[:1], *why["joint_fixes"][:1]]:
        assert check(tmp_path, world, moved(requirements, fixes))["verdict"] == "meets"
    # Something is always offered: all limits together can be moved to what some design reaches.
    assert why["fixes"] or why["joint_fixes"]


@pytest.mark.parametrize("case", CASES, ids=lambda c: str(c[0]))
def test_what_one_requirement_alone_can_do_is_offered(
    case: tuple[int, World, list[Requirement]], tmp_path: Path
) -> None:
    """A single limit whose lifting makes a design exist has a fix, and no other one has."""
    _, world, requirements = case
    found = designs(world)
    why = check(tmp_path, world, requirements)["infeasibility"]
    offered = {f["requirement"] for f in why["fixes"] if f["requirement"] is not None}
    huge = {"accuracy": "1000000 m", "sync": "1000000000", "cost": "9999999 EUR", "mass": "9999 kg"}
    helpful = set()
    for name, kind, _ in requirements:
        lifted = [(n, k, huge[kind] if n == name else v) for n, k, v in requirements]
        helpful |= {name} if feasible(found, lifted) else set()
    assert offered == helpful


ONE = (0.1, 100, 1.0)
WORSE = (0.3, 500, 2.0)  # never taken; it keeps the role open


def world_of_one(tau: float) -> World:
    return World({"position": [ONE, WORSE], "attitude": [ONE], "ranging": [ONE]}, [(tau, 10)])


def test_two_requirements_of_a_kind_move_together(tmp_path: Path) -> None:
    """Both accuracy limits are in the way: neither alone is offered, both are, each in its unit."""
    world = world_of_one(0.0001)
    requirements = [("A", "accuracy", "5 cm"), ("B", "accuracy", "0.04 m")]
    why = check(tmp_path, world, requirements)["infeasibility"]
    assert not [f for f in why["fixes"] if f["kind"] == "accuracy"]
    (together,) = why["joint_fixes"]
    assert {f["requirement"]: f["text"].split()[-1] for f in together} == {"A": "cm", "B": "m"}
    assert feasible(designs(world)[:1], moved(requirements, together))
    assert "without any one of them" not in "\n".join(why["text"])


def test_a_conflict_that_contains_sync_is_resolved_by_two_limits(tmp_path: Path) -> None:
    """The only payload is too dear, and its stamps too poor for the limit."""
    world = world_of_one(0.01)
    requirements = [("C", "cost", "200 EUR"), ("S", "sync", f"{designs(world)[0].sync / 3:.3g}")]
    why = check(tmp_path, world, requirements)["infeasibility"]
    together = why["joint_fixes"][0]
    assert {f["requirement"] for f in together} == {"C", "S"}
    assert {f["to"] for f in together if f["kind"] == "cost"} == {330.0}
    assert check(tmp_path, world, moved(requirements, together))["verdict"] == "meets"


ALONE = """\
syncline: 1
name: one candidate, one way to stamp it
catalogs: [alone.yaml]
requirements:
  - {id: A, kind: accuracy, limit: LIMIT}
stages:
  - name: boat
    platform: {v_max: 1 m/s, omega_max: 1 deg/s, distance: 1 m, baseline: 1 m}
    position: WRITTEN
"""
ALONE_CATALOG = """\
sensors:
  only: {modality: position, sigma_position: [2 cm, 3 cm, 6 cm], primitives: [pps], cost: 1 EUR}
timestamping:
  bench:
    primitives: [pps]
    timeline: host
    cost: 1 EUR
    error: {distribution: constant, value: 1 ms}
  wire:
    primitives: [network]
    timeline: host
    cost: 1 EUR
    error: {distribution: constant, value: 1 us}
clocks:
  steady: {offset: {distribution: constant, value: 0 us}, cost: 1 EUR}
"""


@pytest.mark.parametrize(("limit", "meets"), [("72 mm", True), ("70 mm", False), ("1 mm", False)])
@pytest.mark.parametrize(
    "written",
    [
        "{candidates: [only], timestamping: bench}",
        "{sensor: only, timestamping: {candidates: [bench, wire]}}",
        "{sensor: only}\n    timestamping: {candidates: [wire, bench]}",
        "{sensor: only}\ntimestamping: {candidates: [wire, bench]}",
    ],
)
def test_one_combination_is_judged_alike_by_check_and_optimize(
    tmp_path: Path, limit: str, meets: bool, written: str
) -> None:
    """7 cm of noise and 1 mm of motion: 71 mm.  Candidates without a design: infeasible."""
    (tmp_path / "alone.yaml").write_text(ALONE_CATALOG)
    text = ALONE.replace("LIMIT", limit).replace("WRITTEN", written)
    loaded = load_text(text, tmp_path / "spec.yaml")
    verdict = check_loaded(loaded, CheckSettings(monte_carlo=False)).to_json()
    chosen = optimize(loaded, OptimizeSettings()).result.to_json()
    if meets:
        assert verdict["verdict"] == chosen["verdict"] == "meets"
    else:
        assert verdict["verdict"] == chosen["verdict"] == "infeasible"
        assert verdict["infeasibility"] == chosen["infeasibility"]
        (fix,) = [f for f in verdict["infeasibility"]["fixes"] if f["kind"] == "accuracy"]
        assert 0.071 <= fix["to"] <= 0.0711


@pytest.mark.parametrize(
    "written",
    [
        "{sensor: only, timestamping: bench}",
        "{sensor: only, timestamping: bench}\n    timestamping: {candidates: [bench, wire]}",
        "{sensor: only}\n    clock: steady\ntimestamping: bench",
        "{sensor: only}\n    clock: {candidates: [steady]}\ntimestamping: {candidates: [bench]}",
    ],
)
def test_a_spec_that_pins_every_role_is_verified_with_its_figures(
    tmp_path: Path, written: str
) -> None:
    """Lists of one, and lists that no role takes from, leave nothing open."""
    (tmp_path / "alone.yaml").write_text(ALONE_CATALOG)
    text = ALONE.replace("LIMIT", "70 mm").replace("WRITTEN", written)
    verdict = check_loaded(
        load_text(text, tmp_path / "spec.yaml"), CheckSettings(monte_carlo=False)
    ).to_json()
    assert verdict["verdict"] == "fails"
    assert verdict["syncline"]["total_m"] == pytest.approx(0.071, rel=1e-12)


@pytest.mark.parametrize(
    ("limit", "words"), [("0.004", "exactly"), ("0.00399999996", "1.00000001")]
)
def test_a_role_that_misses_by_nothing_visible_says_so(
    tmp_path: Path, limit: str, words: str
) -> None:
    """1 ms at 1 m/s against 25 cm of noise: a ratio of 0.004, to stay below the limit."""
    catalog = ALONE_CATALOG.replace("[2 cm, 3 cm, 6 cm]", "[12 cm, 16 cm, 15 cm]")
    (tmp_path / "alone.yaml").write_text(catalog)
    text = ALONE.replace("LIMIT", "1 m").replace(
        "WRITTEN", "{candidates: [only], timestamping: bench}"
    )
    text = text.replace("stages:", f"  - {{id: S, kind: sync, limit: {limit}}}\nstages:")
    verdict = check_loaded(
        load_text(text, tmp_path / "spec.yaml"), CheckSettings(monte_carlo=False)
    ).to_json()
    (gap,) = verdict["infeasibility"]["roles_without_options"]
    assert words in gap["text"]
    assert "has 1 times" not in gap["text"]
