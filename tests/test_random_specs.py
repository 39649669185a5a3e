"""Random specs over the built-in catalogs: reading, tables of options and exact front together.

The front of `choose.front` against plain enumeration, which shares no code with the package.
"""

from __future__ import annotations

import random
from pathlib import Path
from typing import Any

import pytest
import yaml

from plain_enumeration import Enumeration, failed, limits_of, read_catalog
from syncline_design.choice.front import front
from syncline_design.choice.problem import build_problem
from syncline_design.spec.load import load

SPECS = sorted((Path(__file__).parent.parent / "specs").glob("*.yaml"))
CATALOG = read_catalog()
MOST_DESIGNS = 2500
Point = tuple[float, float]


def front_by_enumeration(spec: dict[str, Any]) -> list[Point]:
    """(cost, error) of designs that meet all but accuracy, none beaten, by rising cost."""
    accuracy = {name for name, (kind, _) in limits_of(spec).items() if kind == "accuracy"}
    outcomes = (o for o in Enumeration(spec) if failed(spec, o) <= accuracy)
    points: list[Point] = []
    for cost, error in sorted({(round(o.cost, 6), o.total_m) for o in outcomes}):
        # Equal errors that differ in the last bits only are one point.
        if not points or error < points[-1][1] * (1 - 1e-12):
            points.append((cost, error))
    return points


def front_of_package(path: Path) -> list[Point]:
    return [(float(p.amount), p.error_m) for p in front(build_problem(load(path)))]


def assert_same(found: list[Point], expected: list[Point]) -> None:
    assert [cost for cost, _ in found] == pytest.approx([cost for cost, _ in expected], abs=1e-6)
    assert [error for _, error in found] == pytest.approx([e for _, e in expected], rel=1e-9)


@pytest.mark.parametrize("path", SPECS, ids=lambda p: p.stem)
def test_the_front_of_a_shipped_spec(path: Path) -> None:
    assert_same(front_of_package(path), front_by_enumeration(yaml.safe_load(path.read_text())))


def draw_role(rng: random.Random, modality: str) -> dict[str, Any]:
    names = [n for n, s in CATALOG["sensors"].items() if s["modality"] == modality]
    return {"candidates": rng.sample(names, rng.randint(1, 2))}


def draw_stage(rng: random.Random, index: int, vehicles: list[str]) -> dict[str, Any]:
    stage: dict[str, Any] = {
        "name": f"stage{index}",
        "platform": rng.choice(list(CATALOG["platforms"])),
        "attitude": draw_role(rng, "attitude"),
        "ranging": draw_role(rng, "ranging"),
    }
    if index == 0:
        stage["position"] = draw_role(rng, "position")
    vehicle = rng.choice([*vehicles, f"vehicle{index}"])
    stage["vehicle"] = vehicle
    if vehicle not in vehicles:
        vehicles.append(vehicle)
        if rng.random() < 0.6:
            clocks = rng.sample(list(CATALOG["clocks"]), rng.randint(1, 2))
            stage["clock"] = {"candidates": clocks}
    return stage


def draw_spec(rng: random.Random) -> dict[str, Any]:
    vehicles: list[str] = []
    stages = [draw_stage(rng, i, vehicles) for i in range(rng.choice([1, 1, 2, 2, 3]))]
    requirements: list[dict[str, Any]] = [
        {"id": "S", "kind": "sync", "limit": rng.choice([0.01, 0.5, 1.0, 20.0, 1000.0])}
    ]
    if rng.random() < 0.3:
        requirements.append({"id": "M", "kind": "mass", "limit": f"{rng.randint(1, 150)} kg"})
    if rng.random() < 0.3:
        requirements.append({"id": "P", "kind": "power", "limit": f"{rng.randint(10, 300)} W"})
    methods = rng.sample(list(CATALOG["timestamping"]), rng.randint(2, 6))
    return {
        "syncline": 1,
        "name": "drawn",
        "requirements": requirements,
        "sync_model": rng.choice(["syncline", "per_sensor"]),
        "coverage_factor": rng.choice([1, 2, 3]),
        "stages": stages,
        "timestamping": {"candidates": methods},
    }


def size(spec: dict[str, Any]) -> int:
    return Enumeration(spec).count


def test_the_front_of_random_specs(tmp_path: Path) -> None:
    rng = random.Random(20241121)
    sizes, compared, boards = [], 0, 0
    while compared < 120:
        spec = draw_spec(rng)
        if not 1 <= size(spec) <= MOST_DESIGNS:
            continue
        path = tmp_path / f"{compared}.yaml"
        path.write_text(yaml.safe_dump(spec, sort_keys=False), "utf-8")
        expected = front_by_enumeration(spec)
        assert_same(front_of_package(path), expected)
        compared += 1
        sizes.append(len(expected))
        boards += len({s["vehicle"] for s in spec["stages"]}) < len(spec["stages"])
    # The sample is no test unless it holds real fronts, infeasible specs and shared vehicles.
    assert sum(n > 2 for n in sizes) >= 15
    assert sum(n == 0 for n in sizes) >= 15
    assert boards >= 15
