"""Cholesky factor and solve for the small dense systems of the interior-point kernel."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from landing_cli.kernel import part

Floats = NDArray[np.float64]

SMALLEST_PIVOT = 1e-40


@part
def cholesky(matrix: Floats, n: int) -> None:
    """Factor the leading n x n block in place: its lower triangle becomes L with L L' = matrix.

    Pivots are floored, so a block that round-off made indefinite still yields a direction.
    """
    for j in range(n):
        pivot = math.sqrt(max(matrix[j, j], SMALLEST_PIVOT))
        inverse = 1.0 / pivot
        matrix[j, j] = pivot
        for i in range(j + 1, n):
            matrix[i, j] *= inverse
        # sums over what is known would wait for each other; these updates do not
        for i in range(j + 1, n):
            known = matrix[i, j]
            for k in range(j + 1, i + 1):
                matrix[i, k] -= known * matrix[k, j]


@part
def solve_lower(factor: Floats, n: int, x: Floats) -> None:
    """Solve L x = x in place for the factor of :func:`cholesky`."""
    for i in range(n):
        known = x[i] / factor[i, i]
        x[i] = known
        for k in range(i + 1, n):
            x[k] -= factor[k, i] * known


@part
def solve_upper(factor: Floats, n: int, x: Floats) -> None:
    """Solve L' x = x in place for the factor of :func:`cholesky`."""
    for i in range(n - 1, -1, -1):
        known = x[i] / factor[i, i]
        x[i] = known
        for k in range(i):
            x[k] -= factor[i, k] * known


@part
def cholesky_solve(factor: Floats, n: int, x: Floats) -> None:
    """Solve L L' x = x in place for the factor of :func:`cholesky`."""
    solve_lower(factor, n, x)
    solve_upper(factor, n, x)
