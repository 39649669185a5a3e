"""The kind of a clock's noise: TDEV, MTIE, how long it remembers, whether it stays the same.

Terms and formulas: ITU-T G.810; IEEE Std 1139.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from syncline_design.clocks.series import Array

MOST_POINTS: Final = 200_000  # of a grid; longer sessions are thinned
_STEPS_A_DECADE: Final = 6


def on_a_grid(time_s: Array, offset_s: Array) -> tuple[float, Array]:
    """Offsets at equal steps of the median interval, by interpolation: (step [s], offsets [s])."""
    steps = np.diff(time_s)
    steps = steps[steps > 0.0]
    if not steps.shape[0]:
        return math.nan, offset_s[:0]
    span = float(time_s[-1] - time_s[0])
    step = max(float(np.median(steps)), span / MOST_POINTS)
    count = int(span / step + 1e-6) + 1
    grid = time_s[0] + step * np.arange(count)
    return step, np.interp(grid, time_s, offset_s)


def averaging_factors(count: int, span: int) -> list[int]:
    """1, 2, 3, 5, 7, 10, ... as long as `span` of them fit into the samples."""
    most = (count - 1) // span
    if most < 1:
        return []
    wanted = np.geomspace(1, most, max(2, int(_STEPS_A_DECADE * math.log10(most + 1)) + 1))
    return sorted({round(float(m)) for m in wanted})


def tdev(offset_s: Array, factor: int) -> float:
    """Time deviation [s] at an averaging time of `factor` steps, fully overlapping.

    TVAR = 1 / (6 n^2 (N - 3n + 1)) sum_j (sum_{i=j}^{j+n-1} (x_{i+2n} - 2 x_{i+n} + x_i))^2
    (ITU-T G.810, II.3).
    """
    n, count = factor, offset_s.shape[0]
    if count < 3 * n + 1:
        return math.nan
    second = offset_s[2 * n :] - 2.0 * offset_s[n:-n] + offset_s[: -2 * n]
    heaped = np.concatenate([[0.0], np.cumsum(second)])
    sums = heaped[n:] - heaped[:-n]
    return math.sqrt(float(np.mean(sums**2)) / 6.0) / n


def mtie(offset_s: Array, factor: int) -> float:
    """Largest peak-to-peak offset [s] within any window of `factor` steps (ITU-T G.810, II.5)."""
    from scipy.ndimage import maximum_filter1d, minimum_filter1d

    size = factor + 1
    if offset_s.shape[0] < size:
        return math.nan
    first, last = size // 2, offset_s.shape[0] - (size - 1) // 2
    high = maximum_filter1d(offset_s, size)[first:last]
    low = minimum_filter1d(offset_s, size)[first:last]
    return float(np.max(high - low))


def autocorrelation_s(step_s: float, offset_s: Array) -> float:
    """Integral time scale [s] of the offsets about their mean: how long one sample speaks for.

    Twice the sum of the autocorrelation up to its first zero, times the step; at least one step,
    and the whole session where it never comes down.
    """
    count = offset_s.shape[0]
    centred = offset_s - np.mean(offset_s)
    if count < 4 or not np.any(centred):
        return step_s
    size = 1 << (2 * count - 1).bit_length()
    spectrum = np.fft.rfft(centred, size)
    found = np.fft.irfft(spectrum * np.conj(spectrum), size)[:count]
    normed = found / found[0]
    below = np.flatnonzero(normed <= 0.0)
    end = int(below[0]) if below.shape[0] else count
    return step_s * max(1.0, min(2.0 * float(np.sum(normed[:end])) - 1.0, float(count)))


def is_stationary(offset_s: Array, effective: float) -> bool | None:
    """Whether both halves have one mean (at 3 standard errors); None: too few to say.

    effective: as how many independent samples the session counts.
    """
    half = offset_s.shape[0] // 2
    if effective < 10.0 or half < 5:
        return None
    first, second = offset_s[:half], offset_s[-half:]
    spread = math.hypot(float(np.std(first)), float(np.std(second)))
    if spread == 0.0:
        return True
    error = spread / math.sqrt(effective / 2.0)
    return bool(abs(float(np.mean(first) - np.mean(second))) <= 3.0 * error)
