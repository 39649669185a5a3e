"""How to check a spec, and how it becomes a problem for that."""

from __future__ import annotations

from datetime import date
from typing import TYPE_CHECKING

from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.spec.requirement import JUDGED_KINDS, STATED_KINDS
from syncline_design.verdict.acceptance import Simulations

if TYPE_CHECKING:
    from syncline_design.choice.outcome import Road
    from syncline_design.choice.variations import Build


@dataclass(frozen=True, slots=True)
class CheckSettings:
    """How to check: seed of the random numbers and road of the choice.

    monte_carlo: whether to simulate (a monte_carlo requirement stays undecided without).
    explain: ids of requirements to work out step by step.
    cloud: whether designs around the front are told too, for a picture.
    today: the day on which waivers are judged; None: the machine's date.
    others: whether the designs beside the chosen one are told, which texts do not show.
    brief: what decides, the design and its front alone: no other designs, no warnings, no sources.
    """

    seed: int = 0
    road: Road = "auto"
    monte_carlo: bool = True
    explain: tuple[str, ...] = ()
    today: date | None = None
    cloud: bool = False
    others: bool = True
    brief: bool = False

    @property
    def day(self) -> date:
        """The day on which waivers are judged."""
        return self.today or date.today()


def build_of(settings: CheckSettings) -> Build:
    """How a spec becomes a problem: with simulated requirements, unless nothing is simulated."""
    kinds = JUDGED_KINDS if settings.monte_carlo else STATED_KINDS
    return Simulations(settings.seed, kinds).problem_of
