"""Designs without a sensor, ranges over ways of stamping, bargains: against plain enumeration."""

from __future__ import annotations

import random
from collections import Counter
from pathlib import Path
from typing import Any

import yaml

from questions_oracle import case_of, compare_alternatives, drawn
from random_problems import random_problem
from syncline_design.choice.decide import choose
from syncline_design.choice.enumerate import all_designs
from syncline_design.choice.evaluate import broken
from syncline_design.choice.outcome import Choice
from syncline_design.choice.stampings import stampings_of
from syncline_design.report.on_choice import on_choice
from syncline_design.report.on_verdict import on_verdict
from syncline_design.report.render_console import console
from syncline_design.report.render_html import html
from syncline_design.verdict.optimize import OptimizeSettings, optimize
from syncline_design.verdict.verify import CheckSettings, check_loaded

SPECS = Path(__file__).parent.parent / "specs"


def test_alternatives_and_bargains_are_those_of_plain_enumeration() -> None:
    seen = sum((compare_alternatives(spec) for spec in drawn(21, 10)), Counter[str]())
    assert seen["several ways"] >= 5
    assert seen["without"] >= 5
    assert seen["impossible"] >= 1
    assert seen["bargains"] >= 2


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
