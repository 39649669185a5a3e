"""The few designs that may take another's place as a figure grows, against all designs tried."""

from __future__ import annotations

import random
import sys
from collections import Counter
from fractions import Fraction
from pathlib import Path

import pytest

from random_problems import random_problem, with_random_limits
from syncline_design.choice import slack
from syncline_design.choice.core import Beside
from syncline_design.choice.decide import choose
from syncline_design.choice.enumerate import all_designs, best_by_enumeration
from syncline_design.choice.outcome import Choice, Deadline
from syncline_design.choice.problem import build_problem
from syncline_design.choice.rivals import Changed, Growing, Rivals, rivals
from syncline_design.choice.slack import payload, slack_ledger
from syncline_design.choice.table import Design, Problem, RoleTable
from syncline_design.choice.what_if import (
    of_method,
    of_sensor,
    platform_what_if,
    with_method_tau,
    with_sensor_error,
)
from syncline_design.spec.load import load

SEEDS = range(60)
GROWTHS = (1.0 + 1e-9, 1.05, 1.7, 6.0, 300.0)
BENCHMARKS = Path(__file__).parent.parent / "benchmarks"


def growing_error(r: int) -> Growing:
    def vary(problem: Problem, design: Design) -> Changed:
        rows = of_sensor(problem, r, design.options[r])
        return lambda value: with_sensor_error(problem, r, rows, Fraction(value))

    return Growing(vary, (r,))


def growing_tau(r: int) -> Growing:
    def vary(problem: Problem, design: Design) -> Changed:
        rows = of_method(problem, r, design.options[r])
        return lambda value: with_method_tau(problem, r, rows, Fraction(value))

    return Growing(vary)


def compared(found: Rivals, changed: Changed, least: float) -> Counter[str]:
    """What rivals name at each value, held against every design of the changed problem."""
    seen: Counter[str] = Counter()
    for growth in GROWTHS:
        best = found.best(least * growth)
        if best is None:
            seen["fails"] += 1
            continue
        other = changed(least * growth)
        plain = best_by_enumeration(other, Deadline())
        assert plain is not None
        assert payload(*best) == payload(other, plain)
        seen["changes" if best[1] != found.designs[0] else "stays"] += 1
    return seen


def test_rivals_hold_the_best_of_all_designs() -> None:
    """One sensor's error or one method's tau grown, in problems with every coupling."""
    seen: Counter[str] = Counter()
    for seed in SEEDS:
        rng = random.Random(seed)
        problem = random_problem(rng, 20)
        problem = with_random_limits(rng, problem, [e.error_m for _, e in all_designs(problem)])
        design = best_by_enumeration(problem, Deadline())
        if design is None:
            continue
        for r, table in enumerate(problem.roles):
            option = table.options[design.options[r]]
            for figure, least in (
                (growing_error(r), option.sensor_error_m),
                (growing_tau(r), option.tau_s),
            ):
                found = rivals(problem, design, figure, least, Beside(problem))
                if found is not None and least > 0.0:
                    seen += compared(found, figure.vary(problem, design), least)
    assert min(seen[word] for word in ("fails", "changes", "stays")) > 10, seen


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory):
    """A case whose sync limit rules options out that a longer distance lets in."""
    sys.path.insert(0, str(BENCHMARKS))
    from choice_instances import write_spec

    path = write_spec(tmp_path_factory.mktemp("small"), 1, 4, 8, 8, accuracy_m=0.45, sync=0.1)
    return load(path)


@pytest.mark.parametrize(
    ("figure", "least"), [("v_max", 2.0), ("distance", 10.0), ("omega_max", 0.8)]
)
def test_a_platform_that_moves_more(small, figure, least) -> None:
    problem = build_problem(small)
    chosen = choose(problem)
    assert isinstance(chosen, Choice)
    what_if = platform_what_if(small, problem, build_problem, 0)

    def vary(problem: Problem, _: Design) -> Changed:
        return lambda at: what_if(problem, figure, at)

    noisier = (0, 1, 2) if figure == "distance" else ()
    growing = Growing(vary, noisier, RoleTable.anywhere)
    found = rivals(problem, chosen.design, growing, least, Beside(problem))
    assert found is not None
    assert set(compared(found, vary(problem, chosen.design), least)) == {"stays", "fails"}


def test_a_ledger_chooses_anew_where_the_design_fails_alone(
    small, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As long as the design stands and nothing comes near it, no choice is made."""
    problem = build_problem(small)
    chosen = choose(problem)
    assert isinstance(chosen, Choice)
    asked = []
    best_from = slack.best_from
    monkeypatch.setattr(slack, "best_from", lambda *given: asked.append(1) or best_from(*given))
    fewer = slack_ledger(small, problem, chosen.design)
    tries = len(asked)
    monkeypatch.setattr(slack, "rivals", lambda *_: None)
    assert slack_ledger(small, problem, chosen.design) == fewer
    assert tries <= 2 * len(fewer) < len(asked) - tries
