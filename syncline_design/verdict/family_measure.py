"""Which datasheet figure of a family's candidates would change its payload, were it another.

A figure is a sensor's own: it changes in every mission.  Sensors that no payload can gain from,
even with all their figures at their better ends and no limit on sync, are left out at once.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from functools import partial

import numpy as np

from syncline_design.choice.family import Family
from syncline_design.choice.family_core import unguarded
from syncline_design.choice.family_parts import narrowed_family, ways_with
from syncline_design.choice.family_roads import choose_by_road
from syncline_design.choice.measured_next import (
    Measurement,
    OtherChoice,
    changes,
    ends_tried,
    weight,
)
from syncline_design.choice.outcome import NoVerdict, OutOfTime
from syncline_design.choice.slack import payload
from syncline_design.choice.table import Design, Problem
from syncline_design.choice.variations import (
    Build,
    SheetFigure,
    quantity,
    sigma_figures,
    with_figure,
)
from syncline_design.choice.what_if import numbers_of, with_sensor_error, with_sheet_figure
from syncline_design.machine.deadline import in_force
from syncline_design.verdict.family import Chosen, Work, with_problems


def measure_next(work: Work, chosen: Chosen, build: Callable[[], Build]) -> tuple[Measurement, ...]:
    """Figures that alone flip the family's choice, the dearest flip first.

    Tried are the ends of every tolerance; where no figure has one, 20 % to either side of each.
    """
    every: dict[str, SheetFigure] = {}
    for mission in work.missions:
        for figure in sigma_figures(mission.case):
            every.setdefault(figure.name, figure)
    given = [figure for figure in every.values() if figure.quantity.has_tolerance]
    tried = [(one, ends_tried(one, assumed=not given)) for one in given or every.values()]
    known = _sensors_that_matter(work, chosen, tried)
    found: list[Measurement] = []
    for figure, _ in tried:
        if figure.sensor not in known:
            continue
        choice = partial(_other, work, chosen, build, figure)
        found += changes(figure, assumed=not given, choice=choice)
    return tuple(sorted(found, key=lambda one: (-weight(one), one.figure, one.at)))


def _sensors_that_matter(
    work: Work, chosen: Chosen, tried: Sequence[tuple[SheetFigure, tuple[float, float]]]
) -> set[str]:
    """Sensors of the payload, and those that a payload no dearer could hold were they better."""
    shares: dict[str, float] = {}
    for figure, (low, _) in tried:
        share = low / float(figure.quantity) if figure.quantity > 0.0 else 0.0
        shares[figure.sensor] = min(share, shares.get(figure.sensor, 1.0))
    held = {
        table.options[place].sensor
        for problem, design in zip(chosen.problems, chosen.designs, strict=True)
        for table, place in zip(problem.roles, design.options, strict=True)
    }
    if any(one.case.effects for one in work.missions):
        return held | set(shares)
    return held | {
        sensor
        for sensor, share in shares.items()
        if sensor not in held and _may_gain(work, chosen, sensor, share)
    }


def _may_gain(work: Work, chosen: Chosen, sensor: str, share: float) -> bool:
    """Whether a payload with a sensor whose errors are smaller may come before the chosen one."""
    in_force().check()
    assert chosen.found is not None
    problems = [_better(unguarded(problem), sensor, share) for problem in chosen.problems]
    family = with_problems(work, problems).family
    most = chosen.found.rank[0]
    try:
        for r in range(len(family.roles)):
            part = _holding(family, r, sensor)
            found = None if part is None else choose_by_road(part, "front").found
            if found is not None and found.rank[0] <= most:
                return True
    except OutOfTime:
        raise
    except NoVerdict:
        return True
    return False


def _holding(family: Family, r: int, sensor: str) -> Family | None:
    """The designs with a sensor in a role of some mission."""
    rows = [np.arange(len(role)) for role in family.roles]
    rows[r] = np.flatnonzero(ways_with(family, r, "sensor", sensor))
    return narrowed_family(family, rows)[0] if len(rows[r]) else None


def _better(problem: Problem, sensor: str, share: float) -> Problem:
    """The problem with the error of one sensor down to a share."""
    for r, table in enumerate(problem.roles):
        pool = table.pool()
        _, first = np.unique(pool.sensor, return_index=True)
        for place in first.tolist():
            option = pool[place]
            if option.sensor == sensor and option.error() and share > 0.0:
                rows = np.asarray(pool.sensor == pool.sensor[place])
                problem = with_sensor_error(problem, r, rows, option.error() * Fraction(share))
    return problem


def _other(
    work: Work, chosen: Chosen, build: Callable[[], Build], figure: SheetFigure, end: float
) -> OtherChoice | None:
    """What the choice becomes with a figure at a value; None where it stays."""
    in_force().check()
    assert chosen.found is not None
    value = quantity(end, figure.dimension)
    problems = []
    for mission, problem in zip(work.missions, chosen.problems, strict=True):
        case = mission.case
        if case.effects:
            problems.append(build()(with_figure(case, figure, value)))
        else:
            numbers = numbers_of(case, problem)
            problems.append(with_sheet_figure(case, problem, numbers, figure, value))
    other = with_problems(work, problems)
    found = None if other.family.is_empty else choose_by_road(other.family, "front").found
    if found is None:
        return OtherChoice("infeasible", None)
    designs = other.family.designs(found.design)
    told = list(_changes(work, chosen, problems, designs))
    if not told:
        return None
    return OtherChoice("; ".join(told), _amount(found.rank[0]) - _amount(chosen.found.rank[0]))


def _amount(value: Fraction | float) -> float:
    return float(value) if math.isfinite(value) else 0.0


def _changes(
    work: Work, chosen: Chosen, problems: Sequence[Problem], designs: Sequence[Design]
) -> Iterator[str]:
    """Roles that take another sensor or method; where not in every mission, in which."""
    told: dict[str, list[str]] = {}
    rows = zip(work.missions, chosen.problems, chosen.designs, problems, designs, strict=True)
    for mission, problem, design, other, then in rows:
        before, after = payload(problem, design), payload(other, then)
        for table, old, (sensor, method) in zip(problem.roles, before, after, strict=True):
            if old != (sensor, method):
                line = f"{table.role} of {table.stage_name}: {sensor} stamped by {method}"
                told.setdefault(line, []).append(mission.name)
    for line, names in told.items():
        everywhere = len(names) == len(work.missions)
        yield line if everywhere else f"{line} (in mission {', '.join(names)})"
