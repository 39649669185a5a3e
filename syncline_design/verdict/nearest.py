"""The design nearest to a spec that none meets: that of the least change of limits that helps."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from fractions import Fraction

from syncline_design.choice.evaluate import Evaluation, broken, evaluate
from syncline_design.choice.fixes import Move, with_moves
from syncline_design.choice.front import front
from syncline_design.choice.holding import best_design
from syncline_design.choice.outcome import Explanation, Fix, NoVerdict
from syncline_design.choice.parts import lifted, parts_of
from syncline_design.choice.table import Design, Problem
from syncline_design.choice.variations import Build
from syncline_design.model.quantity import Quantity
from syncline_design.spec.case import Case
from syncline_design.spec.requirement import LIMIT_DIMENSIONS
from syncline_design.verdict.design_data import full_design
from syncline_design.verdict.named import MissedLimit, Nearest, PricedError
from syncline_design.verdict.tree import UNITS

LIMITS = frozenset(LIMIT_DIMENSIONS)  # kinds of fix that move a limit and nothing else
ROOM = Fraction(1, 10**12)  # for a limit that was rounded to a float on its way


def nearest(case: Case, problem: Problem, why: Explanation, build: Build) -> Nearest | None:
    """None where moving limits alone does not help, or where the time is over."""
    sets = [(fix,) for fix in why.fixes if fix.kind in LIMITS] + list(why.joint_fixes)
    if not sets:
        return None
    least = min(sets, key=lambda fixes: max(fix.relative or 0.0 for fix in fixes))
    with suppress(NoVerdict):
        return _of(case, problem, least, build)
    return None


def _of(case: Case, problem: Problem, fixes: Sequence[Fix], build: Build) -> Nearest | None:
    moved = with_moves(case, [_move(case, fix) for fix in fixes])
    eased = build(moved)
    design = best_design(eased)
    if design is None:
        return None
    sums = evaluate(eased, design)
    cost, mass, power = (
        None if a is None else float(a) for a in (sums.cost, sums.mass, sums.power)
    )
    written = {one.id: one.limit_written for one in case.spec.requirements}
    misses = tuple(
        _missed(fix, _reached(eased, design, sums, fix), written.get(fix.requirement or ""))
        for fix in fixes
    )
    shown = full_design(moved, eased, design)
    return Nearest(cost, mass, power, sums.error_m, misses, shown, _front(case, problem, written))


def _move(case: Case, fix: Fix) -> Move:
    """The fix as a limit of the spec; money in its own currency."""
    to = Fraction(fix.to or 0.0) * (1 + ROOM)
    currency = case.spec.currency if fix.kind == "cost" else None
    found = next((one for one in case.spec.requirements if one.id == fix.requirement), None)
    return found, fix.from_ or 0.0, Quantity(to, "", None, currency)


def _reached(problem: Problem, design: Design, sums: Evaluation, fix: Fix) -> float:
    """What the design reaches; of its sync ratio the limit that was shown to do."""
    value = _sum_of(sums, fix.kind)
    if value is not None:
        return float(value)
    judge, name = problem.judge, fix.requirement
    if judge is not None and name in dict(judge.limits):
        return judge.estimate_m(problem, design, name)
    return fix.to or 0.0


def _sum_of(sums: Evaluation, kind: str) -> Fraction | float | None:
    """The sum that a kind of requirement limits; None of what is no sum, or not known."""
    return {
        "accuracy": sums.error_m, "cost": sums.cost, "mass": sums.mass, "power": sums.power
    }.get(kind)  # fmt: skip


def _missed(fix: Fix, reached: float, written: str | None) -> MissedLimit:
    kind = fix.kind
    return MissedLimit(fix.requirement, kind, reached, fix.from_ or 0.0, fix.unit or "", written)


def _front(
    case: Case, problem: Problem, written: Mapping[str, str | None]
) -> tuple[PricedError, ...]:
    """Of all that keeps every sum but cost and accuracy, the cheapest for each error."""
    costs = [part for part in parts_of(problem) if part.kind == "cost"]
    bare = replace(lifted(problem, costs), judge=None)
    return tuple(
        PricedError(
            float(point.amount),
            point.error_m,
            tuple(_broken_limits(case, problem, point.design, written)),
            full_design(case, problem, point.design),
        )
        for point in front(bare)
    )


def _broken_limits(
    case: Case, problem: Problem, design: Design, written: Mapping[str, str | None]
) -> Iterator[MissedLimit]:
    """The sums of a design that are beyond their tightest limit."""
    sums, limits = evaluate(problem, design), problem.limits
    kinds, ids = broken(problem, sums), dict(limits.ids)
    for kind, limit in (("accuracy", limits.accuracy_m), ("cost", limits.cost)):
        value = _sum_of(sums, kind)
        if kind in kinds and value is not None and limit is not None:
            name, unit = ids.get(kind), UNITS.get(kind, case.spec.currency)
            words = written.get(name or "")
            yield MissedLimit(name, kind, float(value), float(limit), unit, words)
