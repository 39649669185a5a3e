"""The slack ledger against choosing anew: each threshold is solved by plain enumeration."""

from __future__ import annotations

import itertools
import random
from dataclasses import replace
from fractions import Fraction
from typing import Any

import pytest

from syncline_design.choice.problem import build_problem
from syncline_design.choice.slack import Slack, slack_ledger
from syncline_design.choice.table import Design, Problem
from syncline_design.report.on_hinges import slack_table
from syncline_design.report.render_console import table_lines
from syncline_design.spec.case import Case
from syncline_design.spec.load import load_text

Option = dict[str, Any]
Tables = list[list[Option]]

SPEC = """\
syncline: 1
name: ledger
requirements:
{requirements}
objective: {objective}
stages:
  - name: s
    platform: {{name: p, v_max: 5 m/s, omega_max: 10 deg/s, distance: 30 m, baseline: 1 m}}
    position: {{candidates: [p0, p1]}}
    attitude: {{candidates: [a0, a1]}}
    ranging: {{candidates: [r0]}}
timestamping: {{candidates: [t0, t1]}}
catalogs: [own.yaml]
"""


def draw_catalog(rng: random.Random) -> str:
    """Few different prices, so that ties are common; one method serves two primitives."""
    lines = ["sensors:"]
    figures = {
        "p": lambda: f"modality: position, sigma_position: {rng.randint(1, 40)} cm",
        "a": lambda: f"modality: attitude, sigma_attitude: 0.{rng.randint(1, 9)} deg",
        "r": lambda: (
            f"modality: ranging, sigma_range: {rng.randint(1, 30)} cm, sigma_bearing: 0.1 deg"
        ),
    }
    for name in ("p0", "p1", "p2", "a0", "a1", "r0", "r1"):
        spent = f"cost: {rng.choice([10, 10, 20, 30])} EUR, mass: 1 kg, power: 1 W"
        lines.append(f"  {name}: {{{figures[name[0]]()}, primitives: [pps, tov], {spent}}}")
    lines.append("timestamping:")
    for name in ("t0", "t1", "t2"):
        high = f"{rng.randint(1, 4000)} us"
        serves = rng.choice(["[pps]", "[pps, tov]"])
        lines.append(
            f"  {name}: {{primitives: {serves}, error: {{distribution: uniform, low: -{high}, "
            f"high: {high}}}, cost: {rng.choice([0, 0, 5])} EUR, mass: 0 kg, power: 0 W}}"
        )
    return "\n".join(lines) + "\n"


def loaded_of(folder: Any, text: str, own: str) -> Case:
    (folder / "own.yaml").write_text(own, "utf-8")
    return load_text(text, folder / "spec.yaml")


def tables_of(problem: Problem) -> Tables:
    """Figures of every option, tau_crit kept or not."""
    out = []
    for table in problem.roles:
        pool = [*table.options, *(o.option for o in table.excluded if o.option is not None)]
        out.append(
            [
                {"names": o.names, "error": o.error(), "tau": o.tau(), "cost": o.resources.cost}
                for o in pool
            ]
        )
    return out


Best = tuple[tuple[Any, ...], tuple[tuple[str, str], ...]]


def best_plain(
    tables: Tables, speed: Fraction, turn: Fraction, accuracy: Fraction | None, objective: str
) -> Best | None:
    """The first design in the documented order, every one looked at; rates in m/s, sync limit 1."""
    best: Best | None = None
    for chosen in itertools.product(*tables):
        rates = (speed, speed + turn, speed + turn)
        error = sum(o["error"] for o in chosen)
        if any(o["tau"] * rate >= o["error"] for o, rate in zip(chosen, rates, strict=True)):
            continue
        tau = max(chosen[0]["tau"], chosen[1]["tau"]) + chosen[2]["tau"]
        caused = (speed + turn) * tau
        if caused >= error or (accuracy is not None and error + caused > accuracy):
            continue
        cost, total = sum(o["cost"] for o in chosen), float(error + caused)
        first = cost if objective == "cost" else total
        place = (first, total, cost, tuple(o["names"] for o in chosen))
        payload = tuple((o["names"][0], o["names"][2]) for o in chosen)
        if best is None or place < best[0]:
            best = (place, payload)
    return best


def grown(tables: Tables, problem: Problem, design: Design, row: Slack, value: Fraction) -> Tables:
    """The tables with one term set: a sensor in its role, a method in all its primitives."""
    role = row.term.split()[0]
    r = [table.role for table in problem.roles].index(role)  # type: ignore[arg-type]
    own = problem.roles[r].options[design.options[r]]
    is_error = row.term.endswith("sensor error")
    key, place, name = ("error", 0, own.sensor) if is_error else ("tau", 2, own.method)
    changed = [dict(o, **{key: value}) if o["names"][place] == name else o for o in tables[r]]
    return [*tables[:r], changed, *tables[r + 1 :]]


def own_design_meets(
    tables: Tables, names: list[Any], speed: Fraction, turn: Fraction, accuracy: Fraction | None
) -> bool:
    alone = [[o for o in t if o["names"] == n] for t, n in zip(tables, names, strict=True)]
    return best_plain(alone, speed, turn, accuracy, "cost") is not None


@pytest.mark.parametrize("seed", range(12))
def test_thresholds_of_terms_by_enumeration(seed: int, tmp_path: Any) -> None:
    """Fixed seeds; figures 1e-4 to either side of each threshold, exact otherwise."""
    rng = random.Random(seed)
    objective = rng.choice(["cost", "cost", "error"])
    limit = rng.choice([None, "2.5 m", "1.2 m", "0.9 m"])
    rows = "  - {id: S, kind: sync, limit: 1.0}"
    rows += "" if limit is None else f"\n  - {{id: A, kind: accuracy, limit: {limit}}}"
    text = SPEC.format(requirements=rows, objective=objective)
    loaded = loaded_of(tmp_path, text, draw_catalog(rng))
    problem = build_problem(loaded)
    if not all(table.options for table in problem.roles):
        return
    speed = problem.pairs[0].rate()
    turn = problem.pairs[1].rate()
    accuracy = None if limit is None else Fraction(limit.split()[0])
    tables = tables_of(problem)
    first = best_plain(tables, speed, turn, accuracy, objective)
    if first is None:
        return
    names = list(first[0][3])
    design = Design(
        tuple(
            [o.names for o in table.options].index(n)
            for table, n in zip(problem.roles, names, strict=True)
        ),
        (0,),
    )
    for row in slack_ledger(loaded, problem, design):
        if "error" not in row.term:
            continue

        def payload(value: float, row: Slack = row) -> Any:
            other = grown(tables, problem, design, row, Fraction(value))
            found = best_plain(other, speed, turn, accuracy, objective)
            return None if found is None else found[1]

        def meets(value: float, row: Slack = row) -> bool:
            other = grown(tables, problem, design, row, Fraction(value))
            return own_design_meets(other, names, speed, turn, accuracy)

        check_threshold(row, row.fails_at, lambda v, m=meets: m(v))  # type: ignore[misc]
        check_threshold(row, row.payload_changes_at, lambda v, p=payload: p(v) == first[1])  # type: ignore[misc]


def check_threshold(row: Slack, at: float | None, holds: Any) -> None:
    """It holds at shares of the way to the threshold and no longer just above it."""
    end = at if at is not None else (row.searched_to or row.value * 1e6)
    for share in (0.0, 0.1, 0.5, 0.9, 0.9999):
        value = row.value + share * (end - row.value)
        assert holds(value), (row, value)
    if at is not None:
        assert not holds(max(at, row.value) * (1 + 1e-4)), row


def test_limit_equal_to_the_total_fails_at_the_value_itself(tmp_path: Any) -> None:
    """No room at all: any growth fails and changes the payload, and neither is called never."""
    rng = random.Random(3)
    text = SPEC.format(requirements="  - {id: A, kind: accuracy, limit: 50 m}", objective="error")
    loaded = loaded_of(tmp_path, text, draw_catalog(rng))
    problem = build_problem(loaded)
    tables = tables_of(problem)
    speed, turn = problem.pairs[0].rate(), problem.pairs[1].rate()
    first = best_plain(tables, speed, turn, None, "error")
    assert first is not None
    design = Design(
        tuple(
            [o.names for o in table.options].index(n)
            for table, n in zip(problem.roles, first[0][3], strict=True)
        ),
        (0,),
    )
    tight = replace(problem, limits=replace(problem.limits, accuracy_m=first[0][1]))
    for row in slack_ledger(loaded, tight, design, lambda spec: with_accuracy(spec, first[0][1])):
        if row.term.endswith("sensor error"):
            assert row.fails_at == pytest.approx(row.value, rel=1e-12)
            assert row.payload_changes_at == pytest.approx(row.value, rel=1e-5)


def with_accuracy(spec: Case, limit_m: float) -> Problem:
    problem = build_problem(spec)
    return replace(problem, limits=replace(problem.limits, accuracy_m=limit_m))


FAR = """\
syncline: 1
name: far
requirements:
  - {id: A, kind: accuracy, limit: 900 m}
  - {id: S, kind: sync, limit: 1000000}
stages:
  - name: s
    platform: {name: p, v_max: 1 m/s, omega_max: 1 deg/s, distance: 1 m, baseline: 1 m}
    position: {sensor: {modality: position, sigma_position: 1 cm, primitives: [pps]}}
    attitude: {sensor: {modality: attitude, sigma_attitude: 0.1 deg, primitives: [pps]}}
    ranging:
      sensor: {modality: ranging, sigma_range: 1 cm, sigma_bearing: 0.1 deg, primitives: [pps]}
timestamping: {candidates: [hardware]}
"""


def test_never_is_said_only_where_proven(tmp_path: Any) -> None:
    """A distance that fails beyond a hundred times its value is found; no accuracy limit: never."""
    loaded = load_text(FAR, tmp_path / "spec.yaml")
    problem = build_problem(loaded)
    rows = {row.term: row for row in slack_ledger(loaded, problem, Design((0, 0, 0), (0,)))}
    assert (rows["distance"].fails_at or 0) > 100
    position = rows["position sensor error"]
    assert position.fails_at == pytest.approx(900, rel=1e-3)
    plain = load_text(
        FAR.replace("  - {id: A, kind: accuracy, limit: 900 m}\n", ""), tmp_path / "spec.yaml"
    )
    ledger = slack_ledger(plain, build_problem(plain), Design((0, 0, 0), (0,)))
    shown = list(table_lines(slack_table(ledger)))
    by_term = {row.term: row for row in ledger}
    assert by_term["position sensor error"].never == ("verdict", "payload")
    assert by_term["distance"].never == ()
    assert by_term["distance"].searched_to == pytest.approx(1e6)
    assert any("distance" in line and "not up to" in line for line in shown)
    assert any("position sensor error" in line and "never" in line for line in shown)


def test_the_noise_of_a_sensor_that_enters_no_error_has_no_row(tmp_path: Any) -> None:
    """A stage without ranging locates itself: how well its attitude is known changes nothing."""
    lines = FAR.splitlines()
    text = "\n".join(line for line in lines if "ranging" not in line) + "\n"
    loaded = load_text(text, tmp_path / "spec.yaml")
    ledger = slack_ledger(loaded, build_problem(loaded), Design((0, 0), (0,)))
    terms = [row.term for row in ledger]
    assert "position sensor error" in terms
    assert "attitude sensor error" not in terms
    (stamp,) = [row for row in ledger if row.term == "attitude timestamp error"]
    assert stamp.fails_at is None
