"""How far a study is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Progress:
    """Cases done of all, how many of them were there already, and the time it took so far."""

    done: int
    total: int
    reused: int
    elapsed_s: float
    retried: int = 0

    @property
    def remaining_s(self) -> float | None:
        """What is left at the rate so far; None while there is no rate yet."""
        computed = self.done - self.reused
        if computed <= 0:
            return None if self.done < self.total else 0.0
        return self.elapsed_s / computed * (self.total - self.done)


Report = Callable[[Progress], None]
