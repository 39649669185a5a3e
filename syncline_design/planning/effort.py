"""How much a search may look at, counted and not timed: the same answer on a busy machine."""

from __future__ import annotations

import math

from syncline_design.machine.quick_dataclass import dataclass


@dataclass(slots=True)
class Effort:
    """A budget of drives whose information is judged; over once `spent` is `most`.

    begun: what a plan looks at before it searches, in as many drives as take that long.
    """

    most: float = math.inf
    spent: float = 0.0
    begun: float = 0.0

    @property
    def is_over(self) -> bool:
        """Whether nothing more may be looked at."""
        return self.spent >= self.most

    def part(self, most: float) -> Effort:
        """A budget of its own, no larger than what is left of this one."""
        return Effort(min(most, max(self.most - self.spent, 0.0)))

    def add(self, part: Effort) -> None:
        """Count what a part has taken."""
        self.spent += part.spent + part.begun
