"""A spec of several missions, or one chosen for any figures within their intervals, as a family.

`choose_for: always` holds a design against both ends of every datasheet interval: accuracy is worst
where every error is largest, sync where every error is smallest (a better sensor has a smaller
tau_crit), so that what holds at both ends holds everywhere between.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from syncline_design.choice.family import Family, FamilyDesign, family_of
from syncline_design.choice.family_best import FamilyPoint, SummedDesign, family_front, iter_family
from syncline_design.choice.family_parts import Whole, narrowed_family
from syncline_design.choice.family_roads import choose_by_road, front_by_road, in_hand
from syncline_design.choice.judged import judgement
from syncline_design.choice.option import ResourceName, Resources
from syncline_design.choice.outcome import OutOfTime, Proof, Road
from syncline_design.choice.prices import resources_of
from syncline_design.choice.problem import sole_design
from syncline_design.choice.table import Design, Problem
from syncline_design.choice.variations import (
    Build,
    SheetFigure,
    quantity,
    sigma_figures,
    with_figure,
)
from syncline_design.machine.deadline import in_force
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.spec.case import Case, Mission
from syncline_design.verdict.likely import Likelihood, likelihood_of

End = Literal["low", "high"]
ALL = ""  # the mission of a spec that has none
MERGED = Proof("front", optimal=True, rechecked=True)


@dataclass(frozen=True, slots=True)
class Scenario:
    """One mission with its figures as given, or all at one end of their intervals."""

    mission: str
    end: End | None
    case: Case
    problem: Problem


@dataclass(frozen=True, slots=True)
class Work:
    """A spec's missions as scenarios, and the family that they are.

    likelihood: where a design has to hold with a probability; seed: of what it draws.
    """

    case: Case
    missions: tuple[Mission, ...]
    scenarios: tuple[Scenario, ...]
    family: Family
    seed: int
    likelihood: Likelihood | None = None

    def of(self, mission: str) -> list[int]:
        """The places of a mission's scenarios."""
        return [i for i, one in enumerate(self.scenarios) if one.mission == mission]


@dataclass(frozen=True, slots=True)
class Chosen:
    """A design of each scenario; found: with the family's sums, None of what is pinned.

    problems: in whose tables the designs' places hold.
    """

    designs: tuple[Design, ...]
    problems: tuple[Problem, ...]
    found: SummedDesign | None = None
    undecided: bool = False
    passed_open: int = 0  # better designs that are left open
    proof: Proof = MERGED


def missions_of(case: Case) -> tuple[Mission, ...]:
    """The missions of a spec; the spec itself where it has none."""
    return case.missions or (Mission(ALL, case),)


def work_of(case: Case, build: Callable[[], Build], seed: int, *, nominal: bool = False) -> Work:
    """The scenarios of a spec; build: a fresh way to make a problem of each case.

    nominal: with figures as given, whatever the spec asks for.
    """
    likely = None
    if not nominal and not isinstance(case.spec.choose_for, str):
        cases = [one.case for one in missions_of(case)]
        likely = likelihood_of(cases, float(case.spec.choose_for), seed)
    missions, wanted = missions_of(case), case.spec.choose_for
    nominal = nominal or wanted != "always"
    scenarios = [
        Scenario(one.name, end, own, build()(own))
        for one in missions
        for end, own in _ends(one.case, nominal)
    ]
    return Work(case, missions, tuple(scenarios), _family(missions, scenarios), seed, likely)


def _family(missions: Sequence[Mission], scenarios: Sequence[Scenario]) -> Family:
    names = [one.mission for one in scenarios]
    order = list(dict.fromkeys(names))
    problems = [one.problem for one in scenarios]
    return family_of(names, problems, _differing(missions), [order.index(n) for n in names])


def with_problems(work: Work, problems: Sequence[Problem]) -> Work:
    """The family with other tables of its scenarios."""
    scenarios = tuple(
        replace(one, problem=problem) for one, problem in zip(work.scenarios, problems, strict=True)
    )
    likely = None if work.likelihood is None else replace(work.likelihood, known={})
    family = _family(work.missions, scenarios)
    return replace(work, scenarios=scenarios, family=family, likelihood=likely)


def intervals(case: Case) -> tuple[SheetFigure, ...]:
    """Every datasheet figure with an interval, of what the spec may use."""
    return tuple(figure for figure in sigma_figures(case) if figure.quantity.has_tolerance)


def _ends(case: Case, nominal: bool) -> list[tuple[End | None, Case]]:
    """A mission's case as it is, or with all figures at either end of their intervals."""
    figures = () if nominal else intervals(case)
    if not figures:
        return [(None, case)]
    return [("high", at_end(case, figures, "high")), ("low", at_end(case, figures, "low"))]


def at_end(case: Case, figures: Sequence[SheetFigure], end: End) -> Case:
    """A case with figures at one end of their intervals."""
    for figure in figures:
        value = figure.quantity.high if end == "high" else figure.quantity.low
        case = with_figure(case, figure, quantity(value, figure.dimension))
    return case


def _differing(missions: Sequence[Mission]) -> dict[int, dict[str, Resources]]:
    """Roles of which each mission may have its own sensor: what each sensor takes alone."""
    out: dict[int, dict[str, Resources]] = {}
    first = missions[0].case
    slots = [(stage.index, role) for stage in first.stages for role in stage.roles]
    for r, (stage, role) in enumerate(slots):
        if not role.choice.per_mission:
            continue
        out[r] = {}
        for mission in missions:
            own = mission.case.stages[stage].role(role.role)
            for one in own.sensors if own is not None else ():
                out[r][one.id] = resources_of(mission.case, one.entry)
    return out


def choose_family(work: Work, road: Road = "auto") -> Chosen | None:
    """The first design that meets every requirement of every mission; None: there is none.

    Where simulation leaves open every design that keeps the sums, the first of those.  A deadline
    that ends the search leaves a design that meets, not proven the best, where one was found.
    """
    held = in_hand(work.family, passing(work))
    try:
        return _proven(work, road)
    except OutOfTime:
        if held is None:
            raise
        proof = held.proof(work.family, road)
        designs = work.family.designs(held.found.design)
        return Chosen(designs, work.family.problems, held.found, proof=proof)


def _proven(work: Work, road: Road) -> Chosen | None:
    left_open: list[FamilyDesign] = []
    problems, passes = work.family.problems, passing(work, left_open)
    by_sums = choose_by_road(work.family, road)
    one, proof = by_sums.found, by_sums.proof
    if one is None:
        return None
    if passes is not None and not passes(one.design):
        left_open.clear()  # what is left open comes again in its order
        one = next(accepted(work, left_open), None)
    if one is not None:
        designs = work.family.designs(one.design)
        return Chosen(designs, problems, one, passed_open=len(left_open), proof=proof)
    if left_open:
        first = work.family.designs(left_open[0])
        return Chosen(first, problems, None, undecided=True, proof=proof)
    return None


def accepted(work: Work, left_open: list[FamilyDesign] | None = None) -> Iterator[SummedDesign]:
    """Designs that meet every requirement of every mission, best first.

    left_open: takes in those that simulation leaves open.
    """
    passes = passing(work, left_open)
    first = next(iter_family(work.family), None)
    if passes is None or first is None or passes(first.design):
        yield from iter_family(work.family, passes)
        return
    if left_open is not None:
        left_open.clear()  # what the rest leaves open comes in its own order
    family, whole = promising_family(work.family)
    for one in iter_family(family, lambda design: passes(whole(design))):
        yield replace(one, design=whole(one.design))


def on_part(work: Work, part: Family) -> Work:
    """The same questions asked of a part of the family."""
    return replace(work, family=part)


def promising_family(family: Family) -> tuple[Family, Whole]:
    """The family without ways that simulation rules out by one sensor alone, in any mission.

    With how its designs are the whole family's.
    """
    kept = [np.ones(len(role), dtype=bool) for role in family.roles]
    for m, problem in enumerate(family.problems):
        if problem.judge is None or not all(len(table.options) for table in problem.roles):
            continue
        for r, (table, role) in enumerate(zip(problem.roles, family.roles, strict=True)):
            in_force().check()
            sensors = table.options.sensor
            _, first = np.unique(sensors, return_index=True)
            gone = [p for p in first.tolist() if problem.judge.hopeless(problem, r, p)]
            kept[r] &= ~np.isin(sensors[role.places[m]], sensors[gone])
    return narrowed_family(family, [np.flatnonzero(one) for one in kept])


def front_of(work: Work, resource: ResourceName = "cost") -> tuple[FamilyPoint, ...]:
    """The exact front of all that meet every requirement but accuracy, simulation included."""
    passes = passing(work)
    if passes is None:
        return front_by_road(work.family, resource)
    family, whole = promising_family(work.family)
    points = family_front(family, resource, lambda design: passes(whole(design)))
    return tuple(replace(one, design=whole(one.design)) for one in points)


def passing(
    work: Work, left_open: list[FamilyDesign] | None = None
) -> Callable[[FamilyDesign], bool] | None:
    """Whether what is no sum accepts a design in every mission; None where nothing asks it."""
    likely = work.likelihood
    if likely is None and all(problem.judge is None for problem in work.family.problems):
        return None

    def passes(design: FamilyDesign) -> bool:
        designs, undecided = work.family.designs(design), False
        for problem, own in zip(work.family.problems, designs, strict=True):
            found = judgement(problem, own)
            if found.failed:  # one mission is enough; the others would be simulated in vain
                return False
            undecided |= bool(found.undecided)
        if likely is not None:
            status = likely.of(work.family.problems, designs).status
            if status == "fail":
                return False
            undecided |= status == "indeterminate"
        if undecided:
            if left_open is not None:
                left_open.append(design)
            return False
        return True

    return passes


def pinned_family(work: Work) -> Chosen | None:
    """The only design that a spec leaves, whatever it breaks; None where something is open."""
    soles = [sole_design(one.problem) for one in work.scenarios]
    given = [one for one in soles if one is not None]
    if len(given) < len(soles):
        return None
    return Chosen(tuple(design for _, design in given), tuple(problem for problem, _ in given))
