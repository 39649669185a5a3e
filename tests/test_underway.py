"""Sound under way and samples that are interpolated: the terms, the choice, figures and samples."""

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
from syncline_design.choice.outcome import Choice
from syncline_design.choice.problem import selection_of, sole_design
from syncline_design.model.budget import budget
from syncline_design.model.system import System
from syncline_design.simulation.figures import error_statistics, worst_case_m
from syncline_design.simulation.sampling import sample_errors
from syncline_design.simulation.settings import SimulationSettings
from syncline_design.spec.case import Case
from syncline_design.spec.load import BadInput, load_text
from syncline_design.verdict.recheck import recheck
from syncline_design.verdict.verify import CheckSettings, check_loaded

Raw = dict[str, Any]
DEGREE = math.pi / 180.0
STILL = {"timestamping": {"error": {"distribution": "constant", "value": "0 s"}}}


def spec(stage: Raw | None = None, **keys: Raw) -> str:
    """One vessel with noise of a micrometre, stamps that are true, and the keys of a test."""
    platform = {"v_max": "0 m/s", "omega_max": "0 deg/s", "baseline": "0 m", "distance": "75 m"}
    entries: Raw = {
        "position": {"type": "total station", "sigma_position": "1 um"},
        "attitude": {"type": "ins", "sigma_attitude": "1e-8 rad"},
        "ranging": {"type": "usbl", "sigma_range": "1 um", "sigma_bearing": "1e-8 rad"},
    }
    roles: Raw = {
        role: {"sensor": {"modality": role, "primitives": [], **own, **keys.get(role, {})}, **STILL}
        for role, own in entries.items()
    }
    one = {"name": "vessel", "platform": {**platform, **keys.get("platform", {})}, **roles}
    return json.dumps({
        "syncline": 1, "name": "under way", **keys.get("spec", {}),
        "requirements": [{"id": "ACC", "kind": "accuracy", "limit": "9 m"},
                         {"id": "SYNC", "kind": "sync", "limit": 1e9}],
        "stages": [{**one, **(stage or {})}],
    })  # fmt: skip


def system(text: str, folder: Path) -> System:
    case = load_text(text, folder / "s.yaml")
    sole = sole_design(problem_of(case))
    assert sole is not None
    return system_of(case, *sole)


SAILING = {"v_max": "2 m/s"}
TURNING = {"omega_max": "30 deg/s"}


@pytest.mark.parametrize(
    ("moves", "limit"), [(SAILING, 0.2), (TURNING, 150 * math.sin(1.5 * DEGREE))]
)
def test_sound_under_way_displaces_by_what_the_vehicle_moves(
    moves: Raw, limit: float, tmp_path: Path
) -> None:
    """v 2 d / c, or the chord 2 d sin(omega d / c), d / c = 50 ms; each direction of it is met."""
    found = system(spec(platform=moves, ranging={"corrects": []}), tmp_path)
    figures = error_statistics(found, seed=0).over_missions
    assert figures.rmse_m["3d"] == pytest.approx(limit, rel=1e-4)
    assert figures.thu95_m == pytest.approx(limit, rel=1e-4)
    assert figures.tvu95_m == pytest.approx(limit, rel=1e-3)
    assert worst_case_m(found, 1.0) == pytest.approx(limit, rel=1e-4)
    largest = np.linalg.norm(sample_errors(found, SimulationSettings(samples=4000)), axis=1).max()
    assert largest == pytest.approx(limit, rel=2e-3)
    arc = 0.2 if moves is SAILING else 75 * 30 * DEGREE * 0.1
    assert budget(found).systematic_m == pytest.approx(arc, rel=1e-12)


def moored(folder: Path, corrects: list[str]) -> str:
    """A buoy that neither moves nor turns, 75 m from an AUV at 2 m/s that looks 1 m away."""
    raw = json.loads(spec(ranging={"corrects": corrects}))
    buoy = raw["stages"][0]
    auv = {**buoy, "name": "auv", "platform": {**buoy["platform"], **SAILING, "distance": "1 m"}}
    auv["ranging"] = {**STILL, "sensor": {**buoy["ranging"]["sensor"], "type": "lidar"}}
    del auv["position"]
    return json.dumps({**raw, "stages": [buoy, auv]})


def test_what_a_moored_buoy_locates_moves_while_sound_is_under_way(tmp_path: Path) -> None:
    """The AUV is 2 m/s 2 75 m / c = 20 cm further when the echo is back; figures, ledger, recheck,
    samples, explanation; where the maker corrects for it, nothing."""
    text = moored(tmp_path, [])
    found = system(text, tmp_path)
    figures = error_statistics(found, seed=0).over_missions
    assert figures.rmse_m["3d"] == pytest.approx(0.2, rel=1e-4)
    assert figures.thu95_m == pytest.approx(0.2, rel=1e-4)
    assert figures.tvu95_m == pytest.approx(0.2, rel=1e-3)
    assert worst_case_m(found, 1.0) == pytest.approx(0.2, rel=1e-4)
    drawn = np.linalg.norm(sample_errors(found, SimulationSettings(samples=4000)), axis=1)
    assert drawn.min() == pytest.approx(0.2, rel=1e-3)
    assert drawn.max() == pytest.approx(0.2, rel=1e-3)
    [term] = [one for one in budget(found).ledger if one.kind == "underway"]
    assert (term.term, term.stage) == ("v_object*2d/c", "vessel")
    assert term.value_m == pytest.approx(0.2, rel=1e-12)
    case = load_text(text, tmp_path / "s.yaml")
    exact = recheck(case, selection_of(*_sole(case)))
    assert float(exact.total_m - exact.sensor_error_m) == pytest.approx(0.2, rel=1e-12)
    asked = CheckSettings(monte_carlo=False, explain=("ACC",))
    verdict = check_loaded(case, asked).to_json()
    assert "auv" not in dict(cautions(text, tmp_path)).get("rate", "")
    [row] = verdict["explained"]
    [step] = [one for one in row["steps"] if one["name"].startswith("travel_object")]
    assert eval(step["numbers"]) == pytest.approx(0.2, rel=1e-12)
    corrected = system(moored(tmp_path, ["travel_time"]), tmp_path)
    assert budget(corrected).systematic_m == 0.0


def test_the_sound_of_the_near_end_travels_less(tmp_path: Path) -> None:
    """Largest at the far end of the distances, in the ledger as in the figures."""
    one = spec({"distance": "30 m .. 75 m"}, platform=SAILING, ranging={"corrects": []})
    one = one.replace(', "distance": "75 m"', "", 1)
    found = system(one, tmp_path)
    assert budget(found).systematic_m == pytest.approx(0.2)
    assert error_statistics(found, seed=0).over_missions.rmse_m["3d"] == pytest.approx(
        0.2, rel=1e-4
    )
    near = load_text(one, tmp_path / "s.yaml")
    exact = recheck(near, selection_of(*_sole(near)))
    assert float(exact.total_m - exact.sensor_error_m) == pytest.approx(0.2, rel=1e-12)


def _sole(case: Case) -> Any:
    return sole_design(problem_of(case))


@pytest.mark.parametrize("role", ["position", "attitude"])
def test_a_chord_between_samples_is_off_by_a_known_distribution(role: str, tmp_path: Path) -> None:
    """x = 4 u (1 - u) of the largest, u uniform: mean square 8 / 15, quantile 1 - (1 - p)^2.

    a T^2 / 8 = 2 m/s2 (0.4 s)^2 / 8 = 4 cm; attitudes turn by that many radians, 75 m away.
    """
    key, most = ("acceleration", "2 m/s^2") if role == "position" else (
        "angular_acceleration", "0.02 rad/s^2")  # fmt: skip
    found = system(spec(platform={key: most}, **{role: {"rate": "2.5 Hz"}}), tmp_path)
    size = 0.04 if role == "position" else 2.0 * 75.0 * math.sin(0.5 * 4e-4)
    figures = error_statistics(found, seed=0).over_missions
    assert budget(found).systematic_m == pytest.approx(0.04 if role == "position" else 0.03)
    for axis in ("horizontal", "vertical", "3d"):
        assert figures.rmse_m[axis] == pytest.approx(size * math.sqrt(8 / 15), rel=2e-3)
    for value in (figures.thu95_m, figures.tvu95_m, figures.quantile95_3d_m):
        assert value == pytest.approx(size * (1 - 0.05**2), rel=2e-3)
    assert worst_case_m(found, 1.0) == pytest.approx(size, rel=3e-4)
    if role == "position":
        drawn = np.linalg.norm(sample_errors(found, SimulationSettings(samples=16384)), axis=1)
        for p in (0.2, 0.5, 0.9):
            assert np.quantile(drawn, p) == pytest.approx(size * (1 - (1 - p) ** 2), rel=0.02)


def test_acceleration_may_point_against_what_a_delay_does(tmp_path: Path) -> None:
    """A late stamp and braking add up: |e| = v tau + a T^2 / 8 is reached, never more."""
    late = {"error": {"distribution": "constant", "value": "-50 ms"}}
    one = json.loads(spec(platform={**SAILING, "acceleration": "2 m/s^2"},
                          position={"rate": "2.5 Hz"}))  # fmt: skip
    one["stages"][0]["position"]["timestamping"] = late
    found = system(json.dumps(one), tmp_path)
    figures = error_statistics(found, seed=0).over_missions
    assert figures.quantile95_3d_m == pytest.approx(0.1 + 0.04 * (1 - 0.05**2), rel=2e-3)
    assert worst_case_m(found, 1.0) == pytest.approx(0.14, rel=1e-4)


TRUE = {"primitives": ["arrival"], "cost": "0 EUR", "timeline": "utc",
        "error": {"distribution": "constant", "value": "0 s"}}  # fmt: skip


def drawn_sensor(rng: random.Random, role: str) -> Raw:
    return {
        "cost": rng.randint(1, 40),
        "s": rng.choice([0.01, 0.05, 0.2]),
        "rate": rng.choice([None, 1.0, 5.0]),
        "c": rng.choice([None, [], ["travel_time"]]),
        "type": rng.choice(["mbes", "lidar"]) if role == "ranging" else "unit",
    }


def drawn_spec(seed: int, folder: Path) -> tuple[str, Raw]:
    """A chain of a vessel and an AUV with a catalog of its own, and its figures in SI."""
    rng = random.Random(seed)
    stages, sensors = [], {}
    for index in range(rng.choice([1, 2])):
        figures = {
            "v": rng.choice([0.5, 2.0]), "w": rng.choice([0.05, 0.2]),
            "d": rng.choice([30.0, 90.0]), "a": rng.choice([None, 0.4, 2.0]),
            "alpha": rng.choice([None, 0.05]),
        }  # fmt: skip
        roles = ("position", "attitude", "ranging")[index > 0 :]
        figures["roles"] = {role: [drawn_sensor(rng, role) for _ in range(2)] for role in roles}
        stages += [figures]
    written = []
    for index, one in enumerate(stages):
        platform = {"v_max": f"{one['v']} m/s", "omega_max": f"{one['w']} rad/s",
                    "baseline": "0 m", "distance": f"{one['d']} m"}  # fmt: skip
        if one["a"]:
            platform["acceleration"] = f"{one['a']} m/s^2"
        if one["alpha"]:
            platform["angular_acceleration"] = f"{one['alpha']} rad/s^2"
        stage: Raw = {"name": f"s{index}", "gnss": True, "platform": platform}
        for role, listed in one["roles"].items():
            stage[role] = {"candidates": [f"{role}_{index}_{k}" for k in range(len(listed))]}
            for k, sensor in enumerate(listed):
                entry = {"modality": role, "cost": f"{sensor['cost']} EUR", "primitives": [],
                         "type": sensor["type"]}  # fmt: skip
                entry |= {
                    "position": {"sigma_position": f"{sensor['s']} m"},
                    "attitude": {"sigma_attitude": f"{sensor['s']} deg"},
                    "ranging": {"sigma_range": f"{sensor['s']} m", "sigma_bearing": "0.1 deg"},
                }[role]
                entry |= {} if sensor["rate"] is None else {"rate": f"{sensor['rate']} Hz"}
                entry |= {} if sensor["c"] is None else {"corrects": sensor["c"]}
                sensors[f"{role}_{index}_{k}"] = entry
        written.append(stage)
    (folder / "own.yaml").write_text(
        json.dumps({"sensors": sensors, "timestamping": {"true": TRUE}})
    )
    limit = rng.choice([1.0, 2.0, 4.0])
    return json.dumps({
        "syncline": 1, "timestamping": {"candidates": ["true"]}, "name": "drawn",
        "catalogs": ["own.yaml"], "objective": "cost",
        "requirements": [{"id": "ACC", "kind": "accuracy", "limit": f"{limit} m"},
                         {"id": "SYNC", "kind": "sync", "limit": 1e9}],
        "stages": written,
    }), {"stages": stages, "limit": limit}  # fmt: skip


def by_hand(stages: list[Raw], chosen: dict[tuple[int, str], Raw]) -> float:
    """The total of a design with true stamps: noise, sound under way, and what is interpolated."""
    total = 0.0
    for index, one in enumerate(stages):
        d, sonar = one["d"], chosen[index, "ranging"]
        attitude = chosen[index, "attitude"]
        total += sonar["s"] + math.sqrt(2.0) * 0.1 * DEGREE * d
        total += math.sqrt(3.0) * attitude["s"] * DEGREE * d
        if sonar["type"] == "mbes" and sonar["c"] == []:
            total += (one["v"] + d * one["w"]) * 2.0 * d / 1500.0
            located = stages[index + 1 :]
            total += located[0]["v"] * 2.0 * d / 1500.0 if located else 0.0
        if one["alpha"] and attitude["rate"]:
            total += one["alpha"] / attitude["rate"] ** 2 / 8.0 * d
        if index == 0:
            total += math.sqrt(3.0) * chosen[0, "position"]["s"]
            wait = 1.0 / (chosen[0, "position"]["rate"] or math.inf)
        else:
            before = chosen[index - 1, "ranging"]
            wait = 1.0 / (before["rate"] or math.inf)
            if before["type"] == "mbes":
                wait = max(wait, 2.0 * stages[index - 1]["d"] / 1500.0)
        total += (one["a"] or 0.0) * wait**2 / 8.0
    return total


def test_the_choice_charges_each_sensor_as_by_hand(tmp_path: Path) -> None:
    """Every road against all designs by hand; budget and recheck agree with it to 12 digits."""
    kept = 0
    for seed in range(12):
        text, raw = drawn_spec(seed, tmp_path)
        keys = [(i, role) for i, one in enumerate(raw["stages"]) for role in one["roles"]]
        found = []
        for picked in itertools.product(*(raw["stages"][i]["roles"][role] for i, role in keys)):
            chosen = dict(zip(keys, picked, strict=True))
            total = by_hand(raw["stages"], chosen)
            if total <= raw["limit"]:
                found.append((sum(one["cost"] for one in picked), total))
        case = load_text(text, tmp_path / "spec.yaml")
        problem = problem_of(case)
        for road in ("auto", "front", "milp") if seed < 4 else ("auto",):
            choice = choose(problem, road)  # type: ignore[arg-type]
            assert isinstance(choice, Choice) == bool(found), (seed, road)
            if not isinstance(choice, Choice):
                continue
            cost, total = min(found)
            exact = recheck(case, selection_of(problem, choice.design))
            assert exact.passed
            assert float(exact.cost or 0) == cost
            assert float(exact.total_m) == pytest.approx(total, rel=1e-12)
            made = budget(system_of(case, problem, choice.design))
            assert made.total_m == pytest.approx(total, rel=1e-12)
            assert math.fsum(term.value_m for term in made.ledger) == pytest.approx(total)
            kept += 1
    assert kept >= 8


def test_a_platform_that_moves_less_helps(tmp_path: Path) -> None:
    """The remedy counts the way of sound: (v + d w) 2 d / c = 0.4 m at 4 m/s, 0.1 m are allowed."""
    text = spec(platform={"v_max": "4 m/s"}, ranging={"corrects": []}).replace('"9 m"', '"10 cm"')
    text = text.replace(
        '"sensor": {"modality": "ranging"', '"sensor": {"name": "sonar", "modality": "ranging"'
    )
    verdict = check_loaded(load_text(text, tmp_path / "s.yaml"), CheckSettings(monte_carlo=False))
    row = next(one for one in verdict.to_json()["requirements"] if one["id"] == "ACC")
    assert row["status"] == "fail"
    assert row["value"] == pytest.approx(0.4, abs=1e-5)


def cautions(text: str, folder: Path) -> list[tuple[str, str]]:
    verdict = check_loaded(load_text(text, folder / "s.yaml"), CheckSettings(monte_carlo=False))
    return [(one["key"], one["message"]) for one in verdict.to_json()["warnings"] if one.get("key")]


def test_what_is_not_told_is_no_charge_but_said(tmp_path: Path) -> None:
    silent = spec(platform={**SAILING, "acceleration": "2 m/s^2"})
    found = system(silent, tmp_path)
    assert budget(found).systematic_m == 0.0
    said = dict(cautions(silent, tmp_path))
    assert "look up whether the maker corrects" in said["corrects"]
    assert "vessel accelerates between its samples" in said["rate"]
    charged = dict(cautions(spec(platform=SAILING, ranging={"corrects": []}), tmp_path))
    assert "the ledger has it" in charged["corrects"]
    assert "rate" not in charged
    strict = {"spec": {"strict_facts": True}, "platform": SAILING}
    for facts, charge in ((None, 0.2), ([], 0.2), (["travel_time"], 0.0)):
        told = {} if facts is None else {"corrects": facts}
        sonar = {"reach": {"max": "200 m"}, "medium": "water", **told}
        found = system(spec({"medium": "water"}, **strict, ranging=sonar), tmp_path)
        assert budget(found).systematic_m == pytest.approx(charge)
        case = load_text(spec({"medium": "water"}, **strict, ranging=sonar), tmp_path / "s.yaml")
        exact = recheck(case, selection_of(*_sole(case)))
        assert float(exact.total_m - exact.sensor_error_m) == pytest.approx(charge)
        assert exact.passed
    strict["platform"] = {**SAILING, "acceleration": "2 m/s^2"}
    case = load_text(spec(**strict), tmp_path / "s.yaml")
    exact = recheck(case, selection_of(*_sole(case)))
    assert "does not tell its rate" in next(one.note for one in exact.requirements if one.note)


def test_wrong_accelerations_are_refused_where_they_stand(tmp_path: Path) -> None:
    text = (
        "syncline: 1\nname: n\nrequirements: [{id: A, kind: accuracy, limit: 1 m}]\n"
        "stages:\n  - name: s\n    platform: {use: auv, angular_acceleration: 3 m/s^2}\n"
        "    position: {sensor: ublox_f9p_rtk}\n"
    )
    with pytest.raises(BadInput, match=r"s\.yaml:6:48: .*angular_acceleration: wrong dimension"):
        load_text(text, tmp_path / "s.yaml")


@pytest.mark.parametrize("kind", ["rmse, axis: vertical", "tvu", "worst_case"])
@pytest.mark.parametrize("why", ["echo", "bend"])
def test_one_that_moves_between_its_samples_rules_out_no_other(
    kind: str, why: str, tmp_path: Path
) -> None:
    """The cheap candidate fails by what moves while its sound is under way, or between samples; the
    dear one stands as it does alone (the rest was held against the cheap one's term: infeasible).
    """
    told: dict[str, Raw] = {
        "echo": {"cheap": {"corrects": []}, "dear": {"corrects": ["travel_time"]}},
        "bend": {"cheap": {"rate": "1 Hz"}, "dear": {"rate": "20 Hz"}},
    }
    role = {"echo": "ranging", "bend": "position"}[why]
    noise = {"sigma_position": "1 cm"} if role == "position" else {"sigma_range": "2 cm"}
    beam = {} if role == "position" else {"sigma_bearing": "0.02 deg", "type": "usbl"}
    catalog = {
        name: {"modality": role, "primitives": [], "mass": "1 kg", "power": "1 W", "source": "x",
               "cost": cost, **noise, **beam, **told[why][name]}
        for name, cost in (("cheap", "100 EUR"), ("dear", "900 EUR"))
    }  # fmt: skip
    (tmp_path / "c.yaml").write_text(json.dumps({"sensors": catalog}), "utf-8")
    moving = {"v_max": "8 m/s", "acceleration": "9 m/s^2"}
    limit = {"id": "F", "kind": kind.partition(",")[0], "limit": "0.5 m"}
    limit |= {"axis": "vertical"} if "axis" in kind else {}
    free = {"cost": "0 EUR", "mass": "0 kg", "power": "0 W", "source": "x"}
    whole = json.loads(spec(platform=moving, position=free, attitude=free, ranging=free))
    whole |= {"catalogs": ["c.yaml"], "requirements": [*whole["requirements"], limit]}

    def with_candidates(*names: str) -> Any:
        held = {"candidates": list(names)} if len(names) > 1 else {"sensor": names[0]}
        whole["stages"][0][role] = {**held, **STILL}
        case = load_text(json.dumps(whole), tmp_path / "s.yaml")
        return check_loaded(case, CheckSettings(monte_carlo=False))

    assert with_candidates("cheap").verdict == "fails"
    alone, both = with_candidates("dear"), with_candidates("cheap", "dear")
    assert alone.verdict == both.verdict == "meets"
    assert alone.design is not None
    assert both.design is not None
    assert both.design.cost == alone.design.cost == 900.0
