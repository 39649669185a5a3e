"""What remains of a log when the spec's system, with effects, explains it.

Every candidate is judged by re-simulation, never by a linear regressor alone.  The chain of
`simulation.chain` runs from true states to an error; a log holds measured states, so it is run
backwards here: the measurements are corrected by the departures, one sensor after the other, and
what is left between the place that the antenna says and the place that the target says is noise.
Without departures this is the georeferencing error itself.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import field, replace

import numpy as np

from syncline_design.diagnosis.past import LoggedPast
from syncline_design.diagnosis.recent import Recent
from syncline_design.diagnosis.trajectory import LoggedMotion, pieces, smooth_bend, smooth_slope
from syncline_design.diagnosis.unsettled import without_unlogged_past
from syncline_design.effects import registry
from syncline_design.effects.acting import Acting
from syncline_design.effects.kinematics import bearing, euler_to_rotation, rotate
from syncline_design.effects.record import ActsOn, Array, Departures, StageRows
from syncline_design.logs.log import Log, LogTrack, Rows, StageLog
from syncline_design.logs.stamps import per_stamp
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model import timing
from syncline_design.model.system import Sensor, Stage, System
from syncline_design.simulation.chain import rotation_exp

SLOPES = 8  # sets of effects whose slopes are kept
PARTS = 12  # poses, places and beams of stages that are
ERRORS = 8  # sets of effects whose error is
NO_LEVER = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Scene:
    """A log beside the system that the spec describes."""

    system: System
    log: Log
    motions: tuple[LoggedMotion, ...]
    rows: tuple[StageRows, ...]
    known: tuple[Acting, ...]  # the spec's own effects and mean timestamp errors
    slopes: Recent = field(default_factory=lambda: Recent(SLOPES), repr=False, compare=False)
    errors: Recent = field(default_factory=lambda: Recent(ERRORS), repr=False, compare=False)
    parts: Recent = field(default_factory=lambda: Recent(PARTS), repr=False, compare=False)

    def __len__(self) -> int:
        return len(self.log)

    def error(self, acting: Sequence[Acting] = ()) -> Array:
        """Corrected georeferencing error [m], NED, (n, 3); NaN where the truth is not known."""
        return self.errors.of(asked(acting), lambda: self._error(acting))

    def _error(self, acting: Sequence[Acting]) -> Array:
        error = _corrected_error(self, self._departures(acting))
        return without_unlogged_past(self.system, self.rows, error, (*self.known, *acting))

    def mistaken(self, made: Acting, taken: Acting) -> Array:
        """Error (n, 3) [m] of a log that one effect made, corrected for another one, where this log
        has neither."""
        left, own = (_corrected_error(self, self._departures((one,))) for one in (taken, made))
        return without_unlogged_past(self.system, self.rows, left - own, (*self.known, taken))

    def _departures(self, acting: Sequence[Acting]) -> list[Departures]:
        ranged = self.log.kind != "position"
        total = [_mean_timing(self.system, stage, ranged) for stage in self.system.stages]
        for a in (*self.known, *acting):
            departed = a.effect.depart(self.rows[a.stage], a.values, a.sensor, None)
            total[a.stage] = total[a.stage] + departed
        return total

    def part(self, index: Rows) -> Scene:
        """The scene on some of the rows (rising); the motions keep all of the log."""
        times = self.log.time_s[index]
        motions = tuple(m.at(times) for m in self.motions)
        rows = tuple(cut_rows(r, index) for r in self.rows)
        return Scene(self.system, self.log.rows(index), motions, rows, self.known)


def asked(acting: Sequence[Acting]) -> Hashable:
    """What tells one set of effects at work from another."""
    return tuple(
        (one.label, one.effect.depart, tuple(sorted(one.values.items()))) for one in acting
    )


def cut_rows(rows: StageRows, index: Rows) -> StageRows:
    """Some rows of a stage; lever arms stay as they are.

    Elapsed time counts from the first row of what an effect is given, so the first row is kept.
    """
    kept = ("antenna_m", "ranging_m", "start_s", "independent", "lagged")
    every = {n: getattr(rows, n) for n in StageRows.__slots__ if n not in kept}
    cut = {n: value[index] for n, value in every.items() if value is not None}
    behind = rows.lagged
    if behind is None:
        return replace(rows, **cut)
    if isinstance(behind, LoggedPast):
        return replace(rows, **cut, lagged=behind.part(index))

    def lagged(constant_s: float) -> tuple[Array, Array]:
        place, turn = behind(constant_s)
        return place[index], turn[index]

    return replace(rows, **cut, lagged=lagged)


def scene(system: System, log: Log, known: Sequence[Acting] = ()) -> Scene:
    """Put a log beside a system; measured states stand in for true ones, to first order."""
    motions: list[LoggedMotion] = []
    rows: list[StageRows] = []
    place: Array | None = None
    for index, (stage, logged) in enumerate(zip(system.stages, log.stages, strict=True)):
        antenna, ranging = levers(stage, index)
        if log.kind == "position":  # the reference point itself is compared
            ranging = np.zeros(3)
        rotation = euler_to_rotation(logged.euler_rad)
        source = logged.antenna_m if place is None else place
        if source is None:
            raise ValueError(f"stage {stage.name!r} has no position")
        position = source - rotate(rotation, antenna)
        moved = _of_the_reference_point(log, logged, rotation, antenna)
        motions.append(
            _motion(log, _of_the_reference_point(log, _quick(log, logged), rotation, antenna))
        )
        path = _path_velocity(log, logged)
        rows.append(_stage_rows(log, moved, path, rotation, position, antenna, ranging))
        place = position + rotate(rotation, ranging + _logged_vector(logged, len(log)))
    last = rows[-1]
    assert place is not None
    truth = np.where(np.isnan(log.truth_m), place, log.truth_m)
    fields = {name: getattr(last, name) for name in StageRows.__slots__}
    rows[-1] = StageRows(**(fields | {"target_m": truth}))
    return Scene(system, log, tuple(motions), tuple(rows), tuple(known))


def _of_the_reference_point(
    log: Log, logged: StageLog, rotation: Array, antenna: Array
) -> StageLog:
    """Slopes of the antenna's places hold the sweep of its arm, which is added where a delay is
    felt."""
    return less_sweep(log, logged, rotation, antenna) if logged.follows_position else logged


def less_sweep(log: Log, logged: StageLog, rotation: Array, antenna: Array) -> StageLog:
    """The stage with the velocity of its reference point, v = v_A - R (w x l_G)."""
    if not np.any(antenna):
        return logged
    sweep = rotate(rotation, np.cross(logged.rate_radps, antenna))
    track = logged.velocity_track
    if track is not None:
        swept = [np.interp(track.time_s, log.time_s, sweep[:, k]) for k in range(3)]
        track = LogTrack(track.time_s, track.value - np.stack(swept, axis=1))
    return replace(logged, velocity_mps=logged.velocity_mps - sweep, velocity_track=track)


def _quick(log: Log, logged: StageLog) -> StageLog:
    """The stage with slopes of its places that are smoothed by what these ask for.

    Displacements rest on them: smoothed over a fixed time, quick motion would be missing from a
    delay and not from the lag of a filter.  Accelerations would be mostly noise.
    """
    place_m = None
    if logged.velocity_track is not None:
        return logged
    if log.kind == "position" and logged.follows_reference and np.all(np.isfinite(log.truth_m)):
        place_m = log.truth_m
    elif logged.follows_position:
        place_m = logged.antenna_m
    if place_m is None:
        return logged
    times, places = per_stamp(log.time_s, place_m)
    return replace(logged, velocity_mps=smooth_slope(times, places, log.time_s))


def _motion(log: Log, stage: StageLog) -> LoggedMotion:
    velocity = stage.velocity_track or LogTrack(log.time_s, stage.velocity_mps)
    rate = stage.rate_track or LogTrack(log.time_s, stage.rate_radps)
    return LoggedMotion(
        log.time_s,
        pieces(velocity.time_s, velocity.value),
        pieces(rate.time_s, rate.value),
        log.time_s,
        euler_to_rotation(stage.euler_rad),
        stage.follows_position or stage.velocity_of_position,
        stage.rate_of_attitude,
    )


def levers(stage: Stage, index: int) -> tuple[Array, Array]:
    """Lever arms l_G (or the transponder's) and l_L [m] that the spec believes, body, (3,)."""
    if index == 0:
        first = None if stage.position is None else stage.position.lever_arm_m
    else:
        first = stage.transponder_lever_arm_m
    second = None if stage.ranging is None else stage.ranging.lever_arm_m
    return np.array(first or NO_LEVER, dtype=float), np.array(second or NO_LEVER, dtype=float)


def _logged_vector(logged: StageLog, rows: int) -> Array:
    """Measured r n [m] in the body, (n, 3); zero in a position log."""
    if logged.range_m is None or logged.azimuth_rad is None or logged.elevation_rad is None:
        return np.zeros((rows, 3))
    return logged.range_m[:, None] * bearing(logged.azimuth_rad, logged.elevation_rad)


def _acceleration(log: Log, logged: StageLog) -> Array:
    """Of the reference point [m/s2], NED, (n, 3)."""
    if logged.follows_position and logged.antenna_m is not None:
        return smooth_bend(log.time_s, logged.antenna_m, log.time_s)
    track = logged.velocity_track or LogTrack(log.time_s, logged.velocity_mps)
    return smooth_slope(track.time_s, track.value, log.time_s)


def _stage_rows(
    log: Log,
    logged: StageLog,
    path: LogTrack,
    rotation: Array,
    position: Array,
    antenna: Array,
    ranging: Array,
) -> StageRows:
    zero = np.zeros(len(log))
    back = np.swapaxes(rotation, 1, 2)
    vector = _logged_vector(logged, len(log))
    return StageRows(
        time_s=log.time_s,
        position_m=position,
        rotation=rotation,
        euler_rad=logged.euler_rad,
        velocity_mps=rotate(back, logged.velocity_mps),
        acceleration_mps2=rotate(back, _acceleration(log, logged)),
        rate_radps=logged.rate_radps,
        range_m=zero if logged.range_m is None else logged.range_m,
        azimuth_rad=zero if logged.azimuth_rad is None else logged.azimuth_rad,
        elevation_rad=zero if logged.elevation_rad is None else logged.elevation_rad,
        antenna_m=antenna,
        ranging_m=ranging,
        target_m=position + rotate(rotation, ranging + vector),
        lagged=LoggedPast(
            log.time_s,
            path,
            log.time_s,
            rotation,
            logged.rate_radps,
            logged.follows_position,
        ),
    )


def _path_velocity(log: Log, logged: StageLog) -> LogTrack:
    """The velocity [m/s], NED, that a memory of the path sums up.

    Of a path that is known itself it is the slope of the spline through it: the sum undoes the
    slope's noise, and smoothing would take away of the motion.  Of the antenna's own places it is
    the slope as it is, smoothed by what the places ask for and not over a fixed time.
    """
    if logged.follows_position and logged.velocity_track is None and logged.antenna_m is not None:
        times, places = per_stamp(log.time_s, logged.antenna_m)
        return LogTrack(times, smooth_slope(times, places, times))
    if log.kind == "position" and logged.follows_reference and np.all(np.isfinite(log.truth_m)):
        times, places = per_stamp(log.time_s, log.truth_m)
        return LogTrack(times, pieces(times, places).slope(times, times))
    return logged.velocity_track or LogTrack(log.time_s, logged.velocity_mps)


def _mean_timing(system: System, stage: Stage, ranged: bool) -> Departures:
    """The mean timestamp errors that the spec itself declares, against UTC.

    A stamp of the host clock is that clock's offset (host - UTC) ahead: mu = eps - offset.  In a
    log of positions only the position sensor was at work; the rest, and the true time that its
    stamp is held against, are the better system's.
    """

    def mean(sensor: Sensor | None) -> Array:
        if sensor is None:
            return np.zeros(1)
        offset = system.clock_offset(sensor.timeline)
        return np.array([timing.expected(sensor.timing) - timing.expected(offset)])

    if not ranged:
        return Departures(position_shift_s=mean(stage.position))
    return Departures(
        position_shift_s=mean(stage.position),
        attitude_shift_s=mean(stage.attitude),
        ranging_shift_s=mean(stage.ranging),
    )


def _corrected_error(view: Scene, departures: Sequence[Departures]) -> Array:
    reading: Array | None = None  # where the antenna (or transponder) truly was, and when
    carried_shift: Array = np.zeros(1)
    for index, departed in enumerate(departures):
        stage_log = view.log.stages[index]
        if reading is None:
            assert stage_log.antenna_m is not None
            reading = stage_log.antenna_m - departed.position_m
            carried_shift = departed.position_shift_s
        pose = _true_pose(view, index, departed)
        position = _reference_point(view, index, departed, reading, carried_shift, pose)
        vector = _true_vector(view, index, departed)
        arm = view.rows[index].ranging_m + departed.ranging_m + vector
        reading = position + rotate(pose, arm)
        carried_shift = departed.ranging_shift_s
    assert reading is not None
    error: Array = reading - (view.log.truth_m - departures[-1].target_m)
    return error


def _true_pose(view: Scene, index: int, departed: Departures) -> Array:
    """R_nb (n, 3, 3) at the moment at which the ranging sensor measured."""

    def turned() -> Array:
        time_s, rows = view.log.time_s, view.rows[index]
        rotation = rows.rotation[:]  # what is kept is locked
        if np.any(departed.attitude_euler_rad):
            rotation = euler_to_rotation(rows.euler_rad - departed.attitude_euler_rad)
        if np.any(departed.attitude_rotation_rad):
            rotation = rotation @ rotation_exp(-departed.attitude_rotation_rad)
        late = departed.attitude_shift_s
        ranged_at = time_s + departed.ranging_shift_s
        return view.motions[index].turned(rotation, time_s + late, ranged_at, late)

    return view.parts.of(_asked_of("pose", index, _of_pose(departed)), turned)


def _of_pose(departed: Departures) -> tuple[Array, ...]:
    return (
        departed.attitude_euler_rad,
        departed.attitude_rotation_rad,
        departed.attitude_shift_s,
        departed.ranging_shift_s,
    )


def _asked_of(what: str, index: int, moved: Sequence[Array]) -> Hashable:
    """What a part of the chain depends on: most parameters move one part, the others are kept."""
    return what, index, *((one.shape, one.tobytes()) for one in moved)


def _reference_point(
    view: Scene,
    index: int,
    departed: Departures,
    reading: Array,
    shift_s: Array,
    pose: Array,
) -> Array:
    """p (n, 3) at the moment of ranging, from the antenna's true place at its own moment."""

    def carried() -> Array:
        lever = view.rows[index].antenna_m + departed.antenna_m
        own, ranged = view.log.time_s + shift_s, view.log.time_s + departed.ranging_shift_s
        if np.array_equal(own, ranged):
            return reading - rotate(pose, lever)
        motion = view.motions[index]
        there = motion.turned(pose, ranged, own, departed.attitude_shift_s)
        return reading - rotate(there, lever) - motion.displacement(ranged, own, shift_s)

    moved = (*_of_pose(departed), departed.antenna_m, reading, shift_s)
    return view.parts.of(_asked_of("place", index, moved), carried)


def _true_vector(view: Scene, index: int, departed: Departures) -> Array:
    """r n [m] in the body (n, 3), the measured one without its departures."""

    def beam() -> Array:
        rows = view.rows[index]
        if view.log.stages[index].range_m is None:
            return np.zeros((len(rows), 3))
        distance = (rows.range_m - departed.range_m) / (1.0 + departed.range_scale)
        pointing = bearing(
            rows.azimuth_rad - departed.azimuth_rad, rows.elevation_rad - departed.elevation_rad
        )
        if np.any(departed.bearing_rotation_rad):
            turn = rotation_exp(departed.bearing_rotation_rad)
            pointing = rotate(np.broadcast_to(turn, (len(rows), 3, 3)), pointing)
        vector: Array = distance[:, None] * pointing
        return vector

    moved = (
        departed.range_m,
        departed.range_scale,
        departed.azimuth_rad,
        departed.elevation_rad,
        departed.bearing_rotation_rad,
    )
    return view.parts.of(_asked_of("beam", index, moved), beam)


def acting(name: str, sensor: ActsOn, stage: int, values: Mapping[str, float]) -> Acting:
    """An effect of the dictionary at work."""
    return Acting(registry()[name], sensor, stage, dict(values))
