"""Gross faults first: frames, units, signs, whole-second slips.

They are discrete, so each is tried on the whole log by re-simulation; it is taken when the usual
size of the error falls to a third or less and was far from noise before.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from syncline_design.diagnosis.scene import Acting, Scene, acting, scene
from syncline_design.effects import registry
from syncline_design.effects.frame_convention import conventions
from syncline_design.effects.record import Array, Target
from syncline_design.logs.log import GAP_FACTOR, Log, StageLog, Track
from syncline_design.logs.merging import hermite
from syncline_design.logs.stamps import per_stamp
from syncline_design.model.system import System
from syncline_design.simulation.chain import euler_to_rotation, rotation_to_euler

FALLS_TO = 1.0 / 3.0
FAR_FROM_NOISE = 4.0  # times the expected size
MOST = 3  # gross faults at once
ROWS = 3000
LEAST_LEFT = 10  # rows
WHOLE_S = 0.002  # a latency this near to whole seconds is a slip between time scales
SHORT_SLIP = 2  # a slip this short may be a latency of no whole number of seconds
NEARLY_NOISE = 1.05  # times the expected size: what is left after a short slip has to be so little
SECONDS = tuple(k for k in range(-18, 19) if k)
DEGREE = np.pi / 180.0


Reread = Callable[[float], Log]


@dataclass(frozen=True, slots=True)
class Gross:
    """A gross fault found: the acting effect, and the log with it undone where it is a column's."""

    acting: Acting
    falls_by: float  # usual size of the error before over after


def undone(log: Log, sensor: Target, stage: int, convention: str) -> Log:
    """The log with a sensor's columns brought back to the package's conventions."""
    old = log.stages[stage]
    if sensor == "position" and old.antenna_m is not None:
        new = replace(old, antenna_m=_position(old.antenna_m, convention))
    elif sensor == "attitude":
        new = replace(old, euler_rad=_attitude(old.euler_rad, convention))
    else:
        new = _ranging(old, convention)
    stages = tuple(new if k == stage else s for k, s in enumerate(log.stages))
    return replace(log, stages=stages)


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
    track = first.velocity_track or Track(*per_stamp(log.time_s, first.velocity_mps))
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
    """The log with one gross fault undone."""
    if one.effect.name == "integer_second_slip":
        seconds = float(one.values["seconds"])
        return unslipped(log, seconds) if reread is None else reread(seconds)
    return undone(log, one.sensor, one.stage, str(one.values["convention"]))


def _position(antenna: Array, convention: str) -> Array:
    flipped: Array = antenna * np.array([1.0, 1.0, -1.0])
    return flipped[:, [1, 0, 2]] if convention == "enu" else flipped


def _attitude(euler: Array, convention: str) -> Array:
    roll, pitch, yaw = euler.T
    if convention == "transposed":
        return rotation_to_euler(np.swapaxes(euler_to_rotation(euler), 1, 2))
    columns = {
        "yaw_sign": (roll, pitch, -yaw),
        "yaw_180": (roll, pitch, yaw - np.pi),
        "enu": (roll, -pitch, 0.5 * np.pi - yaw),
        "radians": (roll / DEGREE, pitch / DEGREE, yaw / DEGREE),
        "degrees": (roll * DEGREE, pitch * DEGREE, yaw * DEGREE),
    }[convention]
    wrapped: Array = np.stack(columns, axis=-1)
    return wrapped


def _ranging(stage: StageLog, convention: str) -> StageLog:
    azimuth, elevation = stage.azimuth_rad, stage.elevation_rad
    assert azimuth is not None
    assert elevation is not None
    if convention == "azimuth_sign":
        return replace(stage, azimuth_rad=-azimuth)
    if convention == "elevation_sign":
        return replace(stage, elevation_rad=-elevation)
    factor = 1.0 / DEGREE if convention == "radians" else DEGREE
    return replace(stage, azimuth_rad=azimuth * factor, elevation_rad=elevation * factor)


def gross_faults(
    system: System,
    log: Log,
    known: Sequence[Acting],
    expected_m: float,
    exclude: Sequence[str] = (),
    reread: Reread | None = None,
) -> tuple[tuple[Gross, ...], Log]:
    """Gross faults of a log, and the log with them undone.

    expected_m: usual length of the error vector that the spec's noise makes.  reread: gives the
    log anew with the positions' stamps set back by so many seconds; None where one file holds it.
    """
    found: list[Gross] = []
    while len(found) < MOST:
        thin = log.rows(slice(None, None, max(1, len(log) // ROWS)))
        base = scene(system, thin, known)
        size = usual_size(base.error())
        if not size > FAR_FROM_NOISE * expected_m:
            break
        taken = [g.acting.label for g in found]
        trials = _trials(system, log, base, taken, exclude)
        sizes = [(usual_size(trial()), k, one) for k, (one, trial) in enumerate(trials)]
        best, _, one = min(sizes, key=lambda entry: entry[:2], default=(size, 0, None))
        if one is None or not best < FALLS_TO * size:
            break
        if _is_short_slip(one) and not best < NEARLY_NOISE * expected_m:
            break
        found.append(Gross(one, size / max(best, 1e-300)))
        log = mended(log, one, reread)
    return tuple(found), log


def _is_short_slip(one: Acting) -> bool:
    return (
        one.effect.name == "integer_second_slip" and abs(float(one.values["seconds"])) <= SHORT_SLIP
    )


def whole_seconds(latency_s: float, uncertainty_s: float) -> Acting | None:
    """The slip that a position latency of whole seconds is: two time scales, in practice."""
    seconds = float(round(latency_s))
    near = abs(latency_s - seconds) < max(3.0 * uncertainty_s, WHOLE_S)
    if not seconds or not near:
        return None
    return acting("integer_second_slip", "position", 0, {"seconds": seconds})


Trials = list[tuple[Acting, Callable[[], Array]]]


def _trials(
    system: System,
    log: Log,
    base: Scene,
    taken: Sequence[tuple[str, str, int]],
    exclude: Sequence[str],
) -> Trials:
    """Every gross fault with a function that re-simulates the log under it."""
    trials: Trials = []
    for k, stage in enumerate(system.stages):
        sensors = (
            ("position",) if log.kind == "position" else registry()["frame_convention"].sensors
        )
        for sensor in sensors:
            if getattr(stage, sensor) is None:
                continue
            for convention in conventions(sensor):
                values: dict[str, float] = {"convention": convention}  # type: ignore[dict-item]
                one = acting("frame_convention", sensor, k, values)
                if one.label not in taken:
                    trials.append((one, _reread(system, base, sensor, k, convention)))
    if ("integer_second_slip", "position", 0) not in taken:
        for seconds in SECONDS:
            one = acting("integer_second_slip", "position", 0, {"seconds": float(seconds)})
            trials.append((one, _slipped(base, one)))
    return [trial for trial in trials if trial[0].effect.name not in exclude]


def _reread(
    system: System, base: Scene, sensor: Target, stage: int, convention: str
) -> Callable[[], Array]:
    return lambda: scene(system, undone(base.log, sensor, stage, convention), base.known).error()


def _slipped(base: Scene, one: Acting) -> Callable[[], Array]:
    return lambda: base.error((one,))


def usual_size(error: Array) -> float:
    """Median length of the error vector [m]; components without a truth count as zero."""
    length = np.sqrt(np.nansum(error**2, axis=1))
    return float(np.median(length))
