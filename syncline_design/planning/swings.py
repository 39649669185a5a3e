"""Swings of speed, slow and fast once, on a line or an arc: the shortest drives that tell a delay.

What a delay does grows with the speed, what a lever arm does turns with the vehicle: a change of
speed tells them apart, and on an arc what points ahead and what points aside as well.  How large
the swing has to be, how long and how far about hangs on what is asked: a few are legs of every
search, and `swing` makes one of any time for a drive that is cut to what is asked (`cutting`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final, Literal

import numpy as np

from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import to_digits
from syncline_design.planning.legs import Leg, LegTooLongError, course, ramps, speed_words
from syncline_design.planning.path import STEP_S, rounded
from syncline_design.planning.vehicle import Vehicle

NAME: Final = "swing of speed"
QUICK_S: Final = 0.5  # rounding of commands of a vehicle that changes its speed quickly
SLOWEST_SHARE: Final = 0.02  # of v_max: slower, little is left that a swing could change
LEAST_SWING: Final = 1.1  # fast over slow
ALONG: Final = 0.6  # of the acceleration, beside what turns take (`ramps`)
HALVINGS: Final = 14


@dataclass(frozen=True, slots=True)
class SwingShape:
    """What a swing looks like, whatever its length.

    bend: of the tightest arc that all its speeds allow, 0 a line; a circle at most.  hold: how long
    slow and fast are held each, over the time between them.  way: from the joining speed down only,
    up only, or both.
    """

    bend: float
    hold: float
    way: Literal["down", "up", "both"] = "both"


HOLDS: Final[dict[Literal["down", "up", "both"], tuple[float, ...]]] = {
    "both": (0.5, 0.1, 1.5), "down": (0.5, 0.1), "up": (0.5, 4.0),
}  # fmt: skip
SHAPES: Final = tuple(
    SwingShape(bend, hold, way)
    for bend in (1.0, 0.5, 0.0)
    for way, holds in HOLDS.items()
    for hold in holds
)
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
    slow, fast = _speeds(vehicle, shape, ramp_s)
    if not _swings(slow, fast):
        return None
    hold_s = shape.hold * ramp_s
    try:
        steps = [(fast, hold_s)] if shape.way == "up" else [(slow, hold_s), (fast, hold_s)]
        ahead = ramps(vehicle, steps, vehicle.join_mps)
    except LegTooLongError:
        return None
    tight = _tightest(vehicle, (slow, fast, vehicle.join_mps))
    length = float(np.sum(ahead)) * STEP_S
    arc_deg = step_deg * math.floor(math.degrees(shape.bend * length / tight) / step_deg)
    arc_deg = min(arc_deg, WHOLE_DEG)
    if shape.bend and not arc_deg:
        return None
    radius = length / math.radians(arc_deg) if arc_deg else math.inf
    words = f"{_where(arc_deg, radius)}: {_words(vehicle, hold_s, rounded(vehicle, ahead))}"
    return Leg(NAME, stage, words, course(ahead, turn=ahead / radius))


def swing_within(vehicle: Vehicle, stage: int, shape: SwingShape, most_s: float) -> Leg | None:
    """The longest swing of a shape that takes at most so long."""
    low, high, found = 0.0, most_s, None
    for _ in range(HALVINGS):
        ramp_s = 0.5 * (low + high)
        one = swing(vehicle, stage, shape, ramp_s)
        if one is not None and one.duration_s <= most_s:
            found, low = one, ramp_s
        elif one is None and _lasts_s(vehicle, shape, ramp_s) <= most_s:  # too small to be one
            low = ramp_s
        else:
            high = ramp_s
    return found


def _speeds(vehicle: Vehicle, shape: SwingShape, ramp_s: float) -> tuple[float, float]:
    """Slow and fast: as far apart as the time and the vehicle allow."""
    change = ALONG * vehicle.acceleration_mps2 * ramp_s
    least = max(vehicle.slowest_mps, SLOWEST_SHARE * vehicle.v_max_mps)
    join, most = vehicle.join_mps, vehicle.fast_mps
    match shape.way:
        case "up":
            slow = max(join, least)
        case "down":
            slow, most = max(join - change, least), join
        case _:
            slow = max(join - 0.5 * change, least)
    return slow, min(slow + change, most)


def _lasts_s(vehicle: Vehicle, shape: SwingShape, ramp_s: float) -> float:
    """Time of a swing, whether it can be driven or not, as `ramps` has it."""
    slow, fast = _speeds(vehicle, shape, ramp_s)
    join, slope = vehicle.join_mps, ALONG * vehicle.acceleration_mps2
    if shape.way == "up":
        return 2.0 * abs(fast - join) / slope + shape.hold * ramp_s
    changed = abs(join - slow) + abs(fast - slow) + abs(fast - join)
    return changed / slope + 2.0 * shape.hold * ramp_s


def _swings(slow_mps: float, fast_mps: float) -> bool:
    """Whether that is a change of speed that shows."""
    return fast_mps > LEAST_SWING * slow_mps


def _tightest(vehicle: Vehicle, speeds: tuple[float, ...]) -> float:
    """The smallest radius that all of some speeds allow [m]."""
    return max(one / vehicle.turn_radps(one) for one in speeds if one > 0.0)


def _where(arc_deg: int, radius: float) -> str:
    if not arc_deg:
        return "Straight ahead"
    return f"On an arc to the right of {to_digits(radius, 3)} m radius, {arc_deg} deg in all"


def _words(vehicle: Vehicle, hold_s: float, speed: Array) -> str:
    """How the speed changes; speed: as it is driven."""
    slow, fast, begun = float(speed.min()), float(speed.max()), vehicle.join_mps
    back = speed_words(begun) if begun else "rest"
    parts = [f"down to {speed_words(slow)}"] if slow < 0.99 * begun else []
    parts += [f"up to {speed_words(fast)}"] if fast > 1.01 * begun else []
    held = f", held there for {to_digits(hold_s, 2)} s" if hold_s >= 0.5 else ""
    return f"{', '.join(parts)}{held}, and back to {back}"
