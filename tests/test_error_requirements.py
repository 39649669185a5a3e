"""Requirements on figures of the error: worst case, THU, TVU, root mean square, quantile."""

from __future__ import annotations

import itertools
import json
import math
from pathlib import Path

import jsonschema
import pytest
from scipy.stats import chi2

from syncline_design.report.schema import json_schema
from syncline_design.report.verdict_words import kind_text
from syncline_design.spec.load import BadInput, load_text
from syncline_design.verdict.no_design import unmet
from syncline_design.verdict.tree import RequirementResult, Verdict
from syncline_design.verdict.verify import CheckSettings, check_loaded

SIGMA = 0.02


def boat(requirement: str) -> str:
    """A position sensor alone with isotropic noise and a true clock."""
    return f"""
syncline: 1
name: boat
requirements:
  - {requirement}
stages:
  - name: usv
    platform: {{v_max: 2 m/s, omega_max: 10 deg/s, distance: 40 m, baseline: 0 m}}
    position:
      sensor: {{modality: position, sigma_position: 2 cm, primitives: []}}
      timestamping: {{error: {{distribution: constant, value: 0 s}}}}
"""


def checked(text: str) -> Verdict:
    return check_loaded(load_text(text, "boat.yaml"), CheckSettings(monte_carlo=False))


def row(text: str) -> RequirementResult:
    found = checked(text)
    return next(one for one in found.requirements if one.id == "R")


KINDS = {
    "{id: R, kind: thu, limit: LIMIT}": math.sqrt(chi2.ppf(0.95, 2)),
    "{id: R, kind: thu, confidence: 0.5, limit: LIMIT}": math.sqrt(chi2.ppf(0.5, 2)),
    "{id: R, kind: tvu, limit: LIMIT}": math.sqrt(chi2.ppf(0.95, 1)),
    "{id: R, kind: rmse, axis: horizontal, limit: LIMIT}": math.sqrt(2.0),
    "{id: R, kind: rmse, axis: vertical, limit: LIMIT}": 1.0,
    "{id: R, kind: rmse, axis: 3d, limit: LIMIT}": math.sqrt(3.0),
    "{id: R, kind: quantile, of: 3d, p: 0.99, limit: LIMIT}": math.sqrt(chi2.ppf(0.99, 3)),
    "{id: R, kind: quantile, p: 0.95, of: vertical, limit: LIMIT}": math.sqrt(chi2.ppf(0.95, 1)),
    "{id: R, kind: worst_case, limit: LIMIT}": 3.0 * math.sqrt(3.0),
}


@pytest.mark.parametrize("requirement", KINDS)
def test_each_kind_against_its_closed_form(requirement: str) -> None:
    """Isotropic noise: the quantiles of chi; just above they pass, just below they fail."""
    exact = KINDS[requirement] * SIGMA
    for factor, status in ((1.002, "pass"), (0.998, "fail")):
        found = row(boat(requirement.replace("LIMIT", f"{factor * exact:.9f} m")))
        assert found.status == status
        assert found.value == pytest.approx(exact, rel=5e-4)
        assert found.at_distance_m == 40.0


@pytest.mark.parametrize(
    ("limit", "expected"),
    [
        ("{a: 0.25 m, b: 0.02}", math.hypot(0.25, 0.8)),
        ("{a: 0.15 m, b: 0.0075, of: 80 m}", math.hypot(0.15, 0.6)),
        ("{a: 0 m, b: 0.001}", 0.04),
        ("{a: 5 cm, b: 0}", 0.05),
    ],
)
def test_a_limit_by_distance(limit: str, expected: float) -> None:
    """sqrt(a^2 + (b d)^2), d of the last stage or `of`."""
    found = row(boat(f"{{id: R, kind: tvu, limit: {limit}}}"))
    assert found.limit == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(
    ("requirement", "place"),
    [
        ("{id: R, kind: quantile, limit: 1 m}", "p"),
        ("{id: R, kind: rmse, limit: 1 m}", "axis"),
        ("{id: R, kind: thu, quantile: 0.9, limit: 1 m}", "quantile"),
        ("{id: R, kind: thu, confidence: 1.5, limit: 1 m}", "confidence"),
        ("{id: R, kind: rmse, axis: sideways, limit: 1 m}", "axis"),
        ("{id: R, kind: accuracy, p: 0.9, limit: 1 m}", "p"),
        ("{id: R, kind: tvu, limit: {a: 0.1 m}}", "limit"),
        ("{id: R, kind: tvu, limit: {a: 0.1 m, b: 0.1, c: 2}}", "limit"),
        ("{id: R, kind: tvu, limit: {a: 1 s, b: 0.1}}", "limit"),
        ("{id: R, kind: tvu, limit: {a: 0 m, b: 0}}", "limit"),
        ("{id: R, kind: accuracy, limit: {a: 0.1 m, b: 0.1}}", "limit"),
    ],
)
def test_keys_that_do_not_fit_are_refused_where_they_stand(requirement: str, place: str) -> None:
    with pytest.raises(BadInput) as refused:
        load_text(boat(requirement), "boat.yaml")
    (problem,) = refused.value.problems
    assert problem.line == 5
    assert place in problem.path


def test_the_schema_of_a_spec_says_the_same() -> None:
    import yaml

    validator = jsonschema.Draft7Validator(json_schema("spec"))
    good = [one.replace("LIMIT", "1 m") for one in KINDS]
    good.append("{id: R, kind: tvu, limit: {a: 0.1 m, b: 0.1, of: 3 m}}")
    bad = [
        "{id: R, kind: quantile, limit: 1 m}",
        "{id: R, kind: thu, quantile: 0.9, limit: 1 m}",
        "{id: R, kind: accuracy, limit: {a: 0.1 m, b: 0.1}}",
    ]
    for requirement, valid in [*((one, True) for one in good), *((one, False) for one in bad)]:
        spec = json.loads(json.dumps(yaml.safe_load(boat(requirement))))
        assert validator.is_valid(spec) is valid, requirement


CATALOG = """
sensors:
  p1: {modality: position, sigma_position: 5 cm, primitives: [pps], cost: 100 EUR}
  p2: {modality: position, sigma_position: 1 cm, primitives: [pps], cost: 900 EUR}
  a1: {modality: attitude, sigma_attitude: 1 deg, primitives: [pps], cost: 50 EUR}
  a2: {modality: attitude, sigma_attitude: 0.02 deg, primitives: [pps], cost: 2000 EUR}
  r1:
    {modality: ranging, sigma_range: 10 cm, sigma_bearing: 0.5 deg, primitives: [pps], cost: 8 EUR}
  r2:
    {modality: ranging, sigma_range: 1 cm, sigma_bearing: 0.1 deg, primitives: [pps], cost: 70 EUR}
timestamping:
  good:
    primitives: [pps]
    timeline: host
    error: {distribution: uniform, low: -1 us, high: 1 us}
    cost: 300 EUR
  poor:
    primitives: [pps]
    timeline: host
    error: {distribution: normal, mean: 3 ms, std: 1 ms}
    cost: 1 EUR
"""


def spec(requirements: str, pinned: tuple[str, str, str, str] | None = None) -> str:
    roles = ("position", "attitude", "ranging")
    if pinned is None:
        lines = [f"    {r}: {{candidates: [{r[0]}1, {r[0]}2]}}" for r in roles]
        stamping = "{candidates: [good, poor]}"
    else:
        lines = [f"    {r}: {{sensor: {one}}}" for r, one in zip(roles, pinned, strict=False)]
        stamping = pinned[3]
    return f"""
syncline: 1
name: choice
catalogs: [own.yaml]
requirements: [{requirements}, {{id: S, kind: sync, limit: 1000}}]
stages:
  - name: uav
    platform: {{v_max: 5 m/s, omega_max: 20 deg/s, distance: 30 m, baseline: 0 m}}
{chr(10).join(lines)}
timestamping: {stamping}
"""


@pytest.mark.parametrize(
    "requirements",
    [
        "{id: T, kind: tvu, limit: 20 cm}",
        "{id: T, kind: thu, limit: {a: 3 cm, b: 0.01}}",
        "{id: R, kind: rmse, axis: 3d, limit: 12 cm}, {id: W, kind: worst_case, limit: 1.2 m}",
        "{id: Q, kind: quantile, of: 3d, p: 0.9, limit: 1 cm}",
    ],
)
def test_the_choice_is_the_cheapest_that_keeps_them(tmp_path: Path, requirements: str) -> None:
    """Against every combination of sensors, all stamped alike, each verified by itself."""
    (tmp_path / "own.yaml").write_text(CATALOG)
    settings = CheckSettings(monte_carlo=False)
    alike = []
    for one in itertools.product(("p1", "p2"), ("a1", "a2"), ("r1", "r2"), ("good", "poor")):
        verdict = check_loaded(load_text(spec(requirements, one), tmp_path / "s.yaml"), settings)
        if verdict.verdict == "meets" and verdict.design is not None:
            alike.append(verdict.design.cost)
    found = check_loaded(load_text(spec(requirements), tmp_path / "s.yaml"), settings)
    if not alike:
        assert found.verdict == "infeasible"
        return
    assert found.verdict == "meets"
    assert found.design is not None
    assert found.design.cost is not None
    assert found.design.cost <= min(cost for cost in alike if cost is not None)


SCATTER = """
effects:
  - {effect: timestamp_jitter, sensor: position, parameters: {std_s: 0.05}}
"""


@pytest.mark.parametrize("kind", ["thu", "tvu", "rmse, axis: 3d", "quantile, p: 0.95"])
def test_effects_that_scatter_count(kind: str) -> None:
    """A jitter of 50 ms at 2 m/s scatters by 10 cm along the motion: 6 cm are out of reach."""
    loose = "{id: S, kind: sync, limit: 1000}"
    text = boat(f"{{id: R, kind: {kind}, limit: 6 cm}}\n  - {loose}")
    assert row(text).status == "pass"
    verdict = check_loaded(load_text(text + SCATTER, "boat.yaml"), CheckSettings())
    assert verdict.verdict == "fails"
    assert verdict.figures is not None
    assert verdict.figures.rmse_m is not None
    assert verdict.figures.rmse_m["3d"] > 0.1


def test_a_requirement_without_a_design_names_its_own_axis() -> None:
    """It read "RMS of 3D errors" where a vertical one was asked for."""
    text = boat("{id: R, kind: rmse, axis: vertical, limit: 1 cm}")
    case = load_text(text, "boat.yaml")
    (asked,) = case.spec.requirements
    assert kind_text(unmet(case, asked, in_conflict=True)) == "RMS of vertical errors"
