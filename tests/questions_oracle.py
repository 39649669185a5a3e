"""What people ask after a choice, on one spec: the product against plain enumeration.

Each comparison asserts, and returns how much there was to compare.  Shared by the tests and by
`benchmarks/questions.py`.
"""

from __future__ import annotations

import random
from collections import Counter
from typing import Any

import pytest
import yaml

from plain_enumeration import Enumeration, Outcome, failed, limits_of
from syncline_design.choice.decide import choose
from syncline_design.choice.front import front
from syncline_design.choice.holding import best_design
from syncline_design.choice.outcome import Choice
from syncline_design.choice.problem import build_problem
from syncline_design.choice.stampings import stampings_of
from syncline_design.spec.load import Case, load_text
from syncline_design.verdict.admitted import kinds_of, with_whole_catalog
from syncline_design.verdict.alternatives import alternatives, bargains
from syncline_design.verdict.why_not import Answer, AskedSpec, NotTaken, why_not
from test_random_specs import draw_spec

Key = tuple[int, float]  # cents, error [m]


def case_of(spec: dict[str, Any]) -> Case:
    return load_text(yaml.safe_dump(spec, sort_keys=False), "specs/drawn.yaml")


def drawn(seed: int, count: int) -> list[dict[str, Any]]:
    """Random specs with a limit on the error that some designs miss."""
    rng, found = random.Random(seed), []
    while len(found) < count:
        spec = draw_spec(rng)
        plain = Enumeration(spec)
        if not 4 <= plain.count <= 600:
            continue
        errors = sorted(o.total_m for o in plain if not failed(spec, o))
        if len(errors) < 2:
            continue
        limit = f"{1.001 * errors[len(errors) // 3]:.6f} m"
        spec["requirements"].append({"id": "A", "kind": "accuracy", "limit": limit})
        found.append(spec)
    return found


def best(spec: dict[str, Any], outcomes: list[Outcome]) -> Key | None:
    kept = [(round(100 * o.cost), o.total_m) for o in outcomes if not failed(spec, o)]
    return min(kept, default=None)


def held(plain: Enumeration, one: Outcome, kind: str) -> set[str]:
    """Entries of a kind that a design holds."""
    methods = [plain.catalog["timestamping"][option.method] for option in one.options]
    clocks = [plain.catalog["clocks"][name] for name in one.clocks if name is not None]
    return {
        "sensor": {option.sensor for option in one.options},
        "timestamping": {option.method for option in one.options},
        "clock": {name for name in one.clocks if name is not None},
        "hardware": {item for entry in (*methods, *clocks) for item in entry.get("requires", {})},
    }[kind]


def answers_of(spec: dict[str, Any], *entries: str) -> list[Answer]:
    case = case_of(spec)
    problem, whole = build_problem(case), with_whole_catalog(case)
    asked = AskedSpec(case, problem, best_design(problem), build_problem, whole)
    return list(why_not(asked, kinds_of(whole, entries)))


def entries_of(spec: dict[str, Any]) -> set[str]:
    """Everything that a spec lists, and a board."""
    stages = spec["stages"]
    sensors = {
        name
        for stage in stages
        for role in ("position", "attitude", "ranging")
        for name in stage.get(role, {}).get("candidates", [])
    }
    clocks = {name for stage in stages for name in stage.get("clock", {}).get("candidates", [])}
    return {*sensors, *clocks, *spec["timestamping"]["candidates"], "timing_board"}


def compare_why_not(spec: dict[str, Any]) -> Counter[str]:
    """Every entry that the spec lists: the best design that holds it, or that there is none."""
    plain, seen = Enumeration(spec), Counter[str]()
    outcomes = list(plain)
    first = best(spec, outcomes)
    assert first is not None
    rows = answers_of(spec, *sorted(entries_of(spec)))
    # what breaks its own tau_crit in one place is a design here, one that misses the sync limit
    # and of what is no candidate a second row says what if it were
    poor = {
        (r.entry, r.kind)
        for r in rows
        if isinstance(r, NotTaken) and r.code in ("tau", "not-a-candidate")
    }
    for row in rows:
        mine = [o for o in outcomes if row.entry in held(plain, o, row.kind)]
        expected = best(spec, mine)
        if isinstance(row, NotTaken):
            assert expected is None
            assert row.code != "not-a-candidate" or not mine
            kept_out = row.code in ("accuracy", "sync", "mass", "power", "requirements")
            assert (row.entry, row.kind) in poor or bool(mine) == kept_out
            seen["kept out" if kept_out else "ruled out"] += 1
        elif not row.candidate:
            assert not mine
        else:
            assert expected is not None
            assert row.best_with.cost == pytest.approx(expected[0] / 100, abs=1e-9)
            assert row.best_with.error_m == pytest.approx(expected[1], rel=1e-9)
            assert row.dearer_by == pytest.approx((expected[0] - first[0]) / 100, abs=1e-6)
            assert row.worse_by == pytest.approx(expected[1] - first[1], rel=1e-6, abs=1e-9)
            assert not row.in_design or (row.dearer_by, row.worse_by) == (0.0, 0.0)
            seen["best with"] += 1
    return seen


def compare_alternatives(spec: dict[str, Any]) -> Counter[str]:
    """Designs without a sensor, the range over ways of stamping, bargains."""
    every = list(Enumeration(spec))
    kept = [o for o in every if not failed(spec, o)]
    case = case_of(spec)
    problem = build_problem(case)
    choice, first = choose(problem), best(spec, every)
    assert isinstance(choice, Choice)
    assert first is not None
    seen = Counter[str]()
    rows = zip(problem.roles, choice.design.options, strict=True)
    sensors = [table.options[place].sensor for table, place in rows]
    mine = [o for o in kept if [p.sensor for p in o.options] == sensors]
    over = stampings_of(problem, choice.design)
    assert over is not None
    assert over.cost is not None
    assert over.count == len(mine)
    costs, errors = [o.cost for o in mine], [o.total_m for o in mine]
    assert [float(c) for c in over.cost] == pytest.approx([min(costs), max(costs)], abs=1e-6)
    assert over.error_m == pytest.approx((min(errors), max(errors)), rel=1e-9)
    seen["several ways"] += over.count > 1
    for one in alternatives(case, problem, choice.design):
        others = [o for o in kept if one.sensor not in {p.sensor for p in o.options}]
        expected = best(spec, others)
        if expected is None:
            assert (one.verdict, one.cost, one.instead) == ("infeasible", None, ())
            seen["impossible"] += 1
            continue
        seen["without"] += 1
        assert one.verdict == "meets"
        assert one.cost == pytest.approx(expected[0] / 100, abs=1e-9)
        assert one.error_m == pytest.approx(expected[1], rel=1e-9)
        assert one.dearer_by == pytest.approx((expected[0] - first[0]) / 100, abs=1e-6)
        assert one.sensor not in "".join(one.instead)
    shown = list(bargains(case, problem, choice.design, tuple(front(problem))))
    wanted = plain_bargains(spec, every, first)
    assert {(b.kind, round(100 * b.extra)) for b in shown} <= set(wanted)
    for kind in ("better", "cheaper"):
        of_kind = sum(b.kind == kind for b in shown)
        assert of_kind == min(3, sum(k == kind for k, _ in wanted))
    seen["bargains"] += len(shown)
    return seen


def plain_bargains(spec: dict[str, Any], every: list[Outcome], first: Key) -> list[tuple[str, int]]:
    """The rule as the docs state it, over the designs that meet all but accuracy; in cents."""
    limits = limits_of(spec)
    accuracy = {name for name, (kind, _) in limits.items() if kind == "accuracy"}
    allowed = min(limits[name][1] for name in accuracy)
    kept = ((round(100 * o.cost), o.total_m) for o in every if failed(spec, o) <= accuracy)
    points: list[Key] = []
    for cost, error in sorted(kept):
        if not points or error < points[-1][1] * (1 - 1e-12):
            points.append((cost, error))
    out = []
    for cost, error in points:
        extra = cost - first[0]
        off, on = 1 - error / first[1], extra / first[0]
        if extra > 0 and off >= 0.05 and off >= 2 * on:
            out.append(("better", extra))
        if extra < 0 and -on >= 0.05 and -on >= 2 * (error / allowed - 1):
            out.append(("cheaper", extra))
    return out
