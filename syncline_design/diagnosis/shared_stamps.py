"""Which columns of motion carry the stamps of the poses that they are the slope of.

A receiver puts one stamp on its places and its velocities, an INS one on its attitudes and its
rates: where these come late, their slopes come as late.  Taken at the stamps of another clock,
such rates turn an attitude that is s late by w(t + s) s, which errs by dw/dt s^2: enough for other
sensors' delays to fit better than the true one.  Whose stamps they are, a log says itself: columns
are held against their own poses, shifted in time.  So does it of which point velocities are: those
of a receiver are its antenna's, and hold the sweep of the arm, which in a turn looks like a lag.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from syncline_design.diagnosis.agreement import WindowRows, moved_between, windows_of
from syncline_design.diagnosis.scene import Scene, less_sweep, scene
from syncline_design.diagnosis.trajectory import SplinePieces
from syncline_design.effects.kinematics import euler_to_rotation
from syncline_design.effects.record import Array
from syncline_design.logs.log import Log, StageLog
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import format_estimate

LENGTHS_S = (0.4, 0.8, 1.6, 3.2, 6.4)
ROUNDS = 3
ERRORS = 3.0  # standard errors by which stamps of one device may seem apart
ALIKE_S = 3e-3  # and by which they may be: what their own filters delay
CLEARLY_NATS = 10.0  # by which velocities have to fit better as the antenna's
SURE_S = 5e-3  # standard error from which nothing is said: neither matters then


@dataclass(frozen=True, slots=True)
class Apart:
    """By how much columns come later than the poses that they are the slope of [s].

    left: mean square of what they do not explain of the poses; count: of how many readings.
    """

    later_s: float
    uncertainty_s: float
    left: float
    count: int

    @property
    def shared(self) -> bool:
        """Whether both carry the stamps of one device, as far as a log can tell."""
        return self.uncertainty_s < SURE_S and abs(self.later_s) < ALIKE_S + (
            ERRORS * self.uncertainty_s
        )


def with_shared_stamps(log: Log, view: Scene) -> Log:
    """The log, of which is known which columns are as late as their poses; view: the log's scene.

    Of a log of positions the better system's stamps are true.  A note says which are another's.
    """
    log, view = _of_the_reference_point(log, view)
    if log.kind == "position":
        return log
    stages, notes = [], []
    for k, stage in enumerate(log.stages):
        rates, velocities = rates_apart(view, k), None
        if k == 0 and not _of_the_better_system(stage):
            velocities = velocities_apart(view, k)
        stages.append(
            replace(
                stage,
                rate_of_attitude=rates is not None and rates.shared,
                velocity_of_position=velocities is not None and velocities.shared,
            )
        )
        notes += _notes(stage.name, "rates", "attitudes", rates)
        notes += _notes(stage.name, "velocities", "positions", velocities)
    return replace(log, stages=tuple(stages), notes=(*log.notes, *notes))


def _of_the_reference_point(log: Log, view: Scene) -> tuple[Log, Scene]:
    """Log and scene with velocities of the point that lever arms count from, where they are clearly
    the antenna's."""
    first, antenna = log.stages[0], view.rows[0].antenna_m
    if first.follows_position or _of_the_better_system(first) or not np.any(antenna):
        return log, view
    seen = view.log
    own = less_sweep(seen, seen.stages[0], view.rows[0].rotation, antenna)
    other = scene(view.system, replace(seen, stages=(own, *seen.stages[1:])), view.known)
    if _gain(view, other) < CLEARLY_NATS:
        return log, view
    own = less_sweep(log, first, euler_to_rotation(first.euler_rad), antenna)
    note = f"velocities of {first.name} are its antenna's: the sweep of the arm was taken off them"
    return replace(log, stages=(own, *log.stages[1:]), notes=(*log.notes, note)), other


def _of_the_better_system(stage: StageLog) -> bool:
    """Velocities of which origin tells what stamps and what point they are of: the reference's."""
    return stage.follows_reference or stage.velocity_of_reference


def _gain(view: Scene, other: Scene) -> float:
    """By how much velocities fit the places better in another scene [nat], at the better lag."""
    pairs = zip(_lags_of_velocity(view), _lags_of_velocity(other), strict=True)
    known = [(a, b) for a, b in pairs if a is not None and b is not None]
    if not known:
        return 0.0
    own, turned = min(known, key=lambda pair: min(one.uncertainty_s for one in pair))
    return _nats(own, turned)


def _nats(own: Apart, other: Apart) -> float:
    """By how much the other explains the same readings better, noise of either size free."""
    return 0.5 * own.count * float(np.log(max(own.left, 1e-300) / max(other.left, 1e-300)))


def _lags_of_velocity(view: Scene) -> list[Apart | None]:
    """By the better system's places where there are any: the tested arm may be off."""
    place_m, truth_m = view.rows[0].position_m, view.log.truth_m
    if view.log.kind == "position" and np.all(np.isfinite(truth_m)):
        place_m = truth_m
    return _lags(view, 0, place_m, view.motions[0].velocity)


def _notes(stage: str, slopes: str, poses: str, found: Apart | None) -> list[str]:
    if found is None or found.shared or found.uncertainty_s >= SURE_S:
        return []
    size = format_estimate(abs(found.later_s), found.uncertainty_s, "s")
    when = "after" if found.later_s > 0.0 else "before"
    return [f"{slopes} of {stage} come {size} {when} its {poses}: taken as of another clock"]


def rates_apart(view: Scene, index: int) -> Apart | None:
    """By how much a stage's rates come later than its attitudes; None: nothing to tell it by."""
    return _least_uncertain(view, index, None, view.motions[index].rate)


def velocities_apart(view: Scene, index: int) -> Apart | None:
    """By how much a stage's velocities come later than its places.

    A lever arm that is off looks like a lag in a turn: where it explains the places clearly better,
    and with it both carry the same stamps, the lag beside such an arm counts.
    """
    place_m, column = view.rows[index].position_m, view.motions[index].velocity
    alone = _lags(view, index, place_m, column)
    found = min((one for one in alone if one), key=lambda one: one.uncertainty_s, default=None)
    if found is None or found.shared:
        return found
    beside = _lags(view, index, place_m, column, arm=True)
    pairs = [(b, _nats(a, b)) for a, b in zip(alone, beside, strict=True) if a and b and b.shared]
    return next((b for b, nats in pairs if nats > CLEARLY_NATS), found)


def _least_uncertain(
    view: Scene, index: int, place_m: Array | None, column: SplinePieces
) -> Apart | None:
    """Of windows of several lengths: long ones hold much motion, short ones are many."""
    found = _lags(view, index, place_m, column)
    return min((one for one in found if one), key=lambda one: one.uncertainty_s, default=None)


def _lags(
    view: Scene, index: int, place_m: Array | None, column: SplinePieces, *, arm: bool = False
) -> list[Apart | None]:
    """At each length of window that the log has; arm: beside a lever arm that is off."""
    rotation = view.rows[index].rotation
    spans = [each for s in LENGTHS_S if (each := windows_of(view.log.time_s, s)) is not None]
    return [
        _apart(each, moved_between(each, place_m, rotation), column, _swung(each, rotation, arm))
        for each in spans
    ]


def _swung(spans: WindowRows, rotation: Array, arm: bool) -> Array:
    """What an arm of 1 m along each body axis adds to the change of place, (3 windows, 0 or 3)."""
    turned = rotation[spans.rows]
    swung: Array = (turned[spans.last] - turned[spans.first]).reshape(-1, 3)
    return swung[:, : 3 if arm else 0]


def _apart(spans: WindowRows, moved: Array, column: SplinePieces, swung: Array) -> Apart | None:
    """Least squares of the lag s, a constant c of the column and an arm d over windows of length h:

    moved = integral of the column from t0 + s to t1 + s, less c h, and the swing of d.
    """
    begin, end = spans.time_s[spans.first], spans.time_s[spans.last]
    constants = np.column_stack([np.kron((end - begin)[:, None], np.eye(3)), swung])
    later_s, error_s, variance = 0.0, np.inf, 0.0
    for _ in range(ROUNDS):
        own = column.integral(begin + later_s, end + later_s, begin)
        slope = column.value(end + later_s, begin) - column.value(begin + later_s, begin)
        design = np.column_stack([slope.ravel(), constants])
        normal = design.T @ design
        if np.linalg.cond(normal) > 1e12:
            return None
        change = np.linalg.solve(normal, design.T @ (moved - own).ravel())
        left = (moved - own).ravel() - design @ change
        variance = float(left @ left) / max(left.size - design.shape[1], 1)
        later_s += float(change[0])
        error_s = float(np.sqrt(variance * np.linalg.inv(normal)[0, 0]))
    return Apart(later_s, error_s, variance, moved.size)
