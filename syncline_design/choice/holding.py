"""The best design that holds an entry, and the best that does without a sensor.

A design holds an entry where a role or a vehicle takes it, or something that requires it: each such
place alone makes a part of the design space, and the best of their best designs is the answer.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Literal

import numpy as np

from syncline_design.choice.core import Beside, core, standing_near
from syncline_design.choice.decide import choose
from syncline_design.choice.evaluate import evaluate, rank
from syncline_design.choice.exclusions import Exclusions
from syncline_design.choice.narrowed import Narrowed, kept, narrowed
from syncline_design.choice.options import Bools, Options
from syncline_design.choice.outcome import Choice, Infeasible, TooLarge, Unfinished
from syncline_design.choice.table import ClockOption, Design, Problem

EntryKind = Literal["sensor", "timestamping", "hardware", "clock"]


def best_design(problem: Problem) -> Design | None:
    """The best design that meets every requirement; None when there is none.

    Raises Unfinished where simulation gave up, NoVerdict where nothing can be proven.
    """
    found = outcome_of(problem)
    return found.design if isinstance(found, Choice) and found.accepted else None


def outcome_of(problem: Problem) -> Choice | Infeasible:
    """The same, with a design that simulation leaves open where there is none that meets all."""
    try:
        found = choose(problem, "front")
    except TooLarge:
        found = choose(problem)
    if isinstance(found, Choice) and not found.exhausted:
        raise Unfinished("the search for a design that passes simulation gave up")
    return found


def best_in(part: Narrowed) -> Design | None:
    """The best design of a part, as one of the whole."""
    found = None if part.is_empty else best_design(part.problem)
    return None if found is None else part.whole(found)


def parts_with(problem: Problem, kind: EntryKind, identity: str) -> Iterator[Narrowed]:
    """For each role and vehicle that may hold an entry: the designs in which it does."""
    options = [np.arange(len(table.options)) for table in problem.roles]
    clocks = [list(range(len(table.clocks))) for table in problem.vehicles]
    for r, table in enumerate(problem.roles):
        rows = np.flatnonzero(hold(table.options, kind, identity))
        if len(rows):
            part = narrowed(problem, [*options[:r], rows, *options[r + 1 :]], clocks)
            yield replace(part, problem=_for_good(part.problem, r, kind, identity))
    for v, vehicle in enumerate(problem.vehicles):
        mine = [i for i, one in enumerate(vehicle.clocks) if holds(one, kind, identity)]
        if mine:
            yield narrowed(problem, options, [*clocks[:v], mine, *clocks[v + 1 :]])


def _for_good(part: Problem, r: int, kind: EntryKind, identity: str) -> Problem:
    """The part that holds an entry in a role under other limits too: a relaxed one brings back
    options of that role only where they hold it."""
    gone = part.roles[r].excluded
    poor, beyond = (
        own.take(np.flatnonzero(hold(own, kind, identity))) for own in (gone.poor, gone.beyond)
    )
    table = replace(part.roles[r], excluded=Exclusions.in_turn(gone.rest, poor, beyond))
    return replace(part, roles=(*part.roles[:r], table, *part.roles[r + 1 :]))


def best_with(problem: Problem, kind: EntryKind, identity: str) -> Design | None:
    """The first design in the documented order that meets every requirement and holds an entry."""
    found = [best_in(part) for part in parts_with(problem, kind, identity)]
    ranked = [
        (rank(problem, design, evaluate(problem, design)), place, design)
        for place, design in enumerate(found)
        if design is not None
    ]
    return min(ranked)[2] if ranked else None


def without(problem: Problem, sensor: str, chosen: Design | None = None) -> Narrowed:
    """The designs with this sensor in no role.

    chosen: the best design, where only what is as good as another one near it needs to be kept.
    """
    part = kept(problem, lambda _, options: ~hold(options, "sensor", sensor), lambda _, clock: True)
    if chosen is None or part.is_empty or problem.judge is not None:
        return part
    known = standing_near(part.problem, tuple(_left_of(part, chosen)), chosen)
    if known is None:
        return part
    return core(part.problem, known, Beside(part.problem)).within(part)


def _left_of(part: Narrowed, design: Design) -> Iterator[int | None]:
    """Where a part has the options of a design; None where it has not."""
    for own, place in zip(part.options, design.options, strict=True):
        found = np.flatnonzero(own == place)
        yield int(found[0]) if len(found) else None


def hold(options: Options, kind: EntryKind, identity: str) -> Bools:
    """Which options are, use or require an entry."""
    if kind == "hardware":
        needing = [any(name == identity for name, _ in needs) for needs in options.needs]
        return np.array([*needing, False])[options.need]
    if kind == "clock":
        return np.zeros(len(options), dtype=bool)
    numbers = options.sensor if kind == "sensor" else options.method
    _, first = np.unique(numbers, return_index=True)
    names = options.take(first).all_names()
    own = 0 if kind == "sensor" else 2
    named = [place for place, one in zip(first, names, strict=True) if one[own] == identity]
    return np.isin(numbers, numbers[named])


def holds(clock: ClockOption, kind: EntryKind, identity: str) -> bool:
    if kind == "hardware":
        return any(name == identity for name, _ in clock.requires)
    return kind == "clock" and clock.id == identity
