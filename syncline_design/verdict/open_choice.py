"""The best design of an open spec, verified."""

from __future__ import annotations

from collections.abc import Callable

from syncline_design.choice.outcome import Choice, Infeasible, NoVerdict, Road
from syncline_design.choice.table import Design, Problem
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.verdict.verified import Verified


@dataclass(frozen=True, slots=True)
class Picked:
    """What the choice came to: a verified design, or none.

    exhausted: False when the search ended before every design was simulated; the verified one is
    then the first by the sums.
    """

    choice: Choice | Infeasible
    verified: Verified | None
    exhausted: bool = True


def pick(
    problem: Problem,
    road: Road,
    verify: Callable[[Design], Verified],
) -> Picked:
    """The first design in the documented order that meets every requirement, verified.

    Where simulation leaves every candidate open, the first of those.
    """
    from syncline_design.choice.decide import choose  # 17 ms that a pinned spec need not wait

    choice = choose(problem, road)
    if isinstance(choice, Infeasible):
        return Picked(choice, None)
    verified = verify(choice.design)
    if verified.word == "fails" and choice.exhausted:
        raise NoVerdict("the chosen design does not stand up to the independent recheck")
    return Picked(choice, verified, choice.exhausted)
