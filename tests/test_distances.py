"""Stages whose objects are at any distance between two: against a plain walk over the distances."""

from __future__ import annotations

import itertools
import json
import math
import random
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from syncline_design.choice.chosen_system import system_of
from syncline_design.choice.decide import choose
from syncline_design.choice.effect_tables import problem_of
from syncline_design.choice.front import front
from syncline_design.choice.outcome import Choice
from syncline_design.choice.problem import selection_of
from syncline_design.model.budget import budget
from syncline_design.simulation.figures import error_statistics
from syncline_design.simulation.sampling import sample_errors
from syncline_design.simulation.settings import SimulationSettings
from syncline_design.spec.load import BadInput, load_text
from syncline_design.verdict.recheck import recheck
from syncline_design.verdict.verify import CheckSettings, check_loaded

Raw = dict[str, Any]
DEGREE = math.pi / 180.0
WALK = 7  # distances that the oracle looks at, both ends among them


def drawn(seed: int) -> Raw:
    """Plain figures of a spec: sync binds now at the near end, now at the far one."""
    rng = random.Random(seed)
    stages = []
    for index in range(rng.choice([1, 1, 2])):
        near = rng.choice([1.0, 5.0, 20.0])
        span = (near, near * rng.choice([2.0, 8.0, 40.0]))
        roles = ["position"] if index == 0 else []
        sensors = {
            role: [
                {
                    "cost": rng.randint(1, 60) * 10,
                    "a": rng.choice([0.002, 0.01, 0.05, 0.3]) * (role != "attitude"),
                    "b": rng.choice([0.005, 0.02, 0.1, 0.5]) * (role != "position"),
                    "near": rng.choice([0.0, 0.0, 3.0]),
                    "far": rng.choice([math.inf, 200.0, 30.0]),
                }
                for _ in range(rng.randint(1, 3))
            ]
            for role in (*roles, "attitude", "ranging")
        }
        turning, interval = rng.choice([0.5, 5.0, 40.0]), index == 0 or rng.random() < 0.6
        stages.append({
            "v": rng.choice([0.5, 3.0, 20.0]), "w": turning, "sensors": sensors,
            "span": span if interval else (span[1], span[1]),
        })  # fmt: skip
    return {
        "stages": stages,
        "methods": [(rng.choice([1e-5, 1e-4, 2e-3, 2e-2]), rng.randint(0, 9)) for _ in range(2)],
        "accuracy": rng.choice([0.3, 1.0, 4.0, 20.0]),
        "sync": rng.choice([1.0, 0.7, 0.3]),
        "model": rng.choice(["syncline", "per_sensor"]),
    }


def written(raw: Raw, folder: Path) -> str:
    """The same as a spec with a catalog of its own."""
    sensors: Raw = {}
    stages = []
    for index, one in enumerate(raw["stages"]):
        near, far = one["span"]
        stage: Raw = {
            "name": f"s{index}", "gnss": True,
            "platform": {"v_max": f"{one['v']} m/s", "omega_max": f"{one['w']} deg/s",
                         "baseline": "0 m"},
        }  # fmt: skip
        if near == far:
            stage["platform"]["distance"] = f"{far} m"
        else:
            stage["distance"] = f"{near} m .. {far} m"
        for role, listed in one["sensors"].items():
            names = []
            for k, sensor in enumerate(listed):
                entry: Raw = {"modality": role, "cost": f"{sensor['cost']} EUR", "primitives": []}
                if role == "position":
                    entry["sigma_position"] = f"{sensor['a']} m"
                elif role == "attitude":
                    entry["sigma_attitude"] = f"{sensor['b']} deg"
                else:
                    entry["sigma_range"] = f"{sensor['a']} m"
                    entry["sigma_bearing"] = f"{sensor['b']} deg"
                    reach = {"min": f"{sensor['near']} m"}
                    if math.isfinite(sensor["far"]):
                        reach["max"] = f"{sensor['far']} m"
                    entry["reach"] = reach
                name = f"{role}_{index}_{k}"
                sensors[name] = entry
                names.append(name)
            stage[role] = {"candidates": names}
        stages.append(stage)
    methods = {
        f"m{k}": {"primitives": ["arrival"], "timeline": "host", "cost": f"{cost} EUR",
                  "error": {"distribution": "uniform", "low": f"{-tau} s", "high": f"{tau} s"}}
        for k, (tau, cost) in enumerate(raw["methods"])
    }  # fmt: skip
    (folder / "own.yaml").write_text(json.dumps({"sensors": sensors, "timestamping": methods}))
    return json.dumps({
        "syncline": 1, "name": "several distances", "catalogs": ["own.yaml"],
        "sync_model": raw["model"], "objective": "cost",
        "requirements": [
            {"id": "ACC", "kind": "accuracy", "limit": f"{raw['accuracy']} m"},
            {"id": "SYNC", "kind": "sync", "limit": raw["sync"]},
        ],
        "timestamping": {"candidates": list(methods)}, "stages": stages,
    })  # fmt: skip


def walked(raw: Raw, design: list[tuple[Raw, float]]) -> tuple[float, float]:
    """(largest total [m], largest tau / tau_crit) of (sensor, tau) by role, over all distances."""
    spans = [np.linspace(*one["span"], WALK) for one in raw["stages"]]
    total = ratio = 0.0
    steps = itertools.product(*(sorted({*span.tolist()}) for span in spans))
    for distances in steps:
        chosen = iter(design)
        error = rate = 0.0
        pairs: list[tuple[float, float]] = []
        before = 0.0
        for index, (one, d) in enumerate(zip(raw["stages"], distances, strict=True)):
            v, turning = one["v"], d * one["w"] * DEGREE
            if index == 0:
                sensor, before = next(chosen)
                own = math.sqrt(3.0) * sensor["a"]
                error += own
                ratio = max(ratio, before * v / own)
            taus = []
            for role in ("attitude", "ranging"):
                sensor, tau = next(chosen)
                axes = 2 if role == "ranging" else 3
                own = sensor["a"] * (role == "ranging")
                own += math.sqrt(axes) * sensor["b"] * DEGREE * d
                error += own
                ratio = max(ratio, tau * (v + turning) / own)
                taus.append(tau)
            pairs += [(v, before + taus[1]), (turning, taus[0] + taus[1])]
            rate += v + turning
            before = taus[1]
        tau_sys = max(tau for _, tau in pairs)
        caused = rate * tau_sys
        ratio = max(ratio, caused / error)
        if raw["model"] == "per_sensor":
            caused = sum(speed * tau for speed, tau in pairs)
        total = max(total, error + caused)
    return total, ratio


def plain_front(raw: Raw) -> list[tuple[float, float]]:
    """(cost, total) of the designs that keep sync and reach, those that nothing beats."""
    roles = [(one, role) for one in raw["stages"] for role in one["sensors"]]
    options = []
    for stage, role in roles:
        near, far = stage["span"]
        works = [
            sensor
            for sensor in stage["sensors"][role]
            if role != "ranging" or (sensor["near"] <= near and far <= sensor["far"])
        ]
        options.append([(s, tau, s["cost"] + cost) for s in works for tau, cost in raw["methods"]])
    found = []
    for design in itertools.product(*options):
        total, ratio = walked(raw, [(sensor, tau) for sensor, tau, _ in design])
        if ratio < raw["sync"]:
            found.append((sum(cost for *_, cost in design), total))
    found.sort()
    kept: list[tuple[float, float]] = []
    for cost, total in found:
        if not kept or total < kept[-1][1] * (1.0 - 1e-12):
            kept.append((cost, total))
    return kept


NEAR_DECIDES = (6, 11, 15, 17, 18, 22, 23, 29)  # of the seeds below 30


def test_choice_and_front_hold_at_every_distance(tmp_path: Path) -> None:
    near_decides = []
    for seed in range(30):
        raw = drawn(seed)
        case = load_text(written(raw, tmp_path), tmp_path / "spec.yaml")
        problem = problem_of(case)
        wanted = plain_front(raw)
        got = [(float(point.amount), point.error_m) for point in front(problem)]
        assert np.allclose(got, wanted, rtol=1e-11), seed
        best = next((one for one in wanted if one[1] <= raw["accuracy"]), None)
        for road in ("auto", "front", "enumerate"):
            found = choose(problem, road)  # type: ignore[arg-type]
            assert isinstance(found, Choice) == (best is not None), (seed, road)
            if isinstance(found, Choice) and best is not None:
                exact = recheck(case, selection_of(problem, found.design))
                assert exact.passed, (seed, road)
                assert float(exact.cost or 0) == best[0], (seed, road)
                assert float(exact.total_m) == pytest.approx(best[1], rel=1e-12)
                figures = budget(system_of(case, problem, found.design))
                assert figures.sync_ratio == pytest.approx(float(exact.sync_ratio), rel=1e-12)
        ends = [{**stage, "span": (stage["span"][1],) * 2} for stage in raw["stages"]]
        near_decides += [seed] if plain_front({**raw, "stages": ends}) != wanted else []
    assert tuple(near_decides) == NEAR_DECIDES


def test_milp_holds_at_both_ends(tmp_path: Path) -> None:
    for seed in (5, 6):
        raw = drawn(seed)
        case = load_text(written(raw, tmp_path), tmp_path / "spec.yaml")
        problem = problem_of(case)
        best = next((one for one in plain_front(raw) if one[1] <= raw["accuracy"]), None)
        found = choose(problem, "milp")
        cost = None
        if isinstance(found, Choice):
            cost = float(recheck(case, selection_of(problem, found.design)).cost or 0)
        assert cost == (None if best is None else best[0]), seed


SPEC = """
syncline: 1
name: from low to high
requirements:
  - {id: ACC-1, kind: accuracy, limit: 2 m}
  - {id: THU-1, kind: thu, limit: {a: 0.4 m, b: 0.02}}
  - {id: WC-1, kind: worst_case, limit: {a: 2 m, b: 0.05}}
  - {id: MC-1, kind: monte_carlo, quantile: 0.95, limit: 2 m}
stages:
  - name: uav
    platform: {v_max: 5 m/s, omega_max: 20 deg/s, baseline: 0 m}
    distance: 10 m .. 60 m
    position: {sensor: {modality: position, type: total station, primitives: [],
                        sigma_position: 20 cm},
               timestamping: {error: {distribution: uniform, low: -5 ms, high: 5 ms}}}
    attitude: {sensor: {modality: attitude, type: ins, primitives: [], sigma_attitude: 0.1 deg},
               timestamping: {error: {distribution: normal, mean: 0 s, std: 1 ms}}}
    ranging: {sensor: {modality: ranging, type: lidar, primitives: [], sigma_range: 2 cm,
                        sigma_bearing: 0.05 deg},
              timestamping: {error: {distribution: constant, value: 0 s}}}
"""


def test_figures_are_the_largest_at_any_distance(tmp_path: Path) -> None:
    """Against figures of the same system at single distances, and samples drawn at both ends."""
    verdict = check_loaded(load_text(SPEC, tmp_path / "s.yaml"), CheckSettings()).to_json()
    rows = {row["id"]: row for row in verdict["requirements"]}
    shares, bounds, thu = {}, {}, {}
    for d in (10.0, 20.0, 35.0, 60.0):
        one = SPEC.replace("baseline: 0 m}", f"baseline: 0 m, distance: {d} m}}")
        one = one.replace("    distance: 10 m .. 60 m\n", "")
        case = load_text(one, tmp_path / "s.yaml")
        at = check_loaded(case, CheckSettings(monte_carlo=False)).to_json()
        kept = {row["id"]: row for row in at["requirements"]}
        thu[d] = kept["THU-1"]["value"]
        shares[d] = thu[d] / math.hypot(0.4, 0.02 * d)
        bounds[d] = kept["WC-1"]["value"] / math.hypot(2.0, 0.05 * d)
    assert verdict["figures"]["thu95_m"] == pytest.approx(max(thu.values()), rel=2e-3)
    where = rows["THU-1"]["at_distance_m"]
    assert rows["THU-1"]["limit"] == pytest.approx(math.hypot(0.4, 0.02 * where), rel=1e-9)
    found = rows["THU-1"]["value"] / rows["THU-1"]["limit"]
    assert max(shares.values()) * (1.0 - 1e-3) <= found <= max(shares.values()) * 1.02
    found = rows["WC-1"]["value"] / rows["WC-1"]["limit"]
    assert max(bounds.values()) * (1.0 - 1e-9) <= found <= max(bounds.values()) * 1.01
    assert verdict["monte_carlo"]["distances_m"] == {"uav": 60.0}
    system = _system(tmp_path)
    far = sample_errors(system, SimulationSettings(20_000, seed=5))
    assert np.quantile(far, 0.95) <= error_statistics(system, seed=0).over_missions.quantile95_3d_m


def _system(folder: Path) -> Any:
    case = load_text(SPEC, folder / "s.yaml")
    problem = problem_of(case)
    found = choose(problem)
    assert isinstance(found, Choice)
    return system_of(case, problem, found.design)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("10 m .. 60 m", "60 m", "one distance stands in the platform"),
        ("10 m .. 60 m", "60 m .. 10 m", "ends swapped"),
        ("10 m .. 60 m", "0 m .. 10 m", "more than 0"),
        ("10 m .. 60 m", "10 s .. 60 s", "length"),
        ("baseline: 0 m}", "baseline: 0 m, distance: 20 m}", "given twice"),
        ("    distance: 10 m .. 60 m\n", "", "platform.distance: missing"),
    ],
)
def test_what_is_no_interval_is_refused_at_its_place(
    old: str, new: str, message: str, tmp_path: Path
) -> None:
    with pytest.raises(BadInput, match=r"s\.yaml:\d+:\d+: stages\[0\]") as refused:
        load_text(SPEC.replace(old, new), tmp_path / "s.yaml")
    assert message in str(refused.value)


def reaching(folder: Path, reach: str, distance: str = "") -> Any:
    """What `check` says of a lidar that ends at `reach`; distance: one alone, of the platform."""
    part = {"modality": "ranging", "type": "lidar", "primitives": [], "sigma_range": "2 cm",
            "sigma_bearing": "0.05 deg", "reach": {"max": reach}}  # fmt: skip
    (folder / "parts.yaml").write_text(json.dumps({"sensors": {"lidar": part}}))
    head, stamp = SPEC.split("    ranging: ")[0], "{distribution: constant, value: 0 s}"
    head = "\n".join(line for line in head.splitlines() if "-1, kind" not in line or "ACC" in line)
    text = head.replace("low to high", "low to high\nobjective: error\ncatalogs: [parts.yaml]")
    text += f"\n    ranging: {{candidates: [lidar], timestamping: {{error: {stamp}}}}}\n"
    if distance:
        text = text.replace("    distance: 10 m .. 60 m\n", "")
        text = text.replace("baseline: 0 m}", f"baseline: 0 m, distance: {distance}}}")
    case = load_text(text, folder / "s.yaml")
    return check_loaded(case, CheckSettings(monte_carlo=False)).to_json()


def test_fixes_move_the_far_end(tmp_path: Path) -> None:
    """A lidar that ends at 40 m: the interval ends there, too."""
    found = reaching(tmp_path, "40 m")
    assert found["verdict"] == "infeasible"
    fix = next(one for one in found["infeasibility"]["fixes"] if one["figure"] == "distance")
    assert fix["to"] == 40.0
    assert "far end of the distance of uav from 60 m to 40 m" in fix["text"]


def test_a_fix_before_the_near_end_leaves_one_distance(tmp_path: Path) -> None:
    """A lidar that ends at 8 m, from 10 m on: an interval `10 m .. 8 m` cannot be written."""
    found = reaching(tmp_path, "8 m")
    assert found["verdict"] == "infeasible"
    fix = next(one for one in found["infeasibility"]["fixes"] if one["figure"] == "distance")
    assert fix["to"] == 8.0
    assert fix["text"] == "distance of uav from 10 m .. 60 m to 8 m alone, of its platform"
    assert reaching(tmp_path, "8 m", distance="8 m")["verdict"] == "meets"


def test_no_more_intervals_than_can_be_looked_at(tmp_path: Path) -> None:
    raw = drawn(1)
    one = {**raw["stages"][0], "span": (1.0, 2.0)}
    later = {**one, "sensors": {k: v for k, v in one["sensors"].items() if k != "position"}}
    raw["stages"] = [one, *[later] * 4]
    with pytest.raises(BadInput, match=r"stages\[4\]\.distance: too many intervals"):
        load_text(written(raw, tmp_path), tmp_path / "spec.yaml")


def test_an_interval_inside_the_platform_is_sent_to_the_stage(tmp_path: Path) -> None:
    text = SPEC.replace("    distance: 10 m .. 60 m\n", "")
    text = text.replace("baseline: 0 m}", "baseline: 0 m, distance: 10 m .. 60 m}")
    with pytest.raises(BadInput) as refused:
        load_text(text, tmp_path / "s.yaml")
    (problem,) = refused.value.problems
    assert problem.path == "stages[0].platform.distance"
    assert problem.found == "10 m .. 60 m"
    assert "key of the stage" in problem.hint
    assert "distance: NEAR .. FAR" in problem.hint
