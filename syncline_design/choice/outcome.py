"""What a choice comes to, as values."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Literal

from syncline_design.choice.table import Design
from syncline_design.machine.deadline import Deadline as Deadline
from syncline_design.machine.deadline import NoVerdict as NoVerdict
from syncline_design.machine.deadline import OutOfTime as OutOfTime

Road = Literal["auto", "front", "milp", "enumerate"]
METHODS: tuple[Road, ...] = ("auto", "front", "milp", "enumerate")
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
    """

    amount: Fraction | float
    error_m: float
    design: Design
    undecided: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Proof:
    """How a choice was proven.

    method: the road.  rechecked: every sum and constraint of the design was recomputed in exact
    fractions.  agrees_with: further roads that gave the same answer.  gap: of a design that is not
    proven optimal, the share of its objective that the optimum may lie below it at most.
    """

    method: str
    optimal: bool
    rechecked: bool
    agrees_with: tuple[str, ...] = ()
    gap: float | None = None


@dataclass(frozen=True, slots=True)
class Choice:
    """The best design.

    passed_over: how many better ones by the sums fail in simulation, or are left open by it.
    undecided: ids of simulated requirements that are open for the design itself; then no design
    is known to meet them.  exhausted: False when the search ended before every design was tried;
    the design is then the first by the sums alone.
    """

    design: Design
    proof: Proof
    passed_over: int = 0
    undecided: tuple[str, ...] = ()
    exhausted: bool = True

    @property
    def accepted(self) -> bool:
        """Whether the design meets every requirement."""
        return self.exhausted and not self.undecided


@dataclass(frozen=True, slots=True)
class Infeasible:
    """No design meets every requirement.

    proof: the road that showed it; empty_roles: roles that have no option at all; passed_over: how
    many designs keep every sum and fail in simulation.
    """

    proof: Proof
    empty_roles: tuple[int, ...] = ()
    passed_over: int = 0
