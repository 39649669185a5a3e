"""What-ifs on changed columns, against tables built anew and every design tried."""

from __future__ import annotations

import random
import sys
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from random_problems import random_problem, with_random_limits
from syncline_design.choice import platform_fixes as fixes_of_platforms
from syncline_design.choice.core import Beside, best_from, best_with
from syncline_design.choice.decide import choose
from syncline_design.choice.enumerate import all_designs, best_by_enumeration
from syncline_design.choice.evaluate import (
    Incumbent,
    broken,
    chosen_options,
    evaluate,
    rank,
)
from syncline_design.choice.holding import without
from syncline_design.choice.outcome import Choice, Deadline
from syncline_design.choice.parts import Existence, is_feasible
from syncline_design.choice.platform_fixes import platform_fixes
from syncline_design.choice.problem import build_problem
from syncline_design.choice.slack import payload
from syncline_design.choice.tolerance import measure_next
from syncline_design.choice.variations import (
    PLATFORM_FIGURES,
    platform_figure,
    quantity,
    sigma_figures,
    with_figure,
    with_platform_figure,
)
from syncline_design.choice.what_if import (
    Moving,
    of_method,
    of_sensor,
    same_design,
    same_places,
    with_method_tau,
    with_sensor_error,
)
from syncline_design.spec.load import load

SEEDS = range(16)
BENCHMARKS = Path(__file__).parent.parent / "benchmarks"


@pytest.mark.parametrize("seed", SEEDS)
def test_what_a_design_at_hand_leaves_holds_the_best(seed: int) -> None:
    """From any design that meets the sums: the first of all designs in the documented order."""
    rng = random.Random(seed)
    problem = random_problem(rng, 20)
    problem = with_random_limits(rng, problem, [e.error_m for _, e in all_designs(problem)])
    meet = [design for design, found in all_designs(problem) if not broken(problem, found)]
    best = best_by_enumeration(problem, Deadline())
    for at_hand in [None, *rng.sample(meet, min(3, len(meet)))]:
        assert best_from(problem, at_hand, Beside(problem)) == best


@pytest.mark.parametrize("seed", SEEDS)
def test_a_changed_column_is_a_changed_option(seed: int) -> None:
    """One sensor's error, or one method's tau, set in columns or option by option."""
    rng = random.Random(seed)
    problem = random_problem(rng, 20)
    at_hand = next(design for design, _ in all_designs(problem))
    beside = Beside(problem)
    r = rng.randrange(len(problem.roles))
    table = problem.roles[r]
    place = rng.randrange(len(table.options))
    own = table.options[place]
    value = Fraction(rng.randint(1, 40), 16)
    if rng.random() < 0.5:
        changed = with_sensor_error(problem, r, of_sensor(problem, r, place), value)
        options = [
            replace(o, sensor_error_m=float(value), exact_error_m=value)
            if o.sensor == own.sensor
            else o
            for o in table.options
        ]
    else:
        changed = with_method_tau(problem, r, of_method(problem, r, place), value)
        options = [
            replace(o, tau_s=float(value), exact_tau_s=value) if o.method == own.method else o
            for o in table.options
        ]
    table = replace(table, options=tuple(options))
    anew = replace(problem, roles=(*problem.roles[:r], table, *problem.roles[r + 1 :]))
    assert [tuple(o) for o in map(_figures, changed.roles[r].options)] == [
        tuple(o) for o in sorted(map(_figures, options))
    ]
    assert best_from(changed, None, beside) == best_by_enumeration(changed, Deadline())
    assert _names(changed, best_from(changed, at_hand, beside)) == _names(
        anew, best_by_enumeration(anew, Deadline())
    )


@pytest.mark.parametrize("seed", range(40))
def test_the_best_with_another_option_or_near_a_design_that_fails(seed: int) -> None:
    """What bounds leave of a changed problem holds its best design, by every design tried."""
    rng = random.Random(seed)
    problem = random_problem(rng, 20)
    problem = with_random_limits(rng, problem, [e.error_m for _, e in all_designs(problem)])
    best = best_by_enumeration(problem, Deadline())
    if best is None:
        return
    beside, r = Beside(problem), rng.randrange(len(problem.roles))
    place = rng.randrange(len(problem.roles[r].options))
    rows = of_sensor(problem, r, place)
    own = problem.roles[r].pool()[int(np.argmax(rows))].sensor
    changed = with_sensor_error(problem, r, rows, Fraction(rng.randint(1, 64), 64))
    plain = best_by_enumeration(changed, Deadline())
    at_hand = same_design(problem, best, changed)
    near = (tuple(same_places(problem, best, changed)), best)
    assert best_from(changed, at_hand, beside, near) == plain
    if own != problem.roles[r].options[best.options[r]].sensor:
        assert at_hand is not None
        known = Incumbent.of(changed, at_hand)
        assert known is not None
        options = changed.roles[r].options
        with_it = best_with(
            changed, known, r, options.sensor == rows_number(problem, r, own), beside
        )
        found = [at_hand] if with_it is None else [at_hand, with_it]
        assert min(found, key=lambda d: rank(changed, d, evaluate(changed, d))) == plain


def rows_number(problem, r: int, sensor: str) -> int:
    pool = problem.roles[r].pool()
    return next(int(n) for n, one in zip(pool.sensor, pool, strict=True) if one.sensor == sensor)


@pytest.mark.parametrize("seed", range(30))
def test_the_best_without_a_sensor(seed: int) -> None:
    """By what bounds leave near the chosen design, and by every design tried."""
    rng = random.Random(seed)
    problem = random_problem(rng, 20)
    problem = with_random_limits(rng, problem, [e.error_m for _, e in all_designs(problem)])
    best = best_by_enumeration(problem, Deadline())
    if best is None:
        return
    for sensor in {option.sensor for option in chosen_options(problem, best)}:
        whole, part = without(problem, sensor), without(problem, sensor, best)
        plain = None if whole.is_empty else best_by_enumeration(whole.problem, Deadline())
        found = None if part.is_empty else best_by_enumeration(part.problem, Deadline())
        assert (found and part.whole(found)) == (plain and whole.whole(plain))


def _figures(option) -> tuple:
    return (*option.names, option.error(), option.tau(), option.timeline, option.requires)


def _names(problem, design):
    if design is None:
        return None
    roles = zip(problem.roles, design.options, strict=True)
    return [table.options[i].names for table, i in roles], design.clocks


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory):
    """A case of three sensors a role whose choice is close to others."""
    sys.path.insert(0, str(BENCHMARKS))
    from choice_instances import write_spec

    folder = tmp_path_factory.mktemp("small")
    path = write_spec(folder, 1, 3, 3, 8, accuracy_m=0.35, sync=1e-4)
    return load(path)


def test_measure_next_as_if_every_figure_were_tried(small) -> None:
    """20 % to either side of every figure: tables built anew and every design enumerated."""
    problem = build_problem(small)
    found = choose(problem, "enumerate")
    assert isinstance(found, Choice)
    now = payload(problem, found.design)
    expected = set()
    for figure in sigma_figures(small):
        for share in (Fraction(4, 5), Fraction(6, 5)):
            end = float(figure.quantity.exact * share)
            other = build_problem(with_figure(small, figure, quantity(end, figure.dimension)))
            design = best_by_enumeration(other, Deadline())
            if design is None or payload(other, design) != now:
                expected.add((figure.name, end))
    assert expected
    assert {(m.figure, m.at) for m in measure_next(small, problem, found.design)} == expected


@pytest.mark.parametrize("figure", PLATFORM_FIGURES)
@pytest.mark.parametrize("share", [0.01, 0.5, 1.0001, 3.0, 1e4])
def test_a_platform_that_moves_otherwise(small, figure, share: float) -> None:
    """Columns moved are columns built: figures, exclusions and their reasons."""
    problem = build_problem(small)
    value = share * float(platform_figure(small, 0, figure))
    moved = Moving.of(small, problem, 0).at(problem, figure, value)
    dimension = PLATFORM_FIGURES[figure][1]
    anew = build_problem(with_platform_figure(small, 0, figure, quantity(value, dimension)))
    assert moved == replace(anew, roles=moved.roles)
    for one, other in zip(moved.roles, anew.roles, strict=True):
        assert tuple(one.options) == tuple(other.options)
        assert sorted(map(repr, one.excluded)) == sorted(map(repr, other.excluded))
        for column in ("error", "added", "tau", "crit"):
            np.testing.assert_allclose(
                getattr(one.options, column), [_exact(o, column) for o in other.options], rtol=1e-14
            )


@pytest.mark.parametrize(("accuracy_m", "sync"), [(0.02, 1e-4), (0.35, 1e-6), (0.02, 1.0)])
def test_changes_of_a_platform_that_help_are_those_of_tables_built_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, accuracy_m: float, sync: float
) -> None:
    from choice_instances import write_spec

    case = load(write_spec(tmp_path, 1, 3, 3, 8, accuracy_m=accuracy_m, sync=sync))
    problem = build_problem(case)
    found = list(platform_fixes(case, problem, build_problem))

    def built(case, problem, build, stage: int):
        return lambda _, figure, at: build(
            with_platform_figure(case, stage, figure, quantity(at, PLATFORM_FIGURES[figure][1]))
        )

    monkeypatch.setattr(fixes_of_platforms, "platform_what_if", built)
    monkeypatch.setattr(Existence, "of", lambda _, problem: is_feasible(problem))
    assert found == list(platform_fixes(case, problem, build_problem))
    assert found


def test_designs_that_others_had_are_taken_for_none_that_they_are_not() -> None:
    """One problem after the other with other limits and another sensor's error, enumerated."""
    said = []
    for seed in SEEDS:
        rng = random.Random(seed)
        first, existence = random_problem(rng, 20), Existence()
        errors = [found.error_m for _, found in all_designs(first)]
        for _ in range(12):
            r = rng.randrange(len(first.roles))
            rows = of_sensor(first, r, rng.randrange(len(first.roles[r].options)))
            changed = with_sensor_error(first, r, rows, Fraction(rng.randint(1, 40), 16))
            problem = with_random_limits(rng, changed, errors)
            said.append(any(not broken(problem, found) for _, found in all_designs(problem)))
            assert existence.of(problem) == said[-1]
    assert 40 < sum(said) < len(said) - 40


def _exact(option, column: str) -> float:
    if column == "crit":
        return option.tau_crit_s
    error = option.error()
    figures = {"error": error, "added": error + option.systematic(), "tau": option.tau()}
    return float(figures[column])
