"""Facets by extremals: a trust-region SQP over the seven initial costates.

Beyond the free end of the horizon nothing is relaxed: every trial is an exact extremal, flown to the
handover; the SQP moves its costates until the two-stage landing meets every row of ``extremal_terms`` at
the least energy. The Hessian is exact where it can be had for nothing (see ``_differentiate``), and secant
updates supply the rest.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from landing_cli.kernel import inlined, part
from landing_cli.optimize.sqp import (
    LocalModel,
    add_secant,
    convexify,
    new_local_model,
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
from landing_cli.reach.ellipsoid_dips import LEVEL, dip_row, find_dips, new_dips
from landing_cli.reach.extremal_terms import (
    MAX_ROWS,
    ROW_DIPS,
    ROW_HANDOVER,
    ROW_MASS,
    ExtremalProblem,
    final_energy,
    handover_hessian,
    handover_rows,
)

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Steps of a search, and of the flight that is delivered, whose handover is within a millimetre of the truth.
COARSE_STEPS, FINE_STEPS = 30, 120
N = 7
UNCONVERGED, OPTIMAL, STUCK = 0, 1, 2

FEASIBLE = 1e-7  # sum of violations
SETTLED = 1e-9  # of the merit: nothing more is expected
HOPELESS = 1e-4  # of the violation: a full step expects no less of it
MAX_ROUNDS = 120
FIRST_PRICE, LAST_PRICE = 10.0, 1e3
FIRST_REACH, FULL_REACH, LONGEST_REACH, SHORTEST_REACH = 0.5, 1e-2, 4.0, 1e-10
MOST_PROBES = 3


class Trial(NamedTuple):
    """What a flown extremal costs and breaks."""

    steps: int
    rows: int
    energy: float  # J over a0^2 t_p
    broken: float  # violation


class Flight(NamedTuple):
    """A flown extremal, its dips and the rows' values."""

    extremal: Extremal
    dips: Floats  # (MAX_DIPS, 4), see ellipsoid_dips
    values: Floats  # (MAX_ROWS,)


class Search(NamedTuple):
    """What a facet's search keeps from round to round; allocated once and used for many facets."""

    model: LocalModel
    multipliers: Floats  # (MAX_ROWS,)
    secant: Floats  # (7, 7) what the exact part of the Hessian leaves out
    old_gradient: Floats  # (7,)
    old_jacobian: Floats  # (MAX_ROWS, 7)
    node_tangents: Floats  # (nodes, 6, 8)
    step: Floats  # (7,)
    radius: Floats  # (7,)


class Ended(NamedTuple):
    """How a search ended: ``OPTIMAL``, ``STUCK`` (a local least of the violation) or ``UNCONVERGED``."""

    status: int
    rounds: int
    energy: float  # J over a0^2 t_p
    broken: float


@part
def new_flight(n_steps: int) -> Flight:
    """Room for one extremal."""
    return Flight(new_extremal(n_steps), new_dips(), np.zeros(MAX_ROWS))


@part
def new_search(problem: ExtremalProblem, n_steps: int) -> Search:
    """Work space for the facets of one case, flown with ``n_steps`` steps."""
    model = new_local_model(N, MAX_ROWS)
    for r in range(MAX_ROWS):
        model.equality[r] = r == ROW_MASS or (r == ROW_HANDOVER and problem.on_ellipsoid)
        model.pooled[r] = r >= ROW_DIPS or (r == ROW_HANDOVER and not problem.on_ellipsoid)
    return Search(
        model,
        np.zeros(MAX_ROWS),
        np.zeros((N, N)),
        np.zeros(N),
        np.zeros((MAX_ROWS, N)),
        np.zeros((n_steps + MAX_SPLITS + 1, 6, COLUMNS)),
        np.zeros(N),
        np.zeros(N),
    )


@part
def start_extremal(problem: ExtremalProblem, costates: Floats, extremal: Extremal) -> None:
    """Set the initial state and costates."""
    y = extremal.state[0]
    for i in range(3):
        y[i], y[3 + i] = problem.position[i], problem.velocity[i]
    y[6], y[14] = 1.0, 0.0
    for i in range(N):
        y[7 + i] = costates[i]


@part
def _try(
    problem: ExtremalProblem, target: Floats, normal: Floats, costates: Floats, flight: Flight, search: Search
) -> Trial:
    """Fly the extremal of the given costates and evaluate cost and rows."""
    start_extremal(problem, costates, flight.extremal)
    n_steps = flight.extremal.step.shape[0] - MAX_SPLITS
    k = fly_extremal(problem.field, n_steps, flight.extremal)
    x = flight.extremal.state[k]
    handover_rows(problem, target, normal, x, flight.values, np.zeros((ROW_MASS, N)))
    flight.values[ROW_MASS] = x[13]
    rows = ROW_DIPS + find_dips(problem.field.inverse_axes, flight.extremal, k, flight.dips)
    for d in range(rows - ROW_DIPS):
        flight.values[ROW_DIPS + d] = flight.dips[d, LEVEL] - 1.0
    energy = x[14] + final_energy(problem, target, x, np.zeros(N))
    broken = violation(flight.values, search.model.equality, search.model.pooled, rows)
    return Trial(k, rows, energy, broken)


@inlined
def _differentiate(
    problem: ExtremalProblem, target: Floats, normal: Floats, flight: Flight, trial: Trial, search: Search
) -> None:
    """Fill the local model at a flown trial.

    The costates at the handover are the gradient of the descent's least energy as a function of the handover
    state x. With S = dx/dlambda and P the derivative of the last costates, the energy's Hessian in the
    initial costates is therefore -S'P, up to terms that vanish at an optimum without dips, and S'KS adds
    what the final stage and its rows bend.
    """
    model, multipliers = search.model, search.multipliers
    X, K = np.zeros((STATE, COLUMNS)), np.zeros((N, N))
    end_jacobian, end_gradient = np.zeros((ROW_MASS, N)), np.zeros(N)
    tangents(problem.field, flight.extremal, trial.steps, X, search.node_tangents)
    x = flight.extremal.state[trial.steps]
    handover_rows(problem, target, normal, x, model.values, end_jacobian)
    final_energy(problem, target, x, end_gradient)
    handover_hessian(problem, target, x, multipliers, K)
    for j in range(N):
        model.gradient[j], model.jacobian[ROW_MASS, j] = X[14, j], X[13, j]
        for r in range(ROW_MASS):
            model.jacobian[r, j] = 0.0
        for i in range(N):
            model.gradient[j] += end_gradient[i] * X[i, j]
            for r in range(ROW_MASS):
                model.jacobian[r, j] += end_jacobian[r, i] * X[i, j]
    for a in range(N):
        for b in range(a + 1):
            total = 0.0
            for i in range(N):
                total -= 0.5 * (X[i, a] * X[7 + i, b] + X[i, b] * X[7 + i, a])
                for j in range(N):
                    total += X[i, a] * K[i, j] * X[j, b]
            model.hessian[a, b] = model.hessian[b, a] = total
    for r in range(trial.rows):
        model.values[r] = flight.values[r]
    for r in range(ROW_DIPS, trial.rows):
        dip_row(
            problem.field.inverse_axes,
            flight.extremal,
            search.node_tangents,
            flight.dips[r - ROW_DIPS],
            model.jacobian[r],
            -multipliers[r],
            model.hessian,
        )


@inlined
def _renew_model(
    problem: ExtremalProblem,
    target: Floats,
    normal: Floats,
    flight: Flight,
    trial: Trial,
    old_rows: int,
    search: Search,
) -> None:
    """Differentiate at a new point and learn from the step that led there (``old_rows`` 0: none did)."""
    model, secant = search.model, search.secant
    for a in range(N):
        search.old_gradient[a] = model.gradient[a]
        for r in range(MAX_ROWS):
            search.old_jacobian[r, a] = model.jacobian[r, a]
    _differentiate(problem, target, normal, flight, trial, search)
    if old_rows == trial.rows:
        change = np.zeros(N)
        for a in range(N):
            change[a] = model.gradient[a] - search.old_gradient[a]
            for r in range(trial.rows):
                change[a] -= search.multipliers[r] * (model.jacobian[r, a] - search.old_jacobian[r, a])
            for b in range(N):
                change[a] -= model.hessian[a, b] * search.step[b]
        add_secant(change, search.step, secant)
    else:
        for a in range(N):
            for b in range(N):
                secant[a, b] = 0.0
    for a in range(N):
        for b in range(N):
            model.hessian[a, b] += secant[a, b]
    convexify(model.hessian)


@inlined
def _correct(flight: Flight, rows: int, price: float, search: Search, step: Floats) -> None:
    """Second-order correction: aim again, from what the rows turned out to be after the step."""
    model, kept = search.model, np.zeros(rows)
    for r in range(rows):
        kept[r], model.values[r] = model.values[r], flight.values[r]
        for a in range(N):
            model.values[r] -= model.jacobian[r, a] * search.step[a]
    propose(model, rows, price, search.radius, step, np.zeros(rows))
    for r in range(rows):
        model.values[r] = kept[r]


@inlined
def _take_step(
    problem: ExtremalProblem,
    target: Floats,
    normal: Floats,
    costates: Floats,
    now: Trial,
    price: float,
    expected: float,
    there: Flight,
    spare: Flight,
    search: Search,
) -> tuple[Trial, float, bool]:
    """Fly the proposed step, or its correction where that is better.

    Returns
    -------
    trial : Trial
    ratio : float
        How much the merit fell, over what was expected.
    corrected : bool
        Whether the trial is the corrected one, flown in ``spare``.
    """
    trial, step = np.zeros(N), np.zeros(N)
    for a in range(N):
        trial[a] = costates[a] + search.step[a]
    then = _try(problem, target, normal, trial, there, search)
    ratio = (now.energy - then.energy + price * (now.broken - then.broken)) / expected
    if ratio >= 0.5 or then.rows != now.rows:
        return then, ratio, False
    _correct(there, now.rows, price, search, step)
    for a in range(N):
        trial[a] = costates[a] + step[a]
    other = _try(problem, target, normal, trial, spare, search)
    better = (now.energy - other.energy + price * (now.broken - other.broken)) / expected
    if better <= ratio:
        return then, ratio, False
    for a in range(N):
        search.step[a] = step[a]
    return other, better, True


@inlined
def search_extremal(
    problem: ExtremalProblem,
    target: Floats,
    normal: Floats,
    costates: Floats,
    here: Flight,
    there: Flight,
    spare: Flight,
    search: Search,
) -> tuple[Ended, Flight]:
    """Improve the initial costates for one facet.

    Parameters
    ----------
    problem : ExtremalProblem
        The case.
    target : (3,) float, scaled, body frame
        Touchdown point.
    normal : (3,) float, body frame
        Outward unit normal of the facet.
    costates : (7,) float, scaled
        The start; holds the best costates on return.
    here, there, spare : Flight
        Scratch space; its size sets the number of steps.
    search : Search
        Scratch space; its multipliers belong to the returned costates.

    Returns
    -------
    ended : Ended
    flight : Flight
        The one of the three that holds the extremal of the returned costates.
    """
    price, reach, probes = FIRST_PRICE, FIRST_REACH, 0
    fresh, old_rows, status, rounds = True, 0, UNCONVERGED, 0
    for r in range(MAX_ROWS):
        search.multipliers[r] = 0.0
    now = _try(problem, target, normal, costates, here, search)
    while rounds < MAX_ROUNDS:
        rounds += 1
        if fresh:
            _renew_model(problem, target, normal, here, now, old_rows, search)
            fresh = False
        size = 1.0
        for a in range(6):
            size = max(size, abs(costates[a]))
        for a in range(N):
            search.radius[a] = reach * size
        expected = propose(search.model, now.rows, price, search.radius, search.step, search.multipliers)
        if now.broken < FEASIBLE and expected < SETTLED * (1.0 + abs(now.energy)):
            status = OPTIMAL
            break
        if now.broken >= FEASIBLE and expected < max(SETTLED, HOPELESS * price * now.broken):
            if reach < FULL_REACH and probes < MOST_PROBES:
                reach, probes = 2.0 * FULL_REACH, probes + 1
            elif price < LAST_PRICE:
                price *= 10.0
            else:
                status = STUCK
                break
            continue
        then, ratio, corrected = _take_step(
            problem, target, normal, costates, now, price, expected, there, spare, search
        )
        if corrected:
            there, spare = spare, there
        longest = 0.0
        for a in range(N):
            longest = max(longest, abs(search.step[a]))
        if ratio > 1e-3:
            old_rows, now, fresh = now.rows, then, True
            here, there = there, here
            for a in range(N):
                costates[a] += search.step[a]
        if ratio > 0.75:
            reach = max(reach, min(3.0 * longest / size, LONGEST_REACH))
        elif not ratio >= 0.25:
            reach = 0.25 * longest / size
            if reach < SHORTEST_REACH:
                break
    return Ended(status, rounds, now.energy, now.broken), here
