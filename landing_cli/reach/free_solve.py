"""Facets by the conic interior-point method: cold start, iterations, verdicts of the solver.

Flight, gravity, masses and tangent planes are linearised anew at every iteration, so there is no outer
loop: the interior-point method is at the same time the Newton method on the nonlinear problem. As many facets
as there are lanes are iterated together (`kernel_lanes`); each has its own count of iterations.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from landing_cli.kernel import inlined, kernel
from landing_cli.kernel_lanes import WIDTH, any_lane, choose, lane, new_lanes
from landing_cli.kernel_record import by_reference
from landing_cli.optimize.conic_ipm import advance, residuals
from landing_cli.optimize.conic_records import STATE, Model, New, Point, Step, new_model, new_point, new_step
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
# Places in a solver's numbers: residuals and gap, J (scaled), the mass costate at the start, the least target
# of the next step.
PRIMAL, DUAL, GAP, ENERGY, MASS_COSTATE, LEAST_TARGET = range(6)


@by_reference
class Solver(NamedTuple):
    """Everything that a solve works in; allocated once and used for many facets."""

    point: Point
    model: Model
    step: Step
    path: Path
    cuts: Cuts
    target: Floats  # (3,) touchdown point, scaled, body axes
    normal: Floats  # (3,) of the facet, outward
    drift: Floats  # (6,) position and velocity at the end of the flight without thrust
    marks: Floats  # (3,) 1 where a facet begins, its flight's defect is measured, its planes are retaken
    numbers: Floats  # (6,) of the iteration: see PRIMAL to LEAST_TARGET
    duals: Floats  # (J, 4)


@by_reference
class Single(NamedTuple):
    """One facet's part of what is solved in lanes, for what looks at one facet at a time."""

    point: Point
    model: Model
    cuts: Cuts
    target: Floats  # (3,)
    duals: Floats  # (J, 4) scratch space


@by_reference
class LaneSolver(NamedTuple):
    """A solver of as many facets as there are lanes."""

    lanes: Solver
    single: Single
    facet: NDArray[np.int64]  # (WIDTH,) place in the batch, -1: none
    iteration: NDArray[np.int64]  # (WIDTH,)
    bound: Floats  # (WIDTH,)


class Outcome(NamedTuple):
    """How a solve ended."""

    status: int  # STALLED, CONVERGED, CERTIFIED or BLOCKED; -1: it goes on
    bound: float  # certified lower bound on the thrust level


def new_solver_of(
    n_nodes: int, n_cones: int, n_rows: int, planes: int, n_basis: int, new: New = np.zeros
) -> Solver:
    """Allocate a solver with room for so many rows and planes, of arrays that ``new`` makes."""
    return Solver(
        new_point(n_nodes, n_cones, n_rows, new),
        new_model(n_nodes, n_cones, n_rows, n_basis, new),
        new_step(n_nodes, n_cones, n_rows, n_basis, new),
        new_path(n_nodes, new),
        new_cuts(planes, new),
        new(3),
        new(3),
        new(6),
        new(3),
        new(6),
        new((n_cones, 4)),
    )


def basis_of(case: ScaledCase) -> int:
    """Functionals of the thrust that rows are mixed of: the state at the end, and scarce propellant."""
    return STATE + (1 if case.propellant < 1.0 else 0)


def new_solver(case: ScaledCase, walls: int = 0) -> LaneSolver:
    """Allocate a solver for a scaled case, with room for so many walls off the terrain."""
    n = case.mid_cos.shape[0]
    n_cones = case.arc_fractions.shape[0] + 2
    planes = n + 1 + walls
    n_rows = 7 + planes + 2
    whole = np.int64
    return LaneSolver(
        new_solver_of(n, n_cones, n_rows, planes, basis_of(case), new_lanes),
        Single(
            new_point(n, n_cones, n_rows),
            new_model(n, n_cones, n_rows, basis_of(case)),
            new_cuts(planes),
            np.zeros(3),
            np.zeros((n_cones, 4)),
        ),
        np.full(WIDTH, -1, dtype=whole),
        np.zeros(WIDTH, dtype=whole),
        np.zeros(WIDTH),
    )


@kernel
def fill_drift(case: ScaledCase, solver: Solver) -> None:
    """Fly without thrust: all facets' starts are reckoned from there."""
    point, path, drift = solver.point, solver.path, solver.drift
    n = path.gradient.shape[0]
    for k in range(n):
        for i in range(3):
            point.thrust[k, i] = 0.0
    for i in range(6):
        path.defect[i] = 0.0
    fly(case, point.thrust, path)
    for i in range(3):
        drift[i], drift[3 + i] = path.position[n, i], path.velocity[n, i]


@inlined
def _start_thrust(case: ScaledCase, begins: bool, solver: Solver) -> float:
    """Least-energy thrust to a plausible handover, from the unpowered flight's miss, clipped.

    F = f0 + f1 s with int s F = E_r and int F = E_v, where E is the miss in position and velocity. Returns
    the mass at the handover.
    """
    point, y, target, normal, drift = solver.point, solver.point.y, solver.target, solver.normal, solver.drift
    n, T = point.thrust.shape[0], case.final_time
    y[0] = choose(begins, 1.0, y[0])
    for i in range(3):
        y[1 + i] = choose(begins, 0.5 * normal[i], y[1 + i])
        y[4 + i] = choose(begins, -0.2 * normal[i], y[4 + i])
    x0 = target[0] + T * T / 6.0 * 0.8 * normal[0]
    x1 = target[1] + T * T / 6.0 * 0.8 * normal[1]
    x2 = target[2] + T * T / 6.0 * 0.8 * normal[2]
    v0 = -T / 2.0 * 0.3 * normal[0] - case.spin * x1 - drift[3]
    v1 = -T / 2.0 * 0.3 * normal[1] + case.spin * x0 - drift[4]
    v2 = -T / 2.0 * 0.3 * normal[2] - drift[5]
    a0, a1, a2 = (
        12.0 * (x0 - drift[0] - 0.5 * v0),
        12.0 * (x1 - drift[1] - 0.5 * v1),
        12.0 * (x2 - drift[2] - 0.5 * v2),
    )
    used = 0.0
    for k in range(n):
        F, s = point.thrust[k], 0.5 - (k + 0.5) / n
        f0, f1, f2 = v0 + a0 * s, v1 + a1 * s, v2 + a2 * s
        norm = math.sqrt(f0 * f0 + f1 * f1 + f2 * f2)
        scale = choose(norm > 0.7, 0.7 / norm, 1.0)
        F[0], F[1] = choose(begins, scale * f0, F[0]), choose(begins, scale * f1, F[1])
        F[2] = choose(begins, scale * f2, F[2])
        used += math.sqrt(F[0] * F[0] + F[1] * F[1] + F[2] * F[2])
    return 1.0 - case.mass_flow * used / n


@kernel
def cold_start(case: ScaledCase, plan: Layout, begins: bool, solver: Solver) -> None:
    """Set the iterate to a well-centred point where a facet begins; the objective's scale sets the duals.

    The solver's target, normal, drift, planes and ``row_live`` of the planes are given.
    """
    point, model = solver.point, solver.model
    handover_mass = _start_thrust(case, begins, solver)
    fill_handover_rows(case, model)
    fill_arc_cones(case, model)
    fill_glide_cones(case, solver.normal, model)
    n = point.thrust.shape[0]
    scale = 1.0 if plan.tau_free else plan.energy_weight
    for i in range(6):
        solver.path.defect[i] = choose(begins, 0.0, solver.path.defect[i])
    if plan.tau_free:
        point.y[0] = choose(begins, 1.2, point.y[0])
    for k in range(n):
        z, head = point.node_dual[k], 0.5 * scale / n
        z[0] = choose(begins, head, z[0])
        for i in range(3):
            tail = -0.3 * head * point.thrust[k, i] / point.y[0]
            z[1 + i] = choose(begins, tail, z[1 + i])
    for r in range(point.multiplier.shape[0]):
        if r < plan.first_plane:
            model.row_live[r] = 1.0
        held = 0.0 if r < plan.n_equal else 0.05
        # a row that is not there has no slack, and a multiplier that only keeps divisions finite
        there = model.row_live[r] > 0.0
        slack, multiplier = choose(there, held, 0.0), choose(there, -held * scale, -1.0)
        point.slack[r] = choose(begins, slack, point.slack[r])
        point.multiplier[r] = choose(begins, multiplier, point.multiplier[r])
    refresh_arc(case, solver.target, handover_mass, model, point.y)
    for j in range(plan.n_cones):
        s, z = point.cone_slack[j], point.cone_dual[j]
        head = norm2 = 0.0
        for i in range(4):
            total = model.cone_offset[j, i]
            for a in range(7):
                total += model.cone_map[j, i, a] * point.y[a]
            if i == 0:
                head = total
            else:
                norm2 += total * total
                s[i] = choose(begins, total, s[i])
            z[i] = choose(begins, 0.1 * scale if i == 0 else 0.0, z[i])
        s[0] = choose(begins, max(head, math.sqrt(norm2) + 0.1), s[0])


@kernel
def take_out(case: ScaledCase, plan: Layout, place: int, wanted: int, solver: Solver, single: Single) -> None:
    """Copy what the certificates look at out of a lane.

    Parameters
    ----------
    case, plan : ScaledCase, Layout
        The case, its rows and cones.
    place : int
        Which lane.
    wanted : int
        0: what a proof about all flights takes; 1: with the planes; 2: the whole linearised problem.
    solver : Solver
        In lanes.
    single : Single
        Filled.
    """
    point, model, one, its = solver.point, solver.model, single.point, single.model
    rows = 6 if wanted == 0 else plan.n_rows
    for r in range(rows):
        one.multiplier[r] = lane(point.multiplier[r], place)
        for a in range(7):
            its.row_y[r, a] = lane(model.row_y[r, a], place)
    for j in range(plan.n_cones):
        for i in range(4):
            one.cone_dual[j, i] = lane(point.cone_dual[j, i], place)
            for a in range(7):
                its.cone_map[j, i, a] = lane(model.cone_map[j, i, a], place)
    for i in range(3):
        single.target[i] = lane(solver.target[i], place)
    if wanted == 1:
        first = 7 if case.on_ellipsoid else 6
        for c in range(plan.n_rows - plan.first_plane):
            one.multiplier[first + c] = lane(point.multiplier[plan.first_plane + c], place)
            single.cuts.node[c] = lane(solver.cuts.node[c], place)
            for i in range(3):
                single.cuts.normal[c, i] = lane(solver.cuts.normal[c, i], place)
    if wanted == 2:
        for r in range(rows):
            its.row_value[r] = lane(model.row_value[r], place)
        for a in range(7):
            one.y[a] = lane(point.y[a], place)
        for j in range(plan.n_cones):
            for i in range(4):
                its.cone_offset[j, i] = lane(model.cone_offset[j, i], place)
        for k in range(point.thrust.shape[0]):
            for i in range(3):
                one.thrust[k, i] = lane(point.thrust[k, i], place)
                its.row_pull[k, i] = lane(model.row_pull[k, i], place)


@kernel
def _certificate(
    case: ScaledCase,
    tube: Floats,
    arc_bound: float,
    planes: int,
    level: float,
    single: Single,
) -> float:
    """Bound the thrust level by the multipliers that were taken out."""
    return certified_thrust_level(
        case,
        single.target,
        tube,
        arc_bound,
        single.model,
        single.point.multiplier,
        single.point.cone_dual,
        single.duals,
        single.cuts,
        planes,
        level,
    )


@kernel
def judge(
    case: ScaledCase,
    plan: Layout,
    place: int,
    residual: tuple[float, float, float],
    planes: int,
    tube: Floats,
    arc_bound: float,
    limit: int,
    prove: bool,
    solver: LaneSolver,
) -> Outcome:
    """Tell whether the facet in a lane is done.

    Parameters
    ----------
    case, plan : ScaledCase, Layout
        The case, its rows and cones.
    place : int
        Which lane.
    residual : (3,) float
        Primal and dual residual and gap, of the lane.
    planes : int
        Tangent planes of the facet.
    tube, arc_bound : (N,) float, float
        Bounds of gravity for the certificate.
    limit : int
        Most iterations.
    prove : bool
        Bound the thrust level of the flights that keep to the planes, not of all flights, and stop as soon
        as that is above 1.
    solver : LaneSolver
        Its lane's bound is updated.

    Returns
    -------
    outcome : Outcome
        How it ended, if it did.
    """
    primal, dual, gap = residual
    scale = 1.0 if plan.tau_free else plan.energy_weight
    iteration, bound, single = solver.iteration[place], solver.bound[place], solver.single
    level = lane(solver.lanes.cuts.offset[0], place) if prove and planes > 0 else 1.0
    wanted, counted = (1, planes) if prove else (0, 0)
    converged = (
        iteration > DEFECT_PERIOD
        and primal < TOLERANCE
        and dual < DUAL_TOLERANCE * scale
        and gap < GAP_TOLERANCE * scale
    )
    status = CONVERGED if converged else -1
    if (plan.tau_free and converged) or (
        (prove or not plan.tau_free) and not converged and iteration >= FIRST_CERTIFICATE
    ):
        take_out(case, plan, place, wanted, solver.lanes, single)
        bound = max(bound, _certificate(case, tube, arc_bound, counted, level, single))
        solver.bound[place] = bound
        if bound > 1.0 and not converged:
            status = CERTIFIED
    if status < 0 and not plan.tau_free and iteration >= FIRST_BLOCKED:
        take_out(case, plan, place, 2, solver.lanes, single)
        needed = linearised_thrust_level(case, plan, single.point, single.model, single.duals)
        if needed > BLOCKED_LEVEL:
            status = BLOCKED
    if status < 0 and (iteration >= limit or not math.isfinite(gap)):
        status = STALLED
    return Outcome(status, bound)


@kernel
def linearise(case: ScaledCase, plan: Layout, solver: Solver) -> None:
    """Start the facets that begin, linearise all lanes' problems anew and fill the solver's numbers."""
    point, model, path, marks, numbers = solver.point, solver.model, solver.path, solver.marks, solver.numbers
    begins = marks[0] > 0.0
    if any_lane(begins):
        cold_start(case, plan, begins, solver)
    measure_defect(case, point.thrust, path, marks[1] > 0.0)
    retake = marks[2] > 0.0
    energy, mass_costate = refresh(case, solver.target, plan, solver.cuts, retake, point, path, model)
    primal, dual, gap = residuals(
        point, model, solver.step, plan.n_equal, plan.n_rows, plan.n_cones, plan.tau_free
    )
    scale = 1.0 if plan.tau_free else plan.energy_weight
    size = 1.0 * (point.thrust.shape[0] + plan.n_cones)
    for r in range(plan.n_rows):
        size += model.row_live[r]
    numbers[PRIMAL], numbers[DUAL], numbers[GAP] = primal, dual, gap
    numbers[ENERGY], numbers[MASS_COSTATE] = energy, mass_costate
    numbers[LEAST_TARGET] = 0.1 * TOLERANCE * scale / size


@kernel
def take_step(plan: Layout, solver: Solver) -> None:
    """Move all lanes by one predictor-corrector step."""
    gap, least = solver.numbers[GAP], solver.numbers[LEAST_TARGET]
    point, model, step = solver.point, solver.model, solver.step
    advance(point, model, step, plan.n_equal, plan.n_rows, plan.n_cones, gap, least, plan.tau_free)
