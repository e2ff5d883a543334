"""Pieces of a polyhedron's field: in every cube the near facets as they are, the far ones as a polynomial.

The pull of a facet is smooth and harmonic away from it. So a cube is divided in eight until few facets are
near it; those are kept, and the pull of all others is a harmonic polynomial in the coordinates of the cube,
-1 to 1. A child inherits its parent's polynomial, which it holds exactly, and adds that of the facets that
were near the parent and are far from the child, fitted to their pull at points of Chebyshev density by
least squares. (The downward pass of the fast multipole method, Greengard & Rokhlin 1987, by fits for
multipoles.)
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache, partial

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.gravity.interpolated_kernels import DEGREE, FACET, POWERS, fill_pulls
from landing_cli.body.gravity.kernel_types import FloatArray

IntArray = NDArray[np.int64]

MOST_DIVISIONS = 30
_FIT_POINTS = 4 * (DEGREE + 1) ** 2 // 3


@dataclass(frozen=True, eq=False)
class Facets:
    """What the kernels read of every facet.

    Attributes
    ----------
    density : float, 1/s2
        G rho.
    table : (m, FACET) float
        Of every facet three corners, the normal, twice the area; of each edge its length and outward normal.
    lower, upper : (m, 3) float, m
        Corners of the box around each facet.
    """

    density: float
    table: FloatArray
    lower: FloatArray
    upper: FloatArray

    @classmethod
    def of(cls, corners: FloatArray, density: float) -> Facets:
        """Prepare facets (m, 3, 3), m, counter-clockwise seen from outside."""
        along = np.roll(corners, -1, axis=1) - corners
        areas = np.cross(along[:, 0], along[:, 1])
        twice_area = np.linalg.norm(areas, axis=1, keepdims=True)
        normals = areas / twice_area
        length = np.linalg.norm(along, axis=2, keepdims=True)
        edges = np.concatenate([length, np.cross(along / length, normals[:, None])], axis=2)
        m = len(corners)
        table = np.hstack([corners.reshape(m, 9), normals, twice_area, edges.reshape(m, 12)])
        assert table.shape[1] == FACET
        return cls(density, table, corners.min(axis=1), corners.max(axis=1))

    def near(self, chosen: IntArray, center: FloatArray, distance: float) -> NDArray[np.bool_]:
        """Tell which of chosen facets' own boxes come so near a point, along every axis."""
        apart = (self.lower[chosen] > center + distance) | (self.upper[chosen] < center - distance)
        return np.asarray(~apart.any(axis=1))

    def pulls(self, chosen: IntArray, points: FloatArray) -> FloatArray:
        """Return the pull of chosen facets at points (k, 3), (k, 3) m/s2."""
        found = np.empty((len(points), 3))
        fill_pulls(self.table.ravel(), chosen, points, found)
        return self.density * found


@dataclass(frozen=True, eq=False)
class Piece:
    """A cube that is not divided.

    Attributes
    ----------
    node : int
        Its place in the tree.
    center : (3,) float, m
    half : float, m
    coefficients : (c, 3) float, m/s2
        In the order of Horner's scheme: powers of x, then y, then z, falling.
    near : (k,) int
        Facets.
    """

    node: int
    center: FloatArray
    half: float
    coefficients: FloatArray
    near: IntArray


def fit_pieces(
    facets: Facets, center: FloatArray, half: float, reach: float, most_near: int
) -> tuple[IntArray, list[Piece]]:
    """Divide a cube into pieces and fit what is far from each.

    Parameters
    ----------
    facets : Facets
        The polyhedron.
    center : (3,) float, m
        The cube's.
    half : float, m
        Half its side.
    reach : float
        Facets are near up to this far from a cube, in halves of its side.
    most_near : int
        Cubes near more facets are divided.

    Returns
    -------
    tree : (t,) int
        At every node the first of its eight children, which follow each other, that of x below the middle
        first, then y, then z; 0 at pieces.
    pieces : list of Piece
    """
    tree: list[int] = [0]
    pieces: list[Piece] = []
    hand_down = partial(_handed_down, facets, reach)
    every = np.arange(len(facets.table))
    waiting = [(Piece(0, center, half, *hand_down(np.zeros((POWERS, 3)), every, center, half)), 0)]
    while waiting:
        piece, depth = waiting.pop()
        if len(piece.near) <= most_near or depth == MOST_DIVISIONS:
            pieces.append(piece)
            continue
        tree[piece.node] = len(tree)
        h = 0.5 * piece.half
        for octant, to_child in enumerate(_to_children()):
            at = piece.center + h * (2.0 * _bits(octant) - 1.0)
            given = hand_down(to_child @ piece.coefficients, piece.near, at, h)
            waiting.append((Piece(len(tree), at, h, *given), depth + 1))
            tree.append(0)
    return np.array(tree, dtype=np.int64), pieces


def _handed_down(
    facets: Facets, reach: float, inherited: FloatArray, near: IntArray, center: FloatArray, half: float
) -> tuple[FloatArray, IntArray]:
    """Coefficients of a cube whose parent is near ``near``, and the facets that are still near."""
    kept = facets.near(near, center, (1.0 + reach) * half)
    if kept.all():
        return inherited, near
    points, solve = _scheme()
    return inherited + solve @ facets.pulls(near[~kept], center + half * points), near[kept]


def _bits(octant: int) -> FloatArray:
    return np.array([octant >> axis & 1 for axis in range(3)], dtype=np.float64)


@lru_cache(maxsize=1)
def powers() -> IntArray:
    """Exponents of x, y, z of every coefficient, in the order of Horner's scheme, (c, 3) int."""
    falling = range(DEGREE, -1, -1)
    every = [(i, j, k) for i in falling for j in falling for k in falling if i + j + k <= DEGREE]
    return np.array(every, dtype=np.int64)


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


@lru_cache(maxsize=1)
def _scheme() -> tuple[FloatArray, FloatArray]:
    """Points of the fit, and what takes values there to coefficients: (c, k), all harmonic."""
    order, points = powers(), np.cos(np.pi * 0.5 * (spread_points(_FIT_POINTS, 0.5) + 1.0))
    harmonic = _harmonic_powers(order)
    values = np.prod(points[:, None] ** order, axis=2) @ harmonic
    return points, np.asarray(harmonic @ np.linalg.pinv(values))


def _harmonic_powers(order: IntArray) -> FloatArray:
    """Orthonormal coefficients of all polynomials whose Laplacian is 0, (c, (DEGREE + 1)^2)."""
    place = {tuple(exponents): i for i, exponents in enumerate(order.tolist())}
    laplacian = np.zeros((POWERS, POWERS))
    for column, exponents in enumerate(order.tolist()):
        for axis, n in enumerate(exponents):
            if n >= 2:
                lower = tuple(e - 2 * (a == axis) for a, e in enumerate(exponents))
                laplacian[place[lower], column] += n * (n - 1)
    return np.asarray(np.linalg.svd(laplacian)[2][-((DEGREE + 1) ** 2) :].T)


@lru_cache(maxsize=1)
def _to_children() -> list[FloatArray]:
    """Matrices (c, c) from the coefficients of a cube to those of each of its eight children.

    A child's coordinate is twice the parent's, more or less 1.
    """
    order = powers()
    moved = np.zeros((2, DEGREE + 1, DEGREE + 1))
    for upper in (0, 1):
        for i in range(DEGREE + 1):
            moved[upper, : i + 1, i] = (np.polynomial.Polynomial([upper - 0.5, 0.5]) ** i).coef
    matrices = []
    for octant in range(8):
        sides = _bits(octant).astype(int)
        factors = [moved[sides[a]][order[:, a][:, None], order[:, a][None]] for a in range(3)]
        matrices.append(np.asarray(factors[0] * factors[1] * factors[2]))
    return matrices
