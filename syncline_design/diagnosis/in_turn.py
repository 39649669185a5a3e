"""Every second (third, ...) row of a log that is late: two drivers by turns, a buffer of two.

Of row i with the error e_i, its covariance C_i and c_i what a second of delay of a sensor does,
    t_i = c_i' C_i^-1 e_i / (c_i' C_i^-1 c_i)
is the delay that it shows by itself.  Rows k, k + m, k + 2 m, ... are late by themselves where
the mean of their t_i is another than that of the rest (Welch's test, by how far the t_i of either
scatter themselves: a few rows that are very late are no pattern).
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from syncline_design.diagnosis.candidates import (
    Candidate,
    Signature,
    candidates,
    plain_signatures,
)
from syncline_design.diagnosis.judged import log_f
from syncline_design.diagnosis.scene import Scene
from syncline_design.effects import plain_delay
from syncline_design.effects.acting import Acting
from syncline_design.effects.record import Array

PERIODS: Final = range(2, 9)
CHANCE: Final = 1e-9  # that rows of one delay differ so much, each sensor and pattern paid for
LEAST_ROWS: Final = 20  # of a pattern
Mask = NDArray[np.bool_]
_Told = tuple[float, float]


def in_turn(view: Scene, root: Array, held: Mask) -> Mask | None:
    """Rows that are late (or early) by turns with the others; None where none are.

    root (n, 3, 3): of the inverse of every row's covariance.
    """
    delay = plain_delay().name
    best, clearest = None, math.log(CHANCE)
    found = [one for one in candidates(view) if one.effect.name == delay]
    for one in plain_signatures(view, found):
        own, weight = _each(view, root, one, view.error())
        weight = np.where(held, 0.0, weight)
        for period in PERIODS:
            for first in range(period):
                rows = np.arange(len(view)) % period == first
                log_p = _log_p(own, weight, rows) + math.log(len(found) * sum(PERIODS))
                if log_p < clearest:
                    best, clearest = _later(own, weight, rows, period), log_p
    return best


def than_the_others(view: Scene, root: Array, held: Mask, rows: Mask, late: Acting) -> _Told:
    """By how much rows are later than the others once a delay of theirs is undone [s], and its
    standard uncertainty: what wanders slowly is the same of both."""
    (one,) = plain_signatures(view, [Candidate(late.effect, late.sensor, late.stage)])
    error = np.where(rows[:, None], view.error((late,)), view.error())
    own, weight = _each(view, root, one, error)
    weight = np.where(held, 0.0, weight)
    inside, beside = (_mean(own, weight, each) for each in (rows, ~rows))
    return inside[0] - beside[0], math.sqrt(inside[1] + beside[1])


def _each(view: Scene, root: Array, one: Signature, error: Array) -> tuple[Array, Array]:
    """The delay that each row shows by itself, and its weight (n,)."""
    left = np.einsum("nij,nj->ni", root, np.nan_to_num(error))
    along = np.einsum("nij,nj->ni", root, np.nan_to_num(one.columns[:, :, 0]))
    weight = np.sum(along**2, axis=1)
    return np.sum(along * left, axis=1) / np.maximum(weight, 1e-300), weight


def _later(own: Array, weight: Array, rows: Mask, period: int) -> Mask:
    """Of two that take turns the one that is further from nothing."""
    inside, beside = (_mean(own, weight, each)[0] for each in (rows, ~rows))
    return ~rows if period == PERIODS[0] and abs(beside) > abs(inside) else rows


def _mean(own: Array, weight: Array, rows: Mask) -> tuple[float, float, int]:
    """Weighted mean, its variance by the scatter about it, and of how many rows."""
    w, t = weight[rows], own[rows]
    whole = float(np.sum(w))
    count = int(np.sum(w > 0.0))
    if count < LEAST_ROWS or not whole > 0.0:
        return 0.0, math.inf, count
    mean = float(np.sum(w * t)) / whole
    return mean, float(np.sum((w * (t - mean)) ** 2)) / whole**2, count


def _log_p(own: Array, weight: Array, rows: Mask) -> float:
    a, b = _mean(own, weight, rows), _mean(own, weight, ~rows)
    variance = a[1] + b[1]
    if not 0.0 < variance < math.inf:
        return 0.0
    return log_f((a[0] - b[0]) ** 2 / variance, 1, min(a[2], b[2]) - 1)
