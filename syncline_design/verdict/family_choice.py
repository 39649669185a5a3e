"""The choice of a family as data: its front, what robustness costs, which missions do not go."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from typing import TypeVar

from syncline_design.choice.front import staircase
from syncline_design.choice.outcome import TooLarge
from syncline_design.choice.variations import Build
from syncline_design.machine.deadline import Pieces, in_force
from syncline_design.verdict.family import (
    Chosen,
    Work,
    choose_family,
    front_of,
    intervals,
    work_of,
)
from syncline_design.verdict.family_named import (
    Sums,
    as_point,
    front_design,
    front_left_out,
    ranked,
    ruled_out_of,
)
from syncline_design.verdict.family_others import alternatives, bargains, next_best
from syncline_design.verdict.named import ChoiceResult
from syncline_design.verdict.tree import Robustness

T = TypeVar("T")


def robustness_of(work: Work, sums: Sums, build: Callable[[], Build]) -> Robustness | None:
    """What it costs to hold for more than the figures as given."""
    spec = work.case.spec
    if spec.choose_for == "nominal":
        return None
    in_force().doing("choosing at given figures")
    own = work_of(work.case, build, work.seed, nominal=True)
    chosen = choose_family(own) if not own.family.is_empty else None
    best = None if chosen is None or chosen.undecided else ranked(own, chosen)
    unit = {"cost": spec.currency, "mass": "kg", "power": "W"}.get(spec.objective, "m")
    price = None
    if spec.objective != "error" and chosen is not None and chosen.found is not None:
        before, now = chosen.found.sums.amount(spec.objective), sums[spec.objective]
        price = None if before is None or now is None else float(now - before)
    figures = {f.name for one in work.missions for f in intervals(one.case)}
    return Robustness(
        choose_for=str(spec.choose_for), figures=len(figures), nominal=best, price=price, unit=unit
    )


def choice_of_family(work: Work, chosen: Chosen, pieces: Pieces) -> ChoiceResult:
    """The proof, the front, what comes next and what else could be bought, what was ruled out."""

    def listed(name: str, source: Callable[[], Iterable[T]]) -> list[T]:
        return pieces.listed(name, lambda: as_far(name, source, pieces))

    points = listed("front", lambda: front_of(work))
    excluded, count = ruled_out_of(work)
    found = ChoiceResult(
        proof=chosen.proof,
        front=tuple(front_design(work, point) for point in points),
        front_left_out=front_left_out(work),
        staircase=staircase([as_point(work, point) for point in points]),
        excluded=excluded,
        excluded_count=count,
    )
    if chosen.found is None:
        return found
    every = listed("next best of every design", lambda: next_best(work, chosen, every=True))
    return replace(
        found,
        next_best=tuple(listed("next best designs", lambda: next_best(work, chosen))),
        next_best_every=tuple(every),
        alternatives=tuple(listed("alternatives", lambda: alternatives(work, chosen))),
        bargains=tuple(listed("bargains", lambda: bargains(work, chosen, points))),
    )


def as_far(name: str, source: Callable[[], Iterable[T]], pieces: Pieces) -> Iterator[T]:
    """What a source finds until its search gives up; the choice itself stands without it."""
    try:
        yield from source()
    except TooLarge:
        pieces.gave_up.append(name)


def cannot_share(work: Work, build: Callable[[], Build]) -> tuple[str, ...]:
    """Missions that cannot share one payload, none of which can be left out."""
    left = list(work.missions)
    for mission in work.missions:
        rest = tuple(one for one in left if one is not mission)
        if (
            len(rest) > 1
            and choose_family(work_of(replace(work.case, missions=rest), build, work.seed)) is None
        ):
            left = list(rest)
    return tuple(one.name for one in left)
