"""What keeps a set of designs out: a requirement that it misses by least, or several together."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import suppress
from fractions import Fraction

from syncline_design.choice.explain import conflict_of, listed
from syncline_design.choice.outcome import NoVerdict
from syncline_design.choice.parts import FIELDS, SIMULATED, ConflictPart, least, parts_of
from syncline_design.choice.table import Problem
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import format_quantity
from syncline_design.model.quantity import Dimension, Quantity
from syncline_design.model.written import DIMENSIONS, beside
from syncline_design.spec.case import Case
from syncline_design.spec.requirement import LIMIT_DIMENSIONS

_UNITS = {dimension: unit for unit, dimension in DIMENSIONS.items()}
IMPLIED = "the implied sync requirement"


@dataclass(frozen=True, slots=True)
class Missed:
    """kind: of the requirement, `requirements` of several; value: the least that is reached, with
    every other requirement met, limit: what is asked; both in SI or the spec's currency."""

    kind: str
    value: float | None
    limit: float | None
    text: str


def nearest_miss(case: Case, problems: Iterable[Problem]) -> Missed:
    """Of problems without a design, the requirement whose limit would have to move least."""
    every = list(problems)
    found = [one for problem in every for one in _misses(problem)]
    if not found:
        together, minimal = conflict_of(every[0])
        names = listed([part.id or IMPLIED for part in together])
        text = f"no such design meets {names}" + (" together" if len(together) > 1 else "")
        text += "" if minimal else " (a smaller set was not ruled out)"
        return Missed("requirements", None, None, text)
    _, part, value, limit = min(found, key=lambda one: (one[0], one[1]))
    reached, asked = shown_figures(case, part.kind, value, limit)
    text = f"{part.id or IMPLIED}: at best {reached}, the limit is {asked}"
    return Missed(part.kind, float(value), float(limit), text)


def _misses(problem: Problem) -> Iterator[tuple[Fraction, ConflictPart, Fraction, Fraction]]:
    """Every requirement that alone stands in the way: value over limit, it, value and limit."""
    for part in parts_of(problem):
        limit = _limit_of(problem, part)
        if part.kind == SIMULATED or not limit:
            continue
        with suppress(NoVerdict):  # what cannot be proven is not said
            value = least(problem, part)
            if value is not None:
                yield value / limit, ConflictPart(part.kind, part.id or ""), value, limit


def _limit_of(problem: Problem, part: ConflictPart) -> Fraction | None:
    limit = getattr(problem.limits, FIELDS.get(part.kind, part.kind), None)
    return None if limit is None else Fraction(limit)


def shown_figures(case: Case, kind: str, value: Fraction, limit: Fraction) -> tuple[str, str]:
    """Value and limit, in so many digits that they differ; in the limit's unit where it has one."""
    dimension = LIMIT_DIMENSIONS.get(kind, Dimension.DIMENSIONLESS)
    written = _written(case, kind, limit)

    def shown(figure: Fraction, digits: int) -> str:
        if written is not None:
            return beside(written, float(figure), _UNITS[dimension], digits)
        return format_quantity(float(figure), dimension, digits, case.spec.currency)

    texts = ("", "")
    for digits in range(4, 17):
        texts = (shown(value, digits), written or shown(limit, digits))
        if texts[0] != texts[1] and not (written and texts[0] == shown(limit, digits)):
            break
    return texts


def _written(case: Case, kind: str, limit: Fraction) -> str | None:
    """A limit as the spec has it; None where none of that kind has a unit of its own."""
    for one in case.spec.requirements:
        if one.kind == kind and type(one.limit) is Quantity and one.limit.exact == limit:
            return one.limit_written
    return None
