"""Why nothing meets a spec: reasons and remedies, each remedy tried here once more."""

from __future__ import annotations

import json
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest

from syncline_design.choice.decide import choose
from syncline_design.choice.explain import explain
from syncline_design.choice.outcome import Choice, Explanation, Fix, Infeasible
from syncline_design.choice.parts import is_feasible, solve
from syncline_design.choice.problem import build_problem
from syncline_design.choice.table import with_limits
from syncline_design.choice.variations import with_methods
from syncline_design.choice.written import rounded
from syncline_design.spec.case import Case
from syncline_design.spec.load import load, load_text

ROOT = Path(__file__).parent.parent

SPEC = """\
syncline: 1
name: Two sensors each
requirements:
  - {{id: ACC, kind: accuracy, limit: {accuracy}}}
  - {{id: COST, kind: cost, limit: {cost}}}
  - {{id: MASS, kind: mass, limit: 10 kg}}
stages:
  - name: uav
    platform: {{name: wing, v_max: {speed}, omega_max: 20 deg/s, distance: 50 m, baseline: 1 m}}
    position:
      sensor: {{modality: position, sigma_position: 1 cm, primitives: [pps], cost: 800 EUR,
               mass: 0.2 kg}}
    attitude: {{candidates: [cheap_ins, good_ins]}}
    ranging:
      sensor: {{modality: ranging, sigma_range: 1 cm, sigma_bearing: 0.01 deg, primitives: [pps],
               cost: 30000 EUR, mass: 2 kg}}
timestamping: {{candidates: [{methods}]}}
catalogs: [ins.yaml]
"""
INS = """\
sensors:
  cheap_ins: {modality: attitude, sigma_attitude: 0.1 deg, primitives: [pps], cost: 3000 EUR,
              mass: 1 kg}
  good_ins: {modality: attitude, sigma_attitude: 0.01 deg, primitives: [pps], cost: 20000 EUR,
             mass: 1 kg}
"""


def spec(folder: Path, **changes: str) -> Case:
    values = {"accuracy": "10 cm", "cost": "60000 EUR", "speed": "20 m/s", "methods": "gpio"}
    (folder / "ins.yaml").write_text(INS)
    path = folder / "spec.yaml"
    path.write_text(SPEC.format(**(values | changes)))
    return load(path)


def explained(loaded: Case) -> Explanation:
    problem = build_problem(loaded)
    assert isinstance(choose(problem), Infeasible)
    return explain(loaded, problem)


def fix_of(found: Explanation, kind: str) -> Fix:
    return next(fix for fix in found.fixes if fix.kind == kind)


def test_feasible_to_begin_with(tmp_path: Path) -> None:
    assert isinstance(choose(build_problem(spec(tmp_path))), Choice)


def test_conflict_of_two_is_named_with_its_lines_and_is_minimal(tmp_path: Path) -> None:
    found = explained(spec(tmp_path, cost="40000 EUR"))
    assert [(m.id, m.line) for m in found.conflict.requirements] == [("ACC", 4), ("COST", 5)]
    assert found.conflict.minimal
    assert "ACC (line 4) and COST (line 5) cannot hold together" in "\n".join(found.text)


def test_each_member_of_the_conflict_left_out_makes_it_feasible(tmp_path: Path) -> None:
    problem = build_problem(spec(tmp_path, cost="40000 EUR"))
    for changes in ({"accuracy_m": None}, {"cost": None}):
        limits = replace(problem.limits, **changes)  # type: ignore[arg-type]
        assert is_feasible(with_limits(problem, limits))
    limits = replace(problem.limits, mass=None)
    assert not is_feasible(with_limits(problem, limits))


def with_mass(folder: Path, mass: str, **changes: str) -> Case:
    text = spec(folder, **changes).text.replace("limit: 10 kg", f"limit: {mass}")
    return load_text(text, folder / "spec.yaml")


def test_two_conflicts_are_both_named_and_lifted_together(tmp_path: Path) -> None:
    """Neither budget alone is the reason, so no single change helps; both do, and less does not."""
    found = explained(with_mass(tmp_path, "2 kg", cost="20000 EUR"))
    conflicts = [{m.id for m in members} for members in found.conflicts]
    assert sorted(conflicts, key=str) == [{"COST"}, {"MASS"}]
    assert found.fixes == ()
    (together,) = found.joint_fixes
    changed = {fix.requirement: fix.to for fix in together}
    cost, mass = changed["COST"], changed["MASS"]
    assert cost is not None
    assert mass is not None
    for less_cost, less_mass, expected in (
        (0.0, 0.0, Choice), (1.0, 0.0, Infeasible), (0.0, 0.02, Infeasible),
    ):  # fmt: skip
        other = with_mass(tmp_path, f"{mass - less_mass!r} kg", cost=f"{cost - less_cost!r} EUR")
        assert isinstance(choose(build_problem(other)), expected)
    text = "\n".join(found.text)
    assert "Apart from that, " in text
    assert " and ".join(fix.text for fix in together) in text


def test_fixes_are_the_smallest_and_each_holds(tmp_path: Path) -> None:
    """The remedy makes the spec feasible, and a slightly smaller one does not."""
    found = explained(spec(tmp_path, cost="40000 EUR"))
    cost = fix_of(found, "cost")
    assert (cost.from_, cost.requirement) == (40000.0, "COST")
    assert cost.to is not None
    for amount, expected in ((cost.to, Choice), (cost.to - 1, Infeasible)):
        other = spec(tmp_path, cost=f"{amount:.0f} EUR")
        assert isinstance(choose(build_problem(other)), expected)
    accuracy = fix_of(found, "accuracy")
    assert accuracy.to is not None
    for share, expected in ((1.0, Choice), (0.99, Infeasible)):
        other = spec(tmp_path, cost="40000 EUR", accuracy=f"{accuracy.to * share!r} m")
        assert isinstance(choose(build_problem(other)), expected)


def test_text_keeps_the_units_of_the_user(tmp_path: Path) -> None:
    found = explained(spec(tmp_path, cost="40000 EUR"))
    texts = [fix.text for fix in found.fixes]
    assert any(t.startswith("ACC from 10 cm to ") and t.endswith(" cm") for t in texts)
    assert any(t.startswith("COST by ") and "from 40 000 EUR to " in t for t in texts)


def test_platform_fix_holds_and_is_the_largest(tmp_path: Path) -> None:
    """Arrival stamps at 16 ms: only a slow vehicle can live with them."""
    tight = {"speed": "20 m/s", "methods": "gpio_rt", "cost": "40000 EUR", "accuracy": "0.3 m"}
    loaded = spec(tmp_path, **(tight | {"accuracy": "0.2 m"}))
    if isinstance(choose(build_problem(loaded)), Choice):
        loaded = spec(tmp_path, **(tight | {"accuracy": "0.195 m"}))
    found = explained(loaded)
    platform = [fix for fix in found.fixes if fix.kind == "platform" and "speed" in fix.text]
    for fix in platform:
        assert fix.to is not None
        accuracy = loaded.spec.requirements[0].limit.text  # type: ignore[attr-defined]
        for share, expected in ((1.0, Choice), (1.02, Infeasible)):
            text = {"speed": f"{fix.to * share!r} m/s", "accuracy": accuracy}
            other = spec(tmp_path, **(tight | text))
            assert isinstance(choose(build_problem(other)), expected)
    assert platform


def test_role_without_options_names_the_nearest_and_what_would_serve(tmp_path: Path) -> None:
    found = explained(spec(tmp_path, methods="arrival"))
    gap = found.roles_without_options[0]
    assert (gap.stage, gap.role) == ("uav", "position")
    assert gap.nearest is not None
    assert gap.misses_by == pytest.approx(0.016 * 20.0 / (0.01 * 3**0.5))
    assert [m.kind for m in found.conflict.requirements] == ["sync"]
    assert found.conflict.requirements[0].id is None  # implied: the spec has no sync requirement


def test_role_whose_signals_no_method_serves(tmp_path: Path) -> None:
    found = explained(spec(tmp_path, methods="ptp"))
    assert all(gap.nearest is None for gap in found.roles_without_options)
    assert "ptp serves network" in found.roles_without_options[0].text
    assert found.conflict.requirements == ()


def test_sync_fix_is_the_least_ratio(tmp_path: Path) -> None:
    text = (ROOT / "specs" / "infeasible_no_option.yaml").read_text()
    loaded = load_text(text, ROOT / "specs" / "infeasible_no_option.yaml")
    fix = fix_of(explained(loaded), "sync")
    problem = build_problem(loaded)
    assert fix.to is not None
    for limit, expected in ((fix.to, True), (fix.to * 0.99, False)):
        limits = replace(problem.limits, sync=limit)
        assert is_feasible(with_limits(problem, limits)) is expected


def test_method_fixes_hold_and_others_would_not_be_cheaper() -> None:
    loaded = load(ROOT / "specs" / "infeasible_no_option.yaml")
    fixes = [fix for fix in explained(loaded).fixes if fix.kind == "timestamping"]
    assert fixes
    costs = {}
    for name in loaded.catalog.timestamping:
        other = with_methods(loaded, 0, "ranging", ("arrival_ethernet", name))
        sums = solve(build_problem(other))
        if sums is not None:
            costs[name] = sums.cost
    offered = [fix.text.rsplit(" ", 1)[1] for fix in fixes]
    assert set(offered) <= set(costs)
    assert [costs[name] for name in offered] == sorted(costs.values())[: len(offered)]


@pytest.mark.parametrize("name", ["infeasible_example", "infeasible_no_option"])
def test_shipped_infeasible_specs_read_like_a_colleague(name: str) -> None:
    loaded = load(ROOT / "specs" / f"{name}.yaml")
    found = explained(loaded)
    data: dict[str, Any] = json.loads(json.dumps(found.to_json()))
    assert data["fixes"]
    assert all(fix["proven"] for fix in data["fixes"])
    assert data["conflict"]["minimal"]
    text = "\n".join(found.text)
    assert text.startswith("No design meets this spec.")
    for word in ("HiGHS", "solver", "status", "nan", "None", "Fraction"):
        assert word not in text
    for member in found.conflict.requirements:
        if member.line is not None:
            line = loaded.text.splitlines()[member.line - 1]
            assert str(member.id) in line


@pytest.mark.parametrize(
    ("value", "up", "expected"),
    [(0.29453, True, 0.295), (0.29453, False, 0.294), (12345.0, True, 12400.0), (0.5, True, 0.5)],
)
def test_rounding_goes_the_safe_way(value: float, up: bool, expected: float) -> None:
    assert float(rounded(Fraction(value), up=up)) == expected
