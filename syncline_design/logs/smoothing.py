"""Slopes of noisy series by smoothing splines, as smooth as every second row best foretells."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from syncline_design.effects.record import Array
from syncline_design.logs.log import GAP_FACTOR
from syncline_design.logs.stamps import groups, per_stamp

LEAST_SMOOTHED = 20  # rows of a stretch
MOST_TRIED = 1000  # rows on which the penalty is chosen
PENALTIES = np.geomspace(1e-3, 1e4, 15)  # over the cube of the time between rows


def penalty(time_s: Array, series: Array) -> float:
    """Lambda [s3] of least error in rows left out; 0 of a series that is short, still or smooth.

    Half of the rows weigh half, so all of them go with twice the lambda.
    """
    from scipy.interpolate import make_smoothing_spline

    if time_s.shape[0] < 2 * LEAST_SMOOTHED or np.ptp(series) == 0.0:
        return 0.0
    unit = float(np.median(np.diff(time_s))) ** 3
    known, asked = slice(0, None, 2), slice(1, -1, 2)
    errors = [
        np.sum((make_smoothing_spline(time_s[known], series[known], lam=unit * p)(time_s[asked])
                - series[asked]) ** 2)
        for p in PENALTIES
    ]  # fmt: skip
    best = int(np.argmin(errors))
    return 2.0 * unit * float(PENALTIES[best]) if best else 0.0  # a spline through all rows then


def velocity_of(time_s: Array, place_m: Array) -> Array:
    """Velocity [m/s] (n, 3) of places by rising stamps, cut at gaps.

    Each component's spline is as smooth as its own noise asks for: places without noise keep their
    slope, so that no motion is smoothed away, and noisy ones do not put their noise into every
    sensitivity.  Stretches that are too short to tell take the slope between neighbours.
    """
    from scipy.interpolate import make_smoothing_spline

    group = groups(time_s)
    time_s, place_m = per_stamp(time_s, place_m)
    if time_s.shape[0] < 2:
        return np.zeros_like(place_m)[group]
    step = np.diff(time_s)
    cuts = np.flatnonzero(step > GAP_FACTOR * np.median(step)) + 1
    bounds = list(pairwise([0, *cuts.tolist(), time_s.shape[0]]))
    longest = max(bounds, key=lambda ends: ends[1] - ends[0])
    chosen = slice(longest[0], min(longest[1], longest[0] + MOST_TRIED))
    slope = np.zeros_like(place_m)
    for k in range(place_m.shape[1]):
        smooth = penalty(time_s[chosen], place_m[chosen, k])
        for a, b in bounds:
            own, series = time_s[a:b], place_m[a:b, k]
            if b - a >= LEAST_SMOOTHED:
                lam = smooth or 1e-9 * float(np.median(step)) ** 3
                slope[a:b, k] = make_smoothing_spline(own, series, lam=lam)(own, 1)
            elif b - a >= 2:
                slope[a:b, k] = np.gradient(series, own)
    found: Array = slope[group]
    return found
