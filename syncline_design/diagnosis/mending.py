"""A gross fault undone: columns as the package's conventions have them, rows paired anew."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from syncline_design.effects.acting import Acting
from syncline_design.logs.derivatives import derived_velocity
from syncline_design.logs.log import GAP_FACTOR, Log, LogTrack
from syncline_design.logs.merging import hermite
from syncline_design.logs.stamps import per_stamp

LEAST_LEFT = 10  # rows

Reread = Callable[[float], Log]


def undone(log: Log, one: Acting) -> Log:
    """The log with a sensor's columns brought back to the package's conventions."""
    undoing = one.effect.undoing
    assert undoing is not None
    assert undoing.mend is not None
    old, convention = log.stages[one.stage], str(value_of(one))
    if one.sensor == "position":
        if old.antenna_m is None:  # a later stage's place is the stage before's reading
            return log
        new = replace(old, antenna_m=undoing.mend(old.antenna_m, one.sensor, convention))
    elif one.sensor == "attitude":
        new = replace(old, euler_rad=undoing.mend(old.euler_rad, one.sensor, convention))
    else:
        assert old.azimuth_rad is not None
        assert old.elevation_rad is not None
        held = np.stack([old.azimuth_rad, old.elevation_rad], axis=-1)
        azimuth, elevation = undoing.mend(held, one.sensor, convention).T
        new = replace(old, azimuth_rad=azimuth, elevation_rad=elevation)
    stages = tuple(new if k == one.stage else s for k, s in enumerate(log.stages))
    return replace(log, stages=stages)


def value_of(one: Acting) -> str | float:
    """The value of a discrete effect's one parameter."""
    return one.values[one.effect.parameters[0].name]


def unslipped(log: Log, seconds: float) -> Log:
    """The log with every position paired with the rows it belongs to.

    stamp = true + seconds, so the position that was true at t carries the stamp t + seconds.  Rows
    whose position lies beyond the log or in a gap are left out; where that is nearly all of them
    (windows of a very long log shorter than the slip), the log stays as it is.
    """
    first = log.stages[0]
    assert first.antenna_m is not None
    times, antenna = per_stamp(log.time_s, first.antenna_m)
    wanted = log.time_s + seconds
    right = np.clip(np.searchsorted(times, wanted), 1, times.shape[0] - 1)
    step = times[right] - times[right - 1]
    inside = (wanted >= times[0]) & (wanted <= times[-1]) & (step <= GAP_FACTOR * log.interval_s)
    if np.count_nonzero(inside) < LEAST_LEFT:
        return log
    track = first.velocity_track or LogTrack(*per_stamp(log.time_s, first.velocity_mps))
    moved = [
        hermite(
            times,
            antenna[:, k],
            np.interp(times - seconds, track.time_s, track.value[:, k]),
            wanted,
            right,
        )
        for k in range(3)
    ]
    stages = (replace(first, antenna_m=np.stack(moved, axis=1)), *log.stages[1:])
    return replace(log, stages=stages).rows(inside)


def mended(log: Log, one: Acting, reread: Reread | None = None) -> Log:
    """The log with a listed gross fault undone."""
    if not restamps(one):
        return undone(log, one)
    return restamped(log, float(value_of(one)), reread)


def restamped(log: Log, seconds: float, reread: Reread | None = None) -> Log:
    """The log with its positions' stamps set back, by pairing rows anew or reading anew."""
    return unslipped(log, seconds) if reread is None else reread(seconds)


def restamps(one: Acting) -> bool:
    """Whether it is undone by pairing rows anew, not by mending columns."""
    return one.effect.undoing is not None and one.effect.undoing.mend is None


def without_rows(log: Log, out: NDArray[np.bool_]) -> Log:
    """The log without some rows: velocities that are slopes of its places are those of what is
    left."""
    left = log.rows(np.flatnonzero(~out))
    stages = tuple(
        replace(s, velocity_mps=derived_velocity(left.time_s, s.antenna_m))
        if s.follows_position and s.antenna_m is not None and s.velocity_track is None
        else s
        for s in left.stages
    )
    return replace(left, stages=stages)
