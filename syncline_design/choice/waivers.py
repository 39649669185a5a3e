"""Waived requirements that no design keeps: missed by as few and as little as the others allow."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import date
from fractions import Fraction
from typing import Final, TypeVar

from syncline_design.choice.options import RESOURCES
from syncline_design.choice.outcome import NoVerdict, OutOfTime
from syncline_design.choice.parts import SIMULATED, ConflictPart, is_feasible, least
from syncline_design.choice.variations import Build
from syncline_design.spec.case import Case
from syncline_design.spec.requirement import JUDGED_KINDS, Requirement

Eased = Mapping[str, Fraction | None]  # by id: the least limit that a design keeps; None: lifted
ROOM: Final = Fraction(1, 10**12)  # for a figure that was rounded to a float on its way
WIDENED: Final = (0, Fraction(1, 100), Fraction(5, 100))  # a simulated figure, found by samples
MOST_ORDERED: Final = 3  # requirements that are missed together and tried in every order
ENDLESS: Final = Fraction(10**18)  # the share by which a limit of nothing is missed

ValuesT = TypeVar("ValuesT")


def waived(case: Case, day: date) -> tuple[str, ...]:
    """Ids of requirements with a waiver in force, in the order of the spec."""
    return tuple(
        one.id
        for one in case.spec.requirements
        if one.waiver is not None and one.waiver.holds_on(day)
    )


def lifted(case: Case, ids: Sequence[str]) -> Case:
    """The case with waived requirements left out of the choice."""
    return replace(case, eased=dict.fromkeys(ids))


def eased(case: Case, build: Build, ids: Sequence[str]) -> Case | None:
    """The case with waived requirements eased until a design exists; None: not even without them.

    As few as can be are missed; of those the set whose largest miss, as a share of its limit, is
    least.  Inside a set one after the other is missed by as little as the rest allows.
    """
    if not _exists(case, build, dict.fromkeys(ids)):
        return None

    def missed(together: tuple[str, ...]) -> Iterator[tuple[Fraction, dict[str, Fraction]]]:
        if _exists(case, build, dict.fromkeys(together)):
            for values in _least(case, build, together):
                yield _largest(case, values), values

    found = fewest(ids, missed)
    if found is None:  # nothing tells by how little they can be missed
        return lifted(case, ids)
    return replace(case, eased=found)


def fewest(
    ids: Sequence[str], missed: Callable[[tuple[str, ...]], Iterable[tuple[Fraction, ValuesT]]]
) -> ValuesT | None:
    """The values of as few requirements as can be, of these with the least of the largest misses.

    missed: the ways to miss a set of them alone, each with its largest miss, a share of the limit.
    """
    for size in range(1, len(ids) + 1):
        found = [way for together in itertools.combinations(ids, size) for way in missed(together)]
        if found:
            return min(found, key=lambda way: way[0])[1]
    return None


def orders(together: Sequence[str]) -> Iterator[tuple[str, ...]]:
    """In which order requirements are eased."""
    if len(together) > MOST_ORDERED:
        yield tuple(together)
    else:
        yield from itertools.permutations(together)


def with_room(kind: str, value: Fraction) -> Fraction:
    """A least value as a limit that the design it comes from keeps."""
    return value if kind in RESOURCES else value * (1 + ROOM)  # of sums: they are exact


def _exists(case: Case, build: Build, values: Eased) -> bool:
    """Whether a design is known to meet the case so eased; one left open does not count."""
    try:
        return is_feasible(build(replace(case, eased=values)))
    except OutOfTime:
        raise
    except NoVerdict:
        return False


def _least(case: Case, build: Build, together: Sequence[str]) -> Iterator[dict[str, Fraction]]:
    by_id = {one.id: one for one in case.spec.requirements}
    for order in orders(together):
        values: dict[str, Fraction] = {}
        for place, name in enumerate(order):
            value = _least_of(
                case, build, by_id[name], {**values, **dict.fromkeys(order[place + 1 :])}
            )
            if value is None:
                break
            values[name] = value
        else:
            yield values


def _least_of(case: Case, build: Build, one: Requirement, others: Eased) -> Fraction | None:
    """The least limit of one requirement that some design keeps, the others as they are given."""
    judged = one.kind in JUDGED_KINDS
    part = ConflictPart(SIMULATED if judged else one.kind, one.id)
    try:
        value = least(build(replace(case, eased=others)), part)
    except OutOfTime:
        raise
    except NoVerdict:
        return None
    if value is None:
        return None
    for wider in WIDENED if judged else (0,):
        limit = with_room(one.kind, max(value, case.limit(one)) * (1 + wider))
        if _exists(case, build, {**others, one.id: limit}):
            return limit
    return None


def _largest(case: Case, values: Mapping[str, Fraction]) -> Fraction:
    """The largest miss of a set, value over limit; what misses a limit of nothing comes last."""
    limits = {one.id: case.limit(one) for one in case.spec.requirements}
    shares = [value / limits[name] for name, value in values.items() if limits[name]]
    return max(shares) if len(shares) == len(values) else ENDLESS
