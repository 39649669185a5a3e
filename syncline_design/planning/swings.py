"""Swings of speed, slow and fast once, on a line or an arc: the shortest drives that tell a delay.

What a delay does grows with the speed, what a lever arm does turns with the vehicle: a change of
speed tells them apart, and on an arc what points ahead and what points aside as well.  How large
the swing has to be, how long and how far about hangs on what is asked: a few are legs of every
search, and `swing` makes one of any time for a drive that is cut to what is asked (`cutting`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise
from typing import Final, Literal

import numpy as np

from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import to_digits
from syncline_design.planning.legs import (
    Leg,
    LegTooLongError,
    course,
    ramps,
    speed_words,
    transition,
)
from syncline_design.planning.path import STEP_S, rounded
from syncline_design.planning.vehicle import ALONG, Vehicle

NAME: Final = "swing of speed"
QUICK_S: Final = 0.5  # rounding of commands of a vehicle that changes its speed quickly
SLOWEST_SHARE: Final = 0.02  # of v_max: slower, little is left that a swing could change
LEAST_SWING: Final = 1.1  # fast over slow
HALVINGS: Final = 10
FROM_FASTEST: Final = ("ease", "sag")
AT_REST: Final = 0.02  # of the fastest: slower than that nobody can keep to
HELD_S: Final = 0.5  # shorter, a speed is not held but passed
ALONE: Final = ("rise", "dip", "brake", "ease", "sag")  # of a drive of one leg: it joins to nothing


Way = Literal["down", "up", "both", "rise", "dip", "brake", "ease", "sag"]


@dataclass(frozen=True, slots=True)
class SwingShape:
    """What a swing looks like, whatever its length.

    bend: of the tightest arc that all its speeds allow, 0 a line; a circle at most.  hold: how long
    slow and fast are held each, over the time between them.  way: from the joining speed down only,
    up only, or both; or of a drive of its own, that joins to nothing: from the slowest speed a rise
    and back, a dip down to it, or braking to it; from the fastest speed easing, or a sag and back.
    """

    bend: float
    hold: float
    way: Way = "both"


HOLDS: Final[dict[Way, tuple[float, ...]]] = {
    "brake": (0.1, 0.5, 1.5, 4.0),
    "dip": (0.1, 0.5),
    "ease": (0.1, 0.5, 1.5),
    "sag": (0.1, 0.5),
    "rise": (0.1, 0.5),
    "down": (0.1, 0.5),
    "up": (4.0,),
}
SHAPES: Final = (
    *(SwingShape(1.0, hold, way) for way, holds in HOLDS.items() for hold in holds),
    SwingShape(0.0, 0.5, "brake"),
)
"""Those that were the shortest for some of 36 questions to eight vehicles, or within 1 % of it, of
57 with wider arcs, lines, both ways from the joining speed, and gaining speed (2026-11-29); and a
line to brake on."""
OF_EVERY_SEARCH: Final = (SwingShape(0.0, 0.25), SwingShape(1.0, 0.25), SwingShape(1.0, 1.0))
RAMP_S: Final = 5.0  # of these, from slow to fast, of a vehicle that changes speed quickly
WHOLE_DEG: Final = 360
STEP_DEG: Final = 5  # arcs are such that a driver can be told
QUARTER_DEG: Final = 90  # at multiples of which legs end that others follow


def swings(vehicle: Vehicle, stage: int) -> Iterator[Leg]:
    """The swings of every search that the vehicle can drive."""
    pace = max(vehicle.rounding_s / QUICK_S, 1.0)
    known = (swing(vehicle, stage, shape, RAMP_S * pace, QUARTER_DEG) for shape in OF_EVERY_SEARCH)
    yield from (one for one in known if one is not None)


def swing(
    vehicle: Vehicle, stage: int, shape: SwingShape, ramp_s: float, step_deg: int = STEP_DEG
) -> Leg | None:
    """A swing with so much time from slow to fast, on a whole number of steps of a circle; None
    where it is none at all, or where not one step fits."""
    run = _run(vehicle, shape, ramp_s)
    if not run.is_swing:
        return None
    try:
        ahead = ramps(vehicle, [*run.steps], run.begins_mps, run.ends_mps)
    except LegTooLongError:
        return None
    length = float(np.sum(ahead)) * STEP_S
    tight = _tightest(vehicle, run.speeds)
    arc_deg = step_deg * math.floor(math.degrees(shape.bend * length / tight) / step_deg)
    arc_deg = min(arc_deg, WHOLE_DEG)
    if shape.bend and not arc_deg:
        return None
    radius = length / math.radians(arc_deg) if arc_deg else math.inf
    begins_mps = None if run.joins else run.begins_mps
    before = transition(vehicle, 0.0, begins_mps).ahead  # without it rounding takes off its speed
    words = f"{_where(arc_deg, radius)}: {_words(run, rounded(vehicle, np.append(before, ahead)))}"
    return Leg(NAME, stage, words, course(ahead, turn=ahead / radius), begins_mps)


def swing_within(vehicle: Vehicle, stage: int, shape: SwingShape, most_s: float) -> Leg | None:
    """The longest swing of a shape that takes at most so long."""
    low, high, found = 0.0, max(most_s, 0.0), None
    for _ in range(HALVINGS):
        ramp_s = 0.5 * (low + high)
        one = swing(vehicle, stage, shape, ramp_s)
        if one is not None and one.duration_s <= most_s:
            found, low = one, ramp_s
        elif (
            one is None and _run(vehicle, shape, ramp_s).lasts_s(vehicle) <= most_s
        ):  # too small to be one
            low = ramp_s
        else:
            high = ramp_s
    return found


@dataclass(frozen=True, slots=True)
class _SpeedRun:
    """Speed over time: from one through (speed, held [s]) to another; joins: with other legs."""

    begins_mps: float
    steps: tuple[tuple[float, float], ...]
    ends_mps: float
    joins: bool = False

    @property
    def speeds(self) -> tuple[float, ...]:
        return (self.begins_mps, *(speed for speed, _ in self.steps), self.ends_mps)

    @property
    def is_swing(self) -> bool:
        """Whether that is a change of speed that shows."""
        return max(self.speeds) > LEAST_SWING * min(self.speeds)

    def lasts_s(self, vehicle: Vehicle) -> float:
        """As `ramps` has it, whether it can be driven or not."""
        changed = sum(abs(after - before) for before, after in pairwise(self.speeds))
        held_s = sum(hold_s for _, hold_s in self.steps)
        return changed / (ALONG * vehicle.acceleration_mps2) + held_s


def _run(vehicle: Vehicle, shape: SwingShape, ramp_s: float) -> _SpeedRun:
    """The speeds of a swing, as far apart as the time and the vehicle allow."""
    change, hold_s = ALONG * vehicle.acceleration_mps2 * ramp_s, shape.hold * ramp_s
    join, most = vehicle.join_mps, vehicle.fast_mps
    least = max(vehicle.slowest_mps, SLOWEST_SHARE * vehicle.v_max_mps)
    if shape.way in ALONE:
        slow, fast = vehicle.slowest_mps, min(vehicle.slowest_mps + change, most)
        if shape.way in FROM_FASTEST:
            slow, fast = max(most - change, slow), most
        return _alone(shape.way, (slow, hold_s), (fast, hold_s))
    match shape.way:
        case "up":
            return _SpeedRun(join, ((min(max(join, least) + change, most), hold_s),), join, True)
        case "down":
            return _SpeedRun(
                join, ((max(join - change, least), hold_s), (join, hold_s)), join, True
            )
        case _:
            slow = max(join - 0.5 * change, least)
            steps = ((slow, hold_s), (min(slow + change, most), hold_s))
            return _SpeedRun(join, steps, join, True)


def _alone(way: Way, slow: tuple[float, float], fast: tuple[float, float]) -> _SpeedRun:
    """A drive that joins to nothing begins and ends at the speeds that it swings between."""
    match way:
        case "rise":
            return _SpeedRun(slow[0], (fast,), slow[0])
        case "dip" | "sag":
            return _SpeedRun(fast[0], (slow,), fast[0])
        case _:
            return _SpeedRun(fast[0], (fast, slow), slow[0])


def _tightest(vehicle: Vehicle, speeds: tuple[float, ...]) -> float:
    """The smallest radius that all of some speeds allow [m]."""
    return max(one / vehicle.turn_radps(one) for one in speeds if one > 0.0)


def _where(arc_deg: int, radius: float) -> str:
    if not arc_deg:
        return "Straight ahead"
    return f"On an arc to the right of {to_digits(radius, 3)} m radius, {arc_deg} deg in all"


def _words(run: _SpeedRun, speed: Array) -> str:
    """How the speed changes; speed: as it is driven."""
    slow, fast = float(speed.min()), float(speed.max())
    begun, hold_s = run.begins_mps, run.steps[-1][1]
    held = f", held there for {to_digits(hold_s, 2)} s" if hold_s >= HELD_S else ""
    if run.ends_mps != begun:
        first = f" for {to_digits(hold_s, 2)} s, then" if held else ","
        return f"at {_pace(fast, fast)}{first} down to {_pace(slow, fast)}{held}"
    parts = [f"down to {_pace(slow, fast)}"] if slow < 0.99 * begun else []
    parts += [f"up to {_pace(fast, fast)}"] if fast > 1.01 * begun else []
    begins = "" if run.joins else f"from {_pace(begun, fast)} "
    return f"{begins}{', '.join(parts)}{held}, and back to {_pace(begun, fast)}"


def _pace(speed: float, fast: float) -> str:
    return speed_words(speed) if speed > AT_REST * fast else "rest"
