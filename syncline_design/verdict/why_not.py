"""Why an entry is not in the design: ruled out, kept out by a requirement, or dearer or worse.

What the spec does not list is answered twice: that it is no candidate, and what if it were.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from syncline_design.choice.evaluate import evaluate
from syncline_design.choice.explain import listed
from syncline_design.choice.holding import EntryKind, best_with, parts_with
from syncline_design.choice.missed import nearest_miss
from syncline_design.choice.table import Design, Problem
from syncline_design.choice.variations import Build
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.records import Record, optional
from syncline_design.spec.case import Case
from syncline_design.verdict.admitted import Kinds, admissions, homes, kinds_of, with_whole_catalog
from syncline_design.verdict.choice_data import ruled_out_rows
from syncline_design.verdict.design_data import full_design
from syncline_design.verdict.named import Exclusion, FactFigure, NamedDesign

# Of several ways to use an entry in one place the one that comes nearest speaks for it: what only
# its timestamps rule out, then what is not told, and so on; last what does not fit its signals.
NEAREST = (
    "tau", "unknown-fact", "discontinued", "temperature", "depth", "rate", "field_of_view", "gnss",
    "medium", "reach", "primitive",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class NotTaken(Record):
    """An entry that no design of this spec can hold, as one kind of entry, in one place.

    code: of the exclusion; `not-a-candidate`; or the kind of the requirement that every design with
    it misses (`requirements`: several together).  figure: what the entry says, or the least that a
    design with it reaches; limit: what is asked.
    """

    entry: str
    kind: EntryKind
    code: str
    figure: FactFigure
    limit: FactFigure
    reason: str
    place: str | None = optional()


@dataclass(frozen=True, slots=True)
class BestWith(Record):
    """The best design that holds an entry; places: the roles and vehicles in which it does."""

    cost: float | None
    mass: float | None
    power: float | None
    error_m: float
    places: tuple[str, ...]
    design: NamedDesign


@dataclass(frozen=True, slots=True)
class HeldBack(Record):
    """An entry that designs can hold: how much dearer [the spec's currency] and worse [m] the best
    of them is than the best of all, below 0 where it is cheaper or better.

    in_design: it is in the best design; candidate: whether the spec lists it (or it is as if it
    did).
    """

    entry: str
    kind: EntryKind
    best_with: BestWith
    dearer_by: float | None
    worse_by: float | None
    in_design: bool
    candidate: bool


Answer = NotTaken | HeldBack


@dataclass(frozen=True, slots=True)
class AskedSpec:
    """The spec with its tables and best design.

    build: how a changed spec becomes tables; whole: the spec with every entry that is asked about.
    """

    case: Case
    problem: Problem
    chosen: Design | None
    build: Build
    whole: Case


def questions_of(case: Case, entries: Sequence[str]) -> tuple[Case, Kinds]:
    """The case with every entry that is asked about, and what kind of entry each is."""
    if not entries:
        return case, {}
    whole = with_whole_catalog(case)
    return whole, kinds_of(whole, entries)


def why_not(asked: AskedSpec, kinds: Kinds) -> Iterator[Answer]:
    """An answer for each entry, and for each kind of entry that its id names."""
    for entry, named in kinds.items():
        for kind in named:
            yield from _answers(asked, kind, entry)


def _answers(asked: AskedSpec, kind: EntryKind, entry: str) -> Iterator[Answer]:
    held = _held(asked, asked, kind, entry, candidate=True)
    if held is not None:
        yield held
        return
    if any(True for _ in parts_with(asked.problem, kind, entry)):
        yield _kept_out(asked.case, asked.problem, kind, entry)
        return
    gone = list(excluded_rows(asked.case, asked.problem, kind, entry))
    if gone:
        yield from gone
        return
    yield NotTaken(
        entry, kind, "not-a-candidate", None, None, unlisted_text(asked.whole, kind, entry)
    )
    yield from _if_it_were(asked, kind, entry)


def unlisted_text(whole: Case, kind: EntryKind, entry: str) -> str:
    """That a spec does not list an entry."""
    if kind == "hardware":
        return f"no method or clock of this spec requires {entry}"
    where = list(homes(whole, kind, entry))
    if not where:
        modality = whole.catalog.sensors[entry].modality
        return f"{entry} is a {modality} sensor, and no stage of this spec has that role"
    return f"{entry} is not among the candidates of {listed(where)}"


def _if_it_were(asked: AskedSpec, kind: EntryKind, entry: str) -> Iterator[Answer]:
    """The best answer over the places that it could have, were it a candidate there."""
    found: list[HeldBack] = []
    missed: list[NotTaken] = []
    for case in admissions(asked.whole, kind, entry):
        there = replace(asked, case=case, problem=asked.build(case))
        held = _held(asked, there, kind, entry, candidate=False)
        if held is not None:
            found.append(held)
        elif any(True for _ in parts_with(there.problem, kind, entry)):
            missed.append(_kept_out(case, there.problem, kind, entry))
        else:
            missed += excluded_rows(case, there.problem, kind, entry)
    if found:
        yield min(found, key=lambda one: _order(asked.case, one))
    else:
        yield from missed


def _order(case: Case, one: HeldBack) -> tuple[bool, float, float]:
    """Objective, then error, as designs are ranked."""
    best, objective = one.best_with, case.spec.objective
    amount = best.error_m if objective == "error" else getattr(best, objective)
    return amount is None, amount or 0.0, best.error_m


def _held(
    asked: AskedSpec, there: AskedSpec, kind: EntryKind, entry: str, *, candidate: bool
) -> HeldBack | None:
    """The best design that holds an entry, against the best of all."""
    chosen = asked.chosen if candidate else None  # else its places are those of other tables
    taken = chosen is not None and bool(_places(there, chosen, kind, entry))
    design = chosen if taken else best_with(there.problem, kind, entry)
    if design is None:
        return None
    sums = evaluate(there.problem, design)
    dearer = worse = None
    if asked.chosen is not None:
        best = evaluate(asked.problem, asked.chosen)
        worse = float(sums.total_m - best.total_m)
        if sums.cost is not None and best.cost is not None:
            dearer = float(sums.cost - best.cost)
    cost, mass, power = (
        None if a is None else float(a) for a in (sums.cost, sums.mass, sums.power)
    )
    shown = full_design(there.case, there.problem, design)
    places = tuple(_places(there, design, kind, entry))
    with_it = BestWith(cost, mass, power, sums.error_m, places, shown)
    return HeldBack(entry, kind, with_it, dearer, worse, taken, candidate)


def _places(asked: AskedSpec, design: Design, kind: EntryKind, entry: str) -> list[str]:
    """Roles and vehicles that hold an entry in a design."""
    problem, found = asked.problem, []
    for table, place in zip(problem.roles, design.options, strict=True):
        option = table.options[place]
        needs = [name for name, _ in option.requires]
        holds = {"sensor": [option.sensor], "timestamping": [option.method], "hardware": needs}
        if entry in holds.get(kind, ()):
            found.append(f"{table.stage_name}.{table.role}")
    for vehicle, place in zip(problem.vehicles, design.clocks, strict=True):
        clock = vehicle.clocks[place]
        needs = [name for name, _ in clock.requires]
        if entry in (needs if kind == "hardware" else [clock.id] if kind == "clock" else ()):
            found.append(f"the clock of {vehicle.name}")
    return found


def excluded_rows(case: Case, problem: Problem, kind: EntryKind, entry: str) -> Iterator[NotTaken]:
    """Why it was ruled out before the choice: of each place the way that comes nearest."""
    names = set(_requiring(case, entry)) if kind == "hardware" else {entry}
    nearest: dict[str, Exclusion] = {}
    for gone in ruled_out_rows(problem):
        if _named(gone, kind) not in names:
            continue
        role = f"{gone.stage}.{gone.role}"
        place = f"the clock of {gone.stage}" if gone.role == "clock" else role
        if place not in nearest or _distance(gone) < _distance(nearest[place]):
            nearest[place] = gone
    for place, gone in nearest.items():
        yield NotTaken(entry, kind, gone.code, gone.figure, gone.limit, gone.reason, place)
    for place, figure in _incomplete(case, kind, entry):
        reason = f"{entry} gives no {figure}, which a requirement or the objective needs"
        yield NotTaken(entry, kind, "unpriced", None, figure, reason, place)


def _named(gone: Exclusion, kind: EntryKind) -> str | None:
    """The entry of some kind that an exclusion is about; of hardware what requires it."""
    if gone.role == "clock":
        return gone.sensor if kind in ("clock", "hardware") else None
    if kind == "clock":
        return None
    return gone.sensor if kind == "sensor" else gone.method


def _requiring(case: Case, hardware: str) -> Iterator[str]:
    """Candidate methods and clocks that require a piece of shared hardware."""
    for stage in case.stages:
        yield from (one.id for one in stage.clocks if hardware in one.entry.requires)
        for role in stage.roles:
            yield from (one.id for one in role.methods if hardware in one.entry.requires)


def _distance(gone: Exclusion) -> tuple[int, float]:
    """By its code; of timestamp errors the nearest to what is allowed."""
    place = NEAREST.index(gone.code) if gone.code in NEAREST else len(NEAREST)
    ratio = 0.0
    if gone.code == "tau" and isinstance(gone.figure, float) and isinstance(gone.limit, float):
        ratio = gone.figure / gone.limit if gone.limit else float("inf")
    return place, ratio


def _incomplete(case: Case, kind: EntryKind, entry: str) -> Iterator[tuple[str, str]]:
    """Queries that would find a sensor, did it give a figure that is due."""
    for stage in case.stages if kind == "sensor" else ():
        for role in stage.roles:
            for name, figure in role.incomplete:
                if name == entry:
                    yield f"{stage.choice.name}.{role.role}", figure


def _kept_out(case: Case, problem: Problem, kind: EntryKind, entry: str) -> NotTaken:
    """Of an entry that is an option: the requirement that every design with it misses by least."""
    missed = nearest_miss(case, [one.problem for one in parts_with(problem, kind, entry)])
    reason = f"with {entry}, {missed.text}"
    return NotTaken(entry, kind, missed.kind, missed.value, missed.limit, reason)
