"""What accuracy costs: the exact staircase of prices, read off the front.

Duals of a mixed-integer program mean nothing; the front is the price list itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from syncline_design.choice.outcome import FrontPoint


@dataclass(frozen=True, slots=True)
class PriceStep:
    """One step: `amount` buys every accuracy target from `tightest_m` up to `looser_than_m`.

    looser_than_m: error of the next cheaper point, where that one takes over (None: the cheapest).
    extra: what this step costs more than the one before it (None: the cheapest).
    """

    amount: Fraction | float
    tightest_m: float
    looser_than_m: float | None
    extra: Fraction | float | None

    def to_json(self) -> dict[str, Any]:
        """The entry under `staircase`."""
        return {
            "cost": float(self.amount),
            "tightest_m": self.tightest_m,
            "looser_than_m": self.looser_than_m,
            "extra": None if self.extra is None else float(self.extra),
        }


def staircase(points: Sequence[FrontPoint]) -> tuple[PriceStep, ...]:
    """Prices by falling accuracy target, breakpoints exact: one step per point of the front."""
    steps = []
    before: FrontPoint | None = None
    for point in points:
        steps.append(
            PriceStep(
                point.amount,
                point.error_m,
                before.error_m if before else None,
                point.amount - before.amount if before else None,
            )
        )
        before = point
    return tuple(steps)
