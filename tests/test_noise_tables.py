"""Noise that depends on range or on the beam's angle: choice, recheck, figures, refusals."""

from __future__ import annotations

import itertools
import json
import math
import pickle
import random
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from syncline_design.choice.chosen_system import system_of
from syncline_design.choice.decide import choose
from syncline_design.choice.effect_tables import problem_of
from syncline_design.choice.front import front
from syncline_design.choice.outcome import Choice
from syncline_design.choice.problem import selection_of, sole_design
from syncline_design.model.budget import budget
from syncline_design.model.system import System
from syncline_design.simulation.figures import error_statistics, worst_case_m
from syncline_design.simulation.sampling import sample_errors
from syncline_design.simulation.settings import SimulationSettings
from syncline_design.spec.load import BadInput, load_text
from syncline_design.verdict.recheck import recheck
from syncline_design.verdict.verify import CheckSettings, check_loaded

Raw = dict[str, Any]
DEGREE = math.pi / 180.0


def drawn(seed: int) -> Raw:
    """One stage at any of several distances; noise of the ranging flat, bent, or rising at once."""
    rng = random.Random(seed)
    near = rng.choice([2.0, 10.0])
    far = near * rng.choice([5.0, 20.0])
    tables = []
    for _ in range(rng.randint(2, 4)):
        places = sorted(rng.sample([1.0, 3.0, 6.0, 15.0, 40.0, 90.0, 300.0], rng.randint(1, 4)))
        values = sorted(rng.choice([0.01, 0.02, 0.05, 0.3, 1.0]) for _ in places)
        tables.append({"rows": list(zip(places, values, strict=True)), "cost": rng.randint(1, 50),
                       "bearing": rng.choice([0.001, 0.02])})  # fmt: skip
    return {
        "near": near, "far": far, "v": rng.choice([1.0, 5.0]), "w": rng.choice([1.0, 20.0]),
        "ranging": tables,
        "attitude": [{"sigma": s, "cost": c} for s, c in ((0.5, 90), (2.0, 5))],
        "methods": [(rng.choice(two), rng.randint(0, 9)) for two in ((1e-3, 3e-3), (6e-3, 2e-2))],
        "accuracy": rng.choice([3.0, 8.0, 25.0]), "sync": rng.choice([1.0, 0.5]),
        "model": rng.choice(["syncline", "per_sensor"]),
    }  # fmt: skip


def written(raw: Raw, folder: Path) -> str:
    sensors: Raw = {
        "gnss": {"modality": "position", "cost": "0 EUR", "primitives": [],
                 "sigma_position": "50 cm"},
    }  # fmt: skip
    for k, one in enumerate(raw["attitude"]):
        sensors[f"a{k}"] = {"modality": "attitude", "cost": f"{one['cost']} EUR",
                            "primitives": [], "sigma_attitude": f"{one['sigma']} deg"}  # fmt: skip
    for k, one in enumerate(raw["ranging"]):
        rows = {f"{place} m": f"{value} m" for place, value in one["rows"]}
        sensors[f"r{k}"] = {"modality": "ranging", "cost": f"{one['cost']} EUR", "primitives": [],
                            "sigma_range": {"at": rows},
                            "sigma_bearing": f"{one['bearing']} deg"}  # fmt: skip
    methods = {
        f"m{k}": {"primitives": ["arrival"], "timeline": "host", "cost": f"{cost} EUR",
                  "error": {"distribution": "uniform", "low": f"{-tau} s", "high": f"{tau} s"}}
        for k, (tau, cost) in enumerate(raw["methods"])
    }  # fmt: skip
    (folder / "own.yaml").write_text(json.dumps({"sensors": sensors, "timestamping": methods}))
    roles = {"position": "gnss", "attitude": "a", "ranging": "r"}
    stage: Raw = {
        role: {"candidates": [name for name in sensors if name.startswith(first)]}
        for role, first in roles.items()
    }
    stage |= {"name": "s", "distance": f"{raw['near']} m .. {raw['far']} m",
              "platform": {"v_max": f"{raw['v']} m/s", "omega_max": f"{raw['w']} deg/s",
                           "baseline": "0 m"}}  # fmt: skip
    return json.dumps({
        "syncline": 1, "name": "tables", "catalogs": ["own.yaml"], "objective": "cost",
        "sync_model": raw["model"], "timestamping": {"candidates": list(methods)},
        "requirements": [{"id": "ACC", "kind": "accuracy", "limit": f"{raw['accuracy']} m"},
                         {"id": "SYNC", "kind": "sync", "limit": raw["sync"]}],
        "stages": [stage],
    })  # fmt: skip


def sigma(rows: list[tuple[float, float]], d: float) -> float:
    """Straight between rows, the first before, the last line on beyond."""
    if len(rows) == 1 or d <= rows[0][0]:
        return rows[0][1]
    k = next((k for k, row in enumerate(rows) if d <= row[0]), len(rows) - 1)
    (x, low), (y, high) = rows[k - 1], rows[k]
    return low + (high - low) * (d - x) / (y - x)


def walked(raw: Raw, chosen: tuple[Raw, Raw], taus: tuple[float, ...]) -> tuple[float, float]:
    """(largest total [m], largest tau / tau_crit) at distances on a grid and at every row."""
    attitude, ranging = chosen
    rows = [place for place, _ in ranging["rows"] if raw["near"] < place < raw["far"]]
    total = ratio = 0.0
    for d in (*np.linspace(raw["near"], raw["far"], 40).tolist(), *rows):
        v, turning = raw["v"], raw["w"] * DEGREE * d
        across = math.sqrt(2.0) * ranging["bearing"] * DEGREE * d
        turned = math.sqrt(3.0) * attitude["sigma"] * DEGREE * d
        own = (math.sqrt(3.0) * 0.5, turned, sigma(ranging["rows"], d) + across)
        rates = (v, v + turning, v + turning)
        tau_sys = max(taus[0] + taus[2], taus[1] + taus[2])
        caused = (v + turning) * tau_sys
        ratio = max(ratio, caused / sum(own),
                    *(t * r / e for t, r, e in zip(taus, rates, own, strict=True)))  # fmt: skip
        if raw["model"] == "per_sensor":
            caused = v * (taus[0] + taus[2]) + turning * (taus[1] + taus[2])
        total = max(total, sum(own) + caused)
    return total, ratio


def plain_front(raw: Raw) -> list[tuple[float, float]]:
    found = []
    for chosen in itertools.product(raw["attitude"], raw["ranging"]):
        for methods in itertools.product(raw["methods"], repeat=3):
            total, ratio = walked(raw, chosen, tuple(tau for tau, _ in methods))
            if ratio < raw["sync"]:
                cost = sum(one["cost"] for one in chosen) + sum(cost for _, cost in methods)
                found.append((float(cost), total))
    kept: list[tuple[float, float]] = []
    for cost, total in sorted(found):
        if not kept or total < kept[-1][1] * (1.0 - 1e-12):
            kept.append((cost, total))
    return kept


BETWEEN = (17, 110, 112, 136, 186, 240, 260)  # of 300, a row between both ends decides in 7


def test_choice_and_front_hold_where_noise_bends(tmp_path: Path) -> None:
    """Against a walk over distances; in some only a row between both ends breaks sync."""
    between = []
    for seed in (*range(8), *BETWEEN):
        raw = drawn(seed)
        case = load_text(written(raw, tmp_path), tmp_path / "spec.yaml")
        problem, wanted = problem_of(case), plain_front(raw)
        got = [(float(point.amount), point.error_m) for point in front(problem)]
        assert np.allclose(got, wanted, rtol=1e-11), seed
        best = next((one for one in wanted if one[1] <= raw["accuracy"]), None)
        for road in ("auto", "milp") if seed < 3 else ("auto",):
            found = choose(problem, road)  # type: ignore[arg-type]
            assert isinstance(found, Choice) == (best is not None), (seed, road)
            if isinstance(found, Choice) and best is not None:
                exact = recheck(case, selection_of(problem, found.design))
                assert exact.passed
                assert float(exact.cost or 0) == best[0], (seed, road)
                assert float(exact.total_m) == pytest.approx(best[1], rel=1e-12)
                figures = budget(system_of(case, problem, found.design))
                assert figures.sync_ratio == pytest.approx(float(exact.sync_ratio), rel=1e-12)
                assert figures.total_m == pytest.approx(best[1], rel=1e-12) or (
                    raw["model"] == "per_sensor")  # fmt: skip
        ends = {**raw, "ranging": [
            {**one, "rows": [(d, sigma(one["rows"], d)) for d in (raw["near"], raw["far"])]}
            for one in raw["ranging"]]}  # fmt: skip
        between += [seed] if plain_front(ends) != wanted else []
    assert tuple(between) == BETWEEN


def one(ranging: Raw, stage: Raw | None = None, **platform: str) -> str:
    """A vehicle at rest, level, with noise of a micrometre but for its ranging."""
    still = {"timestamping": {"error": {"distribution": "constant", "value": "0 s"}}}
    sensors = {
        "position": {"sigma_position": "1 um"},
        "attitude": {"sigma_attitude": "1e-8 rad"},
        "ranging": {"sigma_range": "1 um", "sigma_bearing": "1e-8 rad", **ranging},
    }
    roles = {
        role: {"sensor": {"modality": role, "type": role, "primitives": [], **own}, **still}
        for role, own in sensors.items()
    }
    motion = {"v_max": "0 m/s", "omega_max": "0 deg/s", "baseline": "0 m", **platform}
    return json.dumps({
        "syncline": 1, "name": "one", "horizon": {"tilt": "0 deg"},
        "requirements": [{"id": "ACC", "kind": "accuracy", "limit": "9 m"},
                         {"id": "SYNC", "kind": "sync", "limit": 1e9}],
        "stages": [{"name": "s", "platform": motion, **roles, **(stage or {})}],
    })  # fmt: skip


def system(text: str, folder: Path) -> System:
    case = load_text(text, folder / "s.yaml")
    sole = sole_design(problem_of(case))
    assert sole is not None
    return system_of(case, *sole)


TABLE = {"sigma_range": {"at": {"10 m": "2 cm", "100 m": "5 cm"}}}


@pytest.mark.parametrize(
    ("d", "expected"), [(4.0, 0.02), (40.0, 0.03), (100.0, 0.05), (160.0, 0.07)]
)
def test_noise_by_range_is_that_of_the_distance(d: float, expected: float, tmp_path: Path) -> None:
    """2 cm at 10 m, 5 cm at 100 m: straight between, on beyond with a word about it."""
    text = one(TABLE, distance=f"{d} m")
    found = system(text, tmp_path)
    figures = error_statistics(found, seed=0).over_missions
    assert budget(found).sensor_error_m == pytest.approx(expected, abs=1e-5)
    assert figures.tvu95_m == pytest.approx(1.959964 * expected, rel=1e-3)
    assert worst_case_m(found, 3.0) == pytest.approx(3.0 * expected, rel=1e-3)
    drawn = np.linalg.norm(sample_errors(found, SimulationSettings(samples=16384)), axis=1)
    assert np.sqrt(np.mean(drawn**2)) == pytest.approx(expected, rel=0.03)
    case = load_text(text, tmp_path / "s.yaml")
    told = check_loaded(case, CheckSettings(monte_carlo=False)).to_json()["warnings"]
    beyond = [one["message"] for one in told if one.get("key") == "sigma_range"
              and one["code"] == "unknown-fact"]  # fmt: skip
    assert bool(beyond) == (d > 100.0)


def test_an_interval_takes_the_far_end_and_each_end_its_own_noise(tmp_path: Path) -> None:
    text = one(TABLE, {"distance": "10 m .. 100 m"})
    found = system(text, tmp_path)
    assert error_statistics(found, seed=0).over_missions.rmse_m["3d"] == pytest.approx(
        0.05, rel=1e-3
    )
    exact = recheck(*_case(text, tmp_path))
    assert float(exact.total_m) == pytest.approx(0.05, abs=5e-6)


def _case(text: str, folder: Path) -> Any:
    case = load_text(text, folder / "s.yaml")
    return case, selection_of(*sole_design(problem_of(case)))  # type: ignore[misc]


BEAMS = {"0 deg": "2 cm", "45 deg": "3 cm", "65 deg": "12 cm"}


@pytest.mark.parametrize(
    ("edge", "worst"), [(-40.0, 0.03 + 0.09 * 5 / 20), (-25.0, 0.12), (-10.0, 0.12)]
)
def test_the_edge_of_the_swath_decides(edge: float, worst: float, tmp_path: Path) -> None:
    """Range noise by beam angle, level vehicle: 1.96 s cos(a) up, 1.96 s sin(a) across."""
    look = {"look": {"elevation": f"-90 deg .. {edge} deg"}}
    text = one({"sigma_range": {"at": BEAMS}}, look, distance="50 m")
    found = system(text, tmp_path)
    off = np.linspace(0.0, 90.0 + edge, 4001)
    along = np.interp(off, (0.0, 45.0, 65.0), (0.02, 0.03, 0.12))
    up, across = along * np.cos(off * DEGREE), along * np.sin(off * DEGREE)
    figures = error_statistics(found, seed=0).over_missions
    assert figures.tvu95_m == pytest.approx(1.959964 * up.max(), rel=2e-3)
    assert figures.thu95_m == pytest.approx(1.959964 * across.max(), rel=2e-3)
    assert figures.rmse_m["3d"] == pytest.approx(along.max(), rel=2e-3)
    assert budget(found).sensor_error_m == pytest.approx(worst, abs=5e-6)
    assert float(recheck(*_case(text, tmp_path)).total_m) == pytest.approx(worst, abs=5e-6)
    assert worst_case_m(found, 1.0) == pytest.approx(worst, rel=1e-3)
    drawn = np.linalg.norm(sample_errors(found, SimulationSettings(samples=32768)), axis=1)
    heights = np.linspace(math.sin(-edge * DEGREE), 1.0, 4001)  # even over the sphere
    angles = np.degrees(np.arccos(heights))
    mean = np.mean(np.interp(angles, (0.0, 45.0, 65.0), (0.02, 0.03, 0.12)) ** 2)
    assert np.mean(drawn**2) == pytest.approx(mean, rel=0.04)


def test_bearing_noise_by_beam_angle(tmp_path: Path) -> None:
    """0.1 deg straight down, 0.4 deg at 60 deg; elevation noise alone lifts, by d s sin(a)."""
    look = {"look": {"elevation": "-90 deg .. -30 deg"}}
    table = {"sigma_bearing": {"at": {"0 deg": "0.1 deg", "60 deg": "0.4 deg"}}}
    found = system(one(table, look, distance="50 m"), tmp_path)
    assert budget(found).sensor_error_m == pytest.approx(50 * math.sqrt(2) * 0.4 * DEGREE, rel=1e-4)
    lifted = 1.959964 * 50.0 * 0.4 * DEGREE * math.sin(60 * DEGREE)
    assert error_statistics(found, seed=0).over_missions.tvu95_m == pytest.approx(lifted, rel=2e-3)


@pytest.mark.parametrize(
    ("figure", "table", "words"),
    [
        ("sigma_range", "{at: {}}", "not a table of noise"),
        ("sigma_range", "{by: {10 m: 2 cm}}", "such as {at: {10 m: 2 cm, 100 m: 5 cm}}, found by"),
        ("sigma_range", "{at: {10 m: 5 cm, 100 m: 2 cm}}", "noise that falls with range"),
        ("sigma_range", "{at: {10 m: 2 deg}}", "wrong dimension"),
        ("sigma_range", "{at: {10 s: 2 cm}}", "a range such as 10 m or a beam angle"),
        ("sigma_range", "{at: {10 m: 2 cm, 1000 cm: 3 cm}}", "a row given twice"),
        ("sigma_range", "{at: {10 m: 2 cm, 20 deg: 3 cm}}", "ranges and angles in one table"),
        ("sigma_range", "{at: {-1 m: 2 cm}}", "0 m or more"),
        ("sigma_bearing", "{at: {10 m: 2 deg}}", "a beam angle such as 60 deg"),
        ("sigma_bearing", "{at: {190 deg: 2 deg}}", "0 deg .. 180 deg"),
        ("sigma_bearing", "{at: {10 deg: 0 deg}}", "more than 0"),
    ],
)  # fmt: skip
def test_a_wrong_table_is_refused_where_it_stands(
    figure: str, table: str, words: str, tmp_path: Path
) -> None:
    text = one({figure: "TABLE"}, distance="50 m").replace('"TABLE"', table)
    with pytest.raises(BadInput) as refused:
        load_text(text, tmp_path / "s.yaml")
    (flaw,) = refused.value.problems
    assert f"ranging.sensor.{figure}" in flaw.path
    assert (flaw.line, words in str(flaw)) == (1, True), str(flaw)


def test_a_table_survives_a_pickle(tmp_path: Path) -> None:
    case = load_text(one(TABLE, distance="40 m"), tmp_path / "s.yaml")
    role = case.stages[0].role("ranging")
    assert role is not None
    table = role.sensors[0].entry.tables["sigma_range"]
    again = pickle.loads(pickle.dumps(table))
    assert (again.rows, again.exact, again.text) == (table.rows, Fraction("0.03"), table.text)
