"""Covariance of an error series: white noise per row plus Gauss-Markov processes, solved in O(n).

C = Sigma + B K B', Sigma block diagonal (n blocks of 3 x 3), K the covariance of m independent
unit-variance first-order Gauss-Markov processes, B (n, 3, m) their loadings.  The precision of the
processes is banded, so by the matrix inversion lemma
    C^-1 = Sigma^-1 - Sigma^-1 B P^-1 B' Sigma^-1,   P = K^-1 + B' Sigma^-1 B  (banded),
    log|C| = log|Sigma| + log|P| - log|K^-1|.
Uneven stamps and gaps need no care: correlation over dt is exp(-dt / T).  Rows of one stamp share
its states, so B' Sigma^-1 B is summed over them; T = 0 is noise that is new at every stamp and
common to its rows.  Constants that rows of a kind share (`Lasting`) are added as U U'.
Source: Rue and Held, Gaussian Markov Random Fields (2005), ch. 2; Woodbury's identity.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, cho_solve_banded, cholesky_banded
from scipy.linalg.lapack import dtbtrs

from syncline_design.effects.record import Array
from syncline_design.logs.stamps import Index, groups, repeated, starts, summed
from syncline_design.machine.quick_dataclass import dataclass

_MANY = 40  # columns from which steps in Python over the stamps are cheaper than columns in turn
_WIDE = 18  # states that are taken in one such step
_LEAST_STEP = 1e-9  # least dt / T: keeps 1 - phi^2 above rounding


def inverse_3x3(matrix: Array) -> tuple[Array, Array]:
    """Inverse (n, 3, 3) and determinant (n,) of symmetric positive 3 x 3 blocks.

    By L D L': cofactors cancel where a row's sizes are very unlike, elimination does not.
    Determinants that are not positive tell of blocks that are not.
    """
    a, d, f = matrix[:, 0, 0], matrix[:, 1, 1], matrix[:, 2, 2]
    with np.errstate(all="ignore"):
        l10, l20 = matrix[:, 0, 1] / a, matrix[:, 0, 2] / a
        second = d - l10 * matrix[:, 0, 1]
        mixed = matrix[:, 1, 2] - l10 * matrix[:, 0, 2]
        l21 = mixed / second
        third = f - l20 * matrix[:, 0, 2] - l21 * mixed
        zero, one = np.zeros_like(a), np.ones_like(a)
        rows = [[one, zero, zero], [-l10, one, zero], [l10 * l21 - l20, -l21, one]]
        lower = np.moveaxis(np.array(rows), -1, 0)  # L^-1
        pivots = np.stack([a, second, third], axis=1)
        inverse = np.swapaxes(lower, 1, 2) @ (lower / pivots[:, :, None])
        positive = np.all(pivots > 0.0, axis=1)
        determinant = np.where(positive, np.prod(pivots, axis=1), -1.0)
    return inverse, determinant


@dataclass(frozen=True, slots=True)
class Lasting:
    """Unit-variance constants, each common to all rows of a kind: C = A + U U'.

    loading (n, 3, q) U [m]; weighted A^-1 U; inverse of G = I + U' A^-1 U, its log determinant.
    """

    loading: Array
    weighted: Array
    inverse: Array
    log_determinant: float

    def held(self, solved: Array) -> Array:
        """A^-1 U G^-1 U' A^-1 Y, for A^-1 Y (n, 3, c)."""
        return _times(self.weighted, self.inverse @ _summed(self.loading, solved))

    def mean(self, solved: Array) -> Array:
        """U G^-1 U' A^-1 Y."""
        return _times(self.loading, self.inverse @ _summed(self.loading, solved))


def _summed(first: Array, second: Array) -> Array:
    product: Array = first.reshape(-1, first.shape[2]).T @ second.reshape(-1, second.shape[2])
    return product


def _times(columns: Array, values: Array) -> Array:
    product: Array = columns.reshape(-1, columns.shape[2]) @ values
    return product.reshape(*columns.shape[:2], values.shape[1])


def with_lasting(known: Precision, loading: Array) -> Precision:
    """The covariance with constants added, by Woodbury's identity once more."""
    weighted = known.solve(loading)
    inner = np.eye(loading.shape[2]) + _summed(loading, weighted)
    inverse: Array = np.asarray(np.linalg.inv(inner), dtype=float)
    log_det = float(np.linalg.slogdet(inner)[1])
    lasting = Lasting(loading, weighted, inverse, log_det)
    return replace(known, log_determinant=known.log_determinant + log_det, lasting=lasting)


@dataclass(frozen=True, slots=True)
class _Halfway:
    """P^-1 R solved forwards, in g groups of w states.

    inverse (g, w, w) A_i; step (g, m, 1) D_i; left (g, w, c) what each group adds; states (g, w, c)
    z_i.
    """

    inverse: Array
    step: Array
    left: Array
    states: Array


@dataclass(frozen=True, slots=True)
class Precision:
    """The factored covariance of one series."""

    white_inverse: Array  # (n, 3, 3) Sigma^-1
    loading: Array  # (n, 3, m) B
    factor: Array  # (m + 1, k m) banded Cholesky factor of P over k stamps, lower form
    step: Array  # (k - 1, m) of P between one stamp and the next, where it is diagonal
    log_determinant: float
    slow: NDArray[np.bool_]  # (m,) which processes last from stamp to stamp
    first: Index | None = None  # first row of every stamp, where rows share stamps
    group: Index | None = None  # (n,) the stamp of every row
    lasting: Lasting | None = None

    def solve(self, series: Array) -> Array:
        """C^-1 Y, Y (n, 3, c)."""
        found = self._in_time(series)
        return found if self.lasting is None else found - self.lasting.held(found)

    def _in_time(self, series: Array) -> Array:
        """The same without what lasts."""
        weighted: Array = self.white_inverse @ series
        if self.loading.shape[2] == 0:
            return weighted
        inside: Array = self.loading @ self.states(weighted)
        return weighted - self.white_inverse @ inside

    def information(self, series: Array) -> Array:
        """Y' C^-1 Y, (c, c): half the work of `solve`, since P^-1 is half way a sum of squares."""
        weighted: Array = self.white_inverse @ series
        found = _summed(series, weighted)
        if self.loading.shape[2]:
            found -= self._explained(self._at_stamps(weighted))
        if self.lasting is not None:
            cross = _summed(self.lasting.weighted, series)
            found -= cross.T @ self.lasting.inverse @ cross
        return found

    def squares(self, series: Array) -> Array:
        """The diagonal of Y' C^-1 Y, (c,)."""
        weighted: Array = self.white_inverse @ series
        found: Array = np.einsum("nic,nic->c", series, weighted)
        if self.loading.shape[2]:
            found -= np.sum(self._halved(self._at_stamps(weighted)) ** 2, axis=0)
        if self.lasting is not None:
            cross = _summed(self.lasting.weighted, series)
            found -= np.sum(cross * (self.lasting.inverse @ cross), axis=0)
        return found

    def _halved(self, right: Array) -> Array:
        """L^-1 R of R (k, m, c), P = L L', (k m, c)."""
        found: Array = dtbtrs(self.factor, right.reshape(-1, right.shape[2]), uplo="L")[0]
        return found

    def _explained(self, right: Array) -> Array:
        """R' P^-1 R of R (k, m, c), (c, c)."""
        if right.shape[2] < _MANY:
            half = self._halved(right)
            product: Array = half.T @ half
            return product
        halfway = self._forwards(right)
        return _summed(halfway.left, halfway.states)

    def _at_stamps(self, weighted: Array) -> Array:
        """B' Sigma^-1 Y summed over the rows of every stamp, (k, m, c)."""
        right: Array = np.swapaxes(self.loading, 1, 2) @ weighted
        return right if self.first is None else summed(self.first, right)

    def states(self, weighted: Array) -> Array:
        """P^-1 B' Sigma^-1 Y at every row, (n, m, c)."""
        m, c = self.loading.shape[2], weighted.shape[2]
        right = self._at_stamps(weighted)
        if c < _MANY:
            found: Array = cho_solve_banded(
                (self.factor, True), right.reshape(-1, c), check_finite=False
            )
            states = found.reshape(-1, m, c)
        else:
            states = self._side_by_side(right)
        return states if self.group is None else states[self.group]

    def _forwards(self, right: Array) -> _Halfway:
        """Half of P^-1 R of many columns, R (k, m, c): a few stamps at a time, all columns at once.

        With A_i the inverse of L_ii L_ii', L_ii the factor's triangle of these stamps, and D_i the
        block of P between the last of them and the next, left_i = r_i - D_i-1 z_i-1 and
        z_i = A_i left_i, so that R' P^-1 R is the sum of left_i' z_i.
        """
        k, m, c = right.shape
        stamps = max(_WIDE // m, 1)
        inverse = self._in_groups(stamps)
        rows = np.zeros((len(inverse), stamps * m, c))
        rows.reshape(-1, m, c)[:k] = right
        step = np.ascontiguousarray(self.step[stamps - 1 :: stamps, :, None])
        states = np.empty_like(rows)
        before = np.matmul(inverse[0], rows[0], out=states[0])
        for block, off, row, found in zip(inverse[1:], step, rows[1:], states[1:], strict=False):
            row[:m] -= off * before[-m:]
            before = np.matmul(block, row, out=found)
        return _Halfway(inverse, step, rows, states)

    def _side_by_side(self, right: Array) -> Array:
        """P^-1 R of many columns, R (k, m, c): backwards x_i = z_i - A_i D_i x_i+1."""
        k, m, c = right.shape
        halfway = self._forwards(right)
        inverse, step, states = halfway.inverse, halfway.step, halfway.states
        before = states[-1]
        last = np.ascontiguousarray(inverse[:, :, -m:])
        for block, off, found in zip(last[-2::-1], step[::-1], states[-2::-1], strict=False):
            found -= block @ (off * before[:m])
            before = found
        return states.reshape(-1, m, c)[:k]

    def _in_groups(self, stamps: int) -> Array:
        """Inverses (g, w, w) of L_ii L_ii' of so many stamps each, the last ones made up."""
        m = self.loading.shape[2]
        wide, length = stamps * m, self.factor.shape[1]
        bands = np.zeros((wide, -(-length // wide) * wide))
        bands[0, length:] = 1.0
        bands[: min(m + 1, wide), :length] = self.factor[:wide]
        bands = bands.reshape(wide, -1, wide).swapaxes(1, 2)
        inverse = lower_inverse(np.ascontiguousarray(bands), m)
        grouped: Array = np.swapaxes(inverse, 1, 2) @ inverse
        return grouped

    def own_blocks(self) -> Array:
        """Inverses (k, m, m) of L_ii L_ii', L_ii the factor's triangle of one stamp."""
        m = self.loading.shape[2]
        bands = np.ascontiguousarray(self.factor.reshape(m + 1, -1, m).swapaxes(1, 2))
        inverse = lower_inverse(bands)
        own: Array = np.swapaxes(inverse, 1, 2) @ inverse
        return own

    def slow_part(self, error: Array) -> Array:
        """B x + U s of what is slow and what lasts, posterior means given the series (n, 3)."""
        constant = self.constant_part(error)
        if not np.any(self.slow):
            return constant
        states = self.states(self.white_inverse @ (error - constant)[:, :, None])
        slow: Array = (self.loading[:, :, self.slow] @ states[:, self.slow])[:, :, 0]
        return constant + slow

    def constant_part(self, error: Array) -> Array:
        """U s, s the posterior mean of what lasts given the series (n, 3); (n, 3)."""
        if self.lasting is None:
            return np.zeros_like(error)
        found: Array = self.lasting.mean(self._in_time(error[:, :, None]))[:, :, 0]
        return found

    def negative_log_likelihood(self, error: Array) -> float:
        """-log N(e; 0, C) [nat], e (n, 3)."""
        return self.likelihood_of(float(self.squares(error[:, :, None])[0]))

    def likelihood_of(self, squares: float) -> float:
        """The same of an error of which e' C^-1 e is known."""
        size = self.white_inverse.shape[0] * 3
        found: float = 0.5 * (squares + self.log_determinant + size * math.log(2.0 * math.pi))
        return found


def factored(white: Array, loading: Array, time_s: Array, time_constant_s: Array) -> Precision:
    """Factor C for white (n, 3, 3), loading (n, 3, m) with std in it, T (m,) [s], 0 for none."""
    inverse, determinant = inverse_3x3(white)
    if np.any(~(determinant > 0.0)):
        raise LinAlgError("covariance of a row is not positive definite")
    log_det = float(np.sum(np.log(determinant)))
    m = loading.shape[2]
    slow = time_constant_s > 0.0
    if m == 0:
        return Precision(inverse, loading, np.zeros((1, 0)), np.zeros((0, 0)), log_det, slow)
    inner = np.swapaxes(loading, 1, 2) @ inverse @ loading
    first = group = None
    if repeated(time_s):
        first, group = starts(time_s), groups(time_s)
        time_s, inner = time_s[first], summed(first, inner)
    band, log_prior = _markov_precision(time_s, time_constant_s)
    blocks = band.reshape(-1, m, m + 1)
    for b in range(m):  # the place of A[j + k, j] is (j, k)
        blocks[:, b, : m - b] += inner[:, b, b:]
    step = blocks[:-1, :, m].copy()
    factor = cholesky_banded(band.T, lower=True, overwrite_ab=True, check_finite=False)
    log_det += 2.0 * float(np.sum(np.log(factor[0]))) - log_prior
    return Precision(inverse, loading, factor, step, log_det, slow, first, group)


def lower_inverse(bands: Array, below: int | None = None) -> Array:
    """Inverses (n, m, m) of the lower triangles (n, m, m) in bands (>= m, m, n), row by row.

    below: how many bands below the diagonal hold anything; all of them.
    """
    m, n = bands.shape[1:]
    found = np.zeros((m, m, n))
    for a, row in enumerate(found):
        for b in range(0 if below is None else max(a - below, 0), a):
            row[: b + 1] -= bands[a - b, b] * found[b, : b + 1]
        row[a] = 1.0
        row[: a + 1] /= bands[0, a]
    return np.ascontiguousarray(np.moveaxis(found, 2, 0))


def _markov_precision(time_s: Array, time_constant_s: Array) -> tuple[Array, float]:
    """K^-1 of m unit Gauss-Markov processes as a lower band, column by column (n m, m + 1), and
    its log determinant.

    Tridiagonal per process: with phi_i over step i and g_i = 1 / (1 - phi_i^2), the diagonal is
    g_{i-1} + phi_i^2 g_i (1 + phi_0^2 g_0 at the start) and the off-diagonal -phi_i g_i.
    """
    n, m = time_s.shape[0], time_constant_s.shape[0]
    apart, of = np.unique(time_constant_s, return_inverse=True)  # axes often share theirs
    with np.errstate(divide="ignore"):
        ratio = np.maximum(np.diff(time_s)[:, None] / apart, _LEAST_STEP)
    fresh = -np.expm1(-2.0 * ratio)  # 1 - phi^2
    phi = np.exp(-ratio)
    band = np.zeros((n, m, m + 1))
    band[0, :, 0] = 1.0
    band[1:, :, 0] = (1.0 / fresh)[:, of]
    band[:-1, :, 0] += (phi * phi / fresh)[:, of]
    band[:-1, :, m] = (-phi / fresh)[:, of]
    log_det = np.sum(np.log(fresh), axis=0)
    return band.reshape(n * m, m + 1), -float(np.sum(log_det[of]))
