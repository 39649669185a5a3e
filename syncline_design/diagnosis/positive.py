"""Systems with symmetric matrices that are positive but for rounding, quickly where they allow it.

By Cholesky where LAPACK's estimate of the reciprocal condition number is well above what counts as
lost; by singular values, which leave lost directions alone, where it is not.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.linalg.lapack import dpocon, dpotrf, dpotri, dpotrs

from syncline_design.effects.record import Array

SAFE = 1e3  # times the share that is lost, from which no direction is near to being so


def _factor(matrix: Array, lost: float) -> Array | None:
    """Lower Cholesky factor; None where a direction is lost, or may be, or there is none at all."""
    if not matrix.size:
        return None  # LAPACK complains of it on the terminal
    lower, info = dpotrf(matrix, lower=1)
    if info != 0:
        return None
    norm = float(np.max(np.sum(np.abs(matrix), axis=0), initial=0.0))
    share, info = dpocon(lower, norm, uplo="L")
    return lower if info == 0 and share > SAFE * lost else None


def solver(matrix: Array, lost: float) -> Callable[[Array], Array]:
    """B (m, c) to x of least squares in A x = B, A symmetric (m, m); lost: share of A's largest."""
    lower = _factor(matrix, lost)
    if lower is None:
        pseudo: Array = np.asarray(np.linalg.pinv(matrix, rcond=lost, hermitian=True), dtype=float)
        return pseudo.__matmul__

    def solved(right: Array) -> Array:
        found: Array = dpotrs(lower, right, lower=1)[0]
        return found

    return solved


def solution(matrix: Array, right: Array, lost: float) -> Array:
    """The same of one B."""
    return solver(matrix, lost)(right)


def inverse(matrix: Array, lost: float) -> Array:
    """A^-1 of a symmetric A (m, m), without the directions that are lost."""
    lower = _factor(matrix, lost)
    if lower is None:
        pseudo: Array = np.asarray(np.linalg.pinv(matrix, rcond=lost, hermitian=True), dtype=float)
        return pseudo
    half, _ = dpotri(lower, lower=1)  # zero above the diagonal, as the factor is
    whole: Array = half + half.T
    np.fill_diagonal(whole, np.diag(half))
    return whole


def pseudo_inverse(matrix: Array, lost: float) -> Array:
    """A^-1 of a symmetric A (m, m), by singular values; of a single number it is quick."""
    if matrix.shape == (1, 1) and matrix[0, 0] > 0.0:
        return 1.0 / matrix
    found: Array = np.asarray(np.linalg.pinv(matrix, rcond=lost), dtype=float)
    return found
