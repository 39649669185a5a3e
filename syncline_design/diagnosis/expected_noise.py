"""The noise that the spec expects of every row, in terms of the georeferencing error."""

from __future__ import annotations

import math

import numpy as np

from syncline_design.diagnosis.noise import Directed, Slow, Structure, White
from syncline_design.diagnosis.scene import Scene
from syncline_design.effects.kinematics import antenna_to_object, bearing, rotate, shift_slope
from syncline_design.effects.record import OUTLIER_FACTOR, Array, StageRows
from syncline_design.model.system import Sensor
from syncline_design.model.timing import Constant, Distribution, Empirical, Normal, Uniform

UNKNOWN_VARIANCE_M2 = 1e8  # of a component whose truth the log does not hold
FLOOR_M = 1e-6  # keeps a row's covariance positive definite where a sensor is claimed perfect
NEGLIGIBLE = 1e-6  # share of every row's variance below which it matters not whose noise it is
LEAST_FREEDOM = 2.05  # of Student's t, for its deviation to be a figure
DOWN = np.array([0.0, 0.0, 1.0])
MATTERS = 0.01  # share of the row's variance below which slow attitude noise is not modelled


def structure_of(view: Scene, directed: tuple[Directed, ...] = ()) -> Structure:
    """White and slow noise of every sensor, and the scatter of the spec's own timing errors.

    Noise that the spec lists among its effects is the spec's noise.
    """
    white: list[White] = []
    slow: list[Slow] = []
    fixed = FLOOR_M**2 * np.eye(3) + _unknown(view)
    stamped: list[Array] = []
    last = len(view.system.stages) - 1
    for index, stage in enumerate(view.system.stages):
        rows = view.rows[index]
        parts = {
            "position": (stage.position, _position(rows)),
            "attitude": (stage.attitude, _attitude(rows)),
            "ranging": (stage.ranging, _ranging(rows)),
        }
        for role, (sensor, slopes) in parts.items():
            if sensor is None or (role != "position" and view.log.kind == "position"):
                continue
            usual, wandering = _sizes(view, index, role, sensor)
            loading = slopes * usual * _episodes(view, index, role)[:, None, None]
            own = role == "ranging" and index == last  # each target is a reading of its own
            covariance = loading @ np.swapaxes(loading, 1, 2)
            white.append(White((stage.name, role), covariance, None if own else loading))
            stamped += _timing_scatter(rows, role, sensor)
            slow.append(Slow((stage.name, role), slopes * wandering, True))
    stamped += _known_scatter(view)
    kept = tuple(s for s in slow if _matters(s, white))
    common, negligible = _split_small(stamped, white)
    fixed = fixed + negligible
    once = one_reading(view)
    return Structure(view.log.time_s, tuple(white), kept, fixed, directed, common, once)


def _sizes(view: Scene, index: int, role: str, sensor: Sensor) -> tuple[Array, Array]:
    """Deviations of a sensor's white and slow noise (3,), with what the spec's own effects add."""
    usual = np.array(sensor.sigma)
    wandering = np.zeros(3)
    for one in view.known:
        if (one.stage, one.sensor) != (index, role):
            continue
        figures = [one.values[p.name] for p in one.effect.parameters]
        if one.effect.opens == "factor":
            usual = usual * figures[0]
        elif one.effect.opens == "tails":
            freedom, outliers = max(figures[0], LEAST_FREEDOM), figures[1]
            tails = (1.0 - outliers) * freedom / (freedom - 2.0)
            grown = np.sqrt(tails + outliers * OUTLIER_FACTOR**2)
            usual = usual * (np.array([grown, 1.0, 1.0]) if role == "ranging" else grown)
        elif one.effect.wanders:
            axes = DOWN if one.effect.opens == "down" else np.ones(3)
            wandering = wandering + (figures[0] * axes) ** 2
    return usual, np.sqrt(usual**2 + wandering)


def _episodes(view: Scene, index: int, role: str) -> Array:
    """Standard deviations over the usual ones that the spec's own episodes have (n,)."""
    total = np.ones(len(view))
    for one in view.known:
        if (one.stage, one.sensor, one.effect.opens) == (index, role, "episode"):
            grown = one.effect.depart(view.rows[index], one.values, one.sensor, None)
            total = total * (1.0 + getattr(grown, f"{role}_noise"))
    return total


def _known_scatter(view: Scene) -> list[Array]:
    """What the spec's own effects scatter along the motion [m], (n, 3, k) each."""
    return [
        one.effect.spread(view.rows[one.stage], one.values, one.sensor)
        for one in view.known
        if one.effect.spread is not None
    ]


def _split_small(stamped: list[Array], white: list[White]) -> tuple[Array | None, Array]:
    """Timing scatter that matters, and the covariance of the rest, which no one could tell apart.

    What rows of a stamp share costs states; hardware stamps of some ns are not worth them.
    """
    rest: Array = np.zeros((1, 3, 3))
    kept = []
    least = sum(np.einsum("nii->n", w.covariance) for w in white)
    for slope in stamped:
        if np.any(np.sum(slope**2, axis=(1, 2)) > NEGLIGIBLE * least):
            kept.append(slope)
        else:
            rest = rest + slope @ np.swapaxes(slope, 1, 2)
    return (np.concatenate(kept, axis=2) if kept else None), rest


def one_reading(view: Scene) -> bool:
    """Whether rows of one stamp hold one reading of the vehicle, and so its very noise.

    Several targets of a scan are paired with one pose.  Where the poses of a stamp differ, the
    stamps are coarse, and every row is a reading of its own.
    """
    log = view.log
    same = log.time_s[1:] == log.time_s[:-1]
    equal = np.ones(same.shape, dtype=bool)
    for stage in log.stages:
        for values in (stage.antenna_m, stage.euler_rad):
            if values is not None:
                equal &= np.all(values[1:] == values[:-1], axis=1)
    return bool(np.mean(equal[same]) > 0.5) if np.any(same) else True


def _matters(part: Slow, white: list[White]) -> bool:
    """Slow noise is modelled where its sensor has a say: per component, in the median row."""
    own = np.sum(part.loading**2, axis=2)
    total = sum(np.einsum("nii->ni", w.covariance) for w in white)
    return bool(np.max(np.median(own / total, axis=0)) > MATTERS)


def _position(rows: StageRows) -> Array:
    """d error / d reading = I (NED)."""
    return np.broadcast_to(np.eye(3), (len(rows), 3, 3))


def _attitude(rows: StageRows) -> Array:
    """d error / d (roll, pitch, yaw) [m/rad]: axis x R q, (n, 3, 3).

    Axes in NED: roll about R e_x, pitch about Rz(yaw) e_y, yaw about e_z.
    """
    sweep = rotate(rows.rotation, antenna_to_object(rows))
    yaw = rows.euler_rad[:, 2]
    zero = np.zeros_like(yaw)
    axes = (
        rows.rotation[:, :, 0],
        np.stack([-np.sin(yaw), np.cos(yaw), zero], axis=-1),
        np.array([0.0, 0.0, 1.0]),
    )
    return np.stack([np.cross(axis, sweep) for axis in axes], axis=-1)


def _ranging(rows: StageRows) -> Array:
    """d error / d (range, azimuth, elevation) = R (n, r dn/daz, r dn/del), (n, 3, 3)."""
    az, el, r = rows.azimuth_rad, rows.elevation_rad, rows.range_m
    zero = np.zeros_like(az)
    across = np.stack([-np.sin(az) * np.cos(el), np.cos(az) * np.cos(el), zero], axis=-1)
    up = np.stack([-np.cos(az) * np.sin(el), -np.sin(az) * np.sin(el), -np.cos(el)], axis=-1)
    columns = (bearing(az, el), r[:, None] * across, r[:, None] * up)
    return np.stack([rotate(rows.rotation, c) for c in columns], axis=-1)


def _timing_scatter(rows: StageRows, role: str, sensor: Sensor) -> list[Array]:
    """Std(mu) times the motion [m], (n, 3, 1) each; mu anew at every stamp."""
    deviation = timing_std(sensor.timing.distribution)
    if deviation == 0.0:
        return []
    slope = deviation * shift_slope(rows, role)  # type: ignore[arg-type]
    return [slope[:, :, None]]


def timing_std(distribution: Distribution) -> float:
    """Standard deviation of mu [s]."""
    match distribution:
        case Uniform(low, high):
            return (high - low) / math.sqrt(12.0)
        case Normal(_, std):
            return std
        case Constant(_):
            return 0.0
        case Empirical(values):
            return float(np.std(values))


def _unknown(view: Scene) -> Array:
    """Components without a known truth count for nothing."""
    variance = np.where(np.isnan(view.log.truth_m), UNKNOWN_VARIANCE_M2, 0.0)
    return variance[:, :, None] * np.eye(3)


def channels(view: Scene) -> list[tuple[tuple[str, str], Array]]:
    """What one standard deviation of every reading does to the error [m], (n, 3, 3) a sensor."""
    found = []
    for index, stage in enumerate(view.system.stages):
        rows = view.rows[index]
        parts = {
            "position": (stage.position, _position(rows)),
            "attitude": (stage.attitude, _attitude(rows)),
            "ranging": (stage.ranging, _ranging(rows)),
        }
        for role, (sensor, slopes) in parts.items():
            if sensor is None or (role != "position" and view.log.kind == "position"):
                continue
            _, wandering = _sizes(view, index, role, sensor)
            found.append(((stage.name, role), slopes * wandering))
    return found
