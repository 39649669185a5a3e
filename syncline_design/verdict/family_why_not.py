"""Why an entry is not in a family's payload: ruled out, kept out by a limit, or dearer or worse."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np

from syncline_design.choice.holding import EntryKind, hold, holds
from syncline_design.choice.missed import shown_figures
from syncline_design.choice.narrowed import narrowed
from syncline_design.choice.outcome import NoVerdict, OutOfTime
from syncline_design.choice.table import Problem
from syncline_design.choice.variations import Build
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.spec.case import Mission
from syncline_design.verdict.admitted import Kinds, admissions, with_whole_catalog
from syncline_design.verdict.family import (
    Chosen,
    Work,
    choose_family,
    with_problems,
    work_of,
)
from syncline_design.verdict.family_fixes import FamilyLimit, asked_of, least_of
from syncline_design.verdict.family_named import ranked
from syncline_design.verdict.why_not import (
    Answer,
    BestWith,
    HeldBack,
    NotTaken,
    excluded_rows,
    unlisted_text,
)


@dataclass(frozen=True, slots=True)
class Question:
    """A family with its payload; build and seed: how a changed one becomes tables."""

    work: Work
    chosen: Chosen | None
    build: Callable[[], Build]
    seed: int


def why_not_in_family(asked: Question, kinds: Kinds) -> Iterator[Answer]:
    """An answer for each entry, and for each kind of entry that its id names."""
    for entry, named in kinds.items():
        for kind in named:
            yield from _answers(asked, kind, entry)


def _answers(asked: Question, kind: EntryKind, entry: str) -> Iterator[Answer]:
    parts = list(_parts(asked.work, kind, entry))
    held = _held(asked, parts, kind, entry, candidate=True)
    if held is not None:
        yield held
        return
    if parts:
        yield _kept_out(parts, kind, entry)
        return
    gone = list(_excluded(asked.work, kind, entry))
    if gone:
        yield from gone
        return
    case = with_whole_catalog(asked.work.missions[0].case)
    yield NotTaken(entry, kind, "not-a-candidate", None, None, unlisted_text(case, kind, entry))
    yield from _if_it_were(asked, kind, entry)


def _parts(work: Work, kind: EntryKind, entry: str) -> Iterator[Work]:
    """For each role and vehicle that may hold an entry, the payloads in which it does."""
    problems = work.family.problems
    for r, role in enumerate(work.family.roles):
        rows = [np.flatnonzero(hold(p.roles[r].options, kind, entry)) for p in problems]
        groups = [range(len(problems))] if role.alone is None else _by_mission(work)
        for group in groups:
            if all(len(rows[m]) for m in group):
                yield with_problems(work, [
                    _with_role(p, r, rows[m]) if m in group else p for m, p in enumerate(problems)
                ])  # fmt: skip
    for v in range(len(problems[0].vehicles)):
        mine = [[i for i, one in enumerate(p.vehicles[v].clocks) if holds(one, kind, entry)]
                for p in problems]  # fmt: skip
        if all(mine):
            own = zip(problems, mine, strict=True)
            yield with_problems(work, [_with_clocks(p, v, some) for p, some in own])


def _by_mission(work: Work) -> list[range]:
    places = [work.of(mission.name) for mission in work.missions]
    return [range(own[0], own[-1] + 1) for own in places]


def _with_role(problem: Problem, r: int, rows: np.ndarray) -> Problem:
    ways = [np.arange(len(table.options)) for table in problem.roles]
    clocks = [range(len(table.clocks)) for table in problem.vehicles]
    return narrowed(problem, [*ways[:r], rows, *ways[r + 1 :]], clocks).problem


def _with_clocks(problem: Problem, v: int, some: Sequence[int]) -> Problem:
    ways = [np.arange(len(table.options)) for table in problem.roles]
    clocks: list[Sequence[int]] = [range(len(table.clocks)) for table in problem.vehicles]
    return narrowed(problem, ways, [*clocks[:v], some, *clocks[v + 1 :]]).problem


def _best(parts: Sequence[Work]) -> tuple[Work, Chosen] | None:
    """The first of the best payloads of all parts."""
    found: list[tuple[Any, int, Work, Chosen]] = []
    for part in parts:
        one = None if part.family.is_empty else choose_family(part)
        if one is not None and one.found is not None:
            found.append((one.found.rank[:5], len(found), part, one))
    if not found:
        return None
    *_, part, one = min(found, key=lambda row: row[:2])
    return part, one


def _held(
    asked: Question, parts: Sequence[Work], kind: EntryKind, entry: str, *, candidate: bool
) -> HeldBack | None:
    """The best payload that holds an entry, against the best of all."""
    chosen = asked.chosen if candidate else None
    taken = chosen is not None and bool(_places(chosen, kind, entry))
    best = (asked.work, chosen) if taken and chosen is not None else _best(parts)
    if best is None:
        return None
    part, one = best
    assert one.found is not None
    shown, dearer, worse = ranked(part, one), None, None
    if asked.chosen is not None and asked.chosen.found is not None:
        now, then = asked.chosen.found.sums, one.found.sums
        worse = then.error_m - now.error_m
        if now.cost is not None and then.cost is not None:
            dearer = float(then.cost - now.cost)
    places = tuple(_places(one, kind, entry))
    with_it = BestWith(shown.cost, shown.mass, shown.power, shown.error_m, places, shown.design)
    return HeldBack(entry, kind, with_it, dearer, worse, taken, candidate)


def _places(chosen: Chosen, kind: EntryKind, entry: str) -> list[str]:
    """Roles and vehicles that hold an entry in a payload, in any mission."""
    found: dict[str, None] = {}
    for problem, design in zip(chosen.problems, chosen.designs, strict=True):
        for table, place in zip(problem.roles, design.options, strict=True):
            if hold(table.options.take([place]), kind, entry)[0]:
                found[f"{table.stage_name}.{table.role}"] = None
        for vehicle, own in zip(problem.vehicles, design.clocks, strict=True):
            if holds(vehicle.clocks[own], kind, entry):
                found[f"the clock of {vehicle.name}"] = None
    return list(found)


def _kept_out(parts: Sequence[Work], kind: EntryKind, entry: str) -> NotTaken:
    """Of an entry that could be chosen: the limit that every payload with it misses by least."""
    found: list[tuple[Fraction, FamilyLimit, Fraction, Fraction, Work]] = []
    for part in parts:
        for one in asked_of(part):
            limit = _limit(part, one)
            if one.part.kind == "sync" or not limit:
                continue  # a looser one lets other options back in
            value = least_of(part, one)
            if value is not None:
                found.append((value / limit, one, value, limit, part))
    if not found:
        reason = f"no payload with {entry} meets every requirement of every mission"
        return NotTaken(entry, kind, "requirements", None, None, reason)
    _, one, value, limit, part = min(found, key=lambda row: row[0])
    reached, wanted = shown_figures(part.case, one.part.kind, value, limit)
    where = f" of mission {one.mission}" if one.mission else ""
    reason = f"with {entry}, {one.part.id}{where}: at best {reached}, the limit is {wanted}"
    return NotTaken(entry, kind, one.part.kind, float(value), float(limit), reason)


def _limit(work: Work, one: FamilyLimit) -> Fraction | None:
    """The tightest that is asked."""
    name = "accuracy_m" if one.part.kind == "accuracy" else one.part.kind
    own = (s for s in work.scenarios if one.mission in (None, s.mission))
    given = [getattr(s.problem.limits, name) for s in own]
    return min((Fraction(limit) for limit in given if limit is not None), default=None)


def _excluded(work: Work, kind: EntryKind, entry: str) -> Iterator[NotTaken]:
    """Why it was ruled out before the choice; in which missions, where not in all."""
    rows: dict[NotTaken, list[str]] = {}
    for one in work.scenarios:
        if _may_hold(one.problem, kind, entry):
            continue  # ruled out elsewhere; here only some ways of stamping it are
        for row in excluded_rows(one.case, one.problem, kind, entry):
            names = rows.setdefault(row, [])
            if one.mission not in names:
                names.append(one.mission)
    for row, names in rows.items():
        everywhere = len(names) == len(work.missions)
        lead = "" if everywhere else f"in mission {', '.join(names)}: "
        yield replace(row, reason=lead + row.reason)


def _may_hold(problem: Problem, kind: EntryKind, entry: str) -> bool:
    """Whether one mission by itself leaves an entry to choose."""
    aboard = [clock for vehicle in problem.vehicles for clock in vehicle.clocks]
    options = [table.options for table in problem.roles]
    return any(holds(clock, kind, entry) for clock in aboard) or any(
        bool(hold(some, kind, entry).any()) for some in options
    )


def _if_it_were(asked: Question, kind: EntryKind, entry: str) -> Iterator[Answer]:
    """The best answer over the places that it could have, were it a candidate there."""
    whole = [with_whole_catalog(mission.case) for mission in asked.work.missions]
    ways = zip(*(admissions(case, kind, entry) for case in whole), strict=True)
    parts: list[Work] = []
    missed: list[NotTaken] = []
    for cases in ways:
        missions = [
            Mission(own.name, case) for own, case in zip(asked.work.missions, cases, strict=True)
        ]
        try:
            work = _again(asked, missions)
            there = list(_parts(work, kind, entry))
        except OutOfTime:
            raise
        except NoVerdict:
            continue
        parts += there
        missed += [] if there else _excluded(work, kind, entry)
    held = _held(asked, parts, kind, entry, candidate=False)
    if held is not None:
        yield held
    elif parts:
        yield _kept_out(parts, kind, entry)
    else:
        yield from missed


def _again(asked: Question, missions: Sequence[Mission]) -> Work:
    case = asked.work.case
    if case.missions:
        return work_of(replace(case, missions=tuple(missions)), asked.build, asked.seed)
    return work_of(missions[0].case, asked.build, asked.seed)
