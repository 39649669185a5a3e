"""Price staircase, slack, tolerances, what to measure next, tables: each against re-solving."""

from __future__ import annotations

import csv
import io
import itertools
import json
from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import jsonschema
import pytest

from syncline_design.choice.decide import best, choose
from syncline_design.choice.evaluate import broken, evaluate
from syncline_design.choice.front import front, staircase
from syncline_design.choice.outcome import Choice, Infeasible, PriceStep
from syncline_design.choice.problem import build_problem, selection_of
from syncline_design.choice.slack import Slack, payload, slack_ledger
from syncline_design.choice.table import Design, Limits, Problem
from syncline_design.choice.tolerance import measure_next, tolerance_verdict
from syncline_design.choice.variations import (
    PLATFORM_FIGURES,
    quantity,
    sigma_figures,
    with_figure,
    with_platform_figure,
)
from syncline_design.choice.what_if import same_design
from syncline_design.machine.deadline import within_s
from syncline_design.machine.records import read_as
from syncline_design.model.known import Known
from syncline_design.model.quantity import Dimension
from syncline_design.report import numbers
from syncline_design.report.choice_csv import designs_csv, front_csv
from syncline_design.report.on_choice import designs_table, front_table, staircase_table
from syncline_design.report.on_hinges import slack_table
from syncline_design.report.result_schemas import result_schema
from syncline_design.spec.case import Case
from syncline_design.spec.load import load, load_text
from syncline_design.verdict.optimize import Optimization, OptimizeSettings, optimize
from syncline_design.verdict.recheck import recheck
from test_choice_explain import spec
from test_front import one_stage, option

ROOT = Path(__file__).parent.parent


def chosen(loaded: Case) -> tuple[Problem, Design]:
    problem = build_problem(loaded)
    found = choose(problem)
    assert isinstance(found, Choice)
    return problem, found.design


def price_of(steps: Sequence[PriceStep], target_m: float) -> PriceStep | None:
    """The step that buys an accuracy target; None where no design reaches it."""
    return next((step for step in steps if step.tightest_m <= target_m), None)


@pytest.mark.parametrize("name", ["uav_corridor", "subsea_survey_small_sv"])
def test_staircase_is_what_solving_again_gives(name: str) -> None:
    """At every breakpoint, just above it and just below it: no duals, only optima."""
    problem = build_problem(load(ROOT / "specs" / f"{name}.yaml"))
    problem = replace(problem, limits=replace(problem.limits, accuracy_m=None, cost=None))
    points = front(problem)
    steps, exact = staircase(points), {float(point.amount): point.amount for point in points}
    assert len(steps) == len(exact) > 3
    for step in steps:
        for factor in (1.0, 1.0 + 1e-9, 1.0 - 1e-9):
            target = step.tightest_m * factor
            solved = choose(
                replace(problem, limits=replace(problem.limits, accuracy_m=target)), "front"
            )
            priced = price_of(steps, target)
            if priced is None:
                assert isinstance(solved, Infeasible)
            else:
                assert isinstance(solved, Choice)
                assert evaluate(problem, solved.design).cost == exact[priced.cost]


def test_steps_join_without_gaps() -> None:
    roles = [
        [option(f"{n}{k}", 0.5 / (k + 1), 0.0, Fraction(10 * k, 3)) for k in range(4)]
        for n in "abc"
    ]
    points = front(one_stage(roles, Limits(None, 1.0), 1.0, 1.0))
    steps = staircase(points)
    assert [step.cost for step in steps] == [float(point.amount) for point in points]
    for before, after in itertools.pairwise(steps):
        assert after.looser_than_m == before.tightest_m
    for step, (before, after) in zip(steps[1:], itertools.pairwise(points), strict=True):
        assert step.extra == float(after.amount - before.amount) > 0
    assert steps[0].looser_than_m is None
    assert price_of(steps, 0.0) is None


def row_of(rows: tuple[Slack, ...], term: str) -> Slack:
    return next(row for row in rows if row.term == term)


def test_slack_of_platform_figures_flips_the_verdict_there(tmp_path: Path) -> None:
    loaded = spec(tmp_path)
    problem, design = chosen(loaded)
    rows = slack_ledger(loaded, problem, design)
    tried = 0
    for figure, (words, dimension) in PLATFORM_FIGURES.items():
        row = row_of(rows, words)
        if row.fails_at is None:
            continue
        tried += 1
        for share, fails in ((0.999, False), (1.001, True)):
            value = quantity(row.fails_at * share, dimension)
            other = build_problem(with_platform_figure(loaded, 0, figure, value))
            same = same_design(problem, design, other)
            verdict = same is None or bool(broken(other, evaluate(other, same)))
            assert verdict is fails, (figure, share)
    assert tried >= 2


def test_slack_of_errors_and_taus_by_the_recheck(tmp_path: Path) -> None:
    """Growing tau or an error to just below and above its threshold, by the independent recheck."""
    loaded = spec(tmp_path)
    problem, design = chosen(loaded)
    selection = selection_of(problem, design)
    for row in slack_ledger(loaded, problem, design):
        if row.unit not in ("m", "s") or row.term == "distance" or row.fails_at is None:
            continue
        role = row.term.split()[0]
        for share, passes in ((1.0 - 1e-6, True), (1.0 + 1e-6, False)):
            growth = row.fails_at * share - row.value
            if row.unit == "s":
                found = recheck(loaded, selection, Known({("uav", role): growth}))  # type: ignore[dict-item]
            else:
                # An error of the same size from elsewhere: what a grown sensor error does to ACC.
                found = recheck(loaded, selection, Known({}, (("grown", "uav", growth),)))
            assert found.passed is passes, (row, share)


def test_slack_names_the_requirement_that_breaks(tmp_path: Path) -> None:
    loaded = spec(tmp_path)
    problem, design = chosen(loaded)
    rows = slack_ledger(loaded, problem, design)
    assert row_of(rows, "attitude sensor error").limited_by == "accuracy"
    loose = spec(tmp_path, accuracy="50 m")
    problem, design = chosen(loose)
    rows = slack_ledger(loose, problem, design)
    assert row_of(rows, "position timestamp error").limited_by == "sync"


def test_payload_change_is_where_the_choice_changes() -> None:
    """With the error as the objective, a grown sensor loses to the next one exactly there."""
    loaded = load(ROOT / "specs" / "car_mapping.yaml")
    built = replace(build_problem(loaded), objective="error")
    found = choose(built)
    assert isinstance(found, Choice)
    rows = slack_ledger(
        loaded, built, found.design, lambda spec: replace(build_problem(spec), objective="error")
    )
    changes = [row for row in rows if row.payload_changes_at and row.unit == "m/s"]
    for row in changes:
        for share, same in ((0.999, True), (1.001, False)):
            value = quantity((row.payload_changes_at or 0.0) * share, Dimension.SPEED)
            other = build_problem(with_platform_figure(loaded, 0, "v_max", value))
            again = choose(replace(other, objective="error"))
            kept = isinstance(again, Choice) and payload(other, again.design) == payload(
                built, found.design
            )
            assert kept is same


TOLERANT = """\
syncline: 1
name: Datasheet tolerances
requirements:
  - {{id: ACC, kind: accuracy, limit: {accuracy}}}
stages:
  - name: hull
    platform: {{name: hull, v_max: 2 m/s, omega_max: 1 deg/s, distance: 10 m, baseline: 1 m}}
    position:
      sensor: {{modality: position, sigma_position: {position}, primitives: [pps]}}
    attitude:
      sensor: {{modality: attitude, sigma_attitude: {attitude}, primitives: [pps]}}
    ranging:
      sensor:
        {{modality: ranging, sigma_range: 1 cm, sigma_bearing: 0.01 deg, primitives: [pps]}}
timestamping:
  candidates: [gpio]
"""


def tolerant(position: str, attitude: str, accuracy: str) -> Case:
    text = TOLERANT.format(position=position, attitude=attitude, accuracy=accuracy)
    return load_text(text, "spec.yaml")


@pytest.mark.parametrize(
    ("position", "accuracy", "word"),
    [
        ("1 cm +/- 20 %", "4 cm", "always"),
        ("1 cm +/- 20 %", "3 cm", "sometimes"),
        ("1 cm +/- 20 %", "2.5 cm", "never"),
        ("0.8 cm .. 1.2 cm", "3 cm", "sometimes"),
        ("1 cm", "4 cm", "always"),
    ],
)
def test_passes_always_sometimes_or_never(position: str, accuracy: str, word: str) -> None:
    """sqrt(3) 1 cm + 1 cm + 0.247 cm + attitude: about 2.98 cm, from 2.64 cm to 3.33 cm."""
    loaded = tolerant(position, "0.01 deg", accuracy)
    problem = build_problem(loaded)
    design = Design((0, 0, 0), (0,))
    assert tolerance_verdict(loaded, problem, design).passes == word


def test_deciding_tolerance_is_named() -> None:
    loaded = tolerant("1 cm +/- 20 %", "0.01 deg +/- 1 %", "3 cm")
    found = tolerance_verdict(loaded, build_problem(loaded), Design((0, 0, 0), (0,)))
    assert found.passes == "sometimes"
    assert found.alone
    assert found.deciding == ("hull.position sigma_position",)
    assert "hull.position sigma_position decides it" in found.text


def test_word_agrees_with_trying_values_inside() -> None:
    """Grid of values within both tolerances, each judged by the independent recheck."""
    for accuracy in ("2.6 cm", "2.9 cm", "3.1 cm", "3.4 cm"):
        loaded = tolerant("1 cm +/- 20 %", "0.01 deg +/- 30 %", accuracy)
        problem, design = build_problem(loaded), Design((0, 0, 0), (0,))
        selection = selection_of(problem, design)
        one, other = [f for f in sigma_figures(loaded) if f.quantity.has_tolerance]
        outcomes = set()
        for i in range(5):
            for j in range(5):
                tried = loaded
                for figure, step in ((one, i), (other, j)):
                    low, high = figure.quantity.low, figure.quantity.high
                    value = quantity(low + (high - low) * step / 4, figure.dimension)
                    tried = with_figure(tried, figure, value)
                outcomes.add(recheck(tried, selection).passed)
        word = {(True,): "always", (False,): "never"}.get(tuple(outcomes), "sometimes")
        assert tolerance_verdict(loaded, problem, design).passes == word


def test_better_sensor_can_fail_sync_within_its_tolerance() -> None:
    """At the lower end tau_crit shrinks below tau: accuracy passes throughout, sync does not."""
    loaded = tolerant("20 um +/- 90 %", "0.01 deg", "4 cm")
    found = tolerance_verdict(loaded, build_problem(loaded), Design((0, 0, 0), (0,)))
    assert found.passes == "sometimes"


def test_measure_next_names_what_flips_the_choice(tmp_path: Path) -> None:
    """At the end of its range, already at the nearest value told, and not a 256th of the way
    before that."""
    problem, design = chosen(spec(tmp_path, accuracy="0.3 m"))
    limit = evaluate(problem, design).error_m * 1.02
    loaded = spec(tmp_path, accuracy=f"{limit!r} m")
    problem, design = chosen(loaded)
    found = measure_next(loaded, problem, design)
    assert found
    for one in found:
        assert one.assumed_tolerance
        figure = next(f for f in sigma_figures(loaded) if f.name == one.figure)
        before = one.nearest - (one.at - one.value) / 255.0
        for value, flips in ((one.at, True), (one.nearest, True), (before, False)):
            other = build_problem(with_figure(loaded, figure, quantity(value, figure.dimension)))
            again = choose(other)
            flipped = isinstance(again, Infeasible) or payload(other, again.design) != payload(
                problem, design
            )
            assert flipped == flips, (one, value)


def test_measure_next_finds_a_flip_and_its_price(tmp_path: Path) -> None:
    """The cheap INS just fits: 20 % worse, and the good one for 17 000 EUR more is due."""
    problem, design = chosen(spec(tmp_path, accuracy="0.3 m"))
    limit = evaluate(problem, design).error_m * 1.02
    loaded = spec(tmp_path, accuracy=f"{limit!r} m")
    problem, design = chosen(loaded)
    assert payload(problem, design)[1][0] == "cheap_ins"
    found = measure_next(loaded, problem, design)
    assert "cheap_ins sigma_attitude" in {one.figure for one in found}
    flip = next(one for one in found if one.figure == "cheap_ins sigma_attitude")
    assert flip.objective_change == 17000.0
    assert "good_ins" in flip.becomes


def test_tables_and_csv(tmp_path: Path) -> None:
    problem, design = chosen(spec(tmp_path))
    points = front(problem)
    shown = front_table(problem, points, "cost", "EUR", None)
    assert [head.text for head in shown.heads][:2] == ["Cost", "Error"]
    assert [row[0].sort for row in shown.rows] == [float(p.amount or 0) for p in points]
    assert [row[1].sort for row in shown.rows] == [p.error_m for p in points]
    rows = list(csv.DictReader(io.StringIO(front_csv(problem, points, "cost"))))
    assert [Fraction(row["cost"]) for row in rows] == [point.amount for point in points]
    assert [float(row["error_m"]) for row in rows] == [point.error_m for point in points]
    assert rows[0]["uav_attitude_sensor"] == "cheap_ins"
    assert len(designs_table(problem, best(problem, 3), "EUR", None).rows) >= 1
    assert "uav.position" in designs_csv(problem, [design])
    prices = staircase_table(staircase(points), "EUR", "cost", None)
    assert "and looser" in prices.rows[0][0].text
    (row,) = slack_table([Slack("x", "s", 1.0, "m", None, None, 2.0)]).rows
    assert (row[-1].text, row[-1].sort) == ("2\u00a0m", 2.0)


@pytest.mark.parametrize(
    ("value", "text"), [(5.7563287, "5.757 m"), (0.25, "250 mm"), (0.29453366, "294.6 mm")]
)
def test_printed_targets_are_ones_that_the_price_buys(value: float, text: str) -> None:
    assert numbers.rounded_up(value, None) == text.replace(" ", "\u00a0")


@pytest.mark.parametrize("name", ["=HYPERLINK(1)", "+1+1", "@SUM(A1)", "-2+3"])
def test_csv_runs_no_formula(name: str) -> None:
    roles = [[option(name, 0.5, 0.0, 1)], [option("b", 0.5, 0.0, 1)], [option("c", 0.5, 0.0, 1)]]
    problem = one_stage(roles, Limits(None, 1.0), 1.0, 1.0)
    text = front_csv(problem, front(problem), "cost")
    assert f"'{name}" in text
    assert not any(cell.startswith(("=", "+", "@", "-2")) for cell in text.split(","))


@pytest.mark.parametrize(
    ("name", "settings", "limit_s"),
    [
        ("position_track", OptimizeSettings(count=2, pareto=True), None),
        ("position_track", OptimizeSettings(pareto=True, resource="mass"), None),
        ("position_track", OptimizeSettings(), 1e-6),
        ("infeasible_no_option", OptimizeSettings(pareto=True), None),
        ("usv_wire_missing", OptimizeSettings(), None),
    ],
)
def test_what_optimize_writes_is_what_its_schema_says(
    name: str, settings: OptimizeSettings, limit_s: float | None
) -> None:
    case = load(ROOT / "specs" / f"{name}.yaml")
    with within_s(limit_s):
        found = optimize(case, settings).result
    data = found.to_json()
    jsonschema.validate(data, result_schema("optimization"))
    again = read_as(Optimization, json.dumps(data)).to_json()
    assert again == {key: value for key, value in data.items() if value is not None or key in again}
