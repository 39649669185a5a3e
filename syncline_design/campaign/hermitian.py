"""Symmetric matrices, many small ones at once: what the library does, without its detours.

A look at runs takes thousands of pseudo-inverses and eigenvalues of matrices of one to some ten
rows, for which the library's checks, and its sorting of what is sorted, cost more than they do.
The figures are the library's own, to the last bit (tests/test_hermitian.py).
"""

from __future__ import annotations

import numpy as np

from syncline_design.effects.record import Array


def pseudo_inverses(matrices: Array, lost: float) -> Array:
    """Pseudo-inverses of symmetric matrices (..., p, p), directions of less than `lost` of the
    largest eigenvalue left out: numpy.linalg.pinv(matrices, rcond=lost, hermitian=True)."""
    values, vectors = np.linalg.eigh(matrices)
    sizes, turned = values[..., ::-1], vectors[..., ::-1].copy()  # the largest first
    least = lost * sizes[..., :1]
    if values.size == 0 or np.any(sizes[..., -1:] < -least):  # one that is negative is kept
        return np.asarray(np.linalg.pinv(matrices, rcond=lost, hermitian=True), dtype=float)
    inverse = np.divide(1.0, sizes, where=sizes > least, out=np.zeros(sizes.shape))
    return np.asarray(turned @ (inverse[..., None] * np.swapaxes(turned, -1, -2)))


def eigen(matrices: Array) -> tuple[Array, Array]:
    """Eigenvalues (..., p), ascending, and eigenvectors of symmetric matrices (..., p, p)."""
    if matrices.shape[-1] == 1:
        return matrices[..., 0].copy(), np.ones(matrices.shape)
    values, vectors = np.linalg.eigh(matrices)
    return values, vectors
