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
    for i in range(n):
        for j in range(i):
            total = matrix[i, j]
            for k in range(j):
                total -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = total / matrix[j, j]
        total = matrix[i, i]
        for k in range(i):
            total -= matrix[i, k] * matrix[i, k]
        matrix[i, i] = math.sqrt(max(total, SMALLEST_PIVOT))


@part
def cholesky_solve(factor: Floats, n: int, x: Floats) -> None:
    """Solve L L' x = x in place for the factor of :func:`cholesky`."""
    for i in range(n):
        total = x[i]
        for k in range(i):
            total -= factor[i, k] * x[k]
        x[i] = total / factor[i, i]
    for i in range(n - 1, -1, -1):
        x[i] /= factor[i, i]
        for k in range(i):
            x[k] -= factor[i, k] * x[i]
