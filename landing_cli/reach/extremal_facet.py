"""One facet by extremals: the trust-region SQP over the seven initial costates."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from landing_cli.optimize.elastic_qp import ElasticQP
from landing_cli.optimize.sqp import (
    LocalModel,
    add_secant,
    convexify,
    new_local_model,
    new_qp_for,
    propose,
    violation,
)
from landing_cli.reach.costate_dynamics import (
    COLUMNS,
    MAX_SPLITS,
    STATE,
    Extremal,
    fly_extremal,
    new_extremal,
    tangents,
)
from landing_cli.reach.extremal_terms import (
    MAX_DIPS,
    MAX_ROWS,
    ROW_DIPS,
    ROW_HANDOVER,
    ROW_MASS,
    Dips,
    ExtremalProblem,
    dip_row,
    final_energy,
    find_dips,
    handover_hessian,
    handover_rows,
    new_dips,
)

Floats = NDArray[np.float64]

N_STEPS = 30
N = 7
UNCONVERGED, OPTIMAL, STUCK = 0, 1, 2
FEASIBLE = 1e-7
MAX_ROUNDS = 120
FIRST_PRICE, LAST_PRICE = 10.0, 1e3
SETTLED = 1e-9  # of the merit: nothing more is expected
HOPELESS = 1e-4  # of the violation: a full step expects no less of it
FULL_REACH, SMALLEST_REACH = 1e-2, 1e-10
MOST_PROBES = 3


class Flight(NamedTuple):
    """A trial: the extremal, its dips and the rows' values."""

    extremal: Extremal
    dips: Dips
    values: Floats  # (MAX_ROWS,)


@njit(cache=True, nogil=True, error_model="numpy")
def new_flight() -> Flight:
    """Room for one trial."""
    return Flight(new_extremal(N_STEPS), new_dips(), np.zeros(MAX_ROWS))


@njit(cache=True, nogil=True, error_model="numpy")
def fly_trial(
    problem: ExtremalProblem,
    target: Floats,
    normal: Floats,
    costates: Floats,
    flight: Flight,
    jacobian: Floats,
    gradient: Floats,
) -> tuple[int, int, float]:
    """Fly the extremal of the given costates and evaluate cost and rows.

    Returns
    -------
    steps, rows : int
    energy : float
        J over ``a0^2 t_p``.
    """
    y = flight.extremal.state[0]
    for i in range(3):
        y[i], y[3 + i] = problem.position[i], problem.velocity[i]
    y[6], y[14] = 1.0, 0.0
    for i in range(N):
        y[7 + i] = costates[i]
    k = fly_extremal(problem.field, N_STEPS, flight.extremal)
    x = flight.extremal.state[k]
    handover_rows(problem, target, normal, x, flight.values, jacobian)
    flight.values[ROW_MASS] = x[13]
    n_dips = find_dips(problem.field.inverse_axes, flight.extremal, k, flight.dips)
    for d in range(n_dips):
        flight.values[ROW_DIPS + d] = flight.dips.level[d] - 1.0
    return k, ROW_DIPS + n_dips, x[14] + final_energy(problem, target, x, gradient)


@njit(cache=True, nogil=True, error_model="numpy")
def differentiate(
    problem: ExtremalProblem,
    target: Floats,
    normal: Floats,
    flight: Flight,
    k: int,
    rows: int,
    multipliers: Floats,
    node_tangents: Floats,
    model: LocalModel,
) -> None:
    """Fill the local model at a flown trial.

    The Hessian rests on the costates being the gradient of the descent's least energy: with S and P the
    derivatives of the last state and the last costates, that energy has the Hessian -S'P where the costates
    are those of the optimum.
    """
    X, K = np.zeros((STATE, COLUMNS)), np.zeros((7, 7))
    at_handover, of_final = np.zeros((ROW_MASS, 7)), np.zeros(7)
    tangents(problem.field, flight.extremal, k, X, node_tangents)
    x = flight.extremal.state[k]
    handover_rows(problem, target, normal, x, model.values, at_handover)
    final_energy(problem, target, x, of_final)
    handover_hessian(problem, target, x, multipliers, K)
    for j in range(N):
        model.gradient[j] = X[14, j]
        for i in range(7):
            model.gradient[j] += of_final[i] * X[i, j]
        for r in range(ROW_MASS):
            total = 0.0
            for i in range(7):
                total += at_handover[r, i] * X[i, j]
            model.jacobian[r, j] = total
        model.jacobian[ROW_MASS, j] = X[13, j]
    for a in range(N):
        for b in range(a + 1):
            total = 0.0
            for i in range(7):
                total -= 0.5 * (X[i, a] * X[7 + i, b] + X[i, b] * X[7 + i, a])
                for j in range(7):
                    total += X[i, a] * K[i, j] * X[j, b]
            model.hessian[a, b] = model.hessian[b, a] = total
    for r in range(rows):
        model.values[r] = flight.values[r]
    for d in range(rows - ROW_DIPS):
        r = ROW_DIPS + d
        dip_row(
            problem,
            flight.extremal,
            node_tangents,
            flight.dips.step[d],
            flight.dips.fraction[d],
            flight.dips.bend[d],
            model.jacobian[r],
            -multipliers[r],
            model.hessian,
        )


@njit(cache=True, nogil=True, error_model="numpy")
def solve_from(
    problem: ExtremalProblem, target: Floats, normal: Floats, costates: Floats, log: Floats
) -> tuple[int, int, float, float]:
    """Improve the costates in place.

    Returns
    -------
    status : int
        ``OPTIMAL``, ``STUCK`` (a local minimum of the violation) or ``UNCONVERGED``.
    rounds : int
    energy : float
        J over ``a0^2 t_p``.
    violation : float
    """
    here, there, other = new_flight(), new_flight(), new_flight()
    kept, step2, trial2, multipliers2 = np.zeros(MAX_ROWS), np.zeros(N), np.zeros(N), np.zeros(MAX_ROWS)
    model, qp = new_local_model(N, MAX_ROWS), new_qp_for(N, MAX_ROWS)
    for r in range(MAX_ROWS):
        model.equality[r] = r == ROW_MASS or (r == ROW_HANDOVER and problem.on_ellipsoid)
        model.pooled[r] = r >= ROW_DIPS or (r == ROW_HANDOVER and not problem.on_ellipsoid)
    node_tangents = np.zeros((N_STEPS + MAX_SPLITS + 1, 6, COLUMNS))
    unused_j, unused_g = np.zeros((ROW_MASS, 7)), np.zeros(7)
    multipliers, step, trial, radius = np.zeros(MAX_ROWS), np.zeros(N), np.zeros(N), np.zeros(N)
    old_gradient, old_jacobian, old_rows = np.zeros(N), np.zeros((MAX_ROWS, N)), 0
    secant, change, moved = np.zeros((N, N)), np.zeros(N), np.zeros(N)
    price, reach = FIRST_PRICE, 0.5
    status = UNCONVERGED
    k, rows, energy = fly_trial(problem, target, normal, costates, here, unused_j, unused_g)
    fresh, stepped = True, False
    rounds, probes = 0, 0
    broken = 0.0
    for rounds in range(1, MAX_ROUNDS + 1):
        if fresh:
            old_gradient[:] = model.gradient
            old_jacobian[:, :] = model.jacobian
            differentiate(problem, target, normal, here, k, rows, multipliers, node_tangents, model)
            broken = violation(model.values, model.equality, model.pooled, rows)
            if stepped and rows == old_rows:
                for a in range(N):
                    change[a] = model.gradient[a] - old_gradient[a]
                    for r in range(rows):
                        change[a] -= multipliers[r] * (model.jacobian[r, a] - old_jacobian[r, a])
                    for b in range(N):
                        change[a] -= model.hessian[a, b] * moved[b]
                add_secant(change, moved, secant)
            elif stepped:
                secant[:, :] = 0.0
            for a in range(N):
                for b in range(N):
                    model.hessian[a, b] += secant[a, b]
            convexify(model.hessian)
            old_rows = rows
            fresh = False
        size = 1.0
        for a in range(6):
            size = max(size, abs(costates[a]))
        for a in range(N):
            radius[a] = reach * size
        expected = propose(model, rows, price, radius, qp, step, multipliers)
        log[rounds, 0], log[rounds, 1], log[rounds, 2], log[rounds, 3], log[rounds, 4] = (
            energy,
            broken,
            expected,
            reach,
            price,
        )
        if reach < SMALLEST_REACH and probes == MOST_PROBES:
            break
        if broken < FEASIBLE:
            if expected < SETTLED * (1.0 + abs(energy)):
                status = OPTIMAL
                break
        elif expected < max(SETTLED, HOPELESS * price * broken):
            if reach < FULL_REACH and probes < MOST_PROBES:
                reach, probes = 2.0 * FULL_REACH, probes + 1
                continue
            if price >= LAST_PRICE:
                status = STUCK
                break
            price *= 10.0
            continue
        for a in range(N):
            trial[a] = costates[a] + step[a]
        k2, rows2, energy2 = fly_trial(problem, target, normal, trial, there, unused_j, unused_g)
        broken2 = violation(there.values, model.equality, model.pooled, rows2)
        ratio = (energy - energy2 + price * (broken - broken2)) / expected
        if ratio < 0.5 and rows2 == rows:
            # second-order correction: aim again from what the rows turned out to be
            for r in range(rows):
                kept[r] = model.values[r]
                model.values[r] = there.values[r]
                for a in range(N):
                    model.values[r] -= model.jacobian[r, a] * step[a]
            propose(model, rows, price, radius, qp, step2, multipliers2)
            for r in range(rows):
                model.values[r] = kept[r]
            for a in range(N):
                trial2[a] = costates[a] + step2[a]
            k3, rows3, energy3 = fly_trial(problem, target, normal, trial2, other, unused_j, unused_g)
            broken3 = violation(other.values, model.equality, model.pooled, rows3)
            ratio2 = (energy - energy3 + price * (broken - broken3)) / expected
            if ratio2 > ratio:
                ratio, k2, rows2, energy2, broken2 = ratio2, k3, rows3, energy3, broken3
                there, other = other, there
                trial[:] = trial2
                step[:] = step2
        log[rounds, 5] = ratio
        longest = 0.0
        for a in range(N):
            longest = max(longest, abs(step[a]))
        if ratio > 1e-3:
            for a in range(N):
                costates[a], moved[a] = trial[a], step[a]
            here, there = there, here
            k, rows, energy = k2, rows2, energy2
            fresh, stepped = True, True
        if ratio < 0.25:
            reach = 0.25 * longest / size
        elif ratio > 0.75:
            reach = max(reach, min(3.0 * longest / size, 4.0))
    return status, rounds, energy, broken
