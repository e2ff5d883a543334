"""Derivatives of the least value of `keep_out_bound`, and of log det H, in the weights.

The form is H = sum V_i V_i' over thrust and arc, less that over the ellipsoid. The outputs follow the
weights, so the second derivatives of the least value are those of L less 2 b_i'H^-1 b_j, with b_i half the
gradient of the i-th constraint in the outputs. All are relative to the weights, but absolute for the slopes'.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from landing_cli.reach.keep_out_bound import INTERVALS, NODES, Descent, Facets, Least, Weights, applied

Floats = NDArray[np.float64]

_DIM = 3 * NODES + 3
_LAST = 3 * NODES - 3  # where the handover state begins in the outputs


class _Terms(NamedTuple):
    """The constraints at the outputs, weighted by the roots of their weights, and their columns V."""

    roots: Floats  # (n, K + 1, 2 N) R_k / sqrt(w_k)
    pulls: Floats  # (n, K + 1, 2 N) G^-1 times these: V_k of the thrust is that in each axis
    parts: Floats  # (n, 2 N, 3) whose squares add up to w_k int |a - c|^2
    ellipsoid: Floats  # (n, M, 3) xi
    arc: Floats  # (n, 2, 3)
    slopes: Floats  # (n, 2, 3) not weighted
    columns: Floats  # (n, 3 (K + 1), 3 (M + 2)) V of ellipsoid and arc


def derivatives(
    descent: Descent, facets: Facets, weights: Weights, least: Least, barrier: Floats
) -> tuple[Floats, Floats, Floats]:
    """Differentiate the least value plus ``barrier`` times log det H, and D.

    Parameters
    ----------
    descent : Descent
        The case.
    facets : Facets
        What flights keep.
    weights : Weights
        Where.
    least : Least
        The least value there.
    barrier : (n,) float
        Weight of log det H.

    Returns
    -------
    gradient : (n, m) float
        By thrust, ellipsoid, arc and slope.
    hessian : (n, m, m) float
    price : (n, m) float
        Gradient of D.
    """
    terms = _terms(descent, facets, weights, least)
    n, m = weights.ellipsoid.shape
    gradient, price = _gradients(descent, facets, weights, terms)
    inverse = np.asarray(np.linalg.inv(least.form), dtype=np.float64)
    own, squares, traces = _volume(inverse, terms)
    halves = _halves(descent, facets, terms)
    hessian = -2.0 * halves.transpose(0, 2, 1) @ (inverse @ halves)
    sign = np.concatenate([np.ones(INTERVALS), -descent.outside, np.ones(2)])
    scalars = INTERVALS + m + 2
    hessian[:, :scalars, :scalars] -= barrier[:, None, None] * sign[:, None] * sign * squares
    # G^-1 is not linear in w
    cross = terms.roots.transpose(0, 2, 1) @ terms.pulls
    cross *= terms.parts @ terms.parts.transpose(0, 2, 1) + barrier[:, None, None] * own
    hessian[:, :INTERVALS, :INTERVALS] += 2.0 * _block_sums(cross, 2, 2)
    each, energies = np.arange(INTERVALS), (terms.parts**2).reshape(n, INTERVALS, 6).sum(axis=2)
    hessian[:, each, each] -= 2.0 * (energies + barrier[:, None] * traces[:, :INTERVALS])
    gradient[:, :scalars] += barrier[:, None] * sign * traces
    return gradient, 0.5 * (hessian + hessian.transpose(0, 2, 1)), price


def _terms(descent: Descent, facets: Facets, weights: Weights, least: Least) -> _Terms:
    n, m = weights.ellipsoid.shape
    outputs, mu, omega = least.outputs, np.sqrt(weights.ellipsoid), np.sqrt(weights.arc)
    ends = outputs.reshape(n, 1, _DIM)[:, :, _LAST:]
    roots = descent.roots.transpose(1, 0, 2) / np.sqrt(weights.thrust)[:, None, :, None]
    roots = roots.reshape(n, NODES + 1, -1)
    pulls = least.inverse_gramian @ roots
    columns = np.zeros((n, _DIM, 3 * m + 6))
    for i, place in enumerate(descent.places):
        at = slice(3 * place, 3 * place + 3)
        columns[:, at, 3 * i : 3 * i + 3] = mu[:, i, None, None] * descent.axes[i].T
    arc = omega[:, None, :, None] * descent.arc_maps.transpose(2, 0, 1)
    columns[:, _LAST:, 3 * m :] = arc.reshape(n, 6, 6)
    return _Terms(
        roots,
        pulls,
        pulls.transpose(0, 2, 1) @ (outputs - facets.centre),
        mu[:, :, None] * applied(descent.axes, outputs[:, descent.places]),
        omega[:, :, None] * (applied(descent.arc_maps, ends) + facets.arc_offsets),
        applied(facets.slopes, ends) + facets.slope_offsets,
        columns,
    )


def _gradients(descent: Descent, facets: Facets, weights: Weights, terms: _Terms) -> tuple[Floats, Floats]:
    """Gradients of the least value, which are the constraints' values, and of D."""
    n, m = weights.ellipsoid.shape
    limits = weights.ellipsoid * descent.levels**2
    price = np.concatenate(
        [
            weights.thrust * facets.accelerations**2 / INTERVALS,
            np.zeros((n, m)),
            weights.arc * facets.arc_limits**2,
            np.zeros((n, 6)),
        ],
        axis=1,
    )
    values = np.concatenate(
        [
            (terms.parts**2).reshape(n, INTERVALS, 6).sum(axis=2),
            descent.outside * (limits - (terms.ellipsoid**2).sum(axis=2)),
            (terms.arc**2).sum(axis=2),
            -terms.slopes.reshape(n, -1),
        ],
        axis=1,
    )
    return values - price, price


def _halves(descent: Descent, facets: Facets, terms: _Terms) -> Floats:
    """The vectors b_i, (n, 3 (K + 1), m)."""
    n, others = len(terms.parts), terms.columns.shape[2] // 3
    scalars = INTERVALS + others
    halves = np.zeros((n, _DIM, scalars + 6))
    moved = terms.pulls[:, :, :, None] * terms.parts[:, None]
    moved = moved.reshape(n, NODES + 1, INTERVALS, 2, 3).sum(axis=3)
    halves[:, :, :INTERVALS] = moved.transpose(0, 1, 3, 2).reshape(n, _DIM, INTERVALS)
    factors = np.concatenate([-descent.outside[:, None] * terms.ellipsoid, terms.arc], axis=1)
    moved = terms.columns * factors.reshape(n, 1, -1)
    halves[:, :, INTERVALS:scalars] = moved.reshape(n, _DIM, others, 3).sum(axis=3)
    halves[:, _LAST:, scalars:] = -0.5 * facets.slopes.reshape(n, 6, 6).transpose(0, 2, 1)
    return halves


def _volume(inverse: Floats, terms: _Terms) -> tuple[Floats, Floats, Floats]:
    """Products of the V_i through H^-1: what log det H answers to.

    Returns
    -------
    own : (n, 2 N, 2 N) float
        Of the thrust's pulls, added up over the axes.
    squares : (n, M', M') float
        tr (V_i'H^-1 V_j)(V_j'H^-1 V_i) of the scalar weights.
    traces : (n, M') float
        tr V_i'H^-1 V_i.
    """
    n, others = len(inverse), terms.columns.shape[2] // 3
    pulls, turned = terms.pulls, terms.pulls.transpose(0, 2, 1)
    by_axes = inverse.reshape(n, NODES + 1, 3, NODES + 1, 3).transpose(0, 2, 4, 1, 3)
    thrust = turned[:, None, None] @ by_axes @ pulls[:, None, None]
    solved = inverse @ terms.columns
    mixed = (turned @ solved.reshape(n, NODES + 1, -1)).reshape(n, 2 * INTERVALS, 3, -1)
    held = terms.columns.transpose(0, 2, 1) @ solved
    squares = np.empty((n, INTERVALS + others, INTERVALS + others))
    squares[:, :INTERVALS, :INTERVALS] = _block_sums((thrust**2).sum(axis=(1, 2)), 2, 2)
    squares[:, INTERVALS:, INTERVALS:] = _block_sums(held**2, 3, 3)
    squares[:, :INTERVALS, INTERVALS:] = _block_sums((mixed**2).sum(axis=2), 2, 3)
    squares[:, INTERVALS:, :INTERVALS] = squares[:, :INTERVALS, INTERVALS:].transpose(0, 2, 1)
    own = np.trace(thrust, axis1=1, axis2=2)
    traces = [
        np.diagonal(own, axis1=1, axis2=2).reshape(n, -1, 2).sum(axis=2),
        np.diagonal(held, axis1=1, axis2=2).reshape(n, -1, 3).sum(axis=2),
    ]
    return own, squares, np.concatenate(traces, axis=1)


def _block_sums(matrices: Floats, rows: int, columns: int) -> Floats:
    """Add up the elements of each block, (n, r, c) by (rows, columns)."""
    n, r, c = matrices.shape
    return np.asarray(matrices.reshape(n, r // rows, rows, c // columns, columns).sum(axis=(2, 4)))
