"""The best design, by one road or by roads that must agree."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace

from syncline_design.choice.acceptable import iter_acceptable, iter_judged
from syncline_design.choice.anytime import in_hand, unproven
from syncline_design.choice.enumerate import best_by_enumeration
from syncline_design.choice.evaluate import broken, evaluate, rank
from syncline_design.choice.judged import judgement
from syncline_design.choice.merged_front import merged_front
from syncline_design.choice.option import ResourceName
from syncline_design.choice.outcome import (
    ROAD_NAMES,
    Choice,
    Deadline,
    FrontPoint,
    Infeasible,
    NoVerdict,
    OutOfTime,
    Proof,
    Road,
    TooLarge,
    Unfinished,
)
from syncline_design.choice.partition import iter_differing
from syncline_design.choice.ranked import iter_best
from syncline_design.choice.table import Design, Problem, SimulatedJudgement, is_empty
from syncline_design.machine.deadline import in_force

SMALL = 300  # combinations up to which the automatic road also enumerates
MOST_COUNTED = 1000  # better designs that fail simulation are counted up to here
SAME = 1e-11  # errors that two roads may call the same: neither sums floats more exactly
MOST_STEPS = 4000  # steps of the search that confirms the merge before it is left out


def choose(problem: Problem, road: Road = "auto") -> Choice | Infeasible:
    """The best design in the documented order, or that there is none.

    auto: the front by merging, confirmed by best-first search and, where there are few
    combinations, by enumeration; the MILP where merging gives up.  Raises NoVerdict when a road
    ends without a proof or two roads disagree.  A deadline that ends the search leaves a design
    that meets every sum and is not proven optimal, where one was found.
    """
    if road not in ROAD_NAMES:
        raise ValueError(f"unknown road {road!r}; expected one of {', '.join(ROAD_NAMES)}")
    if is_empty(problem):
        return Infeasible(Proof("tables", True, True))
    deadline = in_force()
    deadline.check()
    found = _by_sums(problem, road, deadline)
    if problem.judge is None or isinstance(found, Infeasible):
        return found
    return _simulated(problem, found, deadline)


def _simulated(problem: Problem, first: Choice, deadline: Deadline) -> Choice | Infeasible:
    """The first design in the order that simulation accepts as well.

    Where it accepts none, the first one that it leaves open.
    """
    left_open: Choice | None = None
    proof, tried = first.proof, 0
    try:
        if judgement(problem, first.design).passed:
            return first
        for design, found in iter_judged(problem, deadline):
            if found.passed:
                place = _before(problem, design, deadline)
                return Choice(design, replace(proof, passed_over=place))
            if left_open is None and not found.failed:
                place = _before(problem, design, deadline)
                left_open = Choice(design, replace(proof, passed_over=place), found.undecided)
            tried += 1
    except Unfinished:
        return Choice(first.design, replace(proof, passed_over=tried), exhausted=False)
    return left_open or Infeasible(replace(proof, passed_over=tried))


def _before(problem: Problem, design: Design, deadline: Deadline) -> int:
    """How many designs come before one in the order, at most as many as anyone would count."""
    order = itertools.islice(iter_best(problem, deadline), MOST_COUNTED)
    return next((place for place, one in enumerate(order) if one == design), MOST_COUNTED)


def _by_sums(problem: Problem, road: Road, deadline: Deadline) -> Choice | Infeasible:
    """The best design by the sums; one in hand where the time ends before the proof."""
    held = in_hand(problem, deadline)
    try:
        return _proven(problem, road, deadline)
    except OutOfTime:
        found = None if held is None else unproven(problem, held, road)
        if found is None:
            raise
        return found


def _proven(problem: Problem, road: Road, deadline: Deadline) -> Choice | Infeasible:
    """The answer of one road, or of roads that agree."""
    if road == "auto":
        return _auto(problem, deadline)
    if road == "enumerate":
        return _outcome(problem, best_by_enumeration(problem, deadline), "enumerate")
    if road == "milp":
        return _by_milp(problem, deadline)
    return _outcome(problem, best_by_front(problem, deadline), "front")


def best_by_front(problem: Problem, deadline: Deadline) -> Design | None:
    """The first design by the merge; close calls and ties are settled by best-first search."""
    points = _merged(problem, deadline)
    if not points:
        return None
    ordered = reversed(points) if problem.objective == "error" else points
    picked = next(
        (p.design for p in ordered if not broken(problem, evaluate(problem, p.design))), None
    )
    try:
        first = next(iter_best(problem, deadline, MOST_STEPS), None)
    except (TooLarge, OutOfTime):  # merging is the proof, the search confirms it
        return picked
    return _agreed(problem, picked, first, "merging", "best-first search")


def some_design(problem: Problem, deadline: Deadline) -> Design | None:
    """The most accurate design that the merge finds to keep every sum, simulation apart.

    As sure as the best design: none where nothing is left of the merge, and one that is found is
    decided exactly.  TooLarge where all that is left is as close to a limit as floats cannot tell.
    """
    deadline.check()
    points = () if is_empty(problem) else _merged(problem, deadline)
    if not points:
        return None
    for point in reversed(points):
        if not broken(problem, evaluate(problem, point.design)):
            return point.design
    raise TooLarge("designs that are all as close to a limit as floats tell apart")


def _merged(problem: Problem, deadline: Deadline) -> Sequence[FrontPoint]:
    """The front of what is to be least, or of cost, over designs that keep every limit."""
    resource: ResourceName = "cost" if problem.objective == "error" else problem.objective
    return merged_front(problem, resource, accuracy=True, deadline=deadline)


def _auto(problem: Problem, deadline: Deadline) -> Choice | Infeasible:
    try:
        design = best_by_front(problem, deadline)
    except TooLarge:
        return _by_milp(problem, deadline)
    agrees: tuple[str, ...] = ()
    if problem.combinations <= SMALL:
        try:
            other = best_by_enumeration(problem, deadline)
        except OutOfTime:  # merging is the proof, enumeration confirms it
            return _outcome(problem, design, "front")
        design = _agreed(problem, design, other, "front", "enumeration")
        agrees = ("enumerate",)
    return _outcome(problem, design, "front", agrees)


def _by_milp(problem: Problem, deadline: Deadline) -> Choice | Infeasible:
    """The MILP's answer; among designs it cannot tell apart, the first in the documented order."""
    from syncline_design.choice.milp import best_by_milp  # 34 ms, and HiGHS

    found = best_by_milp(problem, deadline)
    if found is None:
        return _outcome(problem, None, "milp")
    try:
        first = next(iter_best(problem, deadline, MOST_STEPS), None)
    except TooLarge:
        return _outcome(problem, found, "milp")
    agreed = _agreed(problem, found, first, "MILP", "best-first search")
    return _outcome(problem, agreed, "milp", ("search",))


def _agreed(
    problem: Problem, one: Design | None, other: Design | None, first: str, second: str
) -> Design | None:
    """What two roads found: the same objective and error, as far as sums of floats tell apart.

    Of designs that agree so closely the earlier one in the exact order counts.
    """
    if (one is None) != (other is None):
        raise NoVerdict(f"{first} and {second} disagree on whether any design meets the spec")
    if one is None or other is None:
        return None
    sums = [evaluate(problem, design) for design in (one, other)]
    errors = [found.error_m for found in sums]
    alike = abs(errors[0] - errors[1]) <= SAME * max(errors)
    if problem.objective != "error":
        alike &= sums[0].amount(problem.objective) == sums[1].amount(problem.objective)
    if not alike:
        raise NoVerdict(f"{first} and {second} disagree on the best design")
    return min((one, other), key=lambda design: rank(problem, design, evaluate(problem, design)))


def _outcome(
    problem: Problem, design: Design | None, road: str, agrees: tuple[str, ...] = ()
) -> Choice | Infeasible:
    proof = Proof(road, optimal=True, rechecked=True, agrees_with=agrees)
    if design is None:
        return Infeasible(proof)
    if broken(problem, evaluate(problem, design)):
        raise NoVerdict(f"the design found by {road} does not stand up to the exact recheck")
    return Choice(design, proof)


def _until_unfinished(
    designs: Iterator[tuple[Design, SimulatedJudgement]],
) -> Iterator[tuple[Design, SimulatedJudgement]]:
    """Designs until too many were simulated, which the judge remembers."""
    with suppress(Unfinished):
        yield from designs


def best(problem: Problem, count: int, *, every: bool = False) -> Iterator[Design]:
    """The best `count` designs, best first.

    They differ in a sensor at least, each with its best timestamping and clocks; every: whatever
    differs is a design of its own.
    """
    if every:
        found = _until_unfinished(iter_acceptable(problem))
        return itertools.islice((design for design, _ in found), count)
    return itertools.islice(_differing(problem), count)


def _differing(problem: Problem) -> Iterator[Design]:
    seen: set[tuple[str, ...]] = set()
    try:
        if problem.judge is not None:
            raise TooLarge("simulation decides design by design")
        for design in iter_differing(problem, "sensor"):
            seen.add(_sensors(problem, design))
            yield design
    except TooLarge:  # couplings that merging and splitting do not remove
        for design, _ in _until_unfinished(iter_acceptable(problem)):
            if _sensors(problem, design) not in seen:
                seen.add(_sensors(problem, design))
                yield design


def _sensors(problem: Problem, design: Design) -> tuple[str, ...]:
    options = zip(problem.roles, design.options, strict=True)
    return tuple(table.options[i].sensor for table, i in options)
