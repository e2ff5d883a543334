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
    least_value,
)
from landing_cli.reach.keep_out_derivatives import derivatives

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
    gradient, hessian, price = derivatives(descent, facets, weights, least, barrier)
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
