"""How the likelihood of the noise bends: average information, in O(n).

With C_j = dC / d theta_j and q_j = C_j C^-1 e,
    AI_jk = q_j' C^-1 q_k / 2,
half way between what the log shows and what it is expected to where C is linear in theta.  A column
b of B makes C = b K b', so q = b x with x = K b' C^-1 e its posterior mean, by log of its variance;
by log T it is b y, y = dK b' C^-1 e = -K dQ x, Q = K^-1.
Source: Gilmour, Thompson and Cullis, Biometrics 51 (1995).
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import solveh_banded

from syncline_design.diagnosis.covariance import Precision
from syncline_design.diagnosis.noise_slopes import Slopes, Steps
from syncline_design.effects.record import Array

NEAR = 1e-4  # of one, within which a ratio is taken for it


def average_information(known: Precision, moved: Array) -> Array:
    """AI (p, p), of q (n, 3, p)."""
    return 0.5 * known.information(moved)


def by_times(known: Precision, found: Slopes, time_s: Array, constants_s: Array) -> Array:
    """q by the logarithm of each column's time constant, (n, 3, m)."""
    states = found.states
    if known.first is not None:
        time_s, states = time_s[known.first], states[known.first]
    steps = Steps.of(time_s, constants_s)
    turned = np.zeros_like(states)
    turned[:-1] += steps.turned * states[:-1] + steps.crossed * states[1:]
    turned[1:] += steps.turned * states[1:] + steps.crossed * states[:-1]
    moved = np.zeros_like(states)
    band = np.zeros((2, len(time_s)))
    for k in np.flatnonzero(constants_s > 0.0):
        phi, fresh = steps.phi[:, k], steps.fresh[:, k]
        band[1, 0], band[1, 1:] = 1.0, 1.0 / fresh
        band[1, :-1] += phi * phi / fresh
        band[0, 1:] = -phi / fresh
        moved[:, k] = -solveh_banded(band, turned[:, k], check_finite=False)
    at_rows = moved if known.group is None else moved[known.group]
    return known.loading * at_rows[:, None, :]


def damped(information: Array, expected: Array, shown: Array) -> Array:
    """AI as it lasts over a step to where what is shown of each part is what is expected.

    A part of variance s of which the log shows r s has the cost t (log s + r / s); towards its
    least it bends by t (r - 1) / log r, AI by t r: too much where the part is too small, and far
    too little where it is too large.  expected, shown: t and t r; shown is not positive of what is
    no variance.
    """
    ratio = np.where(shown > 0.0, shown / np.maximum(expected, 1e-12), 1.0)
    ratio = np.clip(ratio, 1e-4, 1e4)
    logs = np.log(ratio)
    near = np.abs(logs) < NEAR
    times = np.where(near, 1.0, (ratio - 1.0) / np.where(near, 1.0, logs) / ratio)
    root = np.sqrt(times)
    return information * root[:, None] * root
