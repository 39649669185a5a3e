"""A whole log as others write theirs: east, north, up instead of north, east, down.

The robots' world (ROS REP 103) counts yaw from east to north; its bodies are either forward, right,
down as here or forward, left, up, in which pitch and the turn rates about two axes have the other
sign, and bearings of a sensor in these axes go to the left.  Column by column such a log looks like
a mirrored world just as well, with roll, pitch or azimuth turned round; undone so it would stay one
(places turned by a quarter, north and east exchanged).  All of it at once is what a person writes.
Source: ROS REP 103, Standard Units of Measure and Coordinate Conventions (2010).
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Final

import numpy as np

from syncline_design.diagnosis.convention import (
    Convention,
    Parts,
    angles_mended,
    everything_turned,
    first_changed,
    polar_mended,
    rates_turned,
    scaled,
    size_of,
    turned,
    vector_of,
)
from syncline_design.effects.kinematics import euler_to_rotation, rotate
from syncline_design.effects.record import Array
from syncline_design.logs.log import Log
from syncline_design.logs.stream_values import ENU_TO_NED, FLU_TO_FRD
from syncline_design.machine.quick_dataclass import dataclass

FROM_EAST: Final = np.array([0.0, 0.0, np.pi / 2.0])  # of roll, pitch and yaw [rad]
FLU_ANGLES: Final = np.array([1.0, -1.0, -1.0])


@dataclass(frozen=True, slots=True)
class _Way:
    """A way of writing a log: what its body's axes and bearings are beside the world.

    angles (3,): signs of roll, pitch, yaw; body (3, 3): its axes to forward, right, down; bearing
    (3,): signs of range, azimuth, elevation; work: for ties, see `Convention`.
    """

    words: str
    sentence: str
    angles: Array
    body: Array
    bearing: Array
    work: int


_SENTENCE: Final = "All of the log is in east, north, up, with yaw from east to north"
WAYS: Final = (
    _Way("yaw from east", "", np.array([1.0, 1.0, -1.0]), np.eye(3), np.ones(3), 3),
    _Way("forward-left-up", " and axes of the body forward, left, up",
         FLU_ANGLES, FLU_TO_FRD, np.ones(3), 4),
    _Way("forward-left-up, azimuth to the left",
         " and axes of the body forward, left, up, to the left of which azimuth grows",
         FLU_ANGLES, FLU_TO_FRD, np.array([1.0, -1.0, 1.0]), 5),
)  # fmt: skip


def logs_from_elsewhere(parts: Parts) -> Iterator[Convention]:
    """Each such way of writing a log, as one convention of its positions."""
    antenna, target = parts.antenna @ ENU_TO_NED.T, turned(parts.target, ENU_TO_NED)
    for way in WAYS:
        if parts.polar is None and np.any(way.bearing < 0.0):
            continue
        polar = None if parts.polar is None else parts.polar * way.bearing
        rotation = euler_to_rotation(scaled(parts.euler, way.angles, FROM_EAST))
        vector = vector_of(parts.arms, polar, len(parts.euler))
        size = size_of(antenna + rotate(rotation, vector) - target)
        yield Convention(
            "position", f"east-north-up in all, {way.words}", partial(_mended, way=way),
            way.work, size, sentence=_SENTENCE + way.sentence,
        )  # fmt: skip


def _mended(log: Log, way: _Way) -> Log:
    log = everything_turned(ENU_TO_NED)(log)
    log = angles_mended(partial(scaled, scale=way.angles, turn=FROM_EAST))(log)
    if log.stages[0].range_m is not None:
        log = polar_mended(lambda polar: polar * way.bearing)(log)
    return first_changed(log, lambda held: rates_turned(held, way.body))
