"""Facets by the conic interior-point method: cold start, iterations, verdicts of the solver.

Flight, gravity, masses and tangent planes are linearised anew at every iteration, so there is no outer
loop: the interior-point method is at the same time the Newton method on the nonlinear problem. As many facets
as there are lanes are iterated together (`kernel_lanes`); each has its own count of iterations.
"""

from __future__ import annotations

import math
import threading
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from landing_cli.kernel import inlined, inner, part
from landing_cli.kernel_address import Callee
from landing_cli.kernel_lanes import WIDTH, any_lane, choose, lane, new_lanes, put_lane, take_lane
from landing_cli.kernel_record import always_alike, by_reference
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
from landing_cli.reach.shooting import Path, measure_defect, new_path

_types: Any = types  # not typed

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
# Facets without planes begin on half as many intervals, where there are so many, for so many iterations.
HALVED_FROM, BEGINNING = 40, 4
_kept = threading.local()

# Places in a solver's marks, 1 in lanes: the facet begins, its flight's defect is measured, its planes are
# retaken, it is new to the lane.
BEGINS, MEASURED, RETAKEN, NEW = range(4)
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
    marks: Floats  # (4,) see BEGINS to NEW
    numbers: Floats  # (6,) of the iteration: see PRIMAL to LEAST_TARGET


@by_reference
class Single(NamedTuple):
    """One facet's part of what is solved in lanes, for what looks at one facet at a time."""

    point: Point
    model: Model
    cuts: Cuts
    target: Floats  # (3,)
    to_start: Floats  # (6, 6)
    numbers: Floats  # (6,)
    duals: Floats  # (J, 4) scratch space


@always_alike
class LaneSolver(NamedTuple):
    """A solver of as many facets as there are lanes."""

    lanes: Solver
    begun: Solver  # on half as many intervals, for the first iterations of facets without planes
    half: ScaledCase  # the case on these
    single: Single
    facet: NDArray[np.int64]  # (2, WIDTH) place in the batch, -1: none; of the lanes, then of the begun
    iteration: NDArray[np.int64]  # (2, WIDTH)
    bound: Floats  # (2, WIDTH)
    linearise: Callee
    take_step: Callee
    judge: Callee


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
        new(4),
        new(6),
    )


def basis_of(case: ScaledCase) -> int:
    """Functionals of the thrust that rows are mixed of: the state at the end, and scarce propellant."""
    return STATE + (1 if case.propellant < 1.0 else 0)


def new_solver(case: ScaledCase, walls: int = 0) -> LaneSolver:
    """Allocate a solver for a scaled case, with room for so many walls off the terrain."""
    n, basis = case.mid_cos.shape[0], basis_of(case)
    n_cones = case.arc_fractions.shape[0] + 2
    planes = n + 1 + walls
    n_rows = 7 + planes + 2
    whole = np.int64
    lanes = new_solver_of(n, n_cones, n_rows, planes, basis, new_lanes)
    single = Single(
        new_point(n, n_cones, n_rows),
        new_model(n, n_cones, n_rows, basis),
        new_cuts(planes),
        np.zeros(3),
        np.zeros((6, 6)),
        np.zeros(6),
        np.zeros((n_cones, 4)),
    )
    return LaneSolver(
        lanes,
        new_solver_of(n // 2, n_cones, 9, 0, basis, new_lanes),
        on_half(case),
        single,
        np.full((2, WIDTH), -1, dtype=whole),
        np.zeros((2, WIDTH), dtype=whole),
        np.zeros((2, WIDTH)),
        *callees(case, lanes, single),
    )


def callees(case: ScaledCase, lanes: Solver, single: Single) -> tuple[Callee, Callee, Callee]:
    """Return `linearise`, `take_step` and `judge` for these kinds of arguments."""
    plan, tube = Layout(0, 0, 0, 0, 1.0, False), np.empty(0)
    outcome = _types.NamedTuple((_types.int64, _types.float64), Outcome)
    return (
        Callee(linearise, _types.none, case, plan, lanes),
        Callee(take_step, _types.none, plan, lanes),
        Callee(judge, outcome, case, plan, lanes, 0, 0, 0, tube, 0.0, 0, False, single, 0.0),
    )


def own_solver(case: ScaledCase, walls: int = 0) -> LaneSolver:
    """Return this thread's solver for cases of such sizes and rows: making one takes as long as a facet."""
    key = case.mid_cos.shape[0], case.arc_fractions.shape[0], walls, basis_of(case), case.on_ellipsoid
    if key not in _kept.__dict__.setdefault("solvers", {}):
        _kept.solvers[key] = new_solver(case, walls)
    solver: LaneSolver = _kept.solvers[key]._replace(half=on_half(case))
    return solver


def on_half(case: ScaledCase) -> ScaledCase:
    """The case on half as many intervals, each made of two."""
    return case._replace(
        node_cos=case.node_cos[::2].copy(),
        node_sin=case.node_sin[::2].copy(),
        mid_cos=case.node_cos[1::2].copy(),
        mid_sin=case.node_sin[1::2].copy(),
    )


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
    used = choose(x0 > 0.0, 0.0, 0.0)
    for k in range(n):
        F, s = point.thrust[k], 0.5 - (k + 0.5) / n
        f0, f1, f2 = v0 + a0 * s, v1 + a1 * s, v2 + a2 * s
        norm = math.sqrt(f0 * f0 + f1 * f1 + f2 * f2)
        scale = choose(norm > 0.7, 0.7 / norm, 1.0)
        F[0], F[1] = choose(begins, scale * f0, F[0]), choose(begins, scale * f1, F[1])
        F[2] = choose(begins, scale * f2, F[2])
        used += math.sqrt(F[0] * F[0] + F[1] * F[1] + F[2] * F[2])
    return 1.0 - case.mass_flow * used / n


@inlined
def fill_constants(case: ScaledCase, solver: Solver) -> None:
    """Fill what stays as it is while facets are solved."""
    fill_handover_rows(case, solver.model)
    fill_arc_cones(case, solver.model)
    fill_glide_cones(case, solver.normal, solver.model)


@inlined
def cold_start(case: ScaledCase, plan: Layout, begins: bool, solver: Solver) -> None:
    """Set the iterate to a well-centred point where a facet begins; the objective's scale sets the duals.

    The solver's target, normal, drift, constants, planes and ``row_live`` are given.
    """
    point, model = solver.point, solver.model
    handover_mass = _start_thrust(case, begins, solver)
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


@part
def hand_over(place: int, to: int, solver: LaneSolver) -> None:
    """Go on with a begun facet on twice as many intervals: each halves, and so do the duals of its thrust."""
    source, into, single = solver.begun, solver.lanes, solver.single
    old, new, own = source.point, into.point, single.point
    take_lane(old.thrust, place, own.thrust)
    take_lane(old.node_dual, place, own.node_dual)
    for k in range(own.thrust.shape[0] - 1, -1, -1):
        for i in range(3):
            own.thrust[k, i] = own.thrust[k // 2, i]
        for i in range(4):
            own.node_dual[k, i] = 0.5 * own.node_dual[k // 2, i]
    own.multiplier[:] = -1.0  # as of rows that are not there
    own.slack[:] = 0.0
    take_lane(old.multiplier, place, own.multiplier)
    take_lane(old.slack, place, own.slack)
    take_lane(old.cone_slack, place, own.cone_slack)
    put_lane(new.cone_slack, to, own.cone_slack)
    take_lane(old.cone_dual, place, own.cone_dual)
    put_lane(new.cone_dual, to, own.cone_dual)
    take_lane(old.y, place, own.y)
    put_lane(new.y, to, own.y)
    put_lane(new.thrust, to, own.thrust)
    put_lane(new.node_dual, to, own.node_dual)
    put_lane(new.multiplier, to, own.multiplier)
    put_lane(new.slack, to, own.slack)
    single.numbers[:] = 0.0
    put_lane(into.path.defect, to, single.numbers)


@part
def take_out(solver: Solver, place: int, whole: bool, single: Single) -> None:
    """Copy what the certificates look at out of a lane; the whole linearised problem, or its duals."""
    point, model, own, its = solver.point, solver.model, single.point, single.model
    take_lane(point.multiplier, place, own.multiplier)
    take_lane(point.cone_dual, place, own.cone_dual)
    take_lane(model.cone_map, place, its.cone_map)
    take_lane(model.row_y, place, its.row_y)
    take_lane(solver.target, place, single.target)
    take_lane(solver.cuts.node, place, single.cuts.node)
    take_lane(solver.cuts.normal, place, single.cuts.normal)
    if whole:
        take_lane(model.row_value, place, its.row_value)
        take_lane(model.row_pull, place, its.row_pull)
        take_lane(model.cone_offset, place, its.cone_offset)
        take_lane(point.y, place, own.y)
        take_lane(point.thrust, place, own.thrust)


@inner
def judge(
    case: ScaledCase,
    plan: Layout,
    solver: Solver,
    place: int,
    iteration: int,
    planes: int,
    tube: Floats,
    arc_bound: float,
    limit: int,
    prove: bool,
    single: Single,
    known: float,
) -> Outcome:
    """Tell whether the facet in a lane is done.

    Parameters
    ----------
    case, plan : ScaledCase, Layout
        The case, its rows and cones.
    solver : Solver
        In lanes, linearised.
    place : int
        Which lane.
    iteration : int
        Of the facet.
    planes : int
        Tangent planes of the facet.
    tube, arc_bound : (N,) float, float
        Bounds of gravity for the certificate.
    limit : int
        Most iterations.
    prove : bool
        Bound the thrust level of the flights that keep to the planes, not of all flights, and stop as soon
        as that is above 1.
    single : Single
        Scratch space.
    known : float
        The bound so far.

    Returns
    -------
    outcome : Outcome
        How it ended, if it did.
    """
    numbers = single.numbers
    take_lane(solver.numbers, place, numbers)
    scale = 1.0 if plan.tau_free else plan.energy_weight
    converged = (
        iteration > DEFECT_PERIOD
        and numbers[PRIMAL] < TOLERANCE
        and numbers[DUAL] < DUAL_TOLERANCE * scale
        and numbers[GAP] < GAP_TOLERANCE * scale
    )
    status, bound = CONVERGED if converged else -1, known
    proves = (prove or not plan.tau_free) and not converged and iteration >= FIRST_CERTIFICATE
    blocks = not plan.tau_free and not converged and iteration >= FIRST_BLOCKED
    if proves or (plan.tau_free and converged):
        take_out(solver, place, blocks, single)
        counted = planes if prove else planes - planes
        level = lane(solver.cuts.offset[0], place) if counted > 0 else 1.0
        if counted > 0:  # the certificate looks for the planes' multipliers here
            first = 7 if case.on_ellipsoid else 6
            for c in range(counted):
                single.point.multiplier[first + c] = single.point.multiplier[plan.first_plane + c]
        bound = max(
            bound,
            certified_thrust_level(
                case,
                single.target,
                tube,
                arc_bound,
                single.model,
                single.point.multiplier,
                single.point.cone_dual,
                single.duals,
                single.cuts,
                counted,
                level,
            ),
        )
        if bound > 1.0 and not converged:
            status = CERTIFIED
    if status < 0 and blocks:
        needed = linearised_thrust_level(case, plan, single.point, single.model, single.duals)
        if needed > BLOCKED_LEVEL:
            status = BLOCKED
    if status < 0 and (iteration >= limit or not math.isfinite(numbers[GAP])):
        status = STALLED
    return Outcome(status, bound)


@inner
def linearise(case: ScaledCase, plan: Layout, solver: Solver) -> None:
    """Linearise all lanes' problems anew and fill the solver's numbers; see their marks."""
    point, model, path, marks, numbers = solver.point, solver.model, solver.path, solver.marks, solver.numbers
    if any_lane(marks[NEW] > 0.0):
        fill_constants(case, solver)
    begins = marks[BEGINS] > 0.0
    if any_lane(begins):
        cold_start(case, plan, begins, solver)
    measure_defect(case, point.thrust, path, marks[MEASURED] > 0.0)
    retake = marks[RETAKEN] > 0.0
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


@inner
def take_step(plan: Layout, solver: Solver) -> None:
    """Move all lanes by one predictor-corrector step."""
    gap, least = solver.numbers[GAP], solver.numbers[LEAST_TARGET]
    point, model, step = solver.point, solver.model, solver.step
    advance(point, model, step, plan.n_equal, plan.n_rows, plan.n_cones, gap, least, plan.tau_free)
