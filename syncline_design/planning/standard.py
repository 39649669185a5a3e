"""The field's standard line plans, judged like the designed one: one speed from end to end.

Straight lines; reciprocal lines and figure eights (antenna and latency checks of aerial survey);
strip-adjustment lines: crossing lines; the hydrographic patch test: lines both ways at two speeds,
and a parallel one (IHO C-13, Manual on Hydrography, ch. 3: latency, pitch, heading, roll).
What is logged are the lines; the turns between them count as time alone.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Final

import numpy as np

from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.planning.legs import FULL_RAD, LINE_S, QUARTER_RAD, Leg
from syncline_design.planning.path import STEP_S, CourseCommands
from syncline_design.planning.placing import LegTold
from syncline_design.planning.search import PlanJudge
from syncline_design.planning.vehicle import LONGEST_TURN_S, Vehicle

LEAST_TURN_RAD: Final = math.radians(10.0)  # what lines that do not turn may wander
LINE, SLOW, ABOUT, EIGHT = "line", "slow line", "line, turn about", "eight"
# name: legs of one round, each with the quarters of the compass that it is driven to
ROUNDS: Final[dict[str, tuple[tuple[str, tuple[int, ...]], ...]]] = {
    "straight lines": ((LINE, (0,)),),
    "reciprocal lines": ((ABOUT, (0, 2)),),
    "figure eights": ((EIGHT, (0,)),),
    "strip-adjustment lines": ((LINE, (0, 2, 1, 3)),),
    "patch-test lines": ((LINE, (0, 2)), (SLOW, (0,)), (LINE, (2,))),
}
MOST_LEGS: Final = 2**16
PART: Final = 0.002  # of a drive that is driven several times, to which its time is told


@dataclass(frozen=True, slots=True)
class Lines:
    """A line plan: the legs of one round, again and again until all is reached.

    information: of each leg, at no drift, (n, p + 1, p + 1).  lasts_s: of each leg.  turns_s:
    between each leg and the one before it; before the first, from the last of the round before.
    """

    name: str
    information: Array
    lasts_s: Array
    turns_s: Array

    def told(self, legs: int) -> Array:
        """Information of so many legs."""
        whole, more = divmod(legs, len(self.lasts_s))
        found: Array = whole * self.information.sum(axis=0) + self.information[:more].sum(axis=0)
        return found

    def duration_s(self, legs: int) -> float:
        """Of so many legs, with the turns between them."""
        if legs <= 0:
            return 0.0
        whole, more = divmod(legs, len(self.lasts_s))
        each = self.lasts_s + self.turns_s
        return float(whole * each.sum() + each[:more].sum() - self.turns_s[0])

    def told_in(self, duration_s: float) -> Array:
        """Information of what fits into a time, of the last leg its share."""
        legs = most_within(lambda count: self.duration_s(count) <= duration_s)
        place = legs % len(self.lasts_s)
        turn_s = float(self.turns_s[place]) if legs else 0.0
        left = duration_s - self.duration_s(legs) - turn_s
        share = min(max(left / float(self.lasts_s[place]), 0.0), 1.0)
        return self.told(legs) + share * np.asarray(self.information[place])


def standard_legs(vehicle: Vehicle, stage: int) -> tuple[Leg, ...]:
    """Lines and turns at one speed; none where a turn about at that speed takes hours."""
    fast, low = vehicle.fast_mps, max(vehicle.slowest_mps, 0.4 * vehicle.fast_mps)
    line, slow = _at(fast, LINE_S), _at(low, LINE_S)
    legs = [(LINE, line), (SLOW, slow)]
    speed = _cornering(vehicle)
    rate = vehicle.turn_radps(speed)
    turn, circle = math.pi / rate, FULL_RAD / rate
    if turn > LONGEST_TURN_S:
        return ()
    straight = _at(speed, LINE_S).turn
    legs.append((ABOUT, _turned(speed, [straight, _steady(rate, turn)])))
    legs.append((EIGHT, _turned(speed, [_steady(rate, circle), _steady(-rate, circle)])))
    return tuple(Leg(name, stage, name, course) for name, course in legs)


def _cornering(vehicle: Vehicle) -> float:
    """The speed of lines with turns: as fast as a turn of 3 deg/s allows, at most."""
    speed = vehicle.fast_mps
    while vehicle.turn_radps(speed) < min(math.radians(3.0), 0.5 * vehicle.omega_max_radps):
        if 0.9 * speed < max(vehicle.slowest_mps, 0.2 * vehicle.v_max_mps):
            break
        speed *= 0.9
    return speed


def _steady(value: float, duration_s: float) -> Array:
    return np.full(max(round(duration_s / STEP_S), 1), value)


def _at(speed: float, duration_s: float) -> CourseCommands:
    ahead = _steady(speed, duration_s)
    zero = np.zeros_like(ahead)
    return CourseCommands(ahead, zero, zero, zero)


def _turned(speed: float, turns: Sequence[Array]) -> CourseCommands:
    turn = np.concatenate(turns)
    zero = np.zeros_like(turn)
    return CourseCommands(np.full(turn.shape, speed), zero, zero, turn)


def line_plans(vehicle: Vehicle, told: Sequence[LegTold]) -> tuple[Lines, ...]:
    """The line plans of a vehicle."""
    known = {t.leg.name: t for t in told}
    rate = vehicle.turn_radps(_cornering(vehicle))
    found = []
    for name, parts in ROUNDS.items():
        own = [(known[leg], h) for leg, headings in parts for h in headings]
        information = np.array([t.now[h] for t, h in own])
        lasts = np.array([t.leg.duration_s for t, _ in own])
        found.append(Lines(name, information, lasts, _turns_s(own, rate)))
    return tuple(found)


def _turns_s(own: Sequence[tuple[LegTold, int]], rate_radps: float) -> Array:
    """Time of the turn from the end of one leg to the heading of the next, around the round."""
    ends = [QUARTER_RAD * heading + told.turned_rad for told, heading in own]
    begins = [QUARTER_RAD * heading for _, heading in own]
    angles = [
        abs(math.remainder(begin - end, FULL_RAD))
        for begin, end in zip(begins, [ends[-1], *ends[:-1]], strict=True)
    ]
    return np.array([angle / rate_radps if angle > LEAST_TURN_RAD else 0.0 for angle in angles])


def legs_needed(judge: PlanJudge, lines: Lines) -> int | None:
    """The fewest legs of a line plan, in its order, that are enough; None: none are."""
    before = most_within(lambda count: not judge.enough(lines.told(count)))
    return None if before >= MOST_LEGS else before + 1


def most_within(holds: Callable[[int], bool]) -> int:
    """The largest count up to MOST_LEGS of which something holds that holds of 0, then ends."""
    low, high = 0, 1
    while high < MOST_LEGS and holds(high):
        low, high = high, 2 * high
    if high >= MOST_LEGS:
        return MOST_LEGS
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low


def times_needed(judge: PlanJudge, information: Array) -> float | None:
    """How many times a drive has to be driven until it is enough, the last one in part; None:
    however often it never is."""
    before = most_within(lambda count: not judge.enough(count * information))
    if before >= MOST_LEGS:
        return None
    low, high = float(before), float(before + 1)
    while high - low > PART * high:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if judge.enough(middle * information) else (middle, high)
    return high
