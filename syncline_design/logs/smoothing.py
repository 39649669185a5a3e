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
    if time_s.shape[0] < 2 * LEAST_SMOOTHED or np.ptp(series) == 0.0:
        return 0.0
    unit = float(np.median(np.diff(time_s))) ** 3
    known, asked = slice(0, None, 2), slice(1, -1, 2)
    foretold = Smoothing(time_s[known], time_s[asked])
    errors = [
        np.sum((foretold.values(series[known], unit * p) - series[asked]) ** 2) for p in PENALTIES
    ]
    best = int(np.argmin(errors))
    return 2.0 * unit * float(PENALTIES[best]) if best else 0.0  # a spline through all rows then


class Smoothing:
    """Smoothing splines of series at some stamps t, read at times between them.

    Of least sum (y - f)^2 + lambda int f''^2.  With Q'y the second differences of the series and
    R = int of the products of hats, the second derivatives at the inner stamps are c of
    (R + lambda Q'Q) c = Q'y, the values y - lambda Q c.  Matrices without lambda are made once.
    Source: Reinsch, Numer. Math. 10 (1967); Green and Silverman (1994), ch. 2.
    """

    def __init__(self, knots_s: Array, asked_s: Array) -> None:
        h = np.diff(knots_s)
        self.step, one = h, 1.0 / h
        self.hats = np.zeros((3, h.shape[0] - 1))  # of R, upper bands, the diagonal last
        self.hats[1, 1:], self.hats[2] = h[1:-1] / 6.0, (h[:-1] + h[1:]) / 3.0
        middle = one[:-1] + one[1:]
        self.rough = np.zeros_like(self.hats)  # of Q'Q
        self.rough[0, 2:] = one[1:-2] * one[2:-1]
        self.rough[1, 1:] = -one[1:-1] * (middle[:-1] + middle[1:])
        self.rough[2] = one[:-1] ** 2 + middle**2 + one[1:] ** 2
        last = knots_s.shape[0] - 2
        self.at = np.clip(np.searchsorted(knots_s, asked_s, side="right") - 1, 0, last)
        self.off = (asked_s - knots_s[self.at]) / h[self.at]

    def values(self, series: Array, lam: float) -> Array:
        """The spline of lambda [s3] at the times asked for."""
        (smooth, bend), at, u = self._fitted(series, lam), self.at, self.off
        curved = (2.0 - u) * bend[at] + (1.0 + u) * bend[at + 1]
        straight = (1.0 - u) * smooth[at] + u * smooth[at + 1]
        found: Array = straight - self.step[at] ** 2 * u * (1.0 - u) / 6.0 * curved
        return found

    def slopes(self, series: Array, lam: float) -> Array:
        """Its first derivative there."""
        (smooth, bend), at, u = self._fitted(series, lam), self.at, self.off
        curved = (2.0 - 6.0 * u + 3.0 * u**2) * bend[at] + (1.0 - 3.0 * u**2) * bend[at + 1]
        straight = (smooth[at + 1] - smooth[at]) / self.step[at]
        found: Array = straight - self.step[at] / 6.0 * curved
        return found

    def bends(self, series: Array, lam: float) -> Array:
        """Its second derivative there."""
        _, bend = self._fitted(series, lam)
        found: Array = (1.0 - self.off) * bend[self.at] + self.off * bend[self.at + 1]
        return found

    def _fitted(self, series: Array, lam: float) -> tuple[Array, Array]:
        """Values and second derivatives at the stamps."""
        from scipy.linalg import solveh_banded

        bend = np.zeros_like(series)
        second = np.diff(np.diff(series) / self.step)
        bend[1:-1] = solveh_banded(self.hats + lam * self.rough, second, check_finite=False)
        return series - lam * self._differences(bend), bend

    def _differences(self, bend: Array) -> Array:
        """Q c, c with its zeros at both ends."""
        slope = np.diff(bend) / self.step
        found: Array = np.diff(slope, prepend=0.0, append=0.0)
        return found


def velocity_of(time_s: Array, place_m: Array) -> Array:
    """Velocity [m/s] (n, 3) of places by rising stamps, cut at gaps.

    Each component's spline is as smooth as its own noise asks for: places without noise keep their
    slope, so that no motion is smoothed away, and noisy ones do not put their noise into every
    sensitivity.  Stretches that are too short to tell take the slope between neighbours.
    """
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
                slope[a:b, k] = Smoothing(own, own).slopes(series, lam)
            elif b - a >= 2:
                slope[a:b, k] = np.gradient(series, own)
    found: Array = slope[group]
    return found
