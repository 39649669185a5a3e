"""Smallest changes that make an infeasible spec feasible, each solved again as it would be written.

A fix is applied to the loaded spec (its limit, its platform, its methods) and the whole choice is
made anew, simulation and known effects included, before it is offered.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction

from syncline_design.choice.outcome import Fix, NoVerdict
from syncline_design.choice.parts import (
    SIMULATED,
    ConflictPart,
    is_feasible,
    least,
    parts_of,
    solve,
)
from syncline_design.choice.table import Problem
from syncline_design.choice.variations import Build, with_methods
from syncline_design.choice.written import in_unit_of, money, plain
from syncline_design.model.figure_text import format_quantity, to_digits
from syncline_design.model.quantity import Dimension, Quantity
from syncline_design.spec.case import Case, usable_primitives
from syncline_design.spec.requirement import LIMIT_DIMENSIONS, LIMIT_UNITS, Requirement

MOST_METHODS = 3
TRIES = 6
WIDENING = Fraction(1, 100)  # by which a simulated limit is widened when it does not hold yet
IMPLIED = "SYNC"


Move = tuple[Requirement | None, float, Quantity]  # requirement (None: implied), before, after


def requirement_fixes(case: Case, problem: Problem, build: Build) -> Iterator[tuple[Fix, ...]]:
    """For each requirement alone the least relaxation that helps.

    Several fixes at once where two requirements of a kind stand in the way.
    """
    for part in parts_of(problem):
        try:
            value = least(problem, part)
            found = value and proven(case, problem, build, {part: value})
        except NoVerdict:  # a remedy that cannot be proven is not offered
            continue
        if found:
            yield found


def proven(
    case: Case, problem: Problem, build: Build, values: Mapping[ConflictPart, Fraction]
) -> tuple[Fix, ...] | None:
    """The changes that bring limits to these values, if the spec so written has a design."""
    for attempt in range(TRIES):
        moves = [
            move
            for part, value in values.items()
            for move in moves_to(case, problem, part, _widened(part, value, attempt))
        ]
        if moves and is_feasible(build(with_moves(case, moves))):
            return tuple(fix_of(case, move) for move in moves)
        if not any(part.kind == SIMULATED for part in values):
            return None
    return None


def as_written(case: Case, problem: Problem, part: ConflictPart, value: Fraction) -> Fraction:
    """The limit that a value becomes once it is written with so many figures."""
    afters = [after for _, _, after in moves_to(case, problem, part, value)]
    if part.kind == "cost":
        return min((case.spec.in_currency(after) for after in afters), default=value)
    return min((after.exact for after in afters), default=value)


def _widened(part: ConflictPart, value: Fraction, attempt: int) -> Fraction:
    return value * (1 + attempt * WIDENING) if part.kind == SIMULATED else value


def moves_to(case: Case, problem: Problem, part: ConflictPart, value: Fraction) -> Iterator[Move]:
    """Requirements whose limit has to move for the kind's to reach a value, and where to."""
    if part.kind == "sync" and part.id is None:
        yield None, problem.limits.sync, plain(value, up=True)
        return
    for requirement in case.spec.requirements:
        if not _is_of(requirement, part):
            continue
        before = case.limit(requirement)
        if before < value:
            yield requirement, float(before), _rounded_up(case, requirement, value)


def _is_of(requirement: Requirement, part: ConflictPart) -> bool:
    """Whether a requirement belongs to a part: to a kind of sums, or by its id."""
    if part.kind == SIMULATED:
        return requirement.id == part.id
    return requirement.kind == part.kind


def _rounded_up(case: Case, requirement: Requirement, value: Fraction) -> Quantity:
    limit = requirement.limit
    if requirement.kind == "sync":
        return plain(value, up=True)
    if requirement.kind == "cost":
        currency = getattr(limit, "currency", None) or case.spec.currency
        rate = case.spec.in_currency(Quantity(Fraction(1), "", None, currency))
        return money(value, rate, currency)
    return in_unit_of(
        getattr(limit, "text", ""), value, LIMIT_DIMENSIONS[requirement.kind], up=True
    )


def with_moves(case: Case, moves: Sequence[Move]) -> Case:
    """The spec with other limits."""
    limits = {requirement.id: after for requirement, _, after in moves if requirement is not None}
    requirements = [
        one.model_copy(update={"limit": limits[one.id]}) if one.id in limits else one
        for one in case.spec.requirements
    ]
    for requirement, _, after in moves:
        if requirement is None:
            requirements.append(Requirement.model_construct(id=IMPLIED, kind="sync", limit=after))
    return with_requirements(case, requirements)


def with_requirements(case: Case, requirements: Sequence[Requirement]) -> Case:
    """The spec with other requirements."""
    spec = case.spec.model_copy(update={"requirements": tuple(requirements)})
    return replace(case, spec=spec)


def fix_of(case: Case, move: Move) -> Fix:
    requirement, before, after = move
    if requirement is None:
        text = (
            f"the implied sync limit from {to_digits(before, 6)} to {after.text}: "
            f"write {{kind: sync, limit: {after.text}}}"
        )
        return Fix("sync", None, None, None, before, float(after), "1", text)
    name, kind = requirement.id, requirement.kind
    written = getattr(requirement.limit, "text", to_digits(before, 6))
    unit = LIMIT_UNITS.get(kind, case.spec.currency)
    if kind != "cost":
        text = f"{name} from {written} to {after.text}"
        return Fix(kind, name, None, None, before, float(after), unit, text)
    exact = requirement.limit.exact if isinstance(requirement.limit, Quantity) else Fraction(0)
    currency = after.currency or case.spec.currency
    shown = [
        format_quantity(float(v), Dimension.MONEY, currency=currency)
        for v in (after.exact - exact, exact, after.exact)
    ]
    text = f"{name} by {shown[0]}, from {shown[1]} to {shown[2]}"
    to = float(case.spec.in_currency(after))
    return Fix(kind, name, None, None, before, to, unit, text)


def method_fixes(case: Case, build: Build, problem: Problem) -> Iterator[Fix]:
    """Timestamping methods of the catalogs that, opened to a role without options, do help."""
    for table in problem.roles:
        if table.options:
            continue
        role = case.stages[table.stage].role(table.role)
        if role is None or role.inline is not None:
            continue
        have = tuple(one.id for one in role.methods)
        found: list[tuple[float, str]] = []
        for name, method in case.catalog.timestamping.items():
            if name in have or not any(
                usable_primitives(one.entry, method, role.choice.primitive) for one in role.sensors
            ):
                continue
            best = solve(build(with_methods(case, table.stage, table.role, (*have, name))))
            if best is not None:
                found.append((float(best.cost or 0), name))
        for _, name in sorted(found)[:MOST_METHODS]:
            text = f"let {table.role} of {table.stage_name} be stamped by {name}"
            yield Fix("timestamping", None, None, table.stage_name, None, None, None, text)
