"""Tolerance bounds over sessions: what the quantiles of a few sessions say of all future ones."""

from __future__ import annotations

import math
from functools import cache
from typing import Final, Literal

import numpy as np

from syncline_design.clocks.series import Array

Method = Literal["log-normal", "order statistic"]
LEFT_SKEWED: Final = -0.5
LEAST_SESSIONS: Final = 3  # from two the bound holds too, thousands of times too wide


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


def tolerance_bound(
    quantiles: Array, share: float, confidence: float, effective: float = math.inf
) -> tuple[float, Method]:
    """Bound [s] that covers a share of future sessions' quantiles, and what it is made by.

    effective: as many independent sessions as these say as much as, where they are not.

    The larger of the largest session, which alone is a bound from as many sessions on as the order
    statistic needs, and of a tolerance bound that takes a transform of the quantiles as normal.
    """
    largest = float(np.max(quantiles))
    count = max(2, math.floor(min(quantiles.shape[0], effective)))
    enough = count >= sessions_of_order_statistic(share, confidence)
    method: Method = "order statistic" if enough else "log-normal"
    positive = quantiles[quantiles > 0.0]
    if quantiles.shape[0] < 2 or not positive.shape[0]:
        return largest, method
    k = normal_factor(count, share, raised_confidence(count, confidence))
    return max(largest, _raised(np.maximum(quantiles, float(np.min(positive))), k)), method


def raised_confidence(count: int, confidence: float) -> float:
    """The confidence of the transformed part: sessions are of its shape only about.

    The more sessions there are, the less of a miss is due to their number and the more to their
    shape: of what may be missed 2/3 is taken at 5 sessions, 1/3 from 20 on.  Measured on clocks of
    six kinds (benchmarks/timing.py): without it flicker noise holds in 88 % at 20 sessions.
    """
    return 1.0 - (1.0 - confidence) / (1.0 + min(count / 10.0, 2.0))


def _raised(quantiles: Array, k: float) -> float:
    """The larger bound of log-normal and of cube-root-normal quantiles.

    Small sessions say nothing about large ones: logarithms further below the median than the
    largest is above it count as if they were not.  Where many sessions are much smaller than the
    rest (skewness of the logarithms below -0.5) they are not log-normal: the cube root alone
    counts, which makes squares of normal values nearly normal (Wilson and Hilferty 1931).
    """
    logs = np.log(quantiles)
    cubic = max(0.0, _mean_plus(np.cbrt(quantiles), k)) ** 3
    away = logs - np.mean(logs)
    spread = float(np.mean(away**2))
    if spread == 0.0 or float(np.mean(away**3)) < LEFT_SKEWED * spread**1.5:
        return cubic
    low = 2.0 * float(np.median(logs)) - float(np.max(logs))
    return max(cubic, math.exp(min(_mean_plus(np.maximum(logs, low), k), 700.0)))


def _mean_plus(values: Array, k: float) -> float:
    """mean + k s; s: standard deviation, or that of the upper side where this is the wider one."""
    away = values - np.mean(values)
    upper = 2.0 * float(np.sum(away[away > 0.0] ** 2)) / (values.shape[0] - 1)
    return float(np.mean(values)) + k * math.sqrt(max(float(np.var(values, ddof=1)), upper))
