"""Constants of Gauss-Radau collocation with eight nodes, the first at the start of the step: order 15.

The nodes are Everhart's (1985, "An efficient integrator that uses Gauss-Radau spacings"): the roots of
P7 + P8 on (-1, 1), taken to (0, 1).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from landing_cli.kernel_record import by_reference

FloatArray = NDArray[np.float64]

NODES = 8


@by_reference
class Radau(NamedTuple):
    """How accelerations at the nodes make velocities and positions, in units of the step.

    Attributes
    ----------
    nodes : (8,) float
        From 0 to below 1.
    first, second : (9, 8) float
        Weights of the first and the second integral up to each node, and (last row) to the step's end.
    leading : (8,) float
        Weights of the polynomial's highest coefficient, that of t^7; also those of its barycentric form.
    monomials : (8, 8) float
        Rows: the nodes' Lagrange polynomials; columns: their coefficients of 1, t, ..., t^7.
    """

    nodes: FloatArray
    first: FloatArray
    second: FloatArray
    leading: FloatArray
    monomials: FloatArray


def radau() -> Radau:
    """Constants of the collocation.

    Returns
    -------
    Radau
    """
    series = np.zeros(NODES + 1)
    series[NODES - 1 :] = 1.0
    roots = np.sort(legendre.legroots(series).real)[1:]
    slope = legendre.legder(series)
    for _ in range(3):
        roots = roots - legendre.legval(roots, series) / legendre.legval(roots, slope)
    nodes = np.concatenate([[0.0], 0.5 * (1.0 + roots)])
    gaps = nodes[:, None] - nodes[None, :] + np.eye(NODES)
    leading = 1.0 / gaps.prod(axis=1)
    ends = np.append(nodes, 1.0)
    points, weights = legendre.leggauss(NODES)
    s = ends[:, None] * 0.5 * (1.0 + points)  # (9, q) within each interval
    w = ends[:, None] * 0.5 * weights
    basis = np.stack(
        [np.prod(s[..., None] - np.delete(nodes, j), axis=-1) * leading[j] for j in range(NODES)], axis=-1
    )
    first = np.einsum("nq,nqj->nj", w, basis)
    second = np.einsum("nq,nqj->nj", w * (ends[:, None] - s), basis)
    others = [np.polynomial.polynomial.polyfromroots(np.delete(nodes, j)) for j in range(NODES)]
    return Radau(nodes, first, second, leading, leading[:, None] * np.array(others))
