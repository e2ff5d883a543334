"""Facets by extremals: what one extremal costs and breaks, and the local model of the SQP there.

Every trial is an exact extremal, flown to the handover. The Hessian is exact where it can be had for nothing
(see ``_differentiate``), and secant updates supply the rest.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from landing_cli.kernel import inlined, inner, part
from landing_cli.kernel_address import Callee, call
from landing_cli.kernel_record import by_reference
from landing_cli.optimize.sqp import LocalModel, add_secant, convexify, new_local_model, violation
from landing_cli.reach.costate_dynamics import (
    Extremal,
    Field,
    Tangents,
    fly_extremal,
    new_extremal,
    new_tangents,
    tangents,
)
from landing_cli.reach.ellipsoid_dips import LEVEL, Dips, dip_row, find_dips, new_dips
from landing_cli.reach.extremal_terms import (
    MAX_ROWS,
    ROW_DIPS,
    ROW_HANDOVER,
    ROW_MASS,
    ArcWork,
    ExtremalProblem,
    final_energy,
    handover_hessian,
    handover_rows,
    new_arc_work,
)

_types: Any = types  # not typed

Floats = NDArray[np.float64]

N = 7


class Trial(NamedTuple):
    """What a flown extremal costs and breaks."""

    steps: int
    rows: int
    energy: float  # J over a0^2 t_p
    broken: float  # violation


@by_reference
class Flight(NamedTuple):
    """A flown extremal, its dips, and what its handover costs and breaks."""

    extremal: Extremal
    dips: Dips
    values: Floats  # (MAX_ROWS,) of the rows
    jacobian: Floats  # (ROW_MASS, 7) of the handover's rows
    gradient: Floats  # (7,) of the final arc's energy
    work: ArcWork
    fly: Callee


@by_reference
class Search(NamedTuple):
    """What a facet's search keeps from round to round; allocated once and used for many facets."""

    target: Floats  # (3,) touchdown point, scaled, body frame
    normal: Floats  # (3,) outward unit normal of the facet
    guard: Floats  # (1,) kept from the thrust bound of the final arc
    model: LocalModel
    multipliers: Floats  # (MAX_ROWS,)
    secant: Floats  # (7, 7) what the exact part of the Hessian leaves out
    old_gradient: Floats  # (7,)
    old_jacobian: Floats  # (MAX_ROWS, 7)
    tangents: Tangents
    bend: Floats  # (7, 7) Hessian of the final arc's energy less its rows
    step: Floats  # (7,)
    radius: Floats  # (7,)
    change: Floats  # (7,) of the gradient


def new_flight(field: Field, n_steps: int) -> Flight:
    """Room for one extremal of ``n_steps`` steps in a field."""
    extremal = new_extremal(n_steps)
    return Flight(
        extremal,
        new_dips(),
        np.zeros(MAX_ROWS),
        np.zeros((ROW_MASS, N)),
        np.zeros(N),
        new_arc_work(),
        Callee(fly_extremal, _types.int64, field, extremal),
    )


def new_search(problem: ExtremalProblem, n_steps: int) -> Search:
    """Work space for the facets of one case, flown with ``n_steps`` steps."""
    model = new_local_model(N, MAX_ROWS)
    for r in range(MAX_ROWS):
        model.equality[r] = r == ROW_MASS or (r == ROW_HANDOVER and problem.on_ellipsoid)
        model.pooled[r] = r >= ROW_DIPS or (r == ROW_HANDOVER and not problem.on_ellipsoid)
    return Search(
        np.zeros(3),
        np.zeros(3),
        np.zeros(1),
        model,
        np.zeros(MAX_ROWS),
        np.zeros((N, N)),
        np.zeros(N),
        np.zeros((MAX_ROWS, N)),
        new_tangents(n_steps),
        np.zeros((N, N)),
        np.zeros(N),
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


@inner
def try_costates(problem: ExtremalProblem, costates: Floats, flight: Flight, search: Search) -> Trial:
    """Fly the extremal of the given costates and evaluate cost and rows."""
    extremal, values, dips = flight.extremal, flight.values, flight.dips
    start_extremal(problem, costates, extremal)
    k = call(flight.fly, (problem.field, extremal))
    x = extremal.state[k]
    handover_rows(
        problem, search.guard[0], search.target, search.normal, x, values, flight.jacobian, flight.work
    )
    values[ROW_MASS] = x[13]
    rows = ROW_DIPS + find_dips(problem.field.inverse_axes, extremal, k, dips)
    for d in range(rows - ROW_DIPS):
        values[ROW_DIPS + d] = dips.places[d, LEVEL] - 1.0
    energy = x[14] + final_energy(problem, search.target, x, flight.gradient)
    broken = violation(values, search.model.equality, search.model.pooled, rows)
    return Trial(k, rows, energy, broken)


@inlined
def _differentiate(problem: ExtremalProblem, flight: Flight, trial: Trial, search: Search) -> None:
    """Fill the local model at a flown trial.

    The costates at the handover are the gradient of the descent's least energy as a function of the handover
    state x. With S = dx/dlambda and P the derivative of the last costates, the energy's Hessian in the
    initial costates is therefore -S'P, up to terms that vanish at an optimum without dips, and S'KS adds
    what the final stage and its rows bend.
    """
    model, multipliers = search.model, search.multipliers
    X, K, end_jacobian, end_gradient = search.tangents.end, search.bend, flight.jacobian, flight.gradient
    tangents(problem.field, flight.extremal, trial.steps, search.tangents)
    x = flight.extremal.state[trial.steps]
    handover_hessian(problem, search.target, x, multipliers, K, flight.work)
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
            search.tangents.nodes,
            flight.dips,
            r - ROW_DIPS,
            model.jacobian[r],
            -multipliers[r],
            model.hessian,
        )


@inner
def renew_model(
    problem: ExtremalProblem, flight: Flight, trial: Trial, old_rows: int, search: Search
) -> None:
    """Differentiate at a new point and learn from the step that led there (``old_rows`` 0: none did)."""
    model, secant = search.model, search.secant
    for a in range(N):
        search.old_gradient[a] = model.gradient[a]
        for r in range(MAX_ROWS):
            search.old_jacobian[r, a] = model.jacobian[r, a]
    _differentiate(problem, flight, trial, search)
    if old_rows == trial.rows:
        change = search.change
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
    convexify(model)
