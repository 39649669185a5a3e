"""The envelope `trajectory`: the vehicle follows a path, rows are random moments of it.

Named manoeuvres are level, at v_max, with the turn rate reaching omega_max:
  straight      no turn;
  circle        constant turn;
  figure_eight  heading A sin(omega_max t / A), A = 2.4048 (first zero of J_0: it closes);
  lawnmower     legs of twice the time of a full turn, joined by half turns, left and right in turn.
Anything else is the path of a CSV file with the columns of a measured log: `time_s`,
`position_{north,east,down}_m`, `{roll,pitch,yaw}_deg` (or `_rad`, `_mm`, `_ms`), if wanted
`range_m`, `azimuth_deg`, `elevation_deg`; in a chain each stage's name as prefix.
"""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import lru_cache, partial
from pathlib import Path

import numpy as np

from syncline_design.effects import acting as acting_effects
from syncline_design.effects.kinematics import bearing, euler_to_rotation, rotate, rotation_to_euler
from syncline_design.effects.record import Array, StageRows
from syncline_design.machine.csv_cells import NotCellsError, rows_of
from syncline_design.machine.input_files import FileContent, UnsuitableError, read_plain
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import to_digits, to_places
from syncline_design.model.system import Platform, SimulationError, Stage, System
from syncline_design.simulation import known_effects
from syncline_design.simulation.chain import ChainNoise
from syncline_design.simulation.draws import (
    RandomSource,
    TimeShifts,
    directions,
    lever_arms,
    noise_draw,
    shaped,
    sight,
    stage_shifts,
    time_margin_s,
    timing_draws,
)
from syncline_design.simulation.settings import DEFAULT_MANOEUVRE, SimulationSettings
from syncline_design.simulation.surroundings import Moment, moment_draw, on_the_level
from syncline_design.simulation.track import Track, lagged

_FIGURE_EIGHT_RAD = 2.404825557695773  # first zero of the Bessel function J_0
_KNOT_TURN_RAD = 0.01  # turn from knot to knot of a named manoeuvre
_MOST_KNOTS = 100_000
_LARGEST_STEP_RAD = 0.5 * math.pi  # of a file, from row to row
_UNITS = {"": 1.0, "s": 1.0, "ms": 1e-3, "m": 1.0, "mm": 1e-3, "rad": 1.0, "deg": math.pi / 180.0}


@dataclass(frozen=True, slots=True)
class Along:
    """Motion along a track from each row's own time."""

    track: Track
    time_s: Array

    def displacement(self, shift_s: Array) -> Array:
        moved: Array = self.track.position(self.time_s + shift_s) - self.track.position(self.time_s)
        return moved

    def rotation(self, shift_s: Array) -> Array:
        return self.track.attitude(self.time_s + shift_s)


def trajectory_errors(
    system: System,
    settings: SimulationSettings,
    source: RandomSource,
    apart: RandomSource,
    part: tuple[float, float] = (0.0, 1.0),
) -> Array:
    """Errors [m] of the chain at random moments, as many as the sources give, NED, (3, count).

    apart: what effects draw from.  part: of a file, as shares of its time, that moments are from.
    """
    shifts = timing_draws(system, source)
    acting = acting_effects.by_stage(system)
    mission = moment_draw(system.horizon, apart) if acting else None
    moment = part[0] + (part[1] - part[0]) * source.uniform(1)[0]
    repeated = settings.trajectory is None or str(settings.trajectory) in MANOEUVRES
    carried: known_effects.Carried | None = None
    for index, stage in enumerate(system.stages):
        track = stage_track(system, settings, index)
        margin = time_margin_s(system)
        first, last = track.time_s[0] + margin, track.time_s[-1] - margin
        time_s = first + (last - first) * moment
        rows = _rows(stage, index == 0, track, time_s, source)
        if mission is not None and repeated:
            rows = _somewhere(rows, mission)
        noise = _noise(system, index, shifts, source, rows)
        motion = Along(track, time_s)
        effects = acting.get(stage.name, ())
        state = (rows, motion, noise)
        carried = known_effects.moved_error(state, effects, apart.generator, carried)
        if repeated:
            moment = source.uniform(1)[0]  # vehicles on manoeuvres of their own are not in step
    assert carried is not None
    return carried.error_m


def _somewhere(rows: StageRows, mission: Moment) -> StageRows:
    """The rows of a manoeuvre that is repeated all through a mission and all over its extent."""
    target = on_the_level(mission)
    moved = rows.position_m + target - rows.target_m
    return replace(rows, time_s=mission.elapsed_s, start_s=0.0, position_m=moved, target_m=target)


def _rows(
    stage: Stage, first: bool, track: Track, time_s: Array, source: RandomSource
) -> StageRows:
    """True state at the moments; the line of sight from the track, else where the stage looks."""
    count = time_s.shape[0]
    uniform = source.uniform(4)
    arm = directions(uniform[:1], uniform[1:2])[0]
    antenna, ranging = (
        np.broadcast_to(lever, (3, count)).T for lever in lever_arms(stage, first, arm)
    )
    if track.sight is not None and stage.ranging is not None:
        range_m, azimuth, elevation = (
            np.interp(time_s, track.time_s, values) for values in track.sight
        )
    else:
        d = 0.0 if stage.ranging is None else float(stage.platform.distance_m)
        range_m = np.full(count, d)
        azimuth = 2.0 * math.pi * uniform[2] - math.pi
        elevation = np.arcsin(2.0 * uniform[3] - 1.0)
        if stage.look is not None:
            x, y, z = sight(stage.look, uniform[2], uniform[3])
            azimuth, elevation = np.arctan2(y, x), -np.arcsin(np.clip(z, -1.0, 1.0))
    rotation, position = track.attitude(time_s), track.position(time_s)
    down = np.swapaxes(rotation, 1, 2)
    vector = ranging + range_m[:, None] * bearing(azimuth, elevation)
    return StageRows(
        time_s=time_s,
        position_m=position,
        rotation=rotation,
        euler_rad=rotation_to_euler(rotation),
        velocity_mps=rotate(down, track.position(time_s, 1)),
        acceleration_mps2=rotate(down, track.acceleration(time_s)),
        rate_radps=track.rate(time_s),
        range_m=range_m,
        azimuth_rad=azimuth,
        elevation_rad=elevation,
        antenna_m=antenna,
        ranging_m=ranging,
        target_m=position + rotate(rotation, vector),
        start_s=float(track.time_s[0]),
        independent=True,
        lagged=partial(lagged, track, time_s),
    )


def _noise(
    system: System, index: int, shifts: TimeShifts, source: RandomSource, rows: StageRows
) -> ChainNoise:
    stage = system.stages[index]
    drawn = noise_draw(stage, source)
    shaped(drawn, stage.ranging, rows.range_m, -np.sin(rows.elevation_rad))
    angles = drawn["angle_noise_rad"]
    return ChainNoise(
        position_m=drawn["position_noise_m"].T,
        attitude_rad=angles[:3].T,
        range_m=drawn["range_noise_m"],
        azimuth_rad=angles[3],
        elevation_rad=angles[4],
        **stage_shifts(system, index, shifts, source.count),
    )


def stage_track(system: System, settings: SimulationSettings, index: int) -> Track:
    """The track of one stage, from its manoeuvre or from the file."""
    stage = system.stages[index]
    chosen = settings.trajectory or DEFAULT_MANOEUVRE
    margin = time_margin_s(system)
    if isinstance(chosen, str) and chosen in MANOEUVRES:
        return _manoeuvre_track(stage.platform, chosen, margin)
    prefix = f"{stage.name}_" if len(system.stages) > 1 else ""
    file = chosen if isinstance(chosen, FileContent) else _content(Path(chosen))
    path, track = file.path, _file_track(file, prefix)
    if track.time_s[-1] - track.time_s[0] <= 2.0 * margin:
        raise SimulationError(
            f"{path}: the trajectory lasts {to_digits(track.time_s[-1] - track.time_s[0])} s, "
            f"expected more "
            f"than {to_digits(2 * margin)} s, twice the largest timestamp error"
        )
    return track


def _heading_straight(_: Array, __: float) -> Array:
    return np.zeros_like(_)


def _heading_circle(time_s: Array, rate_radps: float) -> Array:
    return rate_radps * time_s


def _heading_figure_eight(time_s: Array, rate_radps: float) -> Array:
    swing = np.sin(rate_radps / _FIGURE_EIGHT_RAD * time_s)
    heading: Array = _FIGURE_EIGHT_RAD * swing
    return heading


def _heading_lawnmower(time_s: Array, rate_radps: float) -> Array:
    half_turn = math.pi / max(rate_radps, 1e-300)
    leg = 4.0 * half_turn
    within = np.mod(time_s, 2.0 * (leg + half_turn))  # a left turn undoes the right one
    right = np.clip((within - leg) / half_turn, 0.0, 1.0)
    left = np.clip((within - 2.0 * leg - half_turn) / half_turn, 0.0, 1.0)
    heading: Array = math.pi * (right - left)
    return heading


MANOEUVRES: Mapping[str, Callable[[Array, float], Array]] = {
    "straight": _heading_straight,
    "circle": _heading_circle,
    "figure_eight": _heading_figure_eight,
    "lawnmower": _heading_lawnmower,
}
_TURNS = {"straight": 1.0, "circle": 1.0, "figure_eight": _FIGURE_EIGHT_RAD, "lawnmower": 5.0}


@lru_cache(maxsize=32)
def _manoeuvre_track(platform: Platform, name: str, margin_s: float) -> Track:
    """One period of a manoeuvre with room at both ends for shifts."""
    v, omega = float(platform.v_max_mps), float(platform.omega_max_radps)
    period = 2.0 * math.pi / omega * _TURNS[name] if omega > 0.0 else 1.0
    wanted = (period + 2.0 * margin_s) * max(omega, 0.0) / _KNOT_TURN_RAD
    count = min(max(math.ceil(wanted), 8), _MOST_KNOTS)
    time_s = np.linspace(-margin_s, period + margin_s, count + 1)
    heading = MANOEUVRES[name] if omega > 0.0 else _heading_straight
    step = time_s[1] - time_s[0]
    yaw, middle = heading(time_s, omega), heading(time_s[:-1] + 0.5 * step, omega)
    zero = np.zeros_like(time_s)
    velocity = v * np.stack([np.cos(yaw), np.sin(yaw), zero], axis=-1)
    between = v * np.stack([np.cos(middle), np.sin(middle), np.zeros_like(middle)], axis=-1)
    moved = step / 6.0 * (velocity[:-1] + 4.0 * between + velocity[1:])  # Simpson's rule
    position = np.concatenate([np.zeros((1, 3)), np.cumsum(moved, axis=0)])
    rotation = euler_to_rotation(np.stack([zero, zero, yaw], axis=-1))
    turn = np.stack([zero[1:], zero[1:], np.diff(yaw)], axis=-1)
    return Track(time_s, position, velocity, rotation, turn, period_s=period)


def _content(path: Path) -> FileContent:
    """A trajectory that a caller names by its path."""
    try:
        return FileContent(path, read_plain(path))
    except (OSError, UnsuitableError) as error:
        known = ", ".join(MANOEUVRES)
        reason = getattr(error, "strerror", None) or str(error)
        raise SimulationError(
            f"trajectory: expected a CSV file or one of {known}, found {str(path)!r} ({reason})"
        ) from None


@lru_cache(maxsize=8)
def _file_track(file: FileContent, prefix: str) -> Track:
    """The track of a CSV file; the cache goes by what is in it."""
    path = file.path
    columns = _read_columns(file)
    time_s = _column(path, columns, "time", "s", ("s", "ms"))
    if time_s.shape[0] < 2 or not np.all(np.diff(time_s) > 0.0):
        raise SimulationError(f"{path}: time_s: expected at least two rows of rising time")
    axes = (f"{prefix}position_{axis}" for axis in ("north", "east", "down"))
    position = np.stack([_column(path, columns, a, "m", ("m", "mm")) for a in axes], axis=-1)
    names = (f"{prefix}{angle}" for angle in ("roll", "pitch", "yaw"))
    euler = np.stack([_column(path, columns, a, "deg", ("deg", "rad")) for a in names], axis=-1)
    rotation = euler_to_rotation(euler)
    turn = rotation_log(np.swapaxes(rotation[:-1], 1, 2) @ rotation[1:])
    steps = np.linalg.norm(turn, axis=-1)
    if np.any(steps > _LARGEST_STEP_RAD):
        row = int(np.argmax(steps > _LARGEST_STEP_RAD)) + 2
        raise SimulationError(
            f"{path}:{row + 1}: the attitude turns by "
            f"{to_places(math.degrees(steps[row - 2]), 0)} deg from "
            "the row before; expected at most 90 deg; sample the trajectory faster"
        )
    velocity = np.gradient(position, time_s, axis=0)
    return Track(time_s, position, velocity, rotation, turn, _sight(path, columns, prefix))


def rotation_log(rotation: Array) -> Array:
    """Rotation vector v with exp(S(v)) = R, (n, 3, 3) -> (n, 3), angles below pi."""
    skew = 0.5 * (rotation - np.swapaxes(rotation, 1, 2))
    vector = np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], axis=-1)
    sine = np.linalg.norm(vector, axis=-1)
    angle = np.arctan2(sine, 0.5 * (np.trace(rotation, axis1=1, axis2=2) - 1.0))
    scale = np.where(sine > 1e-12, angle / np.where(sine > 1e-12, sine, 1.0), 1.0)
    log: Array = scale[:, None] * vector
    return log


def _sight(
    path: Path, columns: Mapping[str, Array], prefix: str
) -> tuple[Array, Array, Array] | None:
    if not any(name.startswith(f"{prefix}range_") for name in columns):
        return None
    return (
        _column(path, columns, f"{prefix}range", "m", ("m", "mm")),
        _column(path, columns, f"{prefix}azimuth", "deg", ("deg", "rad")),
        _column(path, columns, f"{prefix}elevation", "deg", ("deg", "rad")),
    )


def _read_columns(file: FileContent) -> dict[str, Array]:
    """All columns of a CSV file as numbers; a cell that is none names its line and column."""
    path = file.path
    try:
        lines = io.StringIO(file.content.decode("utf-8-sig"), newline="")
        rows = [(line, row) for line, row in rows_of(lines) if row]
    except (UnicodeDecodeError, NotCellsError) as failure:
        raise SimulationError(f"{path}: expected a CSV file in UTF-8: {failure}") from None
    if not rows:
        raise SimulationError(f"{path}: expected a header and rows, found an empty file")
    header = [name.strip() for name in rows[0][1]]
    for line, row in rows[1:]:
        if len(row) != len(header):
            raise SimulationError(
                f"{path}:{line}: expected {len(header)} cells as in the header, found {len(row)}"
            )
    return {
        name: np.array([_number(path, line, name, row[at]) for line, row in rows[1:]])
        for at, name in enumerate(header)
    }


def _number(path: Path, line: int, name: str, cell: str) -> float:
    try:
        value = float(cell)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise SimulationError(f"{path}:{line}: {name}: expected a number, found {cell!r}")
    return value


def _column(
    path: Path, columns: Mapping[str, Array], name: str, usual: str, units: tuple[str, ...]
) -> Array:
    """A column by its name with any of the units as suffix, in SI."""
    for unit in units:
        if f"{name}_{unit}" in columns:
            return columns[f"{name}_{unit}"] * _UNITS[unit]
    found = ", ".join(list(columns)[:12]) + (" ..." if len(columns) > 12 else "")
    raise SimulationError(f"{path}: expected a column {name}_{usual}, found {found[:400]}")
