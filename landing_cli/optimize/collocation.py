"""Legendre-Gauss collocation: nodes, quadrature, barycentric interpolation, differentiation.

The Gauss pseudospectral method (Benson 2005) writes a state as the polynomial through the start of a span
and its n Legendre-Gauss nodes, demands the equations of motion at the nodes and reaches the end by Gauss
quadrature. All on the span [-1, 1].
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]


def legendre_gauss(n: int) -> tuple[FloatArray, FloatArray]:
    """Nodes and weights of the Gauss quadrature on [-1, 1], exact up to degree 2 n - 1.

    Parameters
    ----------
    n : int
        Number of nodes, at least 1.

    Returns
    -------
    nodes, weights : (n,) float
        The roots of the Legendre polynomial P_n, ascending, and their weights (sum 2).
    """
    nodes, weights = np.polynomial.legendre.leggauss(n)
    return nodes, weights


def barycentric_weights(nodes: ArrayLike) -> FloatArray:
    """Weights of barycentric interpolation, scaled to largest 1 (Berrut and Trefethen 2004, eq 3.2).

    Parameters
    ----------
    nodes : (n,) float
        Distinct nodes; on [-1, 1] hundreds of Legendre-Gauss nodes are no trouble.

    Returns
    -------
    (n,) float
    """
    x = np.asarray(nodes, dtype=np.float64)
    differences = x[:, None] - x
    np.fill_diagonal(differences, 1.0)
    sign = np.prod(np.sign(differences), axis=1)
    log = -np.log(np.abs(differences)).sum(axis=1)  # the product itself under- and overflows
    return np.asarray(sign * np.exp(log - log.max()))


def interpolation_matrix(nodes: ArrayLike, points: ArrayLike) -> FloatArray:
    """Matrix that takes values at nodes to the values of their polynomial at points.

    The second barycentric form (Berrut and Trefethen 2004, eq 4.2); rows sum to 1.

    Parameters
    ----------
    nodes : (n,) float
        Distinct nodes.
    points : (m,) float
        Where to evaluate; a point may be a node.

    Returns
    -------
    (m, n) float
    """
    x, weights = np.asarray(nodes, dtype=np.float64), barycentric_weights(nodes)
    gaps = np.asarray(points, dtype=np.float64)[:, None] - x
    hit = gaps == 0.0
    terms = weights / np.where(hit, 1.0, gaps)
    on_node = hit.any(axis=1)
    terms[on_node] = hit[on_node]
    return np.asarray(terms / terms.sum(axis=1, keepdims=True))


def differentiation_matrix(nodes: ArrayLike) -> FloatArray:
    """Matrix that takes values at nodes to the derivatives of their polynomial there.

    Barycentric (Berrut and Trefethen 2004, eqs 9.4-9.5): the diagonal is the negative sum of its row, so
    a constant has the derivative zero to rounding.

    Parameters
    ----------
    nodes : (n,) float
        Distinct nodes.

    Returns
    -------
    (n, n) float
    """
    x, weights = np.asarray(nodes, dtype=np.float64), barycentric_weights(nodes)
    gaps = x[:, None] - x
    np.fill_diagonal(gaps, 1.0)
    matrix = weights / weights[:, None] / gaps
    np.fill_diagonal(matrix, 0.0)
    np.fill_diagonal(matrix, -matrix.sum(axis=1))
    return np.asarray(matrix)


@dataclass(frozen=True, eq=False)
class GaussSpan:
    """The matrices of a span of the Gauss pseudospectral method, on [-1, 1].

    Attributes
    ----------
    nodes, weights : (n,) float
        Legendre-Gauss nodes and quadrature weights; the control lives on the nodes.
    support : (n + 1,) float
        The start -1 followed by the nodes: where the state lives.
    derivative : (n, n + 1) float
        Takes the state on the support to its derivative at the nodes (Benson 2005).
    integral : (n, n) float
        Takes a derivative at the nodes to the change from -1 to each node: the inverse of ``derivative``
        without its first column.
    """

    nodes: FloatArray
    weights: FloatArray
    support: FloatArray
    derivative: FloatArray
    integral: FloatArray

    def state_at(self, points: ArrayLike) -> FloatArray:
        """Take the state on the support to its value at points: (m, n + 1) float for (m,) points."""
        return interpolation_matrix(self.support, points)

    def control_at(self, points: ArrayLike) -> FloatArray:
        """Take the control on the nodes to its value at points: (m, n) float for (m,) points."""
        return interpolation_matrix(self.nodes, points)


def gauss_span(n: int) -> GaussSpan:
    """Build the matrices of a span of n Legendre-Gauss nodes.

    Parameters
    ----------
    n : int
        Number of nodes, at least 1.

    Returns
    -------
    GaussSpan
    """
    nodes, weights = legendre_gauss(n)
    support = np.concatenate([[-1.0], nodes])
    derivative = differentiation_matrix(support)[1:]
    integral = np.asarray(np.linalg.inv(derivative[:, 1:]), dtype=np.float64)
    return GaussSpan(nodes, weights, support, derivative, integral)
