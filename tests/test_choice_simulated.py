"""Requirements on simulated quantiles in the choice: what is listed meets them, or says it is open.

A vehicle with a position sensor alone and perfect stamps errs by a normal vector: the quantile of
its length is sigma times that of chi with three degrees of freedom (scipy), so which sensor passes
is known without simulation.  Limits keep 3 % away from the quantiles (a million samples tell 0.3 %
apart), except where a test wants the opposite.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest
import yaml
from scipy.stats import chi

from syncline_design.choice.table import Design
from syncline_design.choice.tolerance import ToleranceVerdict, tolerance_verdict
from syncline_design.report.on_choice import on_choice
from syncline_design.report.optimizations import render_optimize
from syncline_design.report.render_console import console
from syncline_design.spec.case import Case
from syncline_design.spec.load import load_text
from syncline_design.verdict import acceptance, settings
from syncline_design.verdict import optimize as optimization
from syncline_design.verdict.acceptance import Simulations
from syncline_design.verdict.optimize import (
    OptimizeSettings,
    optimize,
)
from syncline_design.verdict.verify import CheckSettings, check_loaded

FACTOR = {q: float(chi.ppf(q, 3)) for q in (0.5, 0.95, 0.997)}
SENSORS = {  # sigma [m], cost
    "a": (0.30, 100),
    "b": (0.20, 200),
    "c": (0.15, 150),
    "d": (0.10, 900),
    "e": (0.05, 4000),
    "f": (0.04, 3000),
}


def spec(folder: Path, requirements: list[dict[str, Any]], **changes: Any) -> Case:
    sensors = {
        name: {
            "modality": "position",
            "sigma_position": f"{sigma} m",
            "primitives": [],
            "cost": f"{cost} EUR",
        }
        for name, (sigma, cost) in (SENSORS | changes.pop("sensors", {})).items()
    }
    stamping = {
        "primitives": ["arrival"],
        "timeline": "utc",
        "cost": "0 EUR",
        "error": {"distribution": "constant", "value": "0 s"},
    }
    own = {"sensors": sensors, "timestamping": {"bench": stamping}}
    (folder / "own.yaml").write_text(yaml.safe_dump(own))
    data = {
        "syncline": 1,
        "name": "position alone",
        "catalogs": ["own.yaml"],
        "requirements": requirements,
        "stages": [
            {
                "name": "boat",
                "platform": {
                    "v_max": "1 m/s",
                    "omega_max": "1 deg/s",
                    "distance": "1 m",
                    "baseline": "1 m",
                },
                "position": {"candidates": sorted(sensors)},
            }
        ],
        "timestamping": {"candidates": ["bench"]},
        "monte_carlo": {"samples": 20000},
        **changes,
    }
    return load_text(yaml.safe_dump(data, sort_keys=False), folder / "spec.yaml")


def simulated(limit: float, quantile: float = 0.95, name: str = "MC") -> dict[str, Any]:
    return {"id": name, "kind": "monte_carlo", "quantile": quantile, "limit": f"{limit!r} m"}


def sums(kind: str, limit: str, name: str) -> dict[str, Any]:
    return {"id": name, "kind": kind, "limit": limit}


def position(design: dict[str, Any]) -> str:
    return str(design["stages"][0]["roles"]["position"]["sensor"])


def passing(limit: float, quantile: float = 0.95) -> list[str]:
    return [n for n, (sigma, _) in SENSORS.items() if FACTOR[quantile] * sigma <= limit]


def plain_front(names: list[str]) -> list[tuple[float, float]]:
    points: list[tuple[float, float]] = []
    for cost, sigma in sorted((float(SENSORS[n][1]), SENSORS[n][0]) for n in names):
        if not points or math.sqrt(3) * sigma < points[-1][1]:
            points.append((cost, math.sqrt(3) * sigma))
    return points


@pytest.mark.parametrize(
    ("limit", "quantile"), [(0.60, 0.95), (0.45, 0.95), (0.135, 0.95), (0.40, 0.997), (0.17, 0.5)]
)
def test_everything_that_is_listed_meets_the_simulated_limit(
    limit: float, quantile: float, tmp_path: Path
) -> None:
    loaded = spec(tmp_path, [simulated(limit, quantile)])
    names = passing(limit, quantile)
    cheapest = min(names, key=lambda n: SENSORS[n][1])
    verdict = check_loaded(loaded, CheckSettings()).to_json()
    assert (verdict["verdict"], position(verdict["design"])) == ("meets", cheapest)
    front = [(p["cost"], p["error_m"]) for p in verdict["choice"]["front"]]
    assert front == [(c, pytest.approx(e, rel=1e-12)) for c, e in plain_front(names)]
    steps = [(s["cost"], s["tightest_m"]) for s in verdict["choice"]["staircase"]]
    assert steps == front
    listed = {position(d["design"]) for d in verdict["choice"]["next_best"]}
    assert listed == set(names) - {cheapest}
    found = optimize(loaded, OptimizeSettings(count=9, pareto=True)).result.to_json()
    assert {position(d["design"]) for d in found["designs"]} == set(names)
    assert [(p["cost"], p["error_m"]) for p in found["front"]] == front


def test_a_better_design_that_fails_is_said_to_be_passed_over(tmp_path: Path) -> None:
    verdict = check_loaded(spec(tmp_path, [simulated(0.30)]), CheckSettings()).to_json()
    assert verdict["choice"]["proof"]["passed_over"] == 3
    assert [w["code"] for w in verdict["warnings"]].count("passed-over") == 1


def test_no_design_passes_is_infeasible_in_check_and_optimize(tmp_path: Path) -> None:
    loaded = spec(tmp_path, [simulated(0.10), sums("accuracy", "5 m", "ACC")])
    verdict = check_loaded(loaded, CheckSettings())
    found = optimize(loaded, OptimizeSettings())
    assert (verdict.verdict, verdict.exit_code, found.result.exit_code) == ("infeasible", 1, 1)
    data = found.result.to_json()
    assert data["verdict"] == "infeasible"
    assert data["designs"] == []
    for why in (verdict.to_json()["infeasibility"], data["infeasibility"]):
        assert why["conflict"] == {
            "requirements": [{"id": "MC", "kind": "monte_carlo", "line": 6}],
            "minimal": True,
            "each_suffices": True,
        }
    status = {r["id"]: r["status"] for r in verdict.to_json()["requirements"]}
    assert status["MC"] == "fail"


def fix_of(verdict: dict[str, Any], name: str) -> dict[str, Any]:
    (fix,) = [f for f in verdict["infeasibility"]["fixes"] if f["requirement"] == name]
    return dict(fix)


def test_a_simulated_limit_is_moved_as_little_as_needed(tmp_path: Path) -> None:
    fix = fix_of(check_loaded(spec(tmp_path, [simulated(0.10)]), CheckSettings()).to_json(), "MC")
    least = FACTOR[0.95] * SENSORS["f"][0]
    assert least * 0.99 < fix["to"] < least * 1.03
    written = fix["text"].rsplit(" to ", 1)[1]
    again = spec(tmp_path, [simulated(0.1) | {"limit": written}])
    assert check_loaded(again, CheckSettings()).to_json()["verdict"] == "meets"


def test_a_conflict_of_cost_and_simulation_names_both(tmp_path: Path) -> None:
    """0.30 m needs d, e or f; 800 EUR buys a, b or c."""
    loaded = spec(tmp_path, [simulated(0.30), sums("cost", "800 EUR", "COST")])
    verdict = check_loaded(loaded, CheckSettings()).to_json()
    why = verdict["infeasibility"]
    assert {m["id"] for m in why["conflict"]["requirements"]} == {"MC", "COST"}
    assert fix_of(verdict, "COST")["to"] == 900
    least = FACTOR[0.95] * SENSORS["c"][0]
    assert least * 0.99 < fix_of(verdict, "MC")["to"] < least * 1.03
    assert any("without any one of them a design exists" in line for line in why["text"])
    for fixed in ([simulated(0.30), sums("cost", "900 EUR", "COST")],):
        assert check_loaded(spec(tmp_path, fixed), CheckSettings()).to_json()["verdict"] == "meets"


def test_two_simulated_requirements_each_count(tmp_path: Path) -> None:
    """The median lets c pass, the 99.7 % quantile asks for d."""
    median, tail = FACTOR[0.5] * 0.16, FACTOR[0.997] * 0.11
    loaded = spec(tmp_path, [simulated(median, 0.5, "MED"), simulated(tail, 0.997, "TAIL")])
    verdict = check_loaded(loaded, CheckSettings()).to_json()
    assert position(verdict["design"]) == "d"
    tight = spec(
        tmp_path, [simulated(median, 0.5, "MED"), simulated(0.03 * FACTOR[0.997], 0.997, "TAIL")]
    )
    why = check_loaded(tight, CheckSettings()).to_json()["infeasibility"]
    assert [m["id"] for m in why["conflict"]["requirements"]] == ["TAIL"]


def test_a_design_that_its_samples_leave_open_carries_the_requirement(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The limit is the cheap sensor's own quantile to 1e-9: no number of samples decides.

    So it may as well be given up after 300 000 of them.
    """
    monkeypatch.setattr(acceptance, "DEFAULT_CAP", 300_000)
    limit = FACTOR[0.95] * 0.15 * (1 + 1e-9)
    loaded = spec(tmp_path, [simulated(limit)], sensors={"c": (0.15, 50)})
    verdict = check_loaded(loaded, CheckSettings()).to_json()
    assert verdict["verdict"] == "meets"
    assert position(verdict["design"]) == "d"
    marked = {position(d["design"]): d.get("undecided") for d in verdict["choice"]["next_best"]}
    assert marked == {"c": ["MC"], "e": None, "f": None}
    points = {position(p["design"]): p.get("undecided") for p in verdict["choice"]["front"]}
    assert points == {"c": ["MC"], "d": None, "f": None}
    printed = console(on_choice(optimize(loaded, OptimizeSettings(count=9, pareto=True))))
    of_c = [line for line in printed.splitlines() if " c by " in line]
    assert len(of_c) == 2  # among the designs and on the front
    assert all(line.endswith("MC undecided") for line in of_c)
    assert printed.count("undecided") == 2


def test_nothing_but_an_open_design_is_no_verdict(tmp_path: Path) -> None:
    limit = FACTOR[0.95] * SENSORS["f"][0] * (1 + 1e-9)
    found = optimize(spec(tmp_path, [simulated(limit)]), OptimizeSettings())
    data = found.result.to_json()
    assert (data["verdict"], found.result.exit_code) == ("indeterminate", 3)
    assert data["designs"][0]["undecided"] == ["MC"]


def test_a_known_effect_decides_in_simulation_too(tmp_path: Path) -> None:
    """Noise twice the datasheet's: the quantile doubles, and another sensor is chosen."""
    effects = [{"effect": "noise_understated", "sensor": "position", "parameters": {"factor": 2.0}}]
    limit = 2.0 * FACTOR[0.95] * 0.15 * 1.05
    loaded = spec(tmp_path, [simulated(limit)], effects=effects)
    verdict = check_loaded(loaded, CheckSettings()).to_json()
    assert position(verdict["design"]) == "c"
    assert {position(p["design"]) for p in verdict["choice"]["front"]} == {"c", "d", "f"}


def test_measured_figures_flip_the_choice_by_simulation(tmp_path: Path) -> None:
    """c just keeps the limit: 20 % more noise and it fails, as nothing but simulation says."""
    loaded = spec(tmp_path, [simulated(FACTOR[0.95] * 0.15 * 1.05)])
    data = optimize(loaded, OptimizeSettings()).result.to_json()
    flips = {one["figure"]: one for one in data["measure_next"]}
    assert "c sigma_position" in flips
    assert flips["c sigma_position"]["at"] == pytest.approx(0.18)


def test_the_ledger_ends_where_simulation_fails(tmp_path: Path) -> None:
    """c's noise may grow until its quantile is the limit; accuracy would allow far more."""
    requirements = [simulated(FACTOR[0.95] * 0.18), sums("accuracy", "3 m", "ACC")]
    found = optimize(spec(tmp_path, requirements), OptimizeSettings())
    assert found.result.slack is not None
    (row,) = [row for row in found.result.slack if row.term == "position sensor error"]
    assert row.limited_by == "monte_carlo"
    assert row.fails_at == pytest.approx(math.sqrt(3) * 0.18, rel=0.03)
    assert row.payload_changes_at == pytest.approx(row.fails_at, rel=0.03)


WAIVER = {"reason": "the buoy is out", "expires": "2999-01-01"}


@pytest.mark.parametrize(("most", "nearest"), [(9999, "f"), (950, "d"), (200, "c")])
def test_a_waived_simulated_requirement_is_missed_by_as_little_as_can_be(
    most: int, nearest: str, tmp_path: Path
) -> None:
    """The sensor of the least noise that the money buys; f is as good as it gets."""
    limits = [simulated(0.001) | {"waiver": WAIVER}, sums("cost", f"{most} EUR", "COST")]
    verdict = check_loaded(spec(tmp_path, limits), CheckSettings()).to_json()
    assert verdict["verdict"] == "meets"
    assert position(verdict["design"]) == nearest
    missed = {row["id"]: row["status"] for row in verdict["requirements"]}
    assert missed == {"SYNC": "pass", "MC": "fail", "COST": "pass"}


def test_a_waived_simulated_requirement_that_can_be_kept_is_kept(tmp_path: Path) -> None:
    loaded = spec(tmp_path, [simulated(0.45) | {"waiver": WAIVER}])
    verdict = check_loaded(loaded, CheckSettings()).to_json()
    assert position(verdict["design"]) == "c"
    assert any("the waiver is not needed" in one["message"] for one in verdict["warnings"])


def test_a_waived_limit_is_held_with_the_probability_that_is_asked_for(tmp_path: Path) -> None:
    """Nine figures of ten: of p those to 0.28 m an axis, of q, dearer and worse at best, 0.24 m."""
    sensors: dict[str, Any] = dict.fromkeys(SENSORS, (0.5, 1))
    sensors |= {"p": ("0.10 m .. 0.30", 5), "q": ("0.15 m .. 0.25", 9)}
    limit = sums("accuracy", "0.20 m", "ACC") | {"waiver": WAIVER}
    loaded = spec(tmp_path, [limit], sensors=sensors, choose_for=0.9)
    verdict = check_loaded(loaded, CheckSettings(monte_carlo=False)).to_json()
    assert (verdict["verdict"], position(verdict["design"])) == ("meets", "q")
    rows = {row["id"]: row["status"] for row in verdict["requirements"]}
    assert rows == {"SYNC": "pass", "ACC": "fail", "CHOOSE_FOR": "pass"}


def tolerances_of_c(loaded: Case) -> ToleranceVerdict:
    build = Simulations().problem_of
    problem = build(loaded)
    place = [option.sensor for option in problem.roles[0].options].index("c")
    return tolerance_verdict(loaded, problem, Design((place,), (0,)), build)


@pytest.mark.parametrize(
    ("at", "factor", "word"),
    [(0.15, 1.0, "sometimes"), (0.17, 1.0, "sometimes"), (0.18, 1.0, "always"),
     (0.17, 2.0, "sometimes"), (0.18, 2.0, "always")],
)  # fmt: skip
def test_the_word_on_tolerances_asks_simulation(
    at: float, factor: float, word: str, tmp_path: Path
) -> None:
    """A sensor of 12 to 18 cm: it always passes where the quantile of 18 cm does (and 3 % more)."""
    effects = [
        {"effect": "noise_understated", "sensor": "position", "parameters": {"factor": factor}}
    ]
    limit = factor * FACTOR[0.95] * at * 1.03
    data = {"c": ("0.12 m .. 0.18", 1)}
    loaded = spec(tmp_path, [simulated(limit)], sensors=data, effects=effects)
    found = tolerances_of_c(loaded)
    assert found.passes == word
    assert found.deciding == (("c sigma_position",) if word != "always" else ())


@pytest.mark.parametrize(
    ("share", "word"), [(1.02, "sometimes"), (1.19, "sometimes"), (1.22, "always")]
)
def test_the_word_on_tolerances_counts_an_effect_at_the_same_end(
    share: float, word: str, tmp_path: Path
) -> None:
    """Noise three times the datasheet's, 12 to 18 cm: between 0.36 and 0.54 m per axis in all."""
    effects = [{"effect": "noise_understated", "sensor": "position", "parameters": {"factor": 3.0}}]
    limit = f"{3 * 0.15 * math.sqrt(3) * share!r} m"
    data = {"c": ("0.12 m .. 0.18", 1)}
    loaded = spec(tmp_path, [sums("accuracy", limit, "A")], sensors=data, effects=effects)
    assert tolerances_of_c(loaded).passes == word


def test_lists_that_simulation_cuts_short_say_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Six sensors pass; with three simulated, the lists hold no more than three."""

    def few(*given: Any) -> Simulations:
        return Simulations(*given, most=3)

    loaded = spec(tmp_path, [simulated(0.9)])
    whole = optimize(loaded, OptimizeSettings(count=9, pareto=True, report=True))
    assert "gave up" not in console(on_choice(whole))
    assert whole.result.gave_up == ()
    monkeypatch.setattr(optimization, "Simulations", few)
    monkeypatch.setattr(settings, "Simulations", few)
    found = optimize(loaded, OptimizeSettings(count=9, pareto=True, report=True))
    data = found.result.to_json()
    assert len(data["designs"]) <= 3
    assert {"front", "next best designs"} <= set(data["gave_up"])
    assert "not complete: front, next best designs" in console(on_choice(found))
    assert "not complete: front, next best designs" in render_optimize("html", found)
    assert "gave up" not in render_optimize("html", whole)
    verdict = check_loaded(loaded, CheckSettings()).to_json()
    assert verdict["verdict"] == "meets"
    (said,) = [w["message"] for w in verdict["warnings"] if w["code"] == "search-gave-up"]
    assert "front, next best designs" in said
