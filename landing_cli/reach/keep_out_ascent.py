"""Weights that make the least value of the Lagrangian of `keep_out_bound` as large as it gets.

It is a concave function of the weights, smooth inside its domain: Newton steps climb it, with logarithms of
the weights added, which fade. Any weights on the way give a valid bound, so a climb ends at the first that
proves something, and what the steps do needs no proof.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from landing_cli.reach.keep_out_bound import (
    INTERVALS,
    NODES,
    Descent,
    Facets,
    Least,
    Weights,
    applied,
    least_value,
)

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

# A value above this is positive whatever the rounding; D = 1.
POSITIVE = 1e-6
# Weight of the logarithms: at first, its fall at a good step, and the last.
FIRST_BARRIER, FALL, LAST_BARRIER = 0.05, 0.4, 3e-5
# At a centred point the largest value lies above by less than GAP times the barrier; elsewhere it may not.
# What cannot get above HOPELESS is given up.
GAP, HOPELESS = 250.0, -0.15
FIRST_ARCS, FIRST_SLOPE, FIRST_ELLIPSOID = 0.9, 0.03, 0.5
MOST_STEPS, MOST_HALVINGS, GOOD_STEP, KEPT = 24, 8, 0.4, 0.1
_FLIP = np.array([1.0, -1.0, -1.0])


class Climb(NamedTuple):
    """Where the climbs of n facets ended."""

    weights: Weights
    value: Floats  # (n,) of L with D = 1
    steps: Ints  # (n,)


def first_weights(descent: Descent, facets: Facets) -> Weights:
    """Weights to begin with: those of a flight from rest to rest, and a little of the ellipsoid's.

    A unit of mu_i takes as much of the form, against the rest, as the largest eigenvalue of the i-th block of
    the inverse form in xi.
    """
    n = len(facets.accelerations)
    middle = (np.arange(INTERVALS) + 0.5) / INTERVALS
    share = np.abs(1.0 - 2.0 * middle) + 0.1
    slope = np.zeros((n, 2, 3))
    slope[:, :, 0] = FIRST_SLOPE
    arc = 0.5 * FIRST_ARCS / facets.arc_limits**2
    thrust = (1.0 - FIRST_ARCS) * share / share.mean() / facets.accelerations**2
    free = Weights(thrust, np.zeros((n, len(descent.places))), arc, slope)
    inverse = np.linalg.inv(least_value(descent, facets, free).form)
    loose = [inverse[:, i : i + 3, i : i + 3] for i in 3 * descent.places]
    spread = descent.axes @ np.stack(loose, axis=1) @ descent.axes.transpose(0, 2, 1)
    return free._replace(ellipsoid=FIRST_ELLIPSOID / NODES / np.linalg.norm(spread, ord=2, axis=(2, 3)))


def climb(descent: Descent, facets: Facets, weights: Weights, first_barrier: float = FIRST_BARRIER) -> Climb:
    """Raise the least value of L from given weights until it is positive or as large as it gets.

    Parameters
    ----------
    descent : Descent
        The case.
    facets : Facets
        What flights to n facets keep.
    weights : Weights
        To begin with.
    first_barrier : float
        Weight of the logarithms at first; small where the weights are those of much the same problem.

    Returns
    -------
    Climb
    """
    n = len(facets.accelerations)
    weights = _normalised(facets, weights)
    best = Climb(Weights(*(x.copy() for x in weights)), np.full(n, -np.inf), np.zeros(n, dtype=np.int64))
    barrier = np.full(n, first_barrier)
    rows, least = np.arange(n), least_value(descent, facets, weights)
    for _ in range(MOST_STEPS):
        for whole, part in zip(best.weights, weights, strict=True):
            whole[rows] = part
        best.value[rows] = least.value
        going = (least.value <= POSITIVE) & np.isfinite(least.value) & (barrier >= LAST_BARRIER)
        going &= least.value + GAP * barrier > HOPELESS
        if not going.any():
            break
        rows, barrier = rows[going], barrier[going]
        facets = Facets(*(x[going] for x in facets))
        weights, least = Weights(*(x[going] for x in weights)), Least(*(x[going] for x in least))
        direction = _direction(descent, facets, weights, least, barrier)
        weights, least, length = _step(descent, facets, weights, least, barrier, direction)
        best.steps[rows] += 1
        barrier = np.where(length >= GOOD_STEP, FALL * barrier, np.where(length > 0.0, barrier, 0.0))
    return best


def _normalised(facets: Facets, weights: Weights) -> Weights:
    """Scale weights so that D = 1."""
    total = (weights.thrust * facets.accelerations**2).sum(axis=1) / INTERVALS
    total += (weights.arc * facets.arc_limits**2).sum(axis=1)
    return Weights(*(x / total.reshape(-1, *(1,) * (x.ndim - 1)) for x in weights))


def _cone_values(slope: Floats) -> Floats:
    """z_0^2 - z_1^2 - z_2^2, or less than 0 outside the cone."""
    return np.where(slope[:, :, 0] > 0.0, (slope * _FLIP * slope).sum(axis=2), -1.0)


def _logarithms(weights: Weights) -> Floats:
    """Sum of the logarithms that keep weights where they belong; -inf outside."""
    with np.errstate(invalid="ignore", divide="ignore"):
        parts = [np.log(x) for x in (*weights[:3], _cone_values(weights.slope))]
    return np.nan_to_num(np.concatenate(parts, axis=1), nan=-np.inf, neginf=-np.inf).sum(axis=1)


def _direction(descent: Descent, facets: Facets, weights: Weights, least: Least, barrier: Floats) -> Floats:
    """Newton's step, (n, m): relative for the scalar weights, absolute for the slopes', D held."""
    gradient, hessian, price = _derivatives(descent, facets, weights, least, barrier)
    scalars = gradient.shape[1] - 6
    gradient[:, :scalars] += barrier[:, None]
    hessian[:, np.arange(scalars), np.arange(scalars)] -= barrier[:, None]
    values = _cone_values(weights.slope)
    for c in range(2):
        at = slice(scalars + 3 * c, scalars + 3 * c + 3)
        normal = 2.0 * _FLIP * weights.slope[:, c] / values[:, c, None]
        gradient[:, at] += barrier[:, None] * normal
        bend = 2.0 * np.diag(_FLIP) / values[:, c, None, None] - normal[:, :, None] * normal[:, None, :]
        hessian[:, at, at] += barrier[:, None, None] * bend
    found = np.linalg.solve(-hessian, np.stack([gradient, price], axis=2))
    up, along = found[:, :, 0], found[:, :, 1]
    held = (price * up).sum(axis=1) / (price * along).sum(axis=1)
    return np.asarray(up - held[:, None] * along)


def _derivatives(
    descent: Descent, facets: Facets, weights: Weights, least: Least, barrier: Floats
) -> tuple[Floats, Floats, Floats]:
    """Gradient (n, m) and Hessian (n, m, m) of the least value and barrier log det H; gradient (n, m) of D.

    The form is H = sum V_i V_i' over thrust and arc, less that over the ellipsoid; b_i is half the gradient
    of the i-th constraint in the outputs. The second derivatives of the least value are those of L less
    2 b_i'H^-1 b_j.
    """
    w, mu, omega, _ = weights
    n, m, last = *mu.shape, 3 * (NODES - 1)
    second, scalars = INTERVALS + m, INTERVALS + m + 2
    sign = np.concatenate([np.ones(INTERVALS), -descent.outside, np.ones(2)])
    outputs = least.outputs
    ends = outputs.reshape(n, -1)[:, last:]
    # relative changes of w change G^-1 by D_k D_k'
    roots = descent.roots.transpose(1, 0, 2) / np.sqrt(w)[:, None, :, None]
    pulls = (least.inverse_gramian @ roots.reshape(n, NODES + 1, -1)).reshape(roots.shape)
    flat_pulls, flat_roots = pulls.reshape(n, NODES + 1, -1), roots.reshape(n, NODES + 1, -1)
    parts = (flat_pulls.transpose(0, 2, 1) @ (outputs - facets.centre)).reshape(n, INTERVALS, 2, 3)
    xi = applied(descent.axes, outputs[:, descent.places])
    thrust = applied(descent.arc_maps, ends[:, None]) + facets.arc_offsets
    slopes = applied(facets.slopes, ends[:, None]) + facets.slope_offsets
    energies = (parts**2).sum(axis=(2, 3))
    prices = (w * facets.accelerations**2 / INTERVALS, omega * facets.arc_limits**2)
    gradient = np.concatenate(
        [
            energies - prices[0],
            descent.outside * mu * (descent.levels**2 - (xi**2).sum(axis=2)),
            omega * (thrust**2).sum(axis=2) - prices[1],
            -slopes.reshape(n, -1),
        ],
        axis=1,
    )
    price = np.zeros_like(gradient)
    price[:, :INTERVALS], price[:, second:scalars] = prices

    # the other weights' columns V, ellipsoid and arc
    columns = np.zeros((n, 3 * NODES + 3, 3 * m + 6))
    for i, place in enumerate(descent.places):
        at = slice(3 * place, 3 * place + 3)
        columns[:, at, 3 * i : 3 * i + 3] = np.sqrt(mu)[:, i, None, None] * descent.axes[i].T
    arc = np.sqrt(omega)[:, None, :, None] * descent.arc_maps.transpose(2, 0, 1)
    columns[:, last:, 3 * m :] = arc.reshape(n, 6, 6)
    inverse = np.linalg.inv(least.form)
    by_axes = inverse.reshape(n, NODES + 1, 3, NODES + 1, 3).transpose(0, 2, 4, 1, 3)
    turned_pulls = flat_pulls.transpose(0, 2, 1)
    own = turned_pulls[:, None, None] @ by_axes @ flat_pulls[:, None, None]
    solved = inverse @ columns
    mixed = turned_pulls @ solved.reshape(n, NODES + 1, -1)
    others = columns.transpose(0, 2, 1) @ solved
    squares = np.empty((n, scalars, scalars))
    squares[:, :INTERVALS, :INTERVALS] = _block_sums((own**2).sum(axis=(1, 2)), 2, 2)
    squares[:, INTERVALS:, INTERVALS:] = _block_sums(others**2, 3, 3)
    crossed = (mixed.reshape(n, 2 * INTERVALS, 3, -1) ** 2).sum(axis=2)
    squares[:, :INTERVALS, INTERVALS:] = _block_sums(crossed, 2, 3)
    squares[:, INTERVALS:, :INTERVALS] = squares[:, :INTERVALS, INTERVALS:].transpose(0, 2, 1)
    own = np.trace(own, axis1=1, axis2=2)
    traces = np.concatenate(
        [
            np.diagonal(own, axis1=1, axis2=2).reshape(n, -1, 2).sum(axis=2),
            np.diagonal(others, axis1=1, axis2=2).reshape(n, -1, 3).sum(axis=2),
        ],
        axis=1,
    )
    held = -(descent.outside * np.sqrt(mu))[:, :, None] * xi
    factors = np.concatenate([held, np.sqrt(omega)[:, :, None] * thrust], axis=1)
    halves = np.zeros((n, 3 * NODES + 3, scalars + 6))
    pulled = (pulls[:, :, :, :, None] * parts[:, None]).sum(axis=3)
    halves[:, :, :INTERVALS] = pulled.transpose(0, 1, 3, 2).reshape(n, -1, INTERVALS)
    moved = columns * factors.reshape(n, 1, -1)
    halves[:, :, INTERVALS:scalars] = moved.reshape(n, -1, m + 2, 3).sum(axis=3)
    halves[:, last:, scalars:] = -0.5 * facets.slopes.reshape(n, 6, 6).transpose(0, 2, 1)
    hessian = -2.0 * halves.transpose(0, 2, 1) @ (inverse @ halves)
    hessian[:, :scalars, :scalars] -= barrier[:, None, None] * sign[:, None] * sign * squares
    gradient[:, :scalars] += barrier[:, None] * sign * traces
    # G^-1 is not linear in w
    cross = flat_roots.transpose(0, 2, 1) @ flat_pulls
    flat_parts = parts.reshape(n, -1, 3)
    cross *= flat_parts @ flat_parts.transpose(0, 2, 1) + barrier[:, None, None] * own
    hessian[:, :INTERVALS, :INTERVALS] += 2.0 * _block_sums(cross, 2, 2)
    each = np.arange(INTERVALS)
    hessian[:, each, each] -= 2.0 * (energies + barrier[:, None] * traces[:, :INTERVALS])
    return gradient, 0.5 * (hessian + hessian.transpose(0, 2, 1)), price


def _block_sums(matrices: Floats, rows: int, columns: int) -> Floats:
    """Add up the elements of each block, (n, r, c) by (rows, columns)."""
    n, r, c = matrices.shape
    return np.asarray(matrices.reshape(n, r // rows, rows, c // columns, columns).sum(axis=(2, 4)))


def _step(
    descent: Descent, facets: Facets, weights: Weights, least: Least, barrier: Floats, direction: Floats
) -> tuple[Weights, Least, Floats]:
    """Go along a direction as far as what is climbed rises; returns how far, 0 where it does not."""
    before = least.value + barrier * (least.volume + _logarithms(weights))
    longest = np.maximum((-direction[:, :-6]).max(axis=1), 1e-300)
    length = np.minimum(1.0, (1.0 - KEPT) / longest)
    weights = Weights(*(x.copy() for x in weights))
    least = Least(*(x.copy() for x in least))
    trying = np.flatnonzero(np.isfinite(direction).all(axis=1))
    done = np.zeros(len(length))
    for _ in range(MOST_HALVINGS):
        part = Facets(*(x[trying] for x in facets))
        tried = _moved(Weights(*(x[trying] for x in weights)), direction[trying], length[trying])
        tried = _normalised(part, tried)
        inside = _logarithms(tried)
        found = least_value(descent, part, tried)
        with np.errstate(invalid="ignore"):
            better = found.value + barrier[trying] * (found.volume + inside) > before[trying]
        places = trying[better]
        for whole, piece in ((weights, tried), (least, found)):
            for into, values in zip(whole, piece, strict=True):
                into[places] = values[better]
        done[places] = length[places]
        trying = trying[~better]
        if len(trying) == 0:
            break
        length[trying] *= 0.5
    return weights, least, done


def _moved(weights: Weights, direction: Floats, length: Floats) -> Weights:
    step = length[:, None] * direction
    first, second = INTERVALS, INTERVALS + weights.ellipsoid.shape[1]
    return Weights(
        weights.thrust * (1.0 + step[:, :first]),
        weights.ellipsoid * (1.0 + step[:, first:second]),
        weights.arc * (1.0 + step[:, second:-6]),
        weights.slope + step[:, -6:].reshape(-1, 2, 3),
    )
