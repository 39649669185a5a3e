"""Readings of a device that may be late alone: a heading, a height; what their delay does, and
how it is undone."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from syncline_design.diagnosis.candidates import Candidate, signature
from syncline_design.diagnosis.frozen_channels import euler_rates
from syncline_design.diagnosis.looked_up import Mask, vector_of
from syncline_design.diagnosis.scene import Scene
from syncline_design.effects import plain_delay
from syncline_design.effects.kinematics import euler_to_rotation, rotate
from syncline_design.effects.record import ActsOn, Array
from syncline_design.logs.log import GAP_FACTOR, Log
from syncline_design.logs.stamps import per_stamp, usual_step_s
from syncline_design.machine.quick_dataclass import dataclass

STEP_RAD: Final = 1e-5  # by which an angle is moved for a slope


@dataclass(frozen=True, slots=True)
class ReadingPart:
    """Readings of a device by their place in its row, and their name; of all of them none."""

    sensor: ActsOn
    readings: tuple[int, ...]
    name: str = ""

    @property
    def columns(self) -> tuple[int, ...]:
        """Their places among those of `readings_late`."""
        first = 0 if self.sensor == "attitude" else 3
        return tuple(first + k for k in self.readings)


PARTS: Final = (
    ReadingPart("attitude", (2,), "yaw"),
    ReadingPart("attitude", (0, 1), "roll and pitch"),
    ReadingPart("attitude", (0,), "roll"),
    ReadingPart("attitude", (1,), "pitch"),
    ReadingPart("position", (2,), "height"),
    ReadingPart("position", (0, 1), "north and east"),
)
WHOLES: Final = (ReadingPart("attitude", (0, 1, 2)), ReadingPart("position", (0, 1, 2)))


def readings_late(view: Scene) -> Array:
    """What a second of delay of roll, pitch, yaw, and of places north, east and down, each alone,
    does to the error (n, 3, 6) [m/s]."""
    delay = Candidate(plain_delay(), "position", 0)
    moved = np.nan_to_num(signature(view, delay, {}))[:, :, 0]
    places = moved[:, :, None] * np.eye(3)
    return np.concatenate([_swept(view), places], axis=2)


def _swept(view: Scene) -> Array:
    """Of roll, pitch and yaw (n, 3, 3)."""
    logged = view.log.stages[0]
    vector, plain = vector_of(view), euler_to_rotation(logged.euler_rad)
    rates = euler_rates(logged)
    columns = []
    for k in range(3):
        moved = euler_to_rotation(logged.euler_rad + STEP_RAD * np.eye(3)[k])
        columns.append(-rates[:, [k]] * rotate(moved - plain, vector) / STEP_RAD)
    return np.stack(columns, axis=2)


def put_back(log: Log, part: ReadingPart, delay_s: float) -> tuple[Log, Mask]:
    """The log with readings as they were at its stamps, and the rows of which these are known."""
    from scipy.interpolate import CubicSpline

    first = log.stages[0]
    readings = first.euler_rad if part.sensor == "attitude" else first.antenna_m
    assert readings is not None
    times, told = per_stamp(log.time_s, readings)
    wanted = log.time_s + delay_s
    right = np.clip(np.searchsorted(times, wanted), 1, len(times) - 1)
    near = times[right] - times[right - 1] <= GAP_FACTOR * usual_step_s(log.time_s)
    found = near & (wanted >= times[0]) & (wanted <= times[-1])
    told = np.unwrap(told, axis=0) if part.sensor == "attitude" else told
    courses = CubicSpline(times, told)(wanted)
    back = readings.copy()
    for k in part.readings:
        back[found, k] = courses[found, k]
    own = (replace(first, euler_rad=back) if part.sensor == "attitude"
           else replace(first, antenna_m=back))  # fmt: skip
    return replace(log, stages=(own, *log.stages[1:])), found
