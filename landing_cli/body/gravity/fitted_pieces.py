"""Polynomial pieces of a potential over a box: fitted where the body is not, split until they are fine.

A piece is a polynomial of total degree n in the local coordinates of a box, -1 to 1. Its Chebyshev
coefficients are the least-squares fit of its gradient to the exact acceleration at points of Chebyshev
density; they are turned into powers for Horner's scheme. A box that holds part of the surface is halved
across its longest side, as is a piece whose gradient errs by more than the tolerance at other points.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from landing_cli.body.gravity.boxed_kernels import DEGREE, PER_PIECE
from landing_cli.body.gravity.field import GravityField
from landing_cli.body.gravity.field_values import accelerations, gradients, potentials
from landing_cli.body.gravity.kernel_types import FloatArray
from landing_cli.body.gravity.triangle_boxes import triangles_in_box

IntArray = NDArray[np.int64]

_FIT_POINTS, _CHECK_POINTS = 180, 40
_UNFITTED = 0


@dataclass(frozen=True, eq=False)
class TurnedPolyhedron:
    """A polyhedron's field in axes of its own.

    Attributes
    ----------
    field : GravityField
        Of a polyhedron.
    origin_m : (3,) float, m, body frame
    axes : (3, 3) float
        Rows: the unit vectors in the body frame.
    """

    field: GravityField
    origin_m: FloatArray
    axes: FloatArray

    def to_body(self, points: FloatArray) -> FloatArray:
        """Return points (k, 3) of these axes in the body frame, m."""
        return np.asarray(points @ self.axes + self.origin_m)

    def potential(self, point: FloatArray) -> float:
        """Return U at a point (3,), m2/s2."""
        return float(potentials(self.field, self.to_body(point))[0])

    def acceleration(self, points: FloatArray) -> FloatArray:
        """Return g at points (k, 3), (k, 3), m/s2."""
        return np.asarray(accelerations(self.field, self.to_body(points)) @ self.axes.T)

    def holds(self, point: FloatArray) -> bool:
        """Tell whether a point (3,) lies inside: there the Laplacian of U is -4 pi G rho, outside 0."""
        trace = np.trace(gradients(self.field, self.to_body(point))[0])
        return bool(trace < -2.0 * np.pi * self.field.params[2])


@dataclass(frozen=True, eq=False)
class Pieces:
    """A binary tree of boxes and their polynomials.

    Attributes
    ----------
    tree : (t,) int
        What is at every node, the root first: the first of its two children, which follow each other; 0
        where nothing is fitted; or -(1 + piece).
    coefficients : (p, c) float, m2/s2
        Of every piece, in the order of Horner's scheme: powers of x, then y, then z, falling.
    center, half : (p, 3) float, m
        The boxes of the pieces.
    """

    tree: IntArray
    coefficients: FloatArray
    center: FloatArray
    half: FloatArray


def fit_pieces(
    body: TurnedPolyhedron,
    triangles: FloatArray,
    center: FloatArray,
    half: FloatArray,
    tolerance: float,
    most_halvings: int,
) -> Pieces:
    """Fit a potential over the part of a box that lies outside a body.

    Parameters
    ----------
    body : TurnedPolyhedron
        The exact field, in the axes of the box.
    triangles : (m, 3, 3) float, m
        The body's surface, in the same axes.
    center, half : (3,) float, m
        The box.
    tolerance : float
        Largest error of the acceleration in a piece, over the acceleration.
    most_halvings : int
        Boxes that would need more stay unfitted.

    Returns
    -------
    Pieces
    """
    tree = [_UNFITTED]
    found: list[tuple[FloatArray, FloatArray, FloatArray]] = []
    waiting = [(0, center, half, triangles, 0)]
    while waiting:
        node, at, size, near, depth = waiting.pop()
        near = triangles_in_box(near, at, size)
        if len(near) == 0:
            if body.holds(at):
                continue
            fit = _fit(body, at, size)
            if _error(body, fit, at, size) <= tolerance:
                tree[node] = -(1 + len(found))
                found.append((fit, at, size))
                continue
        if depth == most_halvings:
            continue
        tree[node] = len(tree)
        tree += [_UNFITTED, _UNFITTED]
        axis = int(np.argmax(size))
        child, step = size.copy(), np.zeros(3)
        child[axis], step[axis] = 0.5 * size[axis], 0.5 * size[axis]
        waiting.append((tree[node], at - step, child, near, depth + 1))
        waiting.append((tree[node] + 1, at + step, child, near, depth + 1))
    fits, centers, halves = zip(*found, strict=True) if found else ([], [], [])
    return Pieces(
        np.array(tree, dtype=np.int64),
        np.array(fits).reshape(-1, PER_PIECE),
        np.array(centers).reshape(-1, 3),
        np.array(halves).reshape(-1, 3),
    )


@lru_cache(maxsize=4)
def powers(degree: int) -> IntArray:
    """Exponents of x, y, z of every coefficient, in the order of Horner's scheme, (c, 3) int."""
    falling = range(degree, -1, -1)
    every = [(i, j, k) for i in falling for j in falling for k in falling if i + j + k <= degree]
    return np.array(every, dtype=np.int64)


def probe_points(count: int, first: float) -> FloatArray:
    """Points over the cube from -1 to 1, half of them on its faces, where fits err most.

    Parameters
    ----------
    count : int
        How many.
    first : float
        Different numbers give different points.

    Returns
    -------
    (count, 3) float
    """
    return np.clip(1.3 * spread_points(count, first), -1.0, 1.0)


def spread_points(count: int, first: float) -> FloatArray:
    """Spread points evenly over the cube from -1 to 1 by a Kronecker sequence, (count, 3) float.

    Parameters
    ----------
    count : int
        How many.
    first : float
        Where the sequence begins: different numbers give different points.
    """
    root = 1.2207440846057596  # of x^4 = x + 1
    steps = 1.0 / root ** np.arange(1, 4)
    return np.asarray(2.0 * ((first + np.arange(1, count + 1)[:, None] * steps) % 1.0) - 1.0)


def _fit(body: TurnedPolyhedron, center: FloatArray, half: FloatArray) -> FloatArray:
    points, solve, to_powers, constant = _scheme()
    g = body.acceleration(center + half * points)
    coefficients = to_powers @ (solve @ (g * half).ravel())
    # the gradient leaves the constant open
    coefficients[constant] = body.potential(center)
    return np.asarray(coefficients)


def _error(body: TurnedPolyhedron, fit: FloatArray, center: FloatArray, half: FloatArray) -> float:
    """Largest error of the acceleration at points of their own, relative."""
    points, slopes = _check_scheme()
    exact = body.acceleration(center + half * points)
    wrong = (slopes @ fit).T / half - exact
    return float((np.linalg.norm(wrong, axis=1) / np.linalg.norm(exact, axis=1)).max())


@lru_cache(maxsize=1)
def _scheme() -> tuple[FloatArray, FloatArray, FloatArray, int]:
    """Points of the fit, its pseudo-inverse, Chebyshev to powers, and the place of the constant."""
    order = powers(DEGREE)
    points = np.cos(np.pi * 0.5 * (spread_points(_FIT_POINTS, 0.5) + 1.0))
    values = chebyshev.chebvander(points, DEGREE)
    derivative = np.stack([chebyshev.chebval(points, _slope(i)) for i in range(DEGREE + 1)], axis=-1)
    columns = []
    for axis in range(3):
        factors = [(derivative if a == axis else values)[:, a][:, order[:, a]] for a in range(3)]
        columns.append(factors[0] * factors[1] * factors[2])
    matrix = np.stack(columns, axis=1).reshape(3 * _FIT_POINTS, -1)
    constant = int(np.flatnonzero(order.sum(axis=1) == 0)[0])
    solve = np.linalg.pinv(matrix)
    solve[constant] = 0.0  # the gradient does not know it
    turned = np.array([np.append(p, np.zeros(DEGREE - i)) for i, p in enumerate(_chebyshev_in_powers())]).T
    to_powers = np.prod([turned[order[:, a][:, None], order[:, a][None]] for a in range(3)], axis=0)
    return points, np.asarray(solve, dtype=np.float64), np.asarray(to_powers), constant


@lru_cache(maxsize=1)
def _check_scheme() -> tuple[FloatArray, FloatArray]:
    """Points of the check, and what takes coefficients to the gradient there, (3, k, c)."""
    points = probe_points(_CHECK_POINTS, 0.25)
    return points, _slope_matrix(points)


def _slope_matrix(points: FloatArray) -> FloatArray:
    """Matrices (3, k, c) from coefficients to the local gradient of a piece at points (k, 3), -1 to 1."""
    order = powers(DEGREE)
    value = points[:, None, :] ** order
    lower = np.where(order > 0, order * points[:, None, :] ** np.maximum(order - 1, 0), 0.0)
    return np.stack(
        [
            np.prod(np.stack([(lower if a == axis else value)[:, :, a] for a in range(3)]), axis=0)
            for axis in range(3)
        ]
    )


def _slope(i: int) -> FloatArray:
    return np.asarray(chebyshev.chebder(np.eye(DEGREE + 1)[i]))


def _chebyshev_in_powers() -> list[FloatArray]:
    return [np.asarray(chebyshev.cheb2poly(np.eye(DEGREE + 1)[i][: i + 1])) for i in range(DEGREE + 1)]
