"""The least value within a box of a cost whose bend is known about: Newton steps, then secants.

A step d is the least g'd + d'Hd / 2 within the box and within reach.  H is what the cost says of
its bend where steps are long, and from there on what the slopes at both ends of every step make of
it (BFGS, damped as by Powell).  It ends when H promises less than what is worth a look.
Source: Nocedal and Wright, Numerical Optimization (2006), ch. 4, 6 and procedure 18.2.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np

from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass

REACH: Final = 2.0  # of a step along any axis, to begin with
LONG: Final = 0.5  # from which the bend is asked again, unless it foretold the step well
WELL: Final = 0.9  # share of what was promised, from which it did
POOR, GOOD = 0.25, 0.75  # the same, for the reach to be halved or doubled
LEAST: Final = 0.05  # the same, for a step to be taken
SWEEPS: Final = 100
SETTLED: Final = 1e-4
OUT_OF_WAY: Final = 2  # how often a step that could promise no more for want of reach is lengthened


@dataclass(frozen=True, slots=True)
class CostHere:
    """A cost at one place: its value, its slopes (p,), and its bend (p, p), made when asked for."""

    value: float
    slope: Array
    bend: Callable[[], Array]


def least(
    look: Callable[[Array], CostHere | None],
    start: Array,
    box: tuple[Array, Array],
    worth: Callable[[float], float],
    most: int,
) -> tuple[Array, float]:
    """Where the cost is least, as near as a step is worth it, and the cost there.

    look: the cost at a place, None where it has none; worth: gain below which a step is not worth
    it, once so much was gained; most: looks at most.
    """
    first = look(start)
    if first is None:
        raise ValueError("the cost has no value to start from")
    path = _Path(start, first, first.bend())
    longer = 0
    for _ in range(most):
        step, promised = path.step(box, path.reach)
        least_gain = worth(first.value - path.here.value)
        if promised < least_gain:
            if longer == OUT_OF_WAY or path.step(box, REACH)[1] < least_gain:
                break
            path.lengthened(again=longer == 0)
            longer += 1
            continue
        path.moved(step, promised, look(path.place + step))
    return path.place, path.here.value


class _Path:
    """Where a search is, what it knows of the cost there, and how far it trusts that."""

    def __init__(self, place: Array, here: CostHere, bend: Array) -> None:
        self.place, self.here, self.bend, self.reach = place, here, bend, REACH

    def step(self, box: tuple[Array, Array], reach: float) -> tuple[Array, float]:
        """The step that promises most within box and reach, and what it promises."""
        low = np.maximum(box[0] - self.place, -reach)
        high = np.minimum(box[1] - self.place, reach)
        step = least_in_box(self.here.slope, self.bend, low, high)
        return step, -float(self.here.slope @ step + 0.5 * step @ self.bend @ step)

    def lengthened(self, again: bool) -> None:
        """More reach; again: for a bend that is asked for anew."""
        self.reach *= 4.0
        if again:
            self.bend = self.here.bend()

    def moved(self, step: Array, promised: float, there: CostHere | None) -> None:
        """Take a step where it gains, and learn from it either way."""
        length = float(np.max(np.abs(step)))
        gain = -np.inf if there is None else self.here.value - there.value
        if there is None or gain <= LEAST * promised:
            if there is not None and gain > -3.0 * promised:
                self.bend = secant(self.bend, step, there.slope - self.here.slope)
            self.reach = length * self._share(step, gain)
            return
        turned = there.slope - self.here.slope
        self.place, self.here = self.place + step, there
        if length > LONG and gain < WELL * promised:
            self.bend = there.bend()
        else:
            self.bend = secant(self.bend, step, turned)
        if gain < POOR * promised:
            self.reach = 0.5 * length
        elif gain > GOOD * promised and length > 0.99 * self.reach:
            self.reach = min(2.0 * self.reach, 2.0 * REACH)

    def _share(self, step: Array, gain: float) -> float:
        """Of a step that does not gain, how much is tried next: to the least of a parabola."""
        falls = float(self.here.slope @ step)
        if not np.isfinite(gain) or falls + gain >= 0.0:
            return 0.3
        return float(np.clip(0.5 * falls / (falls + gain), 0.1, 0.5))


def least_in_box(slope: Array, bend: Array, low: Array, high: Array) -> Array:
    """The least of g'd + d'Hd / 2 within a box around zero: by axes, then by all that are free."""
    step, left, own = np.zeros(len(slope)), slope.copy(), np.diag(bend)
    for _ in range(SWEEPS):
        furthest = 0.0
        for k in range(len(slope)):
            to = min(max(step[k] - left[k] / own[k], low[k]), high[k])
            if to != step[k]:
                left += bend[:, k] * (to - step[k])
                furthest = max(furthest, abs(to - step[k]))
                step[k] = to
        if furthest < SETTLED:
            break
        free = np.flatnonzero((step > low) & (step < high))
        tried = step.copy()
        tried[free] -= np.linalg.solve(bend[np.ix_(free, free)], left[free])
        if np.all((tried >= low) & (tried <= high)):
            step, left = tried, slope + bend @ tried
    return step


def secant(bend: Array, step: Array, turned: Array) -> Array:
    """The bend that turns the slopes as a step did, positive as before (Powell's damped BFGS)."""
    known = bend @ step
    usual, told = float(step @ known), float(step @ turned)
    if told < 0.2 * usual:
        share = 0.8 * usual / (usual - told)
        turned = share * turned + (1.0 - share) * known
        told = float(step @ turned)
    changed: Array = bend - np.outer(known, known) / usual + np.outer(turned, turned) / told
    return changed
