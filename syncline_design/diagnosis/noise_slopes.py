"""Slopes of the likelihood of the noise, all at once and exact, in O(n).

With C = Sigma + B K B', a = C^-1 e, x = P^-1 B' Sigma^-1 e the processes' posterior means and
S = P^-1 their covariance (only its blocks of one stamp and of two neighbours are needed), for
NLL = (e' C^-1 e + log|C|) / 2:
    d NLL = 1/2 sum_i <D_i - a_i a_i', dSigma_i>,
    D_i = Sigma_i^-1 - Sigma_i^-1 B_i S B_i' Sigma_i^-1,
    d NLL / d log b_c = sum [S (B' Sigma^-1 B)]_cc - a' B_c x_c,   b_c the scale of column c of B
    d NLL / d log T_c = 1/2 (tr((S + x x') dQ_c) - d log|Q_c|),   Q = K^-1
Blocks of S run backwards along the factor P = L L': S_ii = A_i + G' S_i+1,i+1 G,
S_i+1,i = -S_i+1,i+1 G, A_i = L_ii^-T L_ii^-1, G = L_i+1,i L_ii^-1 = D_i A_i with D_i = P_i+1,i.
Source: Takahashi et al. (1973), as in Rue and Held, Gaussian Markov Random Fields (2005), ch. 2.
"""

from __future__ import annotations

import math

import numpy as np

from syncline_design.diagnosis.covariance import Precision
from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass


@dataclass(frozen=True, slots=True)
class Slopes:
    """Of the NLL [nat].

    white (n, 3, 3): to be summed against the slope of each row's white covariance.  column (m,): by
    the logarithm of each column's scale.  time (m,): by the logarithm of each time constant.
    squares: e' C^-1 e, which is found on the way.  expected: the same slopes but for what the error
    itself says, tr(C^-1 dC) / 2, which at the best fit is what a part makes up of the error.
    weighted (n, 3): C^-1 e; states (n, m): posterior means of the processes at every row.
    """

    white: Array
    column: Array
    time: Array
    squares: float
    expected_white: Array
    expected_column: Array
    weighted: Array
    states: Array


@dataclass(frozen=True, slots=True)
class Steps:
    """Unit Gauss-Markov processes from stamp to stamp, (n - 1, m); new at every stamp where T is 0.

    phi: what is left of the one before; fresh: 1 - phi^2.  By log T: turned, of 1 / fresh, which Q
    has at both stamps; crossed, of -phi / fresh between them.
    """

    phi: Array
    fresh: Array
    turned: Array
    crossed: Array

    @classmethod
    def of(cls, time_s: Array, constants_s: Array) -> Steps:
        """T (m,) [s]."""
        apart, of = np.unique(constants_s, return_inverse=True)  # axes often share theirs
        slow = apart > 0.0
        ratio = np.diff(time_s)[:, None] / np.where(slow, apart, 1.0)
        ratio = np.where(slow, np.maximum(ratio, 1e-9), 50.0)
        phi, fresh = np.exp(-ratio), -np.expm1(-2.0 * ratio)
        turned = 2.0 * phi**2 * ratio / fresh**2
        crossed = -(phi * ratio / fresh + phi * turned)
        return cls(phi[:, of], fresh[:, of], turned[:, of], crossed[:, of])


def noise_slopes(known: Precision, error: Array, time_s: Array, constants_s: Array) -> Slopes:
    """Slopes at one noise level, error (n, 3) [m]."""
    loading, inverse = known.loading, known.white_inverse
    m = loading.shape[2]
    weighted = inverse @ error[:, :, None]
    if m == 0:
        own = weighted[:, :, 0]
        outer = own[:, :, None] * own[:, None, :]
        squares = float(np.sum(error * own))
        none = np.zeros(0)
        white, states = 0.5 * (inverse - outer), np.zeros((len(error), 0))
        return Slopes(white, none, none, squares, 0.5 * inverse, none, own, states)
    states = known.states(weighted)[:, :, 0]  # at every row
    left = weighted[:, :, 0] - (inverse @ (loading @ states[:, :, None]))[:, :, 0]
    same, next_same = _blocks(known)
    at_rows = same if known.group is None else same[known.group]
    seen = inverse @ loading
    spread = seen @ at_rows
    expected = inverse - spread @ np.swapaxes(seen, 1, 2)
    white = expected - left[:, :, None] * left[:, None, :]
    made_up = np.einsum("nia,nia->a", spread, loading)
    column = made_up - np.einsum("ni,nic,nc->c", left, loading, states)
    at_stamps = states
    if known.first is not None:
        time_s, at_stamps = time_s[known.first], states[known.first]
    times = _times(same, next_same, at_stamps, time_s, constants_s)
    squares = float(np.sum(error * left))
    return Slopes(0.5 * white, column, times, squares, 0.5 * expected, made_up, left, states)


def _blocks(known: Precision) -> tuple[Array, Array]:
    """Blocks of S: of one stamp (n, m, m), and the diagonals of those of neighbours (n - 1, m)."""
    own = known.own_blocks()
    carry = known.step[:, :, None] * own[:-1]
    own[:-1] = _carried(own, carry)
    following = -np.einsum("nab,nba->na", own[1:], carry)
    return own, following


def _carried(own: Array, carry: Array) -> Array:
    """S_i = A_i + C_i' S_i+1 C_i backwards from S_n-1 = A_n-1, (n - 1, m, m).

    Runs of rows go side by side from zero, S_i = s_i + T_i' X T_i with X the S behind the run and
    T_i = T_i+1 C_i; then X is carried from run to run.
    """
    steps, m = carry.shape[:2]
    length = max(math.isqrt(steps), 1)
    runs = -(-steps // length)
    first = np.zeros((2, runs * length, m, m))  # rows before the first carry nothing on
    first[0, runs * length - steps :], first[1, runs * length - steps :] = own[:-1], carry
    alone, product = first.reshape(2, runs, length, m, m)
    for i in range(length - 2, -1, -1):
        step = product[:, i].copy()
        alone[:, i] += np.swapaxes(step, 1, 2) @ alone[:, i + 1] @ step
        product[:, i] = product[:, i + 1] @ step
    behind = np.empty((runs, 1, m, m))
    value = own[-1]
    for run in range(runs - 1, -1, -1):
        behind[run, 0] = value
        value = alone[run, 0] + product[run, 0].T @ value @ product[run, 0]
    found: Array = alone + np.swapaxes(product, 2, 3) @ behind @ product
    return found.reshape(-1, m, m)[runs * length - steps :]


def _times(
    same: Array, following: Array, states: Array, time_s: Array, constants_s: Array
) -> Array:
    """By the logarithms of the time constants; zero for noise that is new at every stamp."""
    steps = Steps.of(time_s, constants_s)
    square = np.einsum("naa->na", same) + states**2
    cross = following + states[1:] * states[:-1]
    total: Array = np.sum(steps.turned * (square[1:] + square[:-1] - steps.fresh), axis=0)
    total += 2.0 * np.sum(steps.crossed * cross, axis=0)
    return np.where(constants_s > 0.0, 0.5 * total, 0.0)


def summed_over(white: Array, covariance: Array) -> float:
    """<slope, dSigma> for the slope by the white covariance of all rows (n, 3, 3)."""
    return float(np.vdot(white, covariance))
