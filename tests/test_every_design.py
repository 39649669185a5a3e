"""`--best K --every` and `next_best_every` rank every design, against all of them written out."""

from __future__ import annotations

import itertools
import json
import math
import random
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from syncline_design.cli.app import app

ROLES = ("position", "attitude", "ranging")
SPEED, TURN_DEG, DISTANCE = 5, 20, 30
Names = tuple[tuple[str, str], ...]


def entries(rng: random.Random) -> tuple[dict[str, list[tuple[str, str, int]]], list[Any]]:
    """Sensors (id, sigma, cents) of each role and methods (id, bound in us, cents)."""
    sigmas = {"position": ("1", "2"), "attitude": ("0.02", "0.05"), "ranging": ("2", "3")}
    sensors = {
        role: [
            (f"{role[0]}{i}", rng.choice(sigmas[role]), rng.choice([1000, 1010, 2000]))
            for i in range(rng.randint(1, 3))
        ]
        for role in ROLES
    }
    methods = [(f"m{i}", rng.choice([1, 2, 2, 50]), rng.choice([0, 10, 20])) for i in range(2)]
    return sensors, methods


def written(sensors: dict[str, list[tuple[str, str, int]]], methods: list[Any], limit: str) -> str:
    sigma = {
        "position": "sigma_position: {} cm",
        "attitude": "sigma_attitude: {} deg",
        "ranging": "sigma_range: {} cm, sigma_bearing: 0.01 deg",
    }
    common = "mass: 1 g, power: 1 W, source: own"
    lines = ["sensors:"]
    for role, rows in sensors.items():
        lines += [
            f"  {name}: {{modality: {role}, {sigma[role].format(value)}, primitives: [pps], "
            f"cost: {cents / 100} EUR, {common}}}"
            for name, value, cents in rows
        ]
    lines.append("timestamping:")
    lines += [
        f"  {name}: {{primitives: [pps], timeline: host, cost: {cents / 100} EUR, {common}, "
        f"error: {{distribution: constant, value: -{bound} us}}}}"
        for name, bound, cents in methods
    ]
    roles = [
        f"    {role}: {{candidates: [{', '.join(name for name, _, _ in rows)}]}}"
        for role, rows in sensors.items()
    ]
    spec = [
        "syncline: 1", "name: every", "catalogs: [own.yaml]", "requirements:",
        f"  - {{id: A, kind: accuracy, limit: {limit}}}", "stages:", "  - name: v",
        f"    platform: {{v_max: {SPEED} m/s, omega_max: {TURN_DEG} deg/s, "
        f"distance: {DISTANCE} m, baseline: 0 m, source: own}}",
        *roles, f"timestamping: {{candidates: [{', '.join(m[0] for m in methods)}]}}",
    ]  # fmt: skip
    return "\n".join(lines) + "\n---\n" + "\n".join(spec) + "\n"


def all_ranked(
    sensors: dict[str, list[tuple[str, str, int]]], methods: list[Any], limit: float
) -> list[tuple[Fraction, float, Names]]:
    """Every design that keeps the accuracy, by cost, error to 12 figures and names."""
    turn = math.radians(TURN_DEG) * DISTANCE
    found = []
    for picked in itertools.product(*(itertools.product(sensors[r], methods) for r in ROLES)):
        (place, at_p), (pose, at_a), (beam, at_r) = picked
        noise = math.sqrt(3) * (float(place[1]) / 100 + math.radians(float(pose[1])) * DISTANCE)
        noise += float(beam[1]) / 100 + math.sqrt(2) * math.radians(0.01) * DISTANCE
        tau = 1e-6 * (at_r[1] + max(at_p[1], at_a[1]))
        error = float(f"{noise + (SPEED + turn) * tau:.12g}")
        cents = sum(sensor[2] + method[2] for sensor, method in picked)
        names = tuple((sensor[0], method[0]) for sensor, method in picked)
        if error <= limit:
            found.append((Fraction(cents, 100), error, names))
    return sorted(found)


def names_of(design: dict[str, Any]) -> Names:
    roles = design["stages"][0]["roles"]
    return tuple((roles[r]["sensor"], roles[r]["timestamping"]) for r in ROLES)


@pytest.mark.parametrize("seed", range(6))
def test_every_design_is_ranked(seed: int, tmp_path: Path) -> None:
    sensors, methods = entries(random.Random(seed))
    expected = all_ranked(sensors, methods, 0.2)
    assert len(expected) >= 8
    own, spec = written(sensors, methods, "0.2 m").split("---\n")
    (tmp_path / "own.yaml").write_text(own, "utf-8")
    path, out = tmp_path / "spec.yaml", tmp_path / "out.json"
    path.write_text(spec, "utf-8")

    def json_of(*words: str) -> Any:
        done = CliRunner().invoke(app, [*words, "-q", "-o", f"json:{out}"])
        assert done.exit_code == 0, done.output
        return json.loads(out.read_text("utf-8"))

    count = min(9, len(expected) + 2)
    told = json_of("optimize", str(path), "--best", str(count), "--every")["designs"]
    ranked = [(Fraction(str(d["cost"])), names_of(d["design"])) for d in told]
    assert ranked == [(cost, names) for cost, _, names in expected[:count]]
    assert [d["error_m"] for d in told] == pytest.approx([e for _, e, _ in expected[:count]])
    choice = json_of("check", str(path))["choice"]
    following = [names_of(d["design"]) for d in choice["next_best_every"]]
    assert following == [names for _, _, names in expected[1:6]]
    differing = {tuple(sensor for sensor, _ in names_of(d["design"])) for d in choice["next_best"]}
    assert len(differing) == len(choice["next_best"])
