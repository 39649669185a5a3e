"""The best design of an open spec, verified."""

from __future__ import annotations

from collections.abc import Callable
from datetime import date

from syncline_design.choice.outcome import Choice, Infeasible, NoVerdict, Road
from syncline_design.choice.table import Problem
from syncline_design.choice.variations import Build
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.spec.case import Case
from syncline_design.verdict.one_design import verify
from syncline_design.verdict.settings import CheckSettings
from syncline_design.verdict.verified import Verified


@dataclass(frozen=True, slots=True)
class Chosen:
    """What the choice of a spec came to, and from which tables.

    case: with waived requirements eased where no design keeps them; build: makes its problem.
    """

    choice: Choice | Infeasible
    case: Case
    problem: Problem
    build: Build


@dataclass(frozen=True, slots=True)
class Picked:
    """What the choice came to: a verified design, or none.

    exhausted: False when the search ended before every design was simulated; the verified one is
    then the first by the sums.
    """

    chosen: Chosen
    verified: Verified | None
    exhausted: bool = True

    @property
    def choice(self) -> Choice | Infeasible:
        """The choice itself."""
        return self.chosen.choice


def pick(chosen: Chosen, settings: CheckSettings) -> Picked:
    """The first design in the documented order that meets every requirement, verified.

    Where simulation leaves every candidate open, the first of those.
    """
    choice = chosen.choice
    if isinstance(choice, Infeasible):
        return Picked(chosen, None)
    verified = verify(chosen.case, chosen.problem, choice.design, settings)
    if verified.word == "fails" and choice.exhausted:
        raise NoVerdict("the chosen design does not stand up to the independent recheck")
    return Picked(chosen, verified, choice.exhausted)


def chosen_of(
    case: Case, problem: Problem, builds: tuple[Build, Callable[[], Build]], road: Road, day: date
) -> Chosen:
    """The choice of a spec: by every limit, where nothing keeps them with waived ones eased.

    builds: what made the problem, and what makes another of the kind that has simulated nothing.
    day: on which waivers are judged.
    """
    # 17 ms that a pinned spec need not wait
    from syncline_design.choice.decide import choose
    from syncline_design.choice.waivers import eased, lifted, waived

    build, fresh = builds
    first = Chosen(choose(problem, road), case, problem, build)
    ids = waived(case, day)
    if not ids or not isinstance(first.choice, Infeasible):
        return first
    own, again = eased(case, fresh(), ids) or lifted(case, ids), fresh()
    problem = again(own)
    return Chosen(choose(problem, road), own, problem, again)
