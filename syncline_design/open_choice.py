"""The best design that also stands up to verification, Monte Carlo requirements included."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import islice
from typing import TYPE_CHECKING

from syncline_design.design_space import Design, Problem
from syncline_design.verdict import Verified

if TYPE_CHECKING:
    from syncline_design.choose.outcome import Choice, Infeasible, Method

MOST_SIMULATED = 100  # designs tried against a Monte Carlo requirement before giving up


@dataclass(frozen=True, slots=True)
class Picked:
    """What the choice came to: a verified design, with how many better ones failed simulation.

    exhausted: no design is left that could pass; the verified one is then the closest, the first.
    """

    choice: Choice | Infeasible
    verified: Verified | None
    passed_over: int = 0
    exhausted: bool = True


def pick(
    problem: Problem,
    method: Method,
    time_limit_s: float | None,
    verify: Callable[[Design], Verified],
) -> Picked:
    """The first design in the documented order that verifies; the first of all when none does."""
    from syncline_design.choose.decide import choose
    from syncline_design.choose.outcome import Infeasible, NoVerdict

    choice = choose(problem, method, time_limit_s)
    if isinstance(choice, Infeasible):
        return Picked(choice, None)
    first = verify(choice.design)
    if first.word == "meets":
        return Picked(choice, first)
    if not first.exact.passed and not first.system.effects:
        raise NoVerdict("the chosen design does not stand up to the independent recheck")
    passed_over = 1
    further = _others(problem, choice.design)
    for design in islice(further, MOST_SIMULATED):
        verified = verify(design)
        if verified.word == "meets":
            return Picked(choice, verified, passed_over)
        passed_over += 1
    return Picked(choice, first, passed_over, next(further, None) is None)


def _others(problem: Problem, first: Design) -> Iterator[Design]:
    from syncline_design.choose.ranked import iter_best

    return (design for design in iter_best(problem) if design != first)
