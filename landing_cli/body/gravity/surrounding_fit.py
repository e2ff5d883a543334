"""Least-squares fits of a potential over a cube, by its gradient and Hessian at a few points."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from landing_cli.body.gravity.fitted_pieces import powers, spread_points
from landing_cli.body.gravity.kernel_types import FloatArray
from landing_cli.body.gravity.surrounding_kernels import NEAR_DEGREE

_EQUATIONS = 2.0  # for every unknown
_HESSIAN_WEIGHT = 0.15  # beside the gradient, in the coordinates of the cube
_PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


@dataclass(frozen=True, eq=False)
class Polynomial:
    """How polynomials of one family are fitted.

    Attributes
    ----------
    points : (k, 3) float
        Where gradients and Hessians are wanted, -1 to 1, of Chebyshev density.
    solve : (c, 9 k) float
        What takes them to coefficients of powers.
    constant : int
        The constant's place, which they leave open.
    """

    points: FloatArray
    solve: FloatArray
    constant: int

    def places(self, center: FloatArray, half: float) -> tuple[FloatArray, FloatArray]:
        """Return the middle (1, 3) and the points (k, 3) of a cube, m."""
        return center[None], center + half * self.points

    def fit(self, half: float, u: float, g: FloatArray, G: FloatArray | None) -> FloatArray:
        """Fit U to its value in the middle, and to gradients (k, 3) and Hessians (k, 3, 3) at the points.

        Parameters
        ----------
        half : float, m
            Half the cube's side.
        u : float, m2/s2
            U in the middle.
        g : (k, 3) float, m/s2
            Gradients.
        G : (k, 3, 3) float, 1/s2, or None
            Where the polynomial is fitted by gradients alone.

        Returns
        -------
        (c,) float, m2/s2
        """
        known = half * g.T
        if G is not None:
            rows, columns = np.array(_PAIRS).T
            known = np.concatenate([known, _HESSIAN_WEIGHT * half**2 * G[:, rows, columns].T])
        # not by BLAS, whose sums may depend on the number of threads
        coefficients = np.einsum("ck,k->c", self.solve, known.ravel())
        coefficients[self.constant] = u
        return np.asarray(coefficients)


def count_of(degree: int) -> int:
    """Return how many coefficients a polynomial of a degree has."""
    return (degree + 1) * (degree + 2) * (degree + 3) // 6


def bits(octant: int) -> FloatArray:
    """Return 0 or 1 along each axis: on which side of the middle an octant lies."""
    return np.array([octant >> axis & 1 for axis in range(3)], dtype=np.float64)


@lru_cache(maxsize=4)
def polynomial(degree: int, harmonic: bool) -> Polynomial:
    """Return the fit over a cube by all polynomials of a degree, or by those whose Laplacian is 0.

    Of the nine numbers at a point eight are independent where the Laplacian is 0.
    """
    unknowns, given = ((degree + 1) ** 2, 8) if harmonic else (count_of(degree), 9)
    points = np.cos(np.pi * 0.5 * (spread_points(math.ceil(_EQUATIONS * unknowns / given), 0.5) + 1.0))
    return _fit_at(points, degree, harmonic)


@lru_cache(maxsize=1)
def outer_polynomial(degree: int) -> Polynomial:
    """Return the fit by harmonic polynomials, with its points all over the unit sphere."""
    count = math.ceil(_EQUATIONS * (degree + 1) ** 2 / 3)
    height = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    turn = np.pi * (3.0 - math.sqrt(5.0)) * np.arange(count)
    across = np.sqrt(1.0 - height**2)
    return _fit_at(
        np.stack([across * np.cos(turn), across * np.sin(turn), height], axis=1), degree, True, False
    )


def _fit_at(points: FloatArray, degree: int, harmonic: bool, hessians: bool = True) -> Polynomial:
    order = powers(degree)
    # in Chebyshev polynomials the problem is well conditioned
    basis = np.eye(degree + 1)
    along = [
        np.stack([chebyshev.chebval(points, chebyshev.chebder(b, m)) for b in basis], axis=-1)
        for m in range(3)
    ]
    wanted = [[int(a == axis) for a in range(3)] for axis in range(3)]
    wanted += [[int(a == i) + int(a == j) for a in range(3)] for i, j in _PAIRS]
    rows = [np.prod([along[m][:, a][:, order[:, a]] for a, m in enumerate(of)], axis=0) for of in wanted]
    matrix = np.concatenate([*rows[:3], *(_HESSIAN_WEIGHT * row for row in rows[3:] if hessians)])
    to_powers = _chebyshev_to_powers(degree)
    constant = int(np.flatnonzero(order.sum(axis=1) == 0)[0])
    if harmonic:
        family = np.linalg.solve(to_powers, _harmonic_powers(degree))
        solve = family @ np.linalg.pinv(matrix @ family, rcond=1e-12)
    else:
        solve = np.linalg.pinv(matrix, rcond=1e-12)
    return Polynomial(points, np.asarray(to_powers @ solve), constant)


def _chebyshev_to_powers(degree: int) -> FloatArray:
    turned = np.zeros((degree + 1, degree + 1))
    for i in range(degree + 1):
        turned[: i + 1, i] = chebyshev.cheb2poly(np.eye(degree + 1)[i][: i + 1])
    return _of_axes([turned, turned, turned], powers(degree))


def _of_axes(factors: list[FloatArray], order: NDArray[np.int64]) -> FloatArray:
    """Matrix between coefficients of all powers, (c, c), from what is done along each axis."""
    chosen = [f[order[:, a][:, None], order[:, a][None]] for a, f in enumerate(factors)]
    return np.asarray(chosen[0] * chosen[1] * chosen[2])


def _harmonic_powers(degree: int) -> FloatArray:
    """Orthonormal coefficients of all polynomials whose Laplacian is 0, (c, (degree + 1)^2)."""
    order = powers(degree)
    place = {tuple(exponents): i for i, exponents in enumerate(order.tolist())}
    laplacian = np.zeros((len(order), len(order)))
    for column, exponents in enumerate(order.tolist()):
        for axis, n in enumerate(exponents):
            if n >= 2:
                lower = tuple(e - 2 * (a == axis) for a, e in enumerate(exponents))
                laplacian[place[lower], column] += n * (n - 1)
    return np.asarray(np.linalg.svd(laplacian)[2][-((degree + 1) ** 2) :].T)


@lru_cache(maxsize=1)
def to_children() -> list[FloatArray]:
    """Matrices (c, c) from the coefficients of a cube near facets to those of each of its eight children.

    A child's coordinate is twice the parent's, more or less 1.
    """
    moved = np.zeros((2, NEAR_DEGREE + 1, NEAR_DEGREE + 1))
    for upper in (0, 1):
        for i in range(NEAR_DEGREE + 1):
            moved[upper, : i + 1, i] = (np.polynomial.Polynomial([upper - 0.5, 0.5]) ** i).coef
    return [_of_axes([moved[int(b)] for b in bits(octant)], powers(NEAR_DEGREE)) for octant in range(8)]
