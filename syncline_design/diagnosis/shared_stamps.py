"""Which columns of motion carry the stamps of the poses that they are the slope of.

A receiver puts one stamp on its places and its velocities, an INS one on its attitudes and its
rates: where these come late, their slopes come as late.  Taken at the stamps of another clock,
such rates turn an attitude that is s late by w(t + s) s, which errs by dw/dt s^2: enough for other
sensors' delays to fit better than the true one.  Whose stamps they are, a log says itself: columns
are held against their own poses, shifted in time.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from syncline_design.diagnosis.agreement import WindowRows, moved_between, windows_of
from syncline_design.diagnosis.scene import Scene
from syncline_design.diagnosis.trajectory import SplinePieces
from syncline_design.effects.record import Array
from syncline_design.logs.log import Log
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import format_estimate

LENGTHS_S = (0.4, 0.8, 1.6, 3.2, 6.4)
ROUNDS = 3
ERRORS = 3.0  # standard errors by which stamps of one device may seem apart
ALIKE_S = 3e-3  # and by which they may be: what their own filters delay
SURE_S = 5e-3  # standard error from which nothing is said: neither matters then


@dataclass(frozen=True, slots=True)
class Apart:
    """By how much columns come later than the poses that they are the slope of [s]."""

    later_s: float
    uncertainty_s: float

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
    if log.kind == "position":
        return log
    stages, notes = [], []
    for k, stage in enumerate(log.stages):
        rates, velocities = rates_apart(view, k), None
        if k == 0 and not stage.follows_reference:
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
    """By how much a stage's velocities come later than its places."""
    place_m = view.rows[index].position_m
    return _least_uncertain(view, index, place_m, view.motions[index].velocity)


def _least_uncertain(
    view: Scene, index: int, place_m: Array | None, column: SplinePieces
) -> Apart | None:
    """Of windows of several lengths: long ones hold much motion, short ones are many."""
    rotation = view.rows[index].rotation
    windows = [windows_of(view.log.time_s, length_s) for length_s in LENGTHS_S]
    found = [
        _apart(spans, moved_between(spans, place_m, rotation), column) for spans in windows if spans
    ]
    return min((one for one in found if one), key=lambda one: one.uncertainty_s, default=None)


def _apart(spans: WindowRows, moved: Array, column: SplinePieces) -> Apart | None:
    """Least squares of the lag s and a constant c of the column over windows of length h:

    moved = integral of the column from t0 + s to t1 + s, less c h.
    """
    begin, end = spans.time_s[spans.first], spans.time_s[spans.last]
    constants = np.kron((end - begin)[:, None], np.eye(3))
    later_s, error_s = 0.0, np.inf
    for _ in range(ROUNDS):
        own = column.integral(begin + later_s, end + later_s, begin)
        slope = column.value(end + later_s, begin) - column.value(begin + later_s, begin)
        design = np.column_stack([slope.ravel(), constants])
        normal = design.T @ design
        if np.linalg.cond(normal) > 1e12:
            return None
        change = np.linalg.solve(normal, design.T @ (moved - own).ravel())
        left = (moved - own).ravel() - design @ change
        variance = float(left @ left) / max(left.size - 4, 1)
        later_s += float(change[0])
        error_s = float(np.sqrt(variance * np.linalg.inv(normal)[0, 0]))
    return Apart(later_s, error_s)
