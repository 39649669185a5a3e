"""The legs that a drive can be made of: what the vehicle does, in commands and in words.

Every leg begins and ends straight ahead at the vehicle's joining speed, so that any can follow any.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from itertools import pairwise

import numpy as np

from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import to_digits, to_places
from syncline_design.planning.path import STEP_S, CourseCommands, rounded
from syncline_design.planning.vehicle import ALONG, GRAVITY_MPS2, Vehicle

LINE_S = 20.0
SHORT_S = 4.0
SWEEP_S = 12.0
SWING_S = 3.5  # from slow to fast on a circle, at most
FULL_RAD = 2.0 * math.pi
QUARTER_RAD = 0.5 * math.pi
MOST_LEG_S = 300.0


@dataclass(frozen=True, slots=True)
class Leg:
    """One leg of one stage's vehicle; words: what to do, for who drives.

    begins_mps: where it begins at another speed than the joining one, so that it follows none.
    """

    name: str
    stage: int
    words: str
    course: CourseCommands
    begins_mps: float | None = None

    @property
    def duration_s(self) -> float:
        return self.course.duration_s


class LegTooLongError(Exception):
    """A leg that takes longer than any is driven."""


def ramps(
    vehicle: Vehicle,
    steps: list[tuple[float, float]],
    begins_mps: float,
    ends_mps: float | None = None,
) -> Array:
    """Speed over time: from one speed through (speed, hold [s]) and back to it, or to another.

    Raises LegTooLongError before anything of that length is made.
    """
    slope = ALONG * vehicle.acceleration_mps2
    at, parts = begins_mps, []
    every = [*steps, (begins_mps if ends_mps is None else ends_mps, 0.0)]
    speeds = [begins_mps, *(speed for speed, _ in every)]
    lasts_s = sum(abs(b - a) / slope for a, b in pairwise(speeds)) + sum(s for _, s in every)
    if not lasts_s <= MOST_LEG_S:
        raise LegTooLongError
    for speed, hold_s in every:
        count = max(math.ceil(abs(speed - at) / slope / STEP_S), 1)
        parts.append(at + (speed - at) * np.arange(1, count + 1) / count)
        parts.append(np.full(round(hold_s / STEP_S), speed))
        at = speed
    return np.concatenate(parts)


def course(ahead: Array, right: Array | None = None, down: Array | None = None,
            turn: Array | None = None) -> CourseCommands:  # fmt: skip
    zero = np.zeros_like(ahead)
    return CourseCommands(ahead, *(zero if v is None else v for v in (right, down, turn)))


def turning(vehicle: Vehicle, speed: float, angles: list[float]) -> CourseCommands:
    """Turns by some angles [rad] one after the other, at one speed held from ramp to ramp."""
    rate = vehicle.turn_radps(speed)
    counts = [max(round(abs(a) / rate / STEP_S), 1) for a in angles]
    ahead = ramps(vehicle, [(speed, STEP_S * sum(counts) + _room_s(vehicle))], vehicle.join_mps)
    turn = np.zeros_like(ahead)
    at = (len(ahead) - sum(counts)) // 2
    for angle, count in zip(angles, counts, strict=True):
        turn[at : at + count] = angle / (count * STEP_S)
        at += count
    return course(ahead, turn=turn)


def _room_s(vehicle: Vehicle) -> float:
    """Time straight on beside turns, so that rounding does not carry them into changes of speed."""
    return max(2.0, 4.0 * vehicle.rounding_s)


def transition(
    vehicle: Vehicle, angle_rad: float, speed_mps: float | None = None
) -> CourseCommands:
    """The turn between two legs, at the joining speed or the one at which the next begins."""
    speed = vehicle.join_mps if speed_mps is None else speed_mps
    rate = vehicle.turn_radps(speed) if speed > 0.0 else vehicle.turn_radps(0.0)
    count = max(round(abs(angle_rad) / rate / STEP_S), 1) if angle_rad else 0
    rest = round(2.0 * vehicle.rounding_s / STEP_S)
    turn = np.concatenate([np.zeros(rest), np.full(count, angle_rad / max(count * STEP_S, STEP_S)),
                           np.zeros(rest)])  # fmt: skip
    return course(np.full(turn.shape, speed), turn=turn)


def _wave(duration_s: float, cycles: int) -> Array:
    """A sine that fades in and out over its first and last cycle."""
    time_s = STEP_S * np.arange(round(duration_s / STEP_S))
    edge = duration_s / cycles
    fade = np.clip(np.minimum(time_s, duration_s - time_s) / edge, 0.0, 1.0)
    return np.asarray(fade * np.sin(FULL_RAD * cycles * time_s / duration_s))


def speed_words(speed: float) -> str:
    return f"{to_digits(speed, 3)} m/s"


def _straight(v: Vehicle) -> tuple[str, CourseCommands]:
    ahead = ramps(v, [(v.fast_mps, LINE_S)], v.join_mps)
    words = f"straight ahead at {speed_words(v.fast_mps)} for {to_places(LINE_S, 0)} s"
    return words, course(ahead)


def _slow(v: Vehicle) -> tuple[str, CourseCommands]:
    speed = max(v.slowest_mps, 0.3 * v.v_max_mps)
    ahead = ramps(v, [(speed, LINE_S)], v.join_mps)
    return f"straight ahead at {speed_words(speed)} for {to_places(LINE_S, 0)} s", course(ahead)


def _reciprocal(v: Vehicle) -> tuple[str, CourseCommands]:
    line = ramps(v, [(v.fast_mps, LINE_S / 2)], v.join_mps)
    turn = transition(v, math.pi)
    ahead = np.concatenate([line, turn.ahead, line])
    zero = np.zeros_like(line)
    words = f"a line at {speed_words(v.fast_mps)}, turn about, the same line back"
    return words, course(ahead, turn=np.concatenate([zero, turn.turn, zero]))


def _stop_and_go(v: Vehicle) -> tuple[str, CourseCommands] | None:
    least = v.slowest_mps
    reach = min(v.fast_mps, least + ALONG * v.acceleration_mps2 * 5.0)
    if reach <= least * 1.1:
        return None
    ahead = ramps(v, [(reach, 1.0), (least, 1.0)] * 3, v.join_mps)
    slow = "a stop" if least == 0.0 else speed_words(least)
    words = f"three times from {slow} up to {speed_words(reach)} and back, straight ahead"
    return words, course(ahead)


def _slow_and_fast(v: Vehicle) -> tuple[str, CourseCommands] | None:
    low = max(v.slowest_mps, 0.25 * v.v_max_mps)
    if low > 0.9 * v.fast_mps:
        return None
    line = [ramps(v, [(s, LINE_S / 2)], v.join_mps) for s in (low, v.fast_mps)]
    turn = transition(v, math.pi)
    zeros = [np.zeros_like(one) for one in line]
    ahead = np.concatenate([line[0], turn.ahead, line[1]])
    words = f"a line at {speed_words(low)}, turn about, the same line at {speed_words(v.fast_mps)}"
    return words, course(ahead, turn=np.concatenate([zeros[0], turn.turn, zeros[1]]))


def _speeds(v: Vehicle, hold_s: float) -> tuple[str, CourseCommands] | None:
    """Two speeds on one line: the shortest that a delay and a lever arm do not share."""
    low = max(v.slowest_mps, 0.25 * v.v_max_mps)
    if low > 0.9 * v.fast_mps:
        return None
    words = (
        f"one line, {to_places(hold_s, 0)} s at {speed_words(low)} and {to_places(hold_s, 0)} s "
        f"at {speed_words(v.fast_mps)}"
    )
    return words, course(ramps(v, [(low, hold_s), (v.fast_mps, hold_s)], v.join_mps))


def _circle(v: Vehicle, sign: float) -> tuple[str, CourseCommands]:
    speed = _turning_speed(v)
    side = "right" if sign > 0 else "left"
    words = f"a full circle to the {side} at {speed_words(speed)}"
    return words, turning(v, speed, [sign * FULL_RAD])


def _swinging_circle(v: Vehicle) -> tuple[str, CourseCommands] | None:
    """Three times slow and fast on one circle: speed and direction change at once, so that a short
    drive parts delays from lever arms.  It ends at a quarter of a turn.

    Along ALONG = 0.6 of the acceleration, across ACROSS = 0.8 of it, which are all of it together.
    """
    low = max(v.slowest_mps, 0.02 * v.v_max_mps)
    high = max(min(v.fast_mps, low + ALONG * v.acceleration_mps2 * SWING_S), v.join_mps)
    if high <= 1.1 * low:
        return None
    ahead = ramps(v, [(high, 0.5), (low, 0.5)] * 3, v.join_mps)
    tightest = high / v.turn_radps(high)
    length = float(np.sum(np.abs(ahead))) * STEP_S
    quarters = min(math.floor(length / tightest / QUARTER_RAD), 4)
    if quarters < 1:
        return None
    radius = length / (quarters * QUARTER_RAD)
    slow, fast = _between_peaks(rounded(v, ahead))
    words = (
        f"on a circle to the right of {to_digits(radius, 2)} m radius, three times up to "
        f"{speed_words(fast)}, down to {speed_words(slow)} in between, {90 * quarters} deg in all"
    )
    return words, course(ahead, turn=ahead / radius)


def _between_peaks(speed: Array) -> tuple[float, float]:
    """The slowest and the fastest of three swings, without what leads up to them and away."""
    peaks = np.flatnonzero((speed[1:-1] > speed[:-2]) & (speed[1:-1] >= speed[2:])) + 1
    inside = speed[peaks[0] : peaks[-1] + 1]
    return float(inside.min()), float(inside.max())


def _turning_speed(v: Vehicle) -> float:
    """A speed at which the vehicle turns well: where acceleration and omega_max both bind."""
    best = 0.8 * v.acceleration_mps2 / (TURNS_WELL * v.omega_max_radps)
    low = max(v.slowest_mps, 0.3 * v.v_max_mps)
    return float(np.clip(best, low, v.fast_mps))


TURNS_WELL = 0.5
LEAST_SLALOM_DEG = 2.0  # swings of the heading below it are a straight line to a driver


def _eight(v: Vehicle) -> tuple[str, CourseCommands]:
    speed = _turning_speed(v)
    words = f"a figure eight at {speed_words(speed)}, first to the right"
    return words, turning(v, speed, [FULL_RAD, -FULL_RAD])


def _reverse(v: Vehicle) -> tuple[str, CourseCommands] | None:
    if not v.usual.reverses or v.slowest_mps > 0.0:
        return None
    speed = min(0.4 * v.v_max_mps, ALONG * v.acceleration_mps2 * 4.0)
    ahead = ramps(v, [(speed, 2.0), (-speed, 2.0)] * 2, v.join_mps)
    return f"twice ahead and back astern at {speed_words(speed)}, the heading kept", course(ahead)


def _spin(v: Vehicle) -> tuple[str, CourseCommands] | None:
    if not v.hovers:
        return None
    return "hover and turn once to the right, once to the left", turning(
        v, 0.0, [FULL_RAD, -FULL_RAD]
    )


def _sway(v: Vehicle, sideways: bool) -> tuple[str, CourseCommands] | None:
    """Roll or pitch of a multirotor: to and fro, leaning by what its acceleration takes."""
    if not v.hovers:
        return None
    cycles, lean = 6, min(v.tilt_rad, math.atan(0.8 * v.acceleration_mps2 / GRAVITY_MPS2))
    omega = FULL_RAD * cycles / SWEEP_S
    speed = min(GRAVITY_MPS2 * math.tan(lean) / omega, 0.4 * v.v_max_mps)
    swing = speed * _wave(SWEEP_S, cycles)
    rounded = speed * math.exp(-0.5 * (omega * v.rounding_s) ** 2)  # a Gaussian's of a sine
    leans = math.degrees(math.atan(rounded * omega / GRAVITY_MPS2))
    zero = np.zeros_like(swing)
    axis, name = ("roll", "sideways") if sideways else ("pitch", "to and fro")
    words = f"{axis} sweeps: sway {name} every {to_places(SWEEP_S / cycles, 0)} s, leaning to " \
            f"{to_digits(leans, 2)} deg"  # fmt: skip
    return words, course(zero, right=swing) if sideways else course(swing)


def _rock(v: Vehicle) -> tuple[str, CourseCommands] | None:
    """Turns to and fro: an aeroplane rolls, others yaw, by enough for a driver to see it."""
    speed = v.join_mps if v.motion == "fixed_wing" else _turning_speed(v)
    rate, cycles = v.turn_radps(speed), 4
    period = max(3.0, 4.0 * v.rounding_s, SWEEP_S / cycles)
    swing = rate * _wave(period * cycles, cycles)
    ahead = ramps(v, [(speed, period * cycles + _room_s(v))], v.join_mps)
    turn = np.zeros_like(ahead)
    at = (len(ahead) - len(swing)) // 2
    turn[at : at + len(swing)] = swing
    each = f"{cycles} times, {to_places(period, 0)} s each"
    if v.motion == "fixed_wing":
        return (
            f"roll sweeps: rock the wings at {speed_words(speed)} to either side, {each}",
            course(ahead, turn=turn),
        )
    heading = math.degrees(float(np.ptp(np.cumsum(rounded(v, turn)) * STEP_S)))
    if heading < LEAST_SLALOM_DEG:
        return None
    words = (
        f"a slalom at {speed_words(speed)}: the heading swings through {to_digits(heading, 2)} "
        f"deg, first to the right, {each}"
    )
    return words, course(ahead, turn=turn)


def _heights(v: Vehicle) -> tuple[str, CourseCommands] | None:
    if not v.usual.climbs:
        return None
    rate = min(0.15 * v.v_max_mps, ALONG * v.acceleration_mps2 * 2.0, 0.04 * v.distance_m)
    ahead = ramps(v, [(max(v.join_mps, 0.3 * v.fast_mps), LINE_S)], v.join_mps)
    down = rate * _wave(len(ahead) * STEP_S, 2)[: len(ahead)]
    down = np.pad(down, (0, len(ahead) - len(down)))
    step = rate * len(ahead) * STEP_S / 2 / math.pi
    return f"height steps: {to_digits(step, 2)} m down and up again, twice, flying on", course(
        ahead, down=down
    )


Maker = Callable[[Vehicle], "tuple[str, CourseCommands] | None"]
MAKERS: dict[str, Maker] = {
    "straight line": _straight,
    "slow line": _slow,
    "reciprocal lines": _reciprocal,
    "slow and fast": _slow_and_fast,
    "two speeds": lambda v: _speeds(v, LINE_S / 2),
    "two speeds, short": lambda v: _speeds(v, SHORT_S),
    "stop and go": _stop_and_go,
    "right circle": lambda v: _circle(v, 1.0),
    "left circle": lambda v: _circle(v, -1.0),
    "figure eight": _eight,
    "slow and fast circle": _swinging_circle,
    "ahead and astern": _reverse,
    "hover and spin": _spin,
    "roll sweeps": lambda v: _sway(v, True),
    "pitch sweeps": lambda v: _sway(v, False),
    "slalom": _rock,
    "height steps": _heights,
}


def usual_legs(vehicle: Vehicle, stage: int) -> tuple[Leg, ...]:
    """The legs of the field, and of flight tests, that the vehicle can do in a time worth it."""
    return tuple(_made(vehicle, stage))


def _made(vehicle: Vehicle, stage: int) -> Iterator[Leg]:
    for name, make in MAKERS.items():
        try:
            made = make(vehicle)
        except LegTooLongError:
            continue
        if made is None:
            continue
        words, course = made
        if course.duration_s <= MOST_LEG_S:
            yield Leg(name, stage, words[0].upper() + words[1:], course)
