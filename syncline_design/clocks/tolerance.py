"""Tolerance bounds over sessions: what the quantiles of a few sessions say of all future ones."""

from __future__ import annotations

import math
from functools import cache
from typing import Final, Literal

import numpy as np

from syncline_design.clocks.series import Array

Method = Literal["log-normal", "order statistic"]
LEAST_SESSIONS: Final = 5  # what the recipe was measured from


def sessions_of_order_statistic(share: float, confidence: float) -> int:
    """The sessions from which the largest of them is a bound: 1 - share^n >= confidence.

    59 for 95 % of sessions at 95 % confidence, 299 for 99 % at 95 % (Wilks 1941).
    """
    return math.ceil(math.log1p(-confidence) / math.log(share) - 1e-9)


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


def tolerance_bound(quantiles: Array, share: float, confidence: float) -> tuple[float, Method]:
    """Bound [s] that covers a share of future sessions' quantiles, and what it is made by.

    The larger of the largest session, which alone is a bound from as many sessions on as the order
    statistic needs, and of a log-normal tolerance bound.
    """
    largest = float(np.max(quantiles))
    count = int(quantiles.shape[0])
    enough = count >= sessions_of_order_statistic(share, confidence)
    method: Method = "order statistic" if enough else "log-normal"
    positive = quantiles[quantiles > 0.0]
    if count < 2 or not positive.shape[0]:
        return largest, method
    logs = np.log(np.maximum(quantiles, float(np.min(positive))))
    k = normal_factor(count, share, raised_confidence(count, confidence))
    raised = float(np.mean(logs)) + k * _spread(logs)
    return max(largest, math.exp(min(raised, 700.0))), method


def raised_confidence(count: int, confidence: float) -> float:
    """The confidence of the log-normal part: sessions are log-normal only about.

    The more sessions there are, the less of a miss is due to their number and the more to their
    shape: of what may be missed 2/3 is taken at 5 sessions, 1/3 from 20 on.  Measured on clocks of
    six kinds (benchmarks/timing.py): without it flicker noise holds in 88 % at 20 sessions.
    """
    return 1.0 - (1.0 - confidence) / (1.0 + min(count / 10.0, 2.0))


def _spread(logs: Array) -> float:
    """Standard deviation, or that of the upper side where this is the wider one."""
    away = logs - np.mean(logs)
    upper = 2.0 * float(np.sum(away[away > 0.0] ** 2)) / (logs.shape[0] - 1)
    return math.sqrt(max(float(np.var(logs, ddof=1)), upper))
