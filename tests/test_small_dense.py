from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
from kernel_calls import from_python

from landing_cli.optimize.small_dense import (
    SMALLEST_PIVOT,
    cholesky as cholesky_part,
    cholesky_solve as cholesky_solve_part,
)

cholesky = from_python(cholesky_part)
cholesky_solve = from_python(cholesky_solve_part)


def positive_definite(size: int, condition: float, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    basis = np.linalg.qr(rng.normal(size=(size, size)))[0]
    return basis @ np.diag(np.geomspace(1.0, 1.0 / condition, size)) @ basis.T


@pytest.mark.parametrize("size", [1, 2, 7, 49])
def test_the_factor_is_that_of_scipy(size: int) -> None:
    matrix = positive_definite(size, 1e4, seed=size)
    factor = matrix.copy()
    cholesky(factor, size)
    expected = scipy.linalg.cholesky(matrix, lower=True)
    np.testing.assert_allclose(np.tril(factor), expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize("condition", [1.0, 1e6, 1e12])
def test_the_solution_leaves_a_residual_of_round_off(condition: float) -> None:
    matrix = positive_definite(9, condition)
    right = np.random.default_rng(1).normal(size=9)
    factor, x = matrix.copy(), right.copy()
    cholesky(factor, 9)
    cholesky_solve(factor, 9, x)
    assert np.abs(matrix @ x - right).max() < 1e-14 * np.linalg.norm(x)
    np.testing.assert_allclose(x, scipy.linalg.solve(matrix, right), rtol=3e-15 * condition)


def test_only_the_leading_block_and_its_lower_triangle_are_read() -> None:
    matrix = positive_definite(5, 10.0)
    padded = np.full((8, 8), np.nan)
    padded[:5, :5] = np.where(np.tri(5), matrix, np.nan)
    x = np.append(np.arange(5.0), [7.0, 8.0, 9.0])
    cholesky(padded, 5)
    cholesky_solve(padded, 5, x)
    np.testing.assert_allclose(x[:5], np.linalg.solve(matrix, np.arange(5.0)), rtol=1e-13, atol=1e-13)
    assert x[5:].tolist() == [7.0, 8.0, 9.0]


def test_a_block_that_is_not_positive_still_gives_finite_numbers() -> None:
    matrix = np.array([[1.0, 2.0], [2.0, 1.0]])
    x = np.ones(2)
    cholesky(matrix, 2)
    cholesky_solve(matrix, 2, x)
    assert matrix[1, 1] == np.sqrt(SMALLEST_PIVOT)
    assert np.isfinite(x).all()
