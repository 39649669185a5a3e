"""What a choice comes to, as values."""

from __future__ import annotations

from fractions import Fraction
from typing import Literal

from syncline_design.choice.table import Design
from syncline_design.machine.deadline import Deadline as Deadline
from syncline_design.machine.deadline import NoVerdict as NoVerdict
from syncline_design.machine.deadline import OutOfTime as OutOfTime
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.records import Record, optional

Road = Literal["auto", "front", "milp", "enumerate"]
FixKind = Literal[
    "accuracy",
    "sync",
    "cost",
    "mass",
    "power",
    "monte_carlo",
    "platform",
    "timestamping",
    "facts",
    "sample_spacing",
    "worst_case",
    "thu",
    "tvu",
    "rmse",
    "quantile",
    "missions",
]
NO_SINGLE_CHANGE = "No single change was found to help."
ROAD_NAMES: tuple[Road, ...] = ("auto", "front", "milp", "enumerate")
# The roads in words, for every text that says how a design was proven best.
ROADS: dict[str, str] = {
    "front": "the exact Pareto front",
    "milp": "an integer program",
    "enumerate": "enumeration of all designs",
}


class TooLarge(NoVerdict):
    """One road gives up; another may still do it."""


class Unfinished(NoVerdict):
    """So many designs were simulated that the search gave up."""


@dataclass(frozen=True, slots=True)
class FrontPoint:
    """One point of the exact front: the least of a resource for this error, and the design.

    amount: infinite where a catalog entry does not say (only off the fronts that are shown).
    undecided: ids of simulated requirements that its samples leave open.
    figure_m: what the front is drawn over, where that is another figure of the error.
    """

    amount: Fraction | float
    error_m: float
    design: Design
    undecided: tuple[str, ...] = ()
    figure_m: float | None = None

    @property
    def drawn_m(self) -> float:
        """What the front sets against the amount [m]."""
        return self.error_m if self.figure_m is None else self.figure_m


@dataclass(frozen=True, slots=True)
class Proof(Record):
    """How a choice was proven.

    method: the road.  rechecked: every sum and constraint of the design was recomputed in exact
    fractions.  gap: of a design that is not proven optimal, the share of its objective that the
    optimum may lie below it at most.  agrees_with: further roads that gave the same answer.
    passed_over: how many designs keep every sum, come before this one (or are all there are) and
    fail in simulation, or are left open by it.
    """

    method: str
    optimal: bool
    rechecked: bool
    gap: float | None = None
    agrees_with: tuple[str, ...] = ()
    passed_over: int = 0


@dataclass(frozen=True, slots=True)
class Choice:
    """The best design.

    undecided: ids of simulated requirements that are open for the design itself; then no design
    is known to meet them.  exhausted: False when the search ended before every design was tried;
    the design is then the first by the sums alone.
    """

    design: Design
    proof: Proof
    undecided: tuple[str, ...] = ()
    exhausted: bool = True

    @property
    def accepted(self) -> bool:
        """Whether the design meets every requirement."""
        return self.exhausted and not self.undecided


@dataclass(frozen=True, slots=True)
class Infeasible:
    """No design meets every requirement.

    proof: the road that showed it.
    """

    proof: Proof


@dataclass(frozen=True, slots=True)
class PriceStep(Record):
    """One step: `cost` buys every accuracy target from `tightest_m` up to `looser_than_m`.

    looser_than_m: error of the next cheaper point, where that one takes over (None: the cheapest).
    extra: what this step costs more than the one before it (None: the cheapest).
    Of a front of mass or power, `cost` and `extra` are amounts of that.
    """

    cost: float
    tightest_m: float
    looser_than_m: float | None
    extra: float | None


@dataclass(frozen=True, slots=True)
class Fix(Record):
    """One change that was solved again and does make the spec feasible.

    requirement: id of the requirement it changes, None where it changes something else; figure and
    stage: of the platform figure that it changes; mission: of several, the one that it is about.
    from_, to: the figure in SI or the spec's
    currency (None: not a figure), unit: theirs; relative: its change as a share of itself.
    """

    kind: FixKind
    requirement: str | None
    figure: str | None
    stage: str | None
    from_: float | None
    to: float | None
    unit: str | None
    text: str
    proven: bool = True
    relative: float | None = None
    mission: str | None = optional()


@dataclass(frozen=True, slots=True)
class RoleGap(Record):
    """A role that no candidate can take; misses_by: tau over the tau it may have at most."""

    stage: str
    role: str
    nearest: str | None
    misses_by: float | None
    text: str


@dataclass(frozen=True, slots=True)
class ConflictMember(Record):
    """A requirement of the conflict; id None and no line: the implied sync limit.

    mission: the one whose limit it is, of several.
    """

    id: str | None
    kind: str
    line: int | None
    mission: str | None = optional()

    @property
    def words(self) -> str:
        """`ACC-1 (line 4)`."""
        where = "" if self.mission is None else f" of mission {self.mission}"
        if self.id is None:
            return f"the implied sync requirement{where}"
        line = "" if self.line is None else f" (line {self.line})"
        return f"{self.id}{where}{line}"


Members = tuple[ConflictMember, ...]


@dataclass(frozen=True, slots=True)
class Conflict(Record):
    """Requirements that cannot hold together.  minimal: proven that any one left out helps.

    each_suffices: true where the whole spec, too, has a design without any one of them.
    """

    requirements: Members
    minimal: bool
    each_suffices: bool | None = optional()


@dataclass(frozen=True, slots=True)
class Explanation(Record):
    """Why a spec is infeasible: the `infeasibility` of a verdict.

    further_conflicts: those that remain once the first is lifted; where there are any, no
    requirement alone can be moved far enough.  joint_fixes: changes that help together.  cut_short:
    the time limit ended the search for reasons and remedies, so what is not there may still exist.
    text: the whole in words, line by line.  missions: of a family those that cannot be met by one
    payload; one alone has the reasons of its own.  about: what it speaks of, in words, where that
    is not the spec as it stands.
    """

    roles_without_options: tuple[RoleGap, ...]
    conflict: Conflict
    further_conflicts: tuple[Members, ...]
    fixes: tuple[Fix, ...]
    joint_fixes: tuple[tuple[Fix, ...], ...]
    cut_short: bool
    text: tuple[str, ...] = ()
    missions: tuple[str, ...] | None = optional()
    about: str | None = optional()

    @property
    def conflicts(self) -> tuple[Members, ...]:
        """The first conflict and those that remain without it."""
        return (self.conflict.requirements, *self.further_conflicts)


def cut_short_words(found: Explanation) -> str:
    """What the time limit left open, in a sentence."""
    which = "further" if found.fixes or found.joint_fixes else "any"
    return (
        f"The time limit ended the search for reasons and remedies: whether {which} change "
        "would help was not worked out."
    )
