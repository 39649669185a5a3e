"""Lines of a clock's log that are none of it: they cost themselves, are counted and said.

A power cut leaves blocks of NUL and lines that the next one is joined to.  Where more than a tenth
of a log is so, it is no such log, and is refused for the first of them.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.sentences import left_out
from syncline_design.spec.load import BadInput

MOST_DAMAGED: Final = 0.1  # of the lines


@dataclass(slots=True)
class DamagedLines:
    """Damaged lines of one file, in any order; first: why the earliest of them is none."""

    count: int = 0
    first: BadInput | None = None

    def add(self, error: BadInput) -> None:
        """One more."""
        self.count += 1
        if self.first is None or _line(error) < _line(self.first):
            self.first = error

    def demand_few(self, good: int, least: int) -> None:
        """Refuse where they are more than so many, and more than damage to this log explains."""
        if self.first is not None and self.count > max(least, MOST_DAMAGED * (good + self.count)):
            raise self.first

    def said(self, path: Path) -> list[str]:
        """For people; nothing where every line was read."""
        if self.first is None:
            return []
        (flaw,) = self.first.problems
        return [f"{path}: {left_out(self.count, flaw.line, flaw.message)}"]


def _line(error: BadInput) -> int:
    (flaw,) = error.problems
    return flaw.line
