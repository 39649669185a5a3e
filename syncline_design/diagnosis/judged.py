"""Parameters as a log's slow states see them: how sure, how likely by chance, and as a course.

Sources: Fisher's F of Hotelling's T^2 for values whose covariance is a jackknife's over few parts;
one-way analysis of variance for a course.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.special import betainc, gammaincc

from syncline_design.diagnosis.positive import pseudo_inverse
from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.distributions import student_limit
from syncline_design.model.normal import NORMAL_95

QUARTERS = 4
LEAST_LOG_P = -700.0


@dataclass(frozen=True, slots=True)
class Judged:
    """Parameters of one group of columns as these states see them.

    values: what they are by the states.  model: their covariance by the states.  jackknives:
    covariance by leaving out one part of the log after the other, and the number of parts: of
    stretches of time, and of targets where they are few.  No variance of what is not seen at all.
    """

    values: Array
    model: Array
    jackknives: tuple[tuple[Array, int], ...] = ()

    @property
    def spread(self) -> Array:
        """Standard uncertainty, the largest of all."""
        variance = np.diag(self.model)
        for covariance, _ in self.jackknives:
            variance = np.maximum(variance, np.diag(covariance))
        return np.sqrt(np.maximum(variance, 0.0))

    @property
    def coverage(self) -> float:
        """Standard uncertainties that a 95 % interval spans to either side."""
        counts = [count for _, count in self.jackknives]
        return student_limit(0.025, min(counts) - 1) if counts else NORMAL_95

    @property
    def model_log_p(self) -> float:
        """log of the chance that these states alone make values at least as large."""
        seen = np.diag(self.model) > 0.0
        size = int(np.sum(seen))
        if size == 0:
            return 0.0
        return _log_chi2(_square(self.values[seen], self.model[seen][:, seen]), size)

    @property
    def log_p(self) -> float:
        """log of the chance that noise alone makes values at least as large, the largest.

        Hotelling's T^2 needs more groups of rows than there are values: fewer say nothing.
        """
        seen = np.diag(self.model) > 0.0
        size = int(np.sum(seen))
        if size == 0:
            return 0.0
        values = self.values[seen]
        found = self.model_log_p
        for covariance, count in self.jackknives:
            own = count - size
            if own <= 0:
                continue
            share = _square(values, covariance[seen][:, seen]) * own / (size * (count - 1))
            found = max(found, log_f(share, size, own))
        return found


def _log_chi2(square: float, freedom: int) -> float:
    """log of the upper tail of chi-square."""
    return _log(float(gammaincc(0.5 * freedom, 0.5 * square)))


def log_f(share: float, first: int, second: int) -> float:
    """log of the upper tail of Fisher's F, by the incomplete beta function."""
    return _log(float(betainc(0.5 * second, 0.5 * first, second / (second + first * share))))


def _log(chance: float) -> float:
    return math.log(chance) if chance > 0.0 else LEAST_LOG_P


def _square(values: Array, covariance: Array) -> float:
    scale = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    inverse = pseudo_inverse(covariance / scale[:, None] / scale, 1e-10)
    scaled = values / scale
    return float(scaled @ inverse @ scaled)


@dataclass(frozen=True, slots=True)
class Course:
    """A parameter in the quarters of a log: values, and the log of the chance that it is one."""

    values: tuple[float, ...]
    log_p: float


def course_of(own: Array, weight: Array) -> Course:
    """Weighted one-way analysis of variance of the blocks' values over QUARTERS of the blocks."""
    groups = np.arange(own.shape[0]) * QUARTERS // own.shape[0]
    total = np.array([np.sum(weight[groups == q]) for q in range(QUARTERS)])
    if np.any(total <= 0.0):
        return Course((), 0.0)
    parts = [np.sum((weight * own)[groups == q]) / total[q] for q in range(QUARTERS)]
    means = np.array(parts)
    whole = float(np.sum(total * means) / np.sum(total))
    between = float(np.sum(total * (means - whole) ** 2)) / (QUARTERS - 1)
    inside = float(np.sum(weight * (own - means[groups]) ** 2)) / (own.shape[0] - QUARTERS)
    log_p = log_f(between / max(inside, 1e-300), QUARTERS - 1, own.shape[0] - QUARTERS)
    return Course(tuple(float(v) for v in means), log_p)
