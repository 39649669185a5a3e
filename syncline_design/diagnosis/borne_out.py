"""Attitudes of a position log in another convention, where the arm is short beside the noise.

The places alone cannot tell a heading that is turned from an arm that is.  The log's own motion
can: where a vehicle goes is where it heads, and its rates are the turns of its attitude.  What they
bear out, the error has to bear out as well: undoing it leaves less in the blocks of the log, and as
little as the best arm would.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from syncline_design.diagnosis.checks import contradicted_columns
from syncline_design.diagnosis.convention import Convention
from syncline_design.diagnosis.conventions import attitude_signs, yaw_quarter
from syncline_design.diagnosis.gross_trials import error_mended, usual_size
from syncline_design.diagnosis.scene import Scene, scene
from syncline_design.diagnosis.swapped import angles_exchanged
from syncline_design.effects.kinematics import rotate
from syncline_design.effects.record import Array
from syncline_design.logs.log import Log
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.system import System

STRAIGHT_ON = 0.9  # of the way that a vehicle goes, along one direction in its body
WITHIN_RAD = math.radians(22.5)  # half of what is nearer to this quarter turn than to the next
BLOCKS = 16
CLEAR = 2.602  # standard errors between blocks: by chance in 1 of 100, and the motion says it too
AS_GOOD = 1.1  # times what the best arm leaves
FALLS_TO = 1.0 / 3.0  # of the arm that shows, with a heading turned back
COURSE = "the vehicle then heads where it goes"
RATES = "the rates are then those of the attitude"


@dataclass(frozen=True, slots=True)
class BorneOut:
    """A convention of the attitude, and what of the log's own motion bears it out."""

    convention: Convention
    witness: str
    size_m: float


def borne_out(system: System, log: Log, base: Scene) -> BorneOut | None:
    """The convention of a position log's attitudes that its own motion and its error both show.

    Of several the simplest that leaves no more than others, as far as the blocks of the log tell.
    """
    if log.kind != "position" or len(system.stages) != 1:
        return None
    before = base.error()
    arm_m, least_m = _best_arm(base, before)
    best, best_left = None, before
    ways = tuple(_by_rates(system, base)) or tuple(_by_course(base))
    for alike, witness in sorted(ways, key=lambda way: way[0][0].work):
        lefts = [error_mended(system, log, base, one.mend) for one in alike]
        size_m, at = min((usual_size(left), k) for k, left in enumerate(lefts))
        left_m, _ = _best_arm(base, lefts[at])
        gone = witness == RATES or np.linalg.norm(left_m) < FALLS_TO * np.linalg.norm(arm_m)
        if gone and size_m < AS_GOOD * least_m and _falls(best_left, lefts[at]):
            best, best_left = BorneOut(alike[at], witness, size_m), lefts[at]
    return best


def heading_off(base: Scene) -> float | None:
    """By how much the heading is turned from the way the vehicle goes [rad]; None: no one way.

    Source: the mean of directions, weighted by speed, e.g. Mardia and Jupp, Directional Statistics.
    """
    held = base.log.stages[0]
    way = held.velocity_mps[:, 0] + 1j * held.velocity_mps[:, 1]
    total = float(np.sum(np.abs(way)))
    mean = complex(np.sum(way * np.exp(-1j * held.euler_rad[:, 2])))
    if not abs(mean) > STRAIGHT_ON * total:
        return None
    return -math.atan2(mean.imag, mean.real)


def _by_course(base: Scene) -> Iterator[tuple[tuple[Convention, ...], str]]:
    off = heading_off(base)
    quarter = 0 if off is None else round(off / (0.5 * math.pi))
    if off is None or not quarter or abs(off - 0.5 * math.pi * quarter) > WITHIN_RAD:
        return
    yield (yaw_quarter(90.0 * quarter if quarter > -2 else 180.0),), COURSE


def _by_rates(system: System, base: Scene) -> Iterator[tuple[tuple[Convention, ...], str]]:
    """Angles exchanged or turned round, where rates contradict them as they are alone.

    A heading counted from another direction has the same rates: of its zeros the error tells.
    """
    if not _contradicted(base):
        return
    ways = (*((one,) for one in angles_exchanged()), *attitude_signs())
    for alike in ways:
        if not _contradicted(scene(system, alike[0].mend(base.log), base.known)):
            yield alike, RATES


def _contradicted(view: Scene) -> bool:
    return any(one.code == "rate_columns" for one in contradicted_columns(view))


def _best_arm(base: Scene, error: Array) -> tuple[Array, float]:
    """By how much the arm seems off [m], body axes, and the usual error with that undone."""
    rotation = base.rows[0].rotation
    known = np.nan_to_num(error)
    arm: Array = np.median(rotate(np.swapaxes(rotation, 1, 2), known), axis=0)
    return arm, usual_size(error - rotate(rotation, arm))


def _falls(before: Array, after: Array) -> bool:
    """Whether the squares of the error fall by far more than they differ between blocks."""
    fall = np.nansum(before**2, axis=1) - np.nansum(after**2, axis=1)
    means = np.array([float(np.mean(part)) for part in np.array_split(fall, BLOCKS)])
    spread = float(np.std(means, ddof=1)) / math.sqrt(BLOCKS)
    return float(np.mean(means)) > CLEAR * spread
