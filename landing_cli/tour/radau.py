"""Constants of Gauss-Radau collocation with eight nodes, the first at the start of the step: order 15.

The nodes are Everhart's (1985, "An efficient integrator that uses Gauss-Radau spacings"): the roots of
P7 + P8 on (-1, 1), taken to (0, 1).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from landing_cli.kernel import part
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


@part
def extrapolate(scheme: Radau, ratio: float, forces: FloatArray, ahead: FloatArray) -> None:
    """Carry the polynomial of a step's accelerations on to the nodes of the next.

    Parameters
    ----------
    scheme : Radau
        Constants of the collocation.
    ratio : float
        Length of the next step over that of the last.
    forces : (8, 3) float, m/s2
        Accelerations at the nodes of the last step.
    ahead : (8, 3) float, m/s2
        Receives those at the nodes 1 to 7 of the next.
    """
    for n in range(1, NODES):
        at = 1.0 + ratio * scheme.nodes[n]
        total = sx = sy = sz = 0.0
        for j in range(NODES):
            weight = scheme.leading[j] / (at - scheme.nodes[j])
            total += weight
            sx += weight * forces[j, 0]
            sy += weight * forces[j, 1]
            sz += weight * forces[j, 2]
        ahead[n, 0], ahead[n, 1], ahead[n, 2] = sx / total, sy / total, sz / total


@part
def state_within(
    scheme: Radau, h: float, share: float, state: FloatArray, forces: FloatArray, out: FloatArray
) -> None:
    """State within a step, by integration of the accelerations' polynomial.

    Parameters
    ----------
    scheme : Radau
        Constants of the collocation.
    h : float, s
        Length of the step.
    share : float
        How far into it, 0 to 1.
    state : (6,) float, m and m/s
        At its start.
    forces : (8, 3) float, m/s2
        Accelerations at its nodes.
    out : (6,) float, m and m/s
        Receives the state.
    """
    for axis in range(3):
        one = two = 0.0
        power = share
        for k in range(NODES):
            coefficient = 0.0
            for j in range(NODES):
                coefficient += scheme.monomials[j, k] * forces[j, axis]
            one += coefficient * power / (k + 1)
            power *= share
            two += coefficient * power / ((k + 1) * (k + 2))
        out[axis] = state[axis] + h * (share * state[3 + axis] + h * two)
        out[3 + axis] = state[3 + axis] + h * one
