"""Pseudo-inverses and eigenvalues of many small matrices are the library's, bit by bit."""

from __future__ import annotations

import numpy as np
import pytest

from syncline_design.campaign.hermitian import eigen, pseudo_inverses


def drawn(rng: np.random.Generator, count: int, size: int, kind: str) -> np.ndarray:
    """Information matrices of full rank, of less, with what is not seen; and one that is none."""
    columns = rng.standard_normal((count, size, max(1, size - 2 * (kind == "flat"))))
    found = columns @ np.swapaxes(columns, 1, 2)
    if kind == "wide":
        found = found * 10.0 ** rng.uniform(-9.0, 9.0, (count, 1, 1))
    elif kind == "unseen":
        found[:, 0] = found[:, :, 0] = 0.0
    elif kind == "indefinite":
        found = found - np.eye(size)
    return found


@pytest.mark.parametrize("kind", ["full", "flat", "wide", "unseen", "indefinite"])
def test_they_are_the_librarys(kind: str) -> None:
    rng = np.random.default_rng(4)
    for size in (1, 2, 3, 5, 12, 40):
        for count in (0, 1, 9):
            found = drawn(rng, count, size, kind)
            for lost in (1e-13, 1e-7, 1e-3):
                expected = np.linalg.pinv(found, rcond=lost, hermitian=True)
                assert np.array_equal(pseudo_inverses(found, lost), expected)
            for own, librarys in zip(eigen(found), np.linalg.eigh(found), strict=True):
                assert np.array_equal(own, librarys)


def test_without_a_size_and_without_a_stack() -> None:
    assert pseudo_inverses(np.zeros((3, 0, 0)), 1e-7).shape == (3, 0, 0)
    alone = np.array([[4.0, 1.0], [1.0, 2.0]])
    assert np.allclose(pseudo_inverses(alone, 1e-7) @ alone, np.eye(2))
