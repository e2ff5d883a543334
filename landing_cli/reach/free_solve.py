"""One facet by the conic interior-point method: cold start, iterations, verdict of the solver.

Flight, gravity, masses and tangent planes are linearised anew at every iteration, so there is no outer
loop: the interior-point method is at the same time the Newton method on the nonlinear problem.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from landing_cli.kernel import inlined, kernel, part
from landing_cli.kernel_record import by_reference
from landing_cli.optimize.conic_ipm import advance, residuals
from landing_cli.optimize.conic_records import Model, Point, Step, new_model, new_point, new_step
from landing_cli.reach.certificate import certified_thrust_level, linearised_thrust_level
from landing_cli.reach.descent_model import (
    Layout,
    fill_arc_cones,
    fill_glide_cones,
    fill_handover_rows,
    refresh,
    refresh_arc,
)
from landing_cli.reach.planes import Cuts, new_cuts
from landing_cli.reach.scaled_case import ScaledCase
from landing_cli.reach.shooting import Path, fly, measure_defect, new_path

Floats = NDArray[np.float64]

STALLED, CONVERGED, CERTIFIED, BLOCKED = 0, 1, 2, 3

# Rows and cones are met, and the duality gap closed, to these. J answers to the square of the stationarity
# residual and tau to its product with the step, so that one may be larger by far.
TOLERANCE, GAP_TOLERANCE, DUAL_TOLERANCE = 2e-7, 2e-6, 1e-4
FIRST_CERTIFICATE = 4
# A least-energy solve is given up when its linearised problem needs this much thrust.
FIRST_BLOCKED, BLOCKED_LEVEL = 8, 1.0 + 1e-4
# The defect of the flight is measured at iterations 5, 9, 13, ...: it hardly changes after that.
FIRST_DEFECT, DEFECT_PERIOD = 1, 4


@by_reference
class Solver(NamedTuple):
    """Everything one facet's solve works in; allocated once and used for many facets."""

    point: Point
    model: Model
    step: Step
    path: Path
    cuts: Cuts
    duals: Floats  # (J, 4)


class Outcome(NamedTuple):
    """How a solve ended."""

    status: int  # STALLED, CONVERGED, CERTIFIED or BLOCKED
    iterations: int
    energy: float  # J, scaled
    bound: float  # certified lower bound on the thrust level
    mass_costate: float  # at the start


def new_solver(case: ScaledCase, walls: int = 0) -> Solver:
    """Allocate a solver for a scaled case, with room for so many walls off the terrain."""
    n = case.mid_cos.shape[0]
    n_cones = case.arc_fractions.shape[0] + 2
    n_rows = 7 + (n + 1) + walls + 2
    return Solver(
        new_point(n, n_cones, n_rows),
        new_model(n, n_cones, n_rows),
        new_step(n, n_cones, n_rows),
        new_path(n),
        new_cuts(n + 1 + walls),
        np.zeros((n_cones, 4)),
    )


@inlined
def _start_thrust(case: ScaledCase, target: Floats, normal: Floats, solver: Solver) -> None:
    """Least-energy thrust to a plausible handover, from the unpowered flight's miss, clipped.

    F = f0 + f1 s with int s F = E_r and int F = E_v, where E is the miss in position and velocity.
    """
    point, path = solver.point, solver.path
    n, y = point.thrust.shape[0], point.y
    point.thrust[:, :] = 0.0
    path.defect[:] = 0.0
    fly(case, point.thrust, path)
    y[0] = 1.0
    x = np.empty(3)
    v = np.empty(3)
    for i in range(3):
        y[1 + i], y[4 + i] = 0.5 * normal[i], -0.2 * normal[i]
        x[i] = target[i] + case.final_time**2 / 6.0 * 0.8 * normal[i]
        v[i] = -case.final_time / 2.0 * 0.3 * normal[i]
    v[0] -= case.spin * x[1]
    v[1] += case.spin * x[0]
    for i in range(3):
        miss_r, miss_v = x[i] - path.position[n, i], v[i] - path.velocity[n, i]
        f1 = 12.0 * (miss_r - 0.5 * miss_v)
        f0 = miss_v - 0.5 * f1
        for k in range(n):
            point.thrust[k, i] = f0 + f1 * (1.0 - (k + 0.5) / n)
    for k in range(n):
        F = point.thrust[k]
        norm = math.sqrt(F[0] * F[0] + F[1] * F[1] + F[2] * F[2])
        if norm > 0.7:
            for i in range(3):
                F[i] *= 0.7 / norm


@kernel
def cold_start(case: ScaledCase, target: Floats, normal: Floats, plan: Layout, solver: Solver) -> None:
    """Set the iterate to a well-centred point; the objective's scale sets the duals."""
    point, model = solver.point, solver.model
    _start_thrust(case, target, normal, solver)
    fill_handover_rows(case, model)
    fill_arc_cones(case, model)
    fill_glide_cones(case, normal, model)
    n = point.thrust.shape[0]
    scale = 1.0 if plan.tau_free else plan.energy_weight
    if plan.tau_free:
        point.y[0] = 1.2
    point.multiplier[:] = 0.0
    for k in range(n):
        point.node_dual[k, 0] = 0.5 * scale / n
        for i in range(3):
            point.node_dual[k, 1 + i] = -0.3 * point.node_dual[k, 0] * point.thrust[k, i] / point.y[0]
    for r in range(plan.n_equal, plan.n_rows):
        point.slack[r] = 0.05
        point.multiplier[r] = -0.05 * scale
    fly(case, point.thrust, solver.path)
    refresh_arc(case, target, float(solver.path.mass[n]), model, point.y)
    for j in range(plan.n_cones):
        s, norm2 = point.cone_slack[j], 0.0
        for i in range(4):
            s[i] = model.cone_offset[j, i]
            for a in range(7):
                s[i] += model.cone_map[j, i, a] * point.y[a]
            norm2 += s[i] * s[i] if i > 0 else 0.0
        s[0] = max(s[0], math.sqrt(norm2) + 0.1)
        point.cone_dual[j, :] = 0.0
        point.cone_dual[j, 0] = 0.1 * scale


@part
def _certificate(
    case: ScaledCase,
    target: Floats,
    tube: Floats,
    arc_bound: float,
    plan: Layout,
    planes: int,
    solver: Solver,
) -> float:
    """Bound the thrust level by the current multipliers."""
    point = solver.point
    return certified_thrust_level(
        case,
        target,
        tube,
        arc_bound,
        solver.model,
        point.multiplier,
        point.cone_dual,
        solver.duals,
        solver.cuts,
        planes,
        plan.level,
    )


@inlined
def solve(
    case: ScaledCase,
    target: Floats,
    normal: Floats,
    plan: Layout,
    retake_from: int,
    tube: Floats,
    arc_bound: float,
    limit: int,
    prove: bool,
    solver: Solver,
) -> Outcome:
    """Solve one facet from a cold start.

    Parameters
    ----------
    case : ScaledCase
        The case.
    target, normal : (3,) float
        Touchdown point (scaled) and outward facet normal, body axes.
    plan : Layout
        Rows, cones and objective.
    retake_from : int
        Iteration from which the tangent planes are moved to the current path.
    tube, arc_bound : (N,) float, float
        Bounds of gravity for the certificate.
    limit : int
        Most iterations.
    prove : bool
        Bound the thrust level of the flights that keep to the planes, not of all flights, and stop as soon
        as that is above 1.
    solver : Solver
        Its cuts are given; its point holds the answer.

    Returns
    -------
    outcome : Outcome
        How it ended.
    """
    point, model, step, path = solver.point, solver.model, solver.step, solver.path
    cold_start(case, target, normal, plan, solver)
    scale = 1.0 if plan.tau_free else plan.energy_weight
    planes = plan.n_cuts if prove else 0
    status, bound, energy, mass_costate = STALLED, 0.0, 0.0, 0.0
    iteration = 0
    while iteration < limit:
        iteration += 1
        if iteration > 1 and iteration % DEFECT_PERIOD == FIRST_DEFECT:
            measure_defect(case, point.thrust, path)
        retake = iteration >= retake_from
        energy, mass_costate = refresh(case, target, plan, solver.cuts, retake, point, path, model)
        primal, dual, gap = residuals(
            point, model, step, plan.n_equal, plan.n_rows, plan.n_cones, plan.tau_free
        )
        if (
            iteration > DEFECT_PERIOD
            and primal < TOLERANCE
            and dual < DUAL_TOLERANCE * scale
            and gap < GAP_TOLERANCE * scale
        ):
            status = CONVERGED
            break
        if (prove or not plan.tau_free) and iteration >= FIRST_CERTIFICATE:
            bound = max(bound, _certificate(case, target, tube, arc_bound, plan, planes, solver))
            if bound > 1.0:
                status = CERTIFIED
                break
            if (
                not plan.tau_free
                and iteration >= FIRST_BLOCKED
                and linearised_thrust_level(case, plan, point, model, solver.duals) > BLOCKED_LEVEL
            ):
                status = BLOCKED
                break
        if not math.isfinite(gap):
            break
        smallest = 0.1 * TOLERANCE * scale / (point.thrust.shape[0] + plan.n_cones + plan.n_rows)
        advance(point, model, step, plan.n_equal, plan.n_rows, plan.n_cones, gap, smallest, plan.tau_free)
    if plan.tau_free and status == CONVERGED:
        bound = max(bound, _certificate(case, target, tube, arc_bound, plan, planes, solver))
    return Outcome(status, iteration, energy, bound, mass_costate)
