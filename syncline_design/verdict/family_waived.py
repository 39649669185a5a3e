"""Waived limits of a family that no payload keeps: missed by as few and as little as can be.

As for one system (`choice/waivers.py`); what is bought once has one value, every other limit one in
each mission, and is eased in those missions alone that cannot keep it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import date
from fractions import Fraction
from typing import Final, NamedTuple

from syncline_design.choice.options import RESOURCES
from syncline_design.choice.outcome import NoVerdict, OutOfTime
from syncline_design.choice.parts import ConflictPart
from syncline_design.choice.variations import Build
from syncline_design.choice.waivers import ENDLESS, fewest, orders, waived, with_room
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.spec.case import Case, Mission
from syncline_design.spec.requirement import JUDGED_KINDS, Requirement
from syncline_design.verdict.family import Work
from syncline_design.verdict.family_fixes import FamilyLimit, again, first_of, least_of

DOUBLINGS: Final = 20  # of a limit that is no sum, until some payload keeps it
HALVINGS: Final = 10  # between there and where none does: to a thousandth of the limit


class WaivedLimit(NamedTuple):
    """A waived limit: of a mission, or (None) of what the whole family buys."""

    mission: str | None
    id: str


Values = Mapping[WaivedLimit, Fraction | None]  # the least that some payload keeps; None: lifted


@dataclass(frozen=True, slots=True)
class _Search:
    """The family as it is asked for; build: a fresh way to make a problem of each case."""

    work: Work
    build: Callable[[], Build]

    def eased(self, values: Values) -> Work:
        """The family with other limits in the choice."""
        missions = tuple(
            replace(one, case=replace(one.case, eased=_of(values, one)))
            for one in self.work.missions
        )
        return again(self.work, missions, self.build, self.work.seed)

    def exists(self, values: Values) -> bool:
        """Whether a payload is known to meet the family so eased; one left open does not count."""
        try:
            return first_of(self.eased(values)) is not None
        except OutOfTime:
            raise
        except NoVerdict:
            return False

    def requirement(self, limit: WaivedLimit) -> Requirement:
        """The requirement of a limit, as its mission has it."""
        rows = self._mission(limit).case.spec.requirements
        return next(one for one in rows if one.id == limit.id)

    def asked(self, limit: WaivedLimit) -> Fraction:
        """What the limit asks for."""
        return self._mission(limit).case.limit(self.requirement(limit))

    def _mission(self, limit: WaivedLimit) -> Mission:
        missions = self.work.missions
        return next(one for one in missions if limit.mission in (None, one.name))


def _of(values: Values, mission: Mission) -> dict[str, Fraction | None]:
    return {limit.id: v for limit, v in values.items() if limit.mission in (None, mission.name)}


def waived_of(work: Work, day: date) -> tuple[str, ...]:
    """Ids of requirements with a waiver in force."""
    return waived(work.missions[0].case, day)


def eased_anywhere(work: Work) -> Case:
    """The spec with all that is eased in any mission."""
    every = {name: value for one in work.missions for name, value in one.case.eased.items()}
    return replace(work.case, eased=every)


def lifted_family(work: Work, build: Callable[[], Build], ids: Sequence[str]) -> Work:
    """The family without its waived limits."""
    return _Search(work, build).eased(dict.fromkeys(_limits(work, ids)))


def eased_family(work: Work, build: Callable[[], Build], ids: Sequence[str]) -> Work | None:
    """The family with waived limits eased until a payload exists; None: not even without them."""
    search = _Search(work, build)
    if not search.exists(dict.fromkeys(_limits(work, ids))):
        return None

    def missed(together: tuple[str, ...]) -> Iterator[tuple[Fraction, Values]]:
        if search.exists(dict.fromkeys(_limits(work, together))):
            for order in orders(together):
                if values := _in_turn(search, _limits(work, order)):
                    most = max(share for share, _ in values.values())
                    yield most, {limit: value for limit, (_, value) in values.items()}

    found = fewest(ids, missed)
    if found is None:  # nothing tells by how little they can be missed
        return lifted_family(work, build, ids)
    return search.eased(found)


def _limits(work: Work, ids: Sequence[str]) -> list[WaivedLimit]:
    """The limits of waived requirements, one after the other as the missions come."""
    return [limit for name in ids for limit in _limits_of(work, name)]


def _limits_of(work: Work, name: str) -> Iterator[WaivedLimit]:
    rows = work.missions[0].case.spec.requirements
    kind = next(one.kind for one in rows if one.id == name)
    if kind in RESOURCES:
        yield WaivedLimit(None, name)
    else:
        yield from (WaivedLimit(mission.name, name) for mission in work.missions)


def _in_turn(
    search: _Search, limits: Sequence[WaivedLimit]
) -> dict[WaivedLimit, tuple[Fraction, Fraction]] | None:
    """Of each limit the share of itself that is reached, and the value; None: not to be told."""
    out: dict[WaivedLimit, tuple[Fraction, Fraction]] = {}
    for place, limit in enumerate(limits):
        known = {one: value for one, (_, value) in out.items()}
        others: Values = {**known, **dict.fromkeys(limits[place + 1 :])}
        value = asked = search.asked(limit)
        if not search.exists({**others, limit: asked}):
            least = _least(search, limit, others)
            if least is None:
                return None
            value = max(asked, with_room(search.requirement(limit).kind, least))
            if not search.exists({**others, limit: value}):
                return None
        out[limit] = (value / asked if asked else ENDLESS, value)
    return out


def _least(search: _Search, limit: WaivedLimit, others: Values) -> Fraction | None:
    """The least of a limit that some payload keeps, where none keeps it as it is asked for."""
    kind = search.requirement(limit).kind
    likely = search.work.likelihood is not None and kind not in RESOURCES  # no sum at given figures
    if likely or kind == "sample_spacing" or kind in JUDGED_KINDS:
        return _by_halving(search, limit, others)
    return least_of(search.eased(others), FamilyLimit(limit.mission, ConflictPart(kind, limit.id)))


def _by_halving(search: _Search, limit: WaivedLimit, others: Values) -> Fraction | None:
    def holds(share: Fraction) -> bool:
        return search.exists({**others, limit: share * search.asked(limit)})

    fails, works = Fraction(1), Fraction(2)
    while not holds(works):
        fails, works = works, 2 * works
        if works > 2**DOUBLINGS:
            return None
    for _ in range(HALVINGS):
        middle = (fails + works) / 2
        fails, works = (fails, middle) if holds(middle) else (middle, works)
    return works * search.asked(limit)
