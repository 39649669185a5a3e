"""Tolerance bounds over sessions: what the quantiles of a few sessions say of all future ones."""

from __future__ import annotations

import math
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

    A log-normal tolerance bound, never below the largest session; from as many sessions on as the
    order statistic needs, the largest one.
    """
    largest = float(np.max(quantiles))
    count = int(quantiles.shape[0])
    if count >= sessions_of_order_statistic(share, confidence):
        return largest, "order statistic"
    positive = quantiles[quantiles > 0.0]
    if not positive.shape[0]:
        return 0.0, "log-normal"
    logs = np.log(np.maximum(quantiles, float(np.min(positive))))
    k = normal_factor(count, share, confidence)
    raised = float(np.mean(logs)) + k * float(np.std(logs, ddof=1))
    return max(largest, math.exp(min(raised, 700.0))), "log-normal"
