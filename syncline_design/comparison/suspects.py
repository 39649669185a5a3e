"""Groups of rows of which at least one is broken, where the log cannot tell which."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Final

from syncline_design.comparison.acceptance import (
    AssumptionResult,
    OneOfThese,
    SuspectedDeparture,
    SuspectedWay,
)
from syncline_design.comparison.departing import Departing
from syncline_design.comparison.in_doubt import InDoubt, OneWay
from syncline_design.effects import registry
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.spec.case import Case

RowsOf = Callable[[Departing], tuple[str, ...]]
# where a drive helps between two rows of one kind; errors of both arms, or turns of both
# mountings, move no object on any drive where they undo one another
_TOLD_BY_DRIVES: Final = ("latency", "timing", "clock")
_LOOK: Final[Mapping[str, str]] = {
    "timing": "how {role} is stamped: trigger or PPS wire, driver, its clock",
    "clock": "the host clock of {stage} and what disciplines it",
    "latency": "the wire and the driver that stamp {role}, and what filters its data",
    "lever_arm": "the lever arm of {role}, with a tape on the vehicle",
    "mounting": "how {role} is mounted",
    "noise": "the {role} sensor itself",
}


@dataclass(frozen=True, slots=True)
class _Group:
    """Doubts that share rows, and all rows of theirs."""

    doubts: tuple[tuple[InDoubt, tuple[OneWay, ...]], ...]
    rows: frozenset[str]


def grouped(
    case: Case, rows: Sequence[AssumptionResult], doubts: Sequence[InDoubt], rows_of: RowsOf
) -> tuple[tuple[AssumptionResult, ...], tuple[OneOfThese, ...]]:
    """The rows, those of a group with its number, and the groups.

    rows_of: the rows that a departure would break, of all that the verdict rests on.  A way is out
    where other evidence bears one of its rows out; a row that all that are left would break is
    broken.  Where a way breaks no row that was asked, but one that was not, nothing is said to be.
    """
    status = {row.name: row.status for row in rows}
    found: list[_Group] = []
    certain: set[str] = set()
    for doubt in (each for each in doubts if not each.may_be_sound):
        ways = tuple(w for w in doubt.ways if not _is_out(w, rows_of, status))
        told = [frozenset(r for part in way.parts for r in rows_of(part)) for way in ways]
        asked = [names & frozenset(status) for names in told]
        known = frozenset().union(*asked) if asked else frozenset[str]()
        elsewhere = any(names and not own for names, own in zip(told, asked, strict=True))
        if not known or elsewhere or any(status[name] == "broken" for name in known):
            continue
        common = frozenset.intersection(*asked)
        if common:
            certain |= common
        else:
            found = _merged(found, _Group(((doubt, ways),), known))
    groups = tuple(_told(case, k, one, rows, rows_of) for k, one in enumerate(found, 1))
    return tuple(_numbered(row, certain, groups) for row in rows), groups


def _is_out(way: OneWay, rows_of: RowsOf, status: Mapping[str, str]) -> bool:
    return any(status.get(name) == "holds" for part in way.parts for name in rows_of(part))


def _merged(found: Sequence[_Group], new: _Group) -> list[_Group]:
    """Groups that share a row are one."""
    apart = [one for one in found if not one.rows & new.rows]
    near = [one for one in found if one.rows & new.rows]
    doubts = tuple(each for one in (*near, new) for each in one.doubts)
    return [*apart, _Group(doubts, new.rows.union(*(one.rows for one in near)))]


def _numbered(
    row: AssumptionResult, certain: Collection[str], groups: Sequence[OneOfThese]
) -> AssumptionResult:
    number = next((one.number for one in groups if row.name in one.rows), None)
    status = "broken" if row.name in certain else row.status
    return replace(row, status=status, one_of=number)


def _told(
    case: Case, number: int, group: _Group, rows: Sequence[AssumptionResult], rows_of: RowsOf
) -> OneOfThese:
    ways = [way for _, own in group.doubts for way in own]
    order = sorted(group.rows, key=lambda name: (_rank(name, ways, rows_of), name))
    first = next(row for row in rows if row.name == order[0])
    look = _LOOK[first.assumption].format(role=first.role, stage=first.stage)
    words = "; ".join(doubt.found for doubt, _ in group.doubts)
    told = tuple(SuspectedWay(tuple(_departure(p, rows_of) for p in w.parts), w.probability)
                 for w in ways)  # fmt: skip
    command = _command(case, order, ways, rows_of)
    return OneOfThese(number, tuple(order), told, words, look, command)


def _departure(part: Departing, rows_of: RowsOf) -> SuspectedDeparture:
    return SuspectedDeparture(part.effect, part.sensors, part.stage, rows_of(part), part.words)


def _rank(name: str, ways: Sequence[OneWay], rows_of: RowsOf) -> tuple[float, int]:
    """The likelier first, of those alike what is met more often: late data before early ones."""
    own = [(way, p) for way in ways for p in way.parts if name in rows_of(p)]
    likely = max(1.0 if way.together else way.probability or 0.0 for way, _ in own)
    return -round(likely, 2), min(registry()[part.effect].rarity for _, part in own)


def _command(
    case: Case, order: Sequence[str], ways: Sequence[OneWay], rows_of: RowsOf
) -> str | None:
    """Looks for the drive that tells the first row from the next that a drive can tell it from."""
    parts = {name: next(_parts_of(name, ways, rows_of), None) for name in order}
    first = parts[order[0]]
    for name in order[1:]:
        other = parts[name]
        if first is not None and other is not None and _apart_by_driving(order[0], name):
            several = len(case.stages) > 1
            pair = [_spelt(one, several) for one in (first, other)]
            return shlex.join(["syncline-design", "plan", str(case.path), "--separate", *pair])
    return None


def _parts_of(name: str, ways: Sequence[OneWay], rows_of: RowsOf) -> Iterator[Departing]:
    for way in sorted((w for w in ways if not w.together), key=lambda one: len(one.parts)):
        for part in way.parts:
            if name in rows_of(part) and registry()[part.effect].sensitivity is not None:
                yield part


def _apart_by_driving(first: str, second: str) -> bool:
    kinds = [name.rpartition("/")[2] for name in (first, second)]
    return kinds[0] != kinds[1] or kinds[0] in _TOLD_BY_DRIVES


def _spelt(one: Departing, several: bool) -> str:
    where = f"{one.stage}.{one.sensors[0]}" if several else one.sensors[0]
    return f"{one.effect}({where})"
