"""How much a search may look at, counted and not timed: the same answer on a busy machine."""

from __future__ import annotations

import math
from typing import Final

from syncline_design.machine.quick_dataclass import dataclass

ROWS_OF_A_DRIVE: Final = 50  # that take as long to look at as a drive by its legs


@dataclass(slots=True)
class Effort:
    """A budget of drives that are judged by what their legs tell; over once `spent` is `most`.

    What is looked at row by row counts as the drives that take as long.  begun: what a plan looks
    at so before it searches.
    """

    most: float = math.inf
    spent: float = 0.0
    begun: float = 0.0

    @property
    def is_over(self) -> bool:
        """Whether nothing more may be looked at."""
        return self.spent >= self.most

    @property
    def is_half_over(self) -> bool:
        """Whether what is only better, and not needed, is to be left."""
        return self.spent + self.begun >= 0.5 * self.most

    def look_at(self, rows: float) -> None:
        """Count rows that are looked at one by one."""
        self.spent += rows / ROWS_OF_A_DRIVE

    def part(self, most: float) -> Effort:
        """A budget of its own, no larger than what is left of this one."""
        return Effort(min(most, max(self.most - self.spent, 0.0)))

    def add(self, part: Effort) -> None:
        """Count what a part has taken."""
        self.spent += part.spent + part.begun
