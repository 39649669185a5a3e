"""Confidence intervals that assume no shape: order statistics and binomial counts.

Standard library only, so that `check` need not import SciPy.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from statistics import NormalDist

_TINY = 1e-300


def incomplete_beta(a: float, b: float, x: float) -> float:
    """Regularised incomplete beta function I_x(a, b), a, b > 0, 0 <= x <= 1.

    Continued fraction (NIST DLMF 8.17.22) by Lentz's method, on the side where it converges fast
    (DLMF 8.17.4).  Absolute error below 1e-6 up to a + b = 1e8, 5e-9 up to 2e6, 1e-9 up to 2e5,
    most of it from the logarithms of the gamma function (tested against mpmath).
    """
    if x <= 0.0 or x >= 1.0:
        return float(x >= 1.0)
    if x > (a + 1.0) / (a + b + 2.0):
        return 1.0 - incomplete_beta(b, a, 1.0 - x)
    log_front = a * math.log(x) + b * math.log1p(-x) - _log_beta(a, b)
    return math.exp(log_front) / a * _beta_fraction(a, b, x)


def _log_beta(a: float, b: float) -> float:
    return math.lgamma(a) + math.lgamma(b) - math.lgamma(a + b)


def _beta_fraction(a: float, b: float, x: float) -> float:
    upper, lower = 1.0, 1.0 / _away_from_zero(1.0 - (a + b) * x / (a + 1.0))
    value = lower
    for m in range(1, 200_000):
        even = m * (b - m) * x / ((a + 2 * m - 1.0) * (a + 2 * m))
        odd = -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1.0))
        for term in (even, odd):
            lower = 1.0 / _away_from_zero(1.0 + term * lower)
            upper = _away_from_zero(1.0 + term / upper)
            change = lower * upper
            value *= change
        if abs(change - 1.0) < 1e-15:
            break
    return value


def _away_from_zero(value: float) -> float:
    return value if abs(value) > _TINY else _TINY


def binomial_cdf(successes: int, trials: int, probability: float) -> float:
    """P(B <= k), B ~ Bin(n, p): I_{1-p}(n - k, k + 1) (DLMF 8.17.5)."""
    if successes < 0 or successes >= trials:
        return float(successes >= trials)
    return incomplete_beta(trials - successes, successes + 1.0, 1.0 - probability)


def binomial_quantile(level: float, trials: int, probability: float) -> int:
    """The smallest k with P(B <= k) >= level, B ~ Bin(n, p).

    Starts at the normal approximation and walks to the exact answer by the ratio of neighbouring
    probabilities.
    """
    spread = math.sqrt(trials * probability * (1.0 - probability))
    k = round(trials * probability + NormalDist().inv_cdf(level) * spread)
    k = min(max(k, 0), trials)
    below = binomial_cdf(k - 1, trials, probability)
    at = _binomial_probability(k, trials, probability)
    while k > 0 and below >= level:
        k -= 1
        at *= (k + 1) / (trials - k) * (1.0 - probability) / probability
        below -= at
    while k < trials and below + at < level:
        below += at
        at *= (trials - k) / (k + 1) * probability / (1.0 - probability)
        k += 1
    return k


def _binomial_probability(k: int, trials: int, probability: float) -> float:
    log_ways = math.lgamma(trials + 1) - math.lgamma(k + 1) - math.lgamma(trials - k + 1)
    return math.exp(log_ways + k * math.log(probability) + (trials - k) * math.log1p(-probability))


def quantile_ranks(quantile: float, samples: int, confidence: float = 0.95) -> tuple[int, int, int]:
    """(low, middle, high): ranks, 1 the smallest, whose values enclose the quantile.

    P(X_(low) <= q <= X_(high)) >= confidence whatever the distribution, by the binomial count of
    samples below q (H. A. David, H. N. Nagaraja, Order Statistics, 3rd ed., 7.1).  low = 0 and
    high = samples + 1 mean that no sample bounds the quantile on that side.
    """
    tail = 0.5 * (1.0 - confidence)
    low = binomial_quantile(tail, samples, quantile)
    high = binomial_quantile(1.0 - tail, samples, quantile) + 1
    middle = min(max(math.ceil(quantile * samples), 1), samples)
    return low, middle, high


def proportion_interval(
    successes: int, trials: int, confidence: float = 0.95
) -> tuple[float, float]:
    """Clopper-Pearson interval of a proportion: covers with at least `confidence`.

    C. J. Clopper, E. S. Pearson, Biometrika 26 (1934) 404-413.
    """
    tail = 0.5 * (1.0 - confidence)
    low, high = 0.0, 1.0
    near = (successes + 0.5) / (trials + 1.0)
    reach = 8.0 * math.sqrt(near * (1.0 - near) / trials)
    bracket = max(near - reach, 0.0), min(near + reach, 1.0)
    z = _score(tail)
    if successes > 0:
        low = _rising_root(lambda p: -_score(binomial_cdf(successes - 1, trials, p)) - z, bracket)
    if successes < trials:
        high = _rising_root(lambda p: z - _score(binomial_cdf(successes, trials, p)), bracket)
    return low, high


def _score(probability: float) -> float:
    """The standard normal quantile: what a binomial tail is nearly a straight line in."""
    return NormalDist().inv_cdf(min(max(probability, 1e-300), 1.0 - 2.0**-53))


def _rising_root(function: Callable[[float], float], bracket: tuple[float, float]) -> float:
    """Root on [0, 1] of a rising function: false position with the Illinois halving.

    `bracket` is where to look first; a side that does not hold falls back to 0 or 1.
    """
    low, high = bracket
    at_low, at_high = function(low), function(high)
    if at_low > 0.0:
        low, at_low = 0.0, function(0.0)
    if at_high < 0.0:
        high, at_high = 1.0, function(1.0)
    kept = 0.0  # the side that the last guess left where it was
    before = math.inf
    for _ in range(200):
        if high - low <= 1e-12 * high or at_high == at_low:
            break
        guess = high - at_high * (high - low) / (at_high - at_low)
        if abs(guess - before) <= 1e-14 * guess:
            return guess
        before, value = guess, function(guess)
        if value > 0.0:
            high, at_high, at_low = guess, value, at_low * (0.5 if kept < 0.0 else 1.0)
            kept = -1.0
        else:
            low, at_low, at_high = guess, value, at_high * (0.5 if kept > 0.0 else 1.0)
            kept = 1.0
    return 0.5 * (low + high)
