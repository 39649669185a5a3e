"""How an effect is another from one run on: at once, or by as much more with every run.

A change from run k on has the course h over the runs, 0 before k: of a step 1, of a drift the
number of runs since, the first counted.  Weights of all courses sum to one: half as many changes
are looked for at the run EARLY as at the first, and DRIFTING of them all are drifts.
"""

from __future__ import annotations

import functools
import math
from typing import Final, Literal

import numpy as np

from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass

Kind = Literal["step", "drift"]
EARLY: Final = 10.0  # runs after which a change is met half as often as at the first
DRIFTING: Final = 0.1  # share of the changes that grow from run to run


@dataclass(frozen=True, slots=True)
class Trend:
    """A change from one run on; k: place of the first run that has it; until: of the first that has
    no more of it, of a drift than the run before, of a step none."""

    kind: Kind
    k: int
    until: int | None = None

    @property
    def is_of_one_run(self) -> bool:
        return self.kind == "step" and self.until == self.k + 1

    @property
    def begun(self) -> Trend:
        """The same without its end."""
        return Trend(self.kind, self.k)

    def over(self, count: int) -> Array:
        """h of so many runs, (count,)."""
        since = np.maximum(np.arange(count) - self.k + 1.0, 0.0)
        if self.until is not None and self.kind == "step":
            since[self.until :] = 0.0
        elif self.until is not None:
            since = np.minimum(since, float(self.until - self.k))
        found: Array = np.minimum(since, 1.0) if self.kind == "step" else since
        return found


def trends(look: int) -> tuple[Trend, ...]:
    """All that so many runs could show: steps from every run from the second on, then drifts."""
    kinds: tuple[Kind, ...] = ("step", "drift")
    return tuple(Trend(kind, k) for kind in kinds for k in range(1, look))


@functools.lru_cache(maxsize=256)
def shapes(look: int) -> Array:
    """Their h, (2 (look - 1), look), the same array at every call."""
    found = np.array([one.over(look) for one in trends(look)]).reshape(-1, look)
    found.flags.writeable = False
    return found


def log_weights(look: int) -> Array:
    """log of their shares of the false alarms, (2 (look - 1),)."""
    shares = {"step": 1.0 - DRIFTING, "drift": DRIFTING}
    return np.log([shares[one.kind] * weight_of(one.k + 1) for one in trends(look)])


def step_weight(k: int) -> float:
    """Share of the false alarms that a step at the run k (from 2) may have."""
    return (1.0 - DRIFTING) * weight_of(k)


def weight_of(k: int) -> float:
    """Share of the false alarms that a change at the run k (from 2) may have."""
    return later(k) - later(k + 1)


def later(k: int) -> float:
    """Share of the changes at the run k (from 2) or later: what was mounted last moves first."""
    return math.sqrt((EARLY + 2.0) / (EARLY + k))
