"""The field's standard line plans, judged like the designed one: one speed from end to end.

Straight lines; reciprocal lines and figure eights (antenna and latency checks of aerial survey);
strip-adjustment lines: crossing lines; the hydrographic patch test: lines both ways at two speeds,
and a parallel one (IHO C-13, Manual on Hydrography, ch. 3: latency, pitch, heading, roll).
What is logged are the lines, with the turns between them where the plan has turns.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from syncline_design.effects.record import Array
from syncline_design.planning.legs import FULL_RAD, LINE_S, Leg
from syncline_design.planning.path import STEP_S, Course
from syncline_design.planning.search import Judge, Told
from syncline_design.planning.vehicle import Vehicle

LINE, SLOW, ABOUT, EIGHT = "line", "slow line", "line, turn about", "eight"
# name: legs of one round, each with the quarters of the compass that it is driven to
ROUNDS: Final[dict[str, tuple[tuple[str, tuple[int, ...]], ...]]] = {
    "straight lines": ((LINE, (0,)),),
    "reciprocal lines": ((ABOUT, (0, 2)),),
    "figure eights": ((EIGHT, (0,)),),
    "strip-adjustment lines": ((LINE, (0, 2, 1, 3)),),
    "patch-test lines": ((LINE, (0, 2)), (SLOW, (0,)), (LINE, (0,))),
}
MOST_ROUNDS: Final = 2.0**14


@dataclass(frozen=True, slots=True)
class Round:
    """One round of a line plan: its information at no drift, time and legs."""

    name: str
    information: Array
    lasts_s: float
    legs: int


def standard_legs(vehicle: Vehicle, stage: int) -> tuple[Leg, ...]:
    """Lines and turns at one speed."""
    fast, low = vehicle.fast_mps, max(vehicle.slowest_mps, 0.4 * vehicle.fast_mps)
    line, slow = _at(fast, LINE_S), _at(low, LINE_S)
    legs = [(LINE, line), (SLOW, slow)]
    speed = _cornering(vehicle)
    rate = vehicle.turn_radps(speed)
    turn, circle = math.pi / rate, FULL_RAD / rate
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


def _at(speed: float, duration_s: float) -> Course:
    ahead = _steady(speed, duration_s)
    zero = np.zeros_like(ahead)
    return Course(ahead, zero, zero, zero)


def _turned(speed: float, turns: Sequence[Array]) -> Course:
    turn = np.concatenate(turns)
    zero = np.zeros_like(turn)
    return Course(np.full(turn.shape, speed), zero, zero, turn)


def rounds(told: Sequence[Told]) -> tuple[Round, ...]:
    """The line plans of a vehicle."""
    known = {t.leg.name: t for t in told}
    found = []
    for name, parts in ROUNDS.items():
        own = [(known[leg], h) for leg, headings in parts for h in headings]
        information = np.sum([t.now[h] for t, h in own], axis=0)
        found.append(Round(name, information, sum(t.leg.duration_s for t, _ in own), len(own)))
    return tuple(found)


def rounds_needed(judge: Judge, one: Round) -> float | None:
    """How many rounds reach what is asked, by bisection; None: none do."""

    def reached(count: float) -> bool:
        return bool(np.all(judge.ratios(count * one.information, exact=True) <= 1.0))

    high = 1.0
    while not reached(high):
        high *= 2.0
        if high > MOST_ROUNDS:
            return None
    low = 0.0
    while high - low > 1e-3 * high:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if reached(middle) else (middle, high)
    return high
