"""Changes of several requirements that together make a spec feasible where no single one does."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from fractions import Fraction

from syncline_design.choice.fixes import as_written, proven
from syncline_design.choice.outcome import Fix, NoVerdict
from syncline_design.choice.parts import ConflictPart, is_feasible, least, lifted, moved, parts_of
from syncline_design.choice.table import Problem
from syncline_design.choice.variations import Build
from syncline_design.spec.case import Case

MOST = 3


def joint_fixes(case: Case, problem: Problem, build: Build) -> tuple[tuple[Fix, ...], ...]:
    """The smallest sets of requirements that have to move, and by how little.

    One after the other each is moved to the least limit that the rest allow while those after it
    are lifted: the first as little as any design permits, the next as little as is left then, with
    the first as it is written.
    """
    found: list[tuple[Fix, ...]] = []
    for together in _sets(problem):
        for order in itertools.permutations(together):
            try:
                values = _least_in_turn(case, problem, order)
                fixes = values and proven(case, problem, build, values)
            except NoVerdict:  # what cannot be proven is not offered
                continue
            if fixes and {f.text for f in fixes} not in [{f.text for f in one} for one in found]:
                found.append(fixes)
            if len(found) == MOST:
                return tuple(found)
    return tuple(found)


def _sets(problem: Problem) -> Iterator[tuple[ConflictPart, ...]]:
    """Sets of requirements whose lifting makes a design exist, of the least size that does."""
    parts = parts_of(problem)
    for size in range(2, len(parts) + 1):
        some = False
        for together in itertools.combinations(parts, size):
            try:
                helps = is_feasible(lifted(problem, together))
            except NoVerdict:
                continue
            if helps:
                some = True
                yield together
        if some:
            return


def _least_in_turn(
    case: Case, problem: Problem, order: tuple[ConflictPart, ...]
) -> dict[ConflictPart, Fraction] | None:
    values: dict[ConflictPart, Fraction] = {}
    for place, part in enumerate(order):
        eased = lifted(moved(problem, _floats(values)), order[place + 1 :])
        value = least(eased, part)
        if value is None:
            return None
        values[part] = as_written(case, problem, part, value)
    return values


def _floats(values: dict[ConflictPart, Fraction]) -> dict[ConflictPart, Fraction | float]:
    """Limits as the problem holds them: budgets exact, the others as floats."""
    exact = ("cost", "mass", "power")
    return {p: v if p.kind in exact else float(v) for p, v in values.items()}
