"""Quick solutions of symmetric systems leave alone what the matrix cannot tell."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from syncline_design.diagnosis.noise import NoiseLevel, Structure, White, precision
from syncline_design.diagnosis.positive import inverse, pseudo_inverse, solution

LOST = 1e-12


def exact_inverse(rows: list[list[Fraction]]) -> np.ndarray:
    """Gauss-Jordan elimination in fractions."""
    n = len(rows)
    work = [[*row, *(Fraction(int(i == k)) for k in range(n))] for i, row in enumerate(rows)]
    for i in range(n):
        work[i] = [x / work[i][i] for x in work[i]]
        for k in range(n):
            if k != i:
                work[k] = [a - work[k][i] * b for a, b in zip(work[k], work[i], strict=True)]
    return np.array([[float(x) for x in row[n:]] for row in work])


@pytest.mark.parametrize("size", [2, 5, 7])
def test_well_enough_told_systems_are_solved_exactly(size: int) -> None:
    """Hilbert's matrices: condition numbers of 19, 5e5 and 5e8."""
    rows = [[Fraction(1, i + k + 1) for k in range(size)] for i in range(size)]
    matrix, wanted = np.array([[float(x) for x in row] for row in rows]), exact_inverse(rows)
    np.testing.assert_allclose(inverse(matrix, LOST), wanted, rtol=1e-6)
    np.testing.assert_allclose(pseudo_inverse(matrix, LOST), wanted, rtol=1e-6)
    assert pseudo_inverse(matrix[-1:, -1:], LOST) == pytest.approx(2.0 * size - 1.0)
    right = np.arange(2.0 * size).reshape(size, 2)
    np.testing.assert_allclose(solution(matrix, right, LOST), wanted @ right, rtol=1e-6)


@pytest.mark.parametrize("rest", [0.0, 1e-15, 1e-14])
def test_a_lost_direction_gets_nothing(rest: float) -> None:
    """Two columns that are one but for rounding share what is there; neither runs away."""
    one, other = np.array([1.0, 1.0, 0.0]), np.array([1.0, -1.0, 0.0])
    matrix = np.outer(one, one) / 2.0 + rest * np.outer(other, other) + np.diag([0.0, 0.0, 3.0])
    right = np.array([[4.0], [2.0], [6.0]])
    np.testing.assert_allclose(solution(matrix, right, LOST)[:, 0], [3.0, 3.0, 2.0], rtol=1e-9)
    wanted = np.array([[0.5, 0.5, 0.0], [0.5, 0.5, 0.0], [0.0, 0.0, 1.0 / 3.0]])
    np.testing.assert_allclose(inverse(matrix, LOST), wanted, atol=1e-9)


def test_a_kept_covariance_is_that_of_its_own_structure_and_level() -> None:
    """White noise of 1 m on three axes, factors by turns: |C| = factor^(2 n) by hand."""
    time_s, unit = np.arange(4.0), np.broadcast_to(np.eye(3), (4, 3, 3)).copy()
    white = (White(("s", "position"), unit),)
    structure = Structure(time_s, white, (), np.zeros((4, 3, 3)))
    for factor in (1.0, 2.0, 1.0, 0.5, 3.0, 4.0, 2.0):
        found = precision(structure, NoiseLevel((factor,), (), ()))
        assert found.log_determinant == pytest.approx(24.0 * np.log(factor), abs=1e-9)
    larger = replace(structure, white=(White(("s", "position"), 4.0 * unit),))
    found = precision(larger, NoiseLevel((2.0,), (), ()))
    assert found.log_determinant == pytest.approx(24.0 * np.log(4.0), abs=1e-9)
    assert precision(structure.rows(slice(0, 2)), NoiseLevel((2.0,), (), ())).loading.shape[0] == 2
