"""The dates of a chain that make the sum of its burns least: BFGS, with waits held at their bounds."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from landing_cli.flight.astronomy import DAY_S
from landing_cli.kernel import part
from landing_cli.tour.chain_kernel import Bounds, FirstLegs, Scratch, chain_cost
from landing_cli.tour.ephemeris import Ephemeris

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

_PROBE_S = 60.0
_SETTLED = 1e-6  # relative
_FIRST_STEP_S = 0.05 * DAY_S
_HALVINGS = 25


@part
def improve_dates(
    dates: FloatArray,
    length: int,
    targets: IntArray,
    first: FirstLegs,
    j: int,
    node_t_s: FloatArray,
    node_states: FloatArray,
    bounds: Bounds,
    ephemeris: Ephemeris,
    scratch: Scratch,
    legs: FloatArray,
    rounds: int,
) -> float:
    """Move the dates of a chain to the least sum of burns nearby: BFGS, with waits held at their bounds.

    Parameters
    ----------
    dates : (2 length - 1,) float, s
        As for `chain_cost`; improved in place.
    length : int
        Flybys.
    targets : (length,) int
        Rows of the nodes.
    first : FirstLegs
        Flights of the first leg.
    j : int
        The chain's own.
    node_t_s, node_states : (k,) and (n, k, 6) float
        Motion of the targets.
    bounds : Bounds
        What the dates keep to.
    ephemeris : Ephemeris
        The Earth among others.
    scratch : Scratch
        Room to work in.
    legs : (length, LEG_COLUMNS) float
        Receives the legs.
    rounds : int
        Steps at most.

    Returns
    -------
    float, m/s
        Sum of the burns; infinite where the dates given break a bound.
    """
    n = 2 * length - 1
    change, trial_change = np.zeros(3), np.zeros(3)
    gradient, old_gradient, direction = np.empty(n), np.empty(n), np.empty(n)
    trial = np.empty(n)
    hessian = np.zeros((n, n))  # inverse
    cost = chain_cost(
        dates, length, targets, first, j, node_t_s, node_states, bounds, ephemeris, change, scratch, legs
    )
    fresh = unscaled = True
    for _ in range(rounds):
        if not cost < np.inf:
            return cost
        for i in range(n):
            trial[:] = dates[:n]
            step = _PROBE_S
            if (i % 2 == 1 and dates[i] + step > bounds.wait_max_s[0]) or (
                i == n - 1 and dates[i] + step > bounds.end_t_s[0]
            ):
                step = -step
            trial[i] += step
            trial_change[:] = change
            found = chain_cost(
                trial,
                length,
                targets,
                first,
                j,
                node_t_s,
                node_states,
                bounds,
                ephemeris,
                trial_change,
                scratch,
                legs,
            )
            gradient[i] = (found - cost) / step if found < np.inf else 0.0
            if i % 2 == 1 and (
                (dates[i] <= 0.0 and gradient[i] > 0.0)
                or (dates[i] >= bounds.wait_max_s[0] and gradient[i] < 0.0)
            ):
                gradient[i] = 0.0
        if not fresh:
            update_inverse(hessian, trial, direction, gradient, old_gradient, n, unscaled)
            unscaled = False
        size = math.sqrt(np.sum(gradient * gradient))
        if size == 0.0:
            break
        if fresh:
            unscaled = True
            hessian[:] = 0.0
            for i in range(n):
                hessian[i, i] = _FIRST_STEP_S / size
        slope = 0.0
        for i in range(n):
            direction[i] = 0.0
            if gradient[i] != 0.0:
                for k in range(n):
                    direction[i] -= hessian[i, k] * gradient[k]
            slope += direction[i] * gradient[i]
        if not slope < 0.0:
            if fresh:
                break
            fresh = True
            continue
        share, gained = 1.0, 0.0
        for _ in range(_HALVINGS):
            for i in range(n):
                trial[i] = dates[i] + share * direction[i]
                if i % 2 == 1:
                    trial[i] = max(0.0, min(bounds.wait_max_s[0], trial[i]))
            trial[n - 1] = min(trial[n - 1], bounds.end_t_s[0])
            trial_change[:] = change
            found = chain_cost(
                trial,
                length,
                targets,
                first,
                j,
                node_t_s,
                node_states,
                bounds,
                ephemeris,
                trial_change,
                scratch,
                legs,
            )
            if found < cost + 1e-4 * share * slope:
                gained = cost - found
                break
            share *= 0.3
        if gained == 0.0:
            if fresh:
                break
            fresh = True
            continue
        for i in range(n):
            direction[i] = trial[i] - dates[i]
            dates[i] = trial[i]
        change[:] = trial_change
        old_gradient[:] = gradient
        if gained < _SETTLED * cost and not fresh:
            cost -= gained
            break
        cost -= gained
        fresh = False
    return chain_cost(
        dates, length, targets, first, j, node_t_s, node_states, bounds, ephemeris, change, scratch, legs
    )


@part
def update_inverse(
    inverse: FloatArray,
    work: FloatArray,
    step: FloatArray,
    new: FloatArray,
    old: FloatArray,
    n: int,
    first: bool,
) -> None:
    """BFGS update of an inverse Hessian (Nocedal and Wright 2006, eq 6.17).

    Skipped where the curvature is not positive.

    Parameters
    ----------
    inverse : (n, n) float
        Improved in place.
    work : (n,) float
        Scratch.
    step : (n,) float
        Last step.
    new, old : (n,) float
        Gradients after and before it.
    n : int
        Unknowns.
    first : bool
        Whether the inverse was not updated before.
    """
    curvature = square = 0.0
    for i in range(n):
        curvature += step[i] * (new[i] - old[i])
        square += (new[i] - old[i]) ** 2
    if not curvature > 1e-12 * square:
        return
    if first:  # the scale of the problem, eq 6.20
        for i in range(n):
            inverse[i, i] = curvature / square
    bend = 0.0
    for i in range(n):
        work[i] = 0.0
        for k in range(n):
            work[i] += inverse[i, k] * (new[k] - old[k])
        bend += work[i] * (new[i] - old[i])
    for i in range(n):
        for k in range(n):
            inverse[i, k] += (
                (1.0 + bend / curvature) * step[i] * step[k] - work[i] * step[k] - step[i] * work[k]
            ) / curvature
