"""Checks before names: does the log stay within the platform's limits, and agree with itself?

Every name rests on the logged motion.  Velocity columns that are not the derivative of the
positions turn a delay of 50 ms into another one, and a log at nine times v_max says nothing about
the platform in the spec.  Rules in docs/diagnosis.md.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from syncline_design.diagnosis.agreement import WORDS, disagreement, windows_of
from syncline_design.diagnosis.hanging import hanging, hanging_checks
from syncline_design.diagnosis.result import Check, Severity
from syncline_design.diagnosis.scatter import scatter, unforetold
from syncline_design.diagnosis.scene import Scene
from syncline_design.effects.acting import Acting
from syncline_design.effects.kinematics import rotate
from syncline_design.effects.record import Array
from syncline_design.logs.log import LogTrack, StageLog
from syncline_design.model.figure_text import format_estimate, to_places
from syncline_design.model.system import Stage

USUAL, RARE = 0.95, 0.99  # quantiles that decide on a contradiction and on a caution
BEYOND = {"speed": 1.25, "turn_rate": 1.25, "range": 2.0}  # times the limit: a contradiction
NEAR = {"speed": 1.1, "turn_rate": 1.1, "range": 1.5}  # times the limit: a caution
MEAN_S = {"speed": 2.0, "turn_rate": 1.0}  # motion is averaged over this long
NOISE = 2.0 * np.sqrt(2.0)  # standard deviations of the difference of two readings
TOLERANCE = {"velocity": 0.05, "rate": 0.08}
LATE_S = (0.03, -0.03, 0.06, -0.06, 0.12, -0.12, 0.24, -0.24)  # attitudes, that places may rest on
USUAL_DELAY_S = 0.1  # by which the noise of velocities is judged
NAMES = {"speed": ("speed", "v_max"), "turn_rate": ("turn rate", "omega_max"),
         "range": ("range", "distance")}  # fmt: skip


def log_checks(view: Scene, named: Sequence[Acting] = ()) -> tuple[Check, ...]:
    """Everything that is wrong, contradictions first.

    named: what was found.  Positions that a filter smooths move less than the vehicle, and its
    velocities are right.
    """
    found: list[Check] = []
    for index, (stage, logged) in enumerate(zip(view.system.stages, view.log.stages, strict=True)):
        found += _limits(view, stage, logged)
        columns = tuple(_columns(view, index, _displaced(view, index, named)))
        found += columns
        moves = all(one.code != "velocity_columns" for one in columns)
        if moves and not logged.follows_position:
            found += _scattering(view, index, stage, logged)
    found += hanging_checks(view, hanging(view))
    return tuple(sorted(found, key=lambda c: c.severity != "contradiction"))


def is_sound(checks: Sequence[Check]) -> bool:
    """Whether nothing contradicts itself or the platform's limits."""
    return all(one.severity != "contradiction" for one in checks)


def contradicted_columns(view: Scene, named: Sequence[Acting] = ()) -> tuple[Check, ...]:
    """Columns of motion that are not the slope of the poses; named: what was found."""
    return tuple(
        check
        for index in range(len(view.system.stages))
        for check in _columns(view, index, _displaced(view, index, named))
    )


def _limits(view: Scene, stage: Stage, logged: StageLog) -> Iterator[Check]:
    platform = stage.platform
    time_s = view.log.time_s
    place_m = 0.0 if stage.position is None else max(stage.position.sigma)
    angle_rad = 0.0 if stage.attitude is None else max(stage.attitude.sigma)
    motion = (
        ("speed", logged.velocity_mps, platform.v_max_mps, place_m, "m/s"),
        ("turn_rate", logged.rate_radps, platform.omega_max_radps, angle_rad, "rad/s"),
    )
    for code, series, limit, sigma, unit in motion:
        spans = windows_of(time_s, MEAN_S[code])
        if spans is None:
            continue
        size = np.linalg.norm(spans.integral(series), axis=1) / spans.length_s
        yield from _limit(code, stage.name, size, limit, NOISE * sigma / MEAN_S[code], unit)
    if logged.range_m is not None and view.log.kind != "pose":  # whose points are our own
        yield from _limit("range", stage.name, logged.range_m, platform.distance_m, 0.0, "m")


def _limit(
    code: str, stage: str, size: Array, limit: float, noise: float, unit: str
) -> Iterator[Check]:
    """A contradiction where the usual value is far beyond the limit, else a caution."""
    usual, rare = (float(np.quantile(size, q)) for q in (USUAL, RARE))
    severity: Severity
    if usual > BEYOND[code] * limit + noise:
        severity, value = "contradiction", usual
    elif rare > NEAR[code] * limit + noise:
        severity, value = "caution", rare
    else:
        return
    share = float(np.mean(size > limit))
    word, key = NAMES[code]
    reached = USUAL if severity == "contradiction" else RARE
    message = (
        f"{word} of {stage} reaches {format_estimate(value, None, unit)} "
        f"({to_places(100.0 * reached, 0)} % of the log is below), the spec's {key} is "
        f"{format_estimate(limit, None, unit)}; "
        f"{to_places(100.0 * share, 0)} % of the log is beyond it"
    )
    yield Check(code, stage, severity, message, value, limit, unit, share)


def _displaced(view: Scene, index: int, named: Sequence[Acting]) -> Array:
    """What the spec's effects and the named ones add to the logged place [m], NED."""
    total = np.zeros((1, 3))
    for one in (*view.known, *named):
        if (one.stage, one.sensor) == (index, "position"):
            departed = one.effect.depart(view.rows[index], one.values, one.sensor, None)
            total = total + departed.position_m
    return total


def _columns(view: Scene, index: int, displaced_m: Array) -> Iterator[Check]:
    """Velocity columns against the positions' motion, rates against the attitudes' turns."""
    stage, logged, rows = view.system.stages[index], view.log.stages[index], view.rows[index]
    place = rows.position_m - displaced_m
    if view.log.kind == "position" and bool(np.all(np.isfinite(view.log.truth_m))):
        place = view.log.truth_m  # the velocity is that of the better system
    sigma_m = _place_sigma_m(view, index)
    angle_rad = 0.0 if stage.attitude is None else float(np.max(stage.attitude.sigma))
    time_s = view.log.time_s
    moved = None
    derived = logged.follows_position or logged.follows_reference
    for arm_m in () if derived else _arms(view, index):  # derived ones say nothing of their own
        other = disagreement(
            time_s, place - arm_m, logged.velocity_mps, rows.rotation, sigma_m,
            TOLERANCE["velocity"],
        )  # fmt: skip
        if other is None:
            moved = None
            break
        moved = moved or other
    turned = disagreement(
        time_s, None, logged.rate_radps, rows.rotation, angle_rad, TOLERANCE["rate"]
    )
    for code, found in (("velocity_columns", moved), ("rate_columns", turned)):
        if found is not None:
            subject, own = WORDS[code]
            message = f"{subject} of {stage.name} contradict {own}: {found.words}"
            yield Check(code, stage.name, "contradiction", message, found.factor, 1.0, "", 1.0)


def _scattering(view: Scene, index: int, stage: Stage, logged: StageLog) -> Iterator[Check]:
    """Velocities so noisy that a delay is no longer told from an arm, which is free of noise."""
    place_m = _place_sigma_m(view, index)
    if index == 0 and stage.position is not None:
        place_m = float(np.sqrt(np.mean(np.square(stage.position.sigma))))
    track = logged.velocity_track or LogTrack(view.log.time_s, logged.velocity_mps)
    found = scatter(track.time_s, track.value)
    harm = found * USUAL_DELAY_S / max(place_m, 1e-300)
    if harm < 0.5 or unforetold(view.log.time_s, view.rows[index].position_m) > 2.0 * place_m:
        return
    severity: Severity = "contradiction" if harm > 1.0 else "caution"
    message = (
        f"velocity columns of {stage.name} scatter by {format_estimate(found, None, 'm/s')} from "
        f"row to row: with a delay of {format_estimate(USUAL_DELAY_S, None, 's')} that is "
        f"{format_estimate(found * USUAL_DELAY_S, None, 'm')}, the places' own noise "
        f"{format_estimate(place_m, None, 'm')}; delays and lever arms may be taken for each other"
    )
    yield Check("velocity_columns", stage.name, severity, message, found, place_m / USUAL_DELAY_S,
                "m/s", 1.0)  # fmt: skip


def _place_sigma_m(view: Scene, index: int) -> float:
    """Noise of the stage's places [m]: a later stage's are what the chain before it measures."""
    stages = view.system.stages
    first = stages[0].position
    total = 0.0 if first is None else float(np.max(first.sigma)) ** 2
    for stage, logged in zip(stages[:index], view.log.stages, strict=False):
        range_m = 0.0 if logged.range_m is None else float(np.median(logged.range_m))
        if stage.ranging is not None:
            along, *across = stage.ranging.sigma
            total += along**2 + (max(across) * range_m) ** 2
        if stage.attitude is not None:
            total += (max(stage.attitude.sigma) * range_m) ** 2
    return float(np.sqrt(total))


def _arms(view: Scene, index: int) -> Iterator[Array]:
    """By how much the reference points may be off [m], NED, as the attitudes are late or early.

    An attitude that is late by s leaves s R (w x l) of the antenna's arm in every place: an effect
    of its own, and no velocity column's fault.
    """
    rows = view.rows[index]
    yield np.zeros((len(rows), 3))
    if view.log.kind == "position" or not np.any(rows.antenna_m):
        return
    arm = np.broadcast_to(rows.antenna_m, rows.rate_radps.shape)
    swept = rotate(rows.rotation, np.cross(rows.rate_radps, arm))
    for late_s in LATE_S:
        yield late_s * swept
