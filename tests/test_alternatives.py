"""Designs without a sensor, ranges over ways of stamping, bargains: against plain enumeration."""

from __future__ import annotations

import random
from pathlib import Path
from typing import Any

import pytest
import yaml

from plain_enumeration import Enumeration, Outcome, failed, limits_of
from random_problems import random_problem
from syncline_design.choice.decide import choose
from syncline_design.choice.enumerate import all_designs
from syncline_design.choice.evaluate import broken
from syncline_design.choice.front import front
from syncline_design.choice.outcome import Choice
from syncline_design.choice.problem import build_problem
from syncline_design.choice.stampings import stampings_of
from syncline_design.report.on_choice import on_choice
from syncline_design.report.on_verdict import on_verdict
from syncline_design.report.render_console import console
from syncline_design.report.render_html import html
from syncline_design.verdict.alternatives import alternatives, bargains
from syncline_design.verdict.optimise import OptimizeSettings, optimize
from syncline_design.verdict.verify import CheckSettings, check_loaded
from test_why_not import case_of, drawn

SPECS = Path(__file__).parent.parent / "specs"


def least(outcomes: list[Outcome]) -> tuple[float, float] | None:
    return min(((round(o.cost, 6), o.total_m) for o in outcomes), default=None)


def test_alternatives_and_bargains_are_those_of_plain_enumeration() -> None:
    without = impossible = found = several = 0
    for spec in drawn(21, 10):
        every = list(Enumeration(spec))
        kept = [o for o in every if not failed(spec, o)]
        case = case_of(spec)
        problem = build_problem(case)
        choice = choose(problem)
        assert isinstance(choice, Choice)
        first = least(kept)
        assert first is not None
        sensors = names(problem, choice.design)
        mine = [o for o in kept if [p.sensor for p in o.options] == sensors]
        over = stampings_of(problem, choice.design)
        assert over is not None
        assert over.cost is not None
        assert over.count == len(mine)
        costs, errors = [o.cost for o in mine], [o.total_m for o in mine]
        assert [float(c) for c in over.cost] == pytest.approx([min(costs), max(costs)], abs=1e-6)
        assert over.error_m == pytest.approx((min(errors), max(errors)), rel=1e-9)
        several += over.count > 1
        for one in alternatives(case, problem, choice.design):
            others = [o for o in kept if one.sensor not in {p.sensor for p in o.options}]
            expected = least(others)
            if expected is None:
                assert (one.verdict, one.cost, one.instead) == ("infeasible", None, ())
                impossible += 1
                continue
            without += 1
            assert one.verdict == "meets"
            assert (one.cost, one.error_m) == pytest.approx(expected, rel=1e-9)
            assert one.dearer_by == pytest.approx(expected[0] - first[0], abs=1e-6)
            assert one.sensor not in "".join(one.instead)
        shown = list(bargains(case, problem, choice.design, tuple(front(problem))))
        expected_ones = plain_bargains(spec, every, first)
        assert {(b.kind, round(b.extra, 2)) for b in shown} <= set(expected_ones)
        for kind in ("better", "cheaper"):
            of_kind = [b for b in shown if b.kind == kind]
            assert len(of_kind) == min(3, sum(k == kind for k, _ in expected_ones))
        found += len(shown)
    assert several >= 5
    assert without >= 5
    assert impossible >= 1
    assert found >= 2


def plain_bargains(
    spec: dict[str, Any], every: list[Outcome], first: tuple[float, float]
) -> list[tuple[str, float]]:
    """The rule as the docs state it, over the designs that meet all but accuracy."""
    limits = limits_of(spec)
    accuracy = {name for name, (kind, _) in limits.items() if kind == "accuracy"}
    allowed = min(limits[name][1] for name in accuracy)
    points: list[tuple[float, float]] = []
    for cost, error in sorted(
        (round(o.cost, 6), o.total_m) for o in every if failed(spec, o) <= accuracy
    ):
        if not points or error < points[-1][1] * (1 - 1e-12):
            points.append((cost, error))
    out = []
    for cost, error in points:
        extra = cost - first[0]
        off, on = 1 - error / first[1], extra / first[0]
        if extra > 1e-6 and off >= 0.05 and off >= 2 * on:
            out.append(("better", round(extra, 2)))
        saved, grown = -on, error / allowed - 1
        if extra < -1e-6 and saved >= 0.05 and saved >= 2 * grown:
            out.append(("cheaper", round(extra, 2)))
    return out


def test_the_range_over_ways_of_stamping_is_that_of_enumeration() -> None:
    compared = several = 0
    rng = random.Random(4)
    for _ in range(24):
        problem = random_problem(rng)
        if not 1 < problem.combinations <= 500:
            continue
        choice = choose(problem)
        if not isinstance(choice, Choice):
            continue
        sensors = names(problem, choice.design)
        mine = [
            sums for design, sums in all_designs(problem)
            if names(problem, design) == sensors and not broken(problem, sums)
        ]  # fmt: skip
        found = stampings_of(problem, choice.design)
        assert found is not None
        assert found.count == len(mine)
        errors, costs = [s.error_m for s in mine], [s.cost for s in mine]
        assert found.error_m == (min(errors), max(errors))
        if None in costs:
            assert found.cost is None
        else:
            assert found.cost == (min(c for c in costs if c is not None),
                                  max(c for c in costs if c is not None))  # fmt: skip
        compared += 1
        several += len(mine) > 1
    assert compared >= 8
    assert several >= 1


def names(problem: Any, design: Any) -> list[str]:
    return [t.options[i].sensor for t, i in zip(problem.roles, design.options, strict=True)]


def test_every_format_tells_of_them() -> None:
    text = yaml.safe_load((SPECS / "position_track.yaml").read_text("utf-8"))
    found = optimize(case_of(text), OptimizeSettings(count=3))
    sensors = [tuple(names(found.problem, d)) for d in found.designs]
    assert len(set(sensors)) == 3
    assert all(one.stampings is not None for one in found.result.designs)
    told = console(on_choice(found))
    assert "If a sensor cannot be had" in told
    assert "Ways of stamping it" in told
    page = html(on_verdict(check_loaded(case_of(text), CheckSettings(monte_carlo=False))))
    assert "If a sensor cannot be had" in page
    every = optimize(case_of(text), OptimizeSettings(count=3, every=True))
    assert all(one.stampings is None for one in every.result.designs)
    assert len({tuple(names(every.problem, d)) for d in every.designs}) < 3
