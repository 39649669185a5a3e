"""Tolerance bounds over sessions: what the quantiles of a few sessions say of all future ones."""

from __future__ import annotations

import math
from functools import cache
from typing import Final, Literal

import numpy as np

from syncline_design.clocks.series import Array

Method = Literal["range", "order statistic"]
LEFT_SKEWED: Final = -0.5
LEAST_SESSIONS: Final = 3  # from two the bound holds too, hundreds of times too wide
TAIL_INDEX: Final = 1.0 / 3.0  # of Student's t of three degrees of freedom
_CELLS: Final = 4000  # of an integral over probability


def sessions_of_order_statistic(share: float, confidence: float) -> int:
    """The sessions from which the largest of them is a bound: 1 - share^n >= confidence.

    59 for 95 % of sessions at 95 % confidence, 299 for 99 % at 95 % (Wilks 1941).
    """
    return math.ceil(math.log1p(-confidence) / math.log(share) - 1e-9)


def unseen_share(count: float, confidence: float) -> float:
    """What may be true of so many of all starts without having come in any of these sessions.

    (1 - p)^n = 1 - confidence: the upper limit of a proportion seen 0 times in n (Clopper and
    Pearson 1934), whatever the distribution.
    """
    return -math.expm1(math.log1p(-confidence) / count)


@cache
def normal_factor(count: int, share: float, confidence: float) -> float:
    """k of mean + k s, a one-sided tolerance bound of normal values [1].

    k = t_{n-1, confidence}(z_share sqrt(n)) / sqrt(n), t the noncentral Student quantile
    (ISO 16269-6; Owen 1963).
    """
    from scipy.special import ndtri
    from scipy.stats import nct

    root = math.sqrt(count)
    return float(nct.ppf(confidence, count - 1, float(ndtri(share)) * root)) / root


@cache
def range_factor(count: int, share: float, confidence: float) -> float:
    """c of largest + c (largest - smallest), a tolerance bound of values with a heavy tail [1].

    Of the generalised Pareto distribution with the tail index 1/3,
    F(x) = 1 - (1 + x / 3)^-3 (Pickands 1975), whatever its level and its unit.  With the largest
    at its probability u, the others lie below it at random, so that the bound misses the quantile
    q of `share` with the chance n integral of max(u - F(m(u)), 0)^(n-1) over u from 0 to share,
    m = x(u) - (q - x(u)) / c.  Summed over v = (u / share)^n.  0 where the largest alone is a
    bound.
    """
    from scipy.optimize import brentq

    if count >= sessions_of_order_statistic(share, confidence):
        return 0.0
    places = share * ((np.arange(_CELLS) + 0.5) / _CELLS) ** (1.0 / count)
    values, sought = _pareto_quantile(places), float(_pareto_quantile(np.array(share)))

    def miss(factor: float) -> float:
        least = _pareto_share(np.maximum(values - (sought - values) / factor, 0.0))
        between = np.maximum(1.0 - least / places, 0.0)
        return float(share**count * np.mean(between ** (count - 1)))

    return float(brentq(lambda factor: miss(factor) - (1.0 - confidence), 1e-9, 1e9))


def _pareto_quantile(share: Array) -> Array:
    found: Array = np.expm1(-TAIL_INDEX * np.log1p(-share)) / TAIL_INDEX
    return found


def _pareto_share(value: Array) -> Array:
    found: Array = -np.expm1(-np.log1p(TAIL_INDEX * value) / TAIL_INDEX)
    return found


def tolerance_bound(
    quantiles: Array, share: float, confidence: float, effective: float = math.inf
) -> tuple[float, Method]:
    """Bound [s] that covers a share of future sessions' quantiles, and what it is made by.

    effective: as many independent sessions as these say as much as, where they are not.

    What a session keeps to is a floor of noise and, beyond it, what its start brought: skewed to
    the right further than a log-normal value.  So the larger is taken of what the range of these
    sessions says of a heavy tail, and of what their logarithms say, where sessions differ by
    orders of magnitude.
    """
    largest = float(np.max(quantiles))
    count = max(2, math.floor(min(quantiles.shape[0], effective)))
    enough = count >= sessions_of_order_statistic(share, confidence)
    method: Method = "order statistic" if enough else "range"
    positive = quantiles[quantiles > 0.0]
    if quantiles.shape[0] < 2 or not positive.shape[0]:
        return largest, method
    apart = largest - float(np.min(quantiles))
    ranged = largest + range_factor(count, share, confidence) * apart
    logs = np.log(np.maximum(quantiles, float(np.min(positive))))
    return max(ranged, _log_normal(logs, normal_factor(count, share, confidence))), method


def _log_normal(logs: Array, k: float) -> float:
    """exp(mean + k s) of logarithms of sessions' quantiles; 0 where they are not log-normal.

    Small sessions say nothing about large ones: logarithms further below the median than the
    largest is above it count as if they were not.  Where many sessions are much smaller than the
    rest (skewness of the logarithms below -0.5) they are of another shape.
    """
    away = logs - np.mean(logs)
    spread = float(np.mean(away**2))
    if spread == 0.0 or float(np.mean(away**3)) < LEFT_SKEWED * spread**1.5:
        return 0.0
    raised = np.maximum(logs, 2.0 * float(np.median(logs)) - float(np.max(logs)))
    return math.exp(min(float(np.mean(raised)) + k * float(np.std(raised, ddof=1)), 700.0))
