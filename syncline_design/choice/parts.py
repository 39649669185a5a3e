"""The requirements of a problem one by one: lifted, moved, and the least limit that would do."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import field, replace
from fractions import Fraction
from typing import Any, NamedTuple

from syncline_design.choice.acceptable import iter_acceptable
from syncline_design.choice.decide import some_design
from syncline_design.choice.evaluate import Evaluation, broken, evaluate
from syncline_design.choice.holding import best_design
from syncline_design.choice.options import RESOURCES
from syncline_design.choice.outcome import TooLarge
from syncline_design.choice.table import Design, Limits, Objective, Problem, with_limits
from syncline_design.choice.what_if import same_design
from syncline_design.machine.deadline import in_force
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.spec.requirement import SUMMED_KINDS

FIELDS = {"accuracy": "accuracy_m", "sample_spacing": "spacing_m"}  # of Limits, else the kind
SIMULATED = "monte_carlo"
STEPS = 40
CLOSE = 1e-4
LARGEST_RATIO = 1e12
MOST_KEPT = 2  # designs that are tried before others are looked for
MOST_TRIED = 60  # designs simulated for the least limit of a simulated requirement


class ConflictPart(NamedTuple):
    """What a conflict is made of: a kind of sums at its tightest limit, or a simulated quantile.

    id: of the requirement that sets the limit; None for the implied sync limit.
    """

    kind: str
    id: str | None


def parts_of(problem: Problem) -> tuple[ConflictPart, ...]:
    """Every requirement in force, the tightest of each kind of sum."""
    names = dict(problem.limits.ids)
    found = [
        ConflictPart(kind, names.get(kind))
        for kind in SUMMED_KINDS
        if _is_active(problem.limits, kind)
    ]
    if problem.judge is not None:
        found += [ConflictPart(SIMULATED, name) for name, _ in problem.judge.limits]
    return tuple(found)


def _is_active(limits: Limits, kind: str) -> bool:
    if kind == "sync":
        return math.isfinite(limits.sync)
    return getattr(limits, FIELDS.get(kind, kind)) is not None


def lifted(problem: Problem, parts: Iterable[ConflictPart]) -> Problem:
    """The problem without some of its requirements."""
    return moved(problem, {part: math.inf if part.kind == "sync" else None for part in parts})


def moved(problem: Problem, limits: Mapping[ConflictPart, Any]) -> Problem:
    """The problem with other limits; None lifts a requirement, infinity the sync one."""
    changes: dict[str, Any] = {}
    for part, value in limits.items():
        if part.kind != SIMULATED:
            changes[FIELDS.get(part.kind, part.kind)] = value
    out = with_limits(problem, replace(problem.limits, **changes)) if changes else problem
    if problem.judge is None:
        return out
    simulated = {p.id: value for p, value in limits.items() if p.kind == SIMULATED}
    kept = [(name, simulated.get(name, limit)) for name, limit in problem.judge.limits]
    left = tuple((name, limit) for name, limit in kept if limit is not None)
    return replace(out, judge=problem.judge.with_limits(left) if left else None)


def solve(problem: Problem) -> Evaluation | None:
    """Sums of the best design that meets every requirement; None when there is none."""
    found = best_design(problem)
    return None if found is None else evaluate(problem, found)


def is_feasible(problem: Problem) -> bool:
    """Whether any design meets every requirement; which is the best of them is not asked."""
    return any_design(problem) is not None


def any_design(problem: Problem) -> Design | None:
    """A design that meets every requirement, the best or not; None when there is none."""
    if problem.judge is None:
        with suppress(TooLarge):
            return some_design(problem, in_force())
    return best_design(problem)


@dataclass
class Existence:
    """Whether problems that are much alike have a design: one that another had is tried first."""

    found: list[tuple[Problem, Design]] = field(default_factory=list)

    def of(self, problem: Problem) -> bool:
        """Whether any design meets every requirement."""
        if problem.judge is None and any(self._stands(problem, *one) for one in self.found):
            return True
        design = any_design(problem)
        if design is not None:
            self.found = [(problem, design), *self.found[: MOST_KEPT - 1]]
        return design is not None

    def _stands(self, problem: Problem, other: Problem, design: Design) -> bool:
        same = same_design(other, design, problem)
        return same is not None and not broken(problem, evaluate(problem, same))


def least(problem: Problem, part: ConflictPart) -> Fraction | None:
    """The least limit of one requirement at which some design meets all; None: at none.

    Sums exactly; sync to 1e-4; a simulated quantile as near as its samples tell, over the designs
    of the least Syncline error.
    """
    if part.kind == "sync":
        return _least_sync(problem, part)
    if part.kind == SIMULATED:
        return _least_simulated(problem, part)
    if part.kind == "sample_spacing":
        return _least_spacing(problem, part)
    objective: Objective = "error"
    if part.kind != "accuracy":
        objective = next(name for name in RESOURCES if name == part.kind)
    best = solve(replace(lifted(problem, [part]), objective=objective))
    if best is None:
        return None
    return Fraction(best.error_m) if objective == "error" else best.amount(objective)


def _least_sync(problem: Problem, part: ConflictPart) -> Fraction | None:
    def holds(limit: float) -> bool:
        return is_feasible(moved(problem, {part: limit}))

    if not holds(math.inf):
        return None
    fails = problem.limits.sync
    if math.isinf(fails):
        fails = 1e-6
    works = 2.0 * fails
    while not holds(works) and works < LARGEST_RATIO:
        fails, works = works, works * 4.0
    if not holds(works):
        return None
    for _ in range(STEPS):
        if works - fails <= CLOSE * works:
            break
        middle = 0.5 * (works + fails)
        works, fails = (middle, fails) if holds(middle) else (works, middle)
    return Fraction(works)


def _least_spacing(problem: Problem, part: ConflictPart) -> Fraction | None:
    """The least of the spacings that there are which leaves a design."""
    apart = {
        option.spacing_m(table.speed_mps, table.distance_m)
        for table, every in [(one, one.anywhere()) for one in problem.roles]
        for option in every.first_of_each(every.sensor)
    }
    tried = sorted(apart)
    first, last = 0, len(tried)
    while first < last:
        middle = (first + last) // 2
        if is_feasible(moved(problem, {part: float(tried[middle])})):
            last = middle
        else:
            first = middle + 1
    return tried[first] if first < len(tried) else None


def _least_simulated(problem: Problem, part: ConflictPart) -> Fraction | None:
    assert problem.judge is not None
    assert part.id is not None
    rest = replace(lifted(problem, [part]), objective="error")
    reached = math.inf
    for tried, (design, found) in enumerate(iter_acceptable(rest)):
        if found.passed:
            reached = min(reached, problem.judge.reached_m(rest, design, part.id))
        if tried >= MOST_TRIED:
            break
    return Fraction(reached) if math.isfinite(reached) else None
