"""The conic solve over a batch of facets, as one compiled loop that keeps every lane at work.

Deciding what to solve next (which side of the ellipsoid, which planes, which objective) is left to
`free_flights`, batch by batch: the big kernel is compiled once and called from one place.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from landing_cli.kernel import kernel
from landing_cli.kernel_lanes import WIDTH, lane, with_lane
from landing_cli.kernel_record import by_reference
from landing_cli.reach.descent_model import Layout, layout
from landing_cli.reach.free_solve import (
    CERTIFIED,
    CONVERGED,
    DEFECT_PERIOD,
    DUAL,
    ENERGY,
    FIRST_DEFECT,
    GAP,
    MASS_COSTATE,
    PRIMAL,
    LaneSolver,
    Solver,
    fill_drift,
    judge,
    linearise,
    take_step,
)
from landing_cli.reach.records import Binding
from landing_cli.reach.scaled_case import ScaledCase

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Places in Batch.pressure, less one for Binding.NONE.
THRUST = int(Binding.THRUST) - 1
ELLIPSOID = int(Binding.ELLIPSOID) - 1
GLIDE_SLOPE = int(Binding.GLIDE_SLOPE) - 1
PROPELLANT = int(Binding.PROPELLANT) - 1
TERRAIN = int(Binding.TERRAIN) - 1
HANDOVER = int(Binding.HANDOVER) - 1


@by_reference
class CutBatch(NamedTuple):
    """Tangent planes of every facet of a batch (n facets, room for C planes each)."""

    planes: Ints  # (n,) how many
    node: Ints  # (n, C)
    normal: Floats  # (n, C, 3) solver axes


@by_reference
class WallBatch(NamedTuple):
    """Planes off the terrain for every facet of a batch (n facets, room for W planes each)."""

    walls: Ints  # (n,) how many
    node: Ints  # (n, W) of the descent, or 0: on the final arc
    fraction: Floats  # (n, W) of the final arc's time-to-go
    normal: Floats  # (n, W, 3) solver axes
    offset: Floats  # (n, W)


@by_reference
class Batch(NamedTuple):
    """How the solves of a batch ended."""

    status: Ints  # (n,)
    iterations: Ints  # (n,)
    energy: Floats  # (n,) J, scaled
    level: Floats  # (n,) thrust level: 1 in energy mode, the least one in margin mode
    bound: Floats  # (n,) certified lower bound on the thrust level
    thrust: Floats  # (n, N, 3) scaled, solver axes
    position: Floats  # (n, N + 1, 3) at the nodes
    costates: Floats  # (n, 7) of position, velocity and mass at the start, rotating frame, body axes
    pressure: Floats  # (n, 6) by constraint: what loosening it by a relative unit takes off the objective


def new_batch(size: int, intervals: int) -> Batch:
    """Return a zeroed batch."""
    return Batch(
        np.zeros(size, dtype=np.int64),
        np.zeros(size, dtype=np.int64),
        np.zeros(size),
        np.zeros(size),
        np.zeros(size),
        np.zeros((size, intervals, 3)),
        np.zeros((size, intervals + 1, 3)),
        np.full((size, 7), np.nan),
        np.zeros((size, 6)),
    )


def no_cuts(size: int, intervals: int) -> CutBatch:
    """Return a batch without tangent planes."""
    room = intervals + 1
    return CutBatch(
        np.zeros(size, dtype=np.int64), np.zeros((size, room), dtype=np.int64), np.zeros((size, room, 3))
    )


def no_walls(size: int) -> WallBatch:
    """Return a batch without planes off the terrain, and without room for any."""
    nodes, numbers = np.zeros((size, 0), dtype=np.int64), np.zeros((size, 0))
    return WallBatch(np.zeros(size, dtype=np.int64), nodes, numbers, np.zeros((size, 0, 3)), numbers.copy())


@kernel
def keep_costates(
    case: ScaledCase, plan: Layout, solver: Solver, place: int, mass_costate: float, out: Floats
) -> None:
    """Carry the multipliers of a lane back to the start and turn them into the rotating frame.

    With v_inertial = v + w x r the costates are lambda_v and lambda_r - w x lambda_v.
    """
    point, model, path = solver.point, solver.model, solver.path
    p = np.zeros(6)
    for b in range(6):
        weight = 0.0
        for r in range(plan.n_rows):
            weight += lane(point.multiplier[r], place) * lane(model.row_mix[r, b], place)
        for i in range(6):
            p[i] += weight * lane(path.to_start[b, i], place)
    p[0] += case.spin * p[4]
    p[1] -= case.spin * p[3]
    c, s = case.node_cos[0], case.node_sin[0]
    for i in range(0, 6, 3):
        out[i], out[i + 1], out[i + 2] = c * p[i] + s * p[i + 1], c * p[i + 1] - s * p[i], p[i + 2]
    out[6] = mass_costate


@kernel
def keep_pressure(
    case: ScaledCase, plan: Layout, solver: Solver, place: int, planes: int, out: Floats
) -> None:
    """What a relative loosening of each constraint takes off the objective (envelope theorem)."""
    point, cuts = solver.point, solver.cuts
    arcs = case.arc_fractions.shape[0]
    out[:] = 0.0
    tau = lane(point.y[0], place)
    for k in range(point.thrust.shape[0]):
        out[THRUST] += lane(point.node_dual[k, 0], place) * tau
    for j in range(arcs):
        out[THRUST] += lane(point.cone_dual[j, 0] * solver.model.cone_map[j, 0, 0], place) * tau
    for j in range(arcs, arcs + 2):
        out[GLIDE_SLOPE] += lane(point.cone_dual[j, 0] * point.cone_slack[j, 0], place)
    for c in range(planes):
        kind = ELLIPSOID if lane(cuts.tangent[c], place) > 0.0 else TERRAIN
        out[kind] -= lane(point.multiplier[plan.first_plane + c], place) * abs(lane(cuts.offset[c], place))
    if case.on_ellipsoid:
        out[HANDOVER] = abs(lane(point.multiplier[6], place))
    if case.propellant < 1.0:
        out[PROPELLANT] = -lane(point.multiplier[plan.first_plane - 1], place) * case.propellant


@kernel
def _load(
    i: int,
    place: int,
    targets: Floats,
    normals: Floats,
    cuts: CutBatch,
    keep_level: Floats,
    walls: WallBatch,
    first_plane: int,
    solver: Solver,
) -> None:
    """Put facet i of a batch into a lane: its place, and its planes."""
    own, live = solver.cuts, solver.model.row_live
    for a in range(3):
        solver.target[a] = with_lane(solver.target[a], place, targets[i, a])
        solver.normal[a] = with_lane(solver.normal[a], place, normals[i, a])
    count = cuts.planes[i]
    for c in range(own.node.shape[0]):
        w = c - count
        tangent = there = 0.0
        node = fraction = offset = n0 = n1 = n2 = 0.0
        if c < count:
            tangent, there, offset, node = 1.0, 1.0, keep_level[i], float(cuts.node[i, c])
            n0, n1, n2 = cuts.normal[i, c, 0], cuts.normal[i, c, 1], cuts.normal[i, c, 2]
        elif w < walls.walls[i]:
            there, offset, node = 1.0, walls.offset[i, w], float(walls.node[i, w])
            fraction = walls.fraction[i, w]
            n0, n1, n2 = walls.normal[i, w, 0], walls.normal[i, w, 1], walls.normal[i, w, 2]
        own.tangent[c], own.node[c] = (
            with_lane(own.tangent[c], place, tangent),
            with_lane(own.node[c], place, node),
        )
        own.fraction[c], own.offset[c] = (
            with_lane(own.fraction[c], place, fraction),
            with_lane(own.offset[c], place, offset),
        )
        n = own.normal[c]
        n[0], n[1], n[2] = with_lane(n[0], place, n0), with_lane(n[1], place, n1), with_lane(n[2], place, n2)
        live[first_plane + c] = with_lane(live[first_plane + c], place, there)


@kernel
def _keep(
    i: int,
    place: int,
    case: ScaledCase,
    plan: Layout,
    solver: Solver,
    mass_costate: float,
    cuts: CutBatch,
    planes: int,
    out: Batch,
) -> None:
    """Copy the answer in a lane to facet i of a batch."""
    point, path = solver.point, solver.path
    out.level[i] = lane(point.y[0], place)
    for k in range(out.thrust.shape[1]):
        for a in range(3):
            out.thrust[i, k, a] = lane(point.thrust[k, a], place)
    for k in range(out.position.shape[1]):
        for a in range(3):
            out.position[i, k, a] = lane(path.position[k, a], place)
    for c in range(cuts.planes[i]):
        for a in range(3):
            cuts.normal[i, c, a] = lane(solver.cuts.normal[c, a], place)
    if out.status[i] == CONVERGED:
        keep_costates(case, plan, solver, place, mass_costate, out.costates[i])
    if out.status[i] == CONVERGED or out.status[i] == CERTIFIED:
        keep_pressure(case, plan, solver, place, planes, out.pressure[i])


@kernel
def _fill_order(planes: Ints, walls: Ints, most: int, order: Ints) -> None:
    """Facets with many planes first: lanes with as many rows share less of what the others do not need."""
    at = np.int64(0)
    for many in range(most, -1, -1):
        for i in range(planes.shape[0]):
            if planes[i] + walls[i] == many:
                order[at] = i
                at += 1


@kernel
def solve_many(
    case: ScaledCase,
    targets: Floats,
    normals: Floats,
    cuts: CutBatch,
    keep_level: Floats,
    walls: WallBatch,
    energy_weight: float,
    tau_free: bool,
    retake_from: int,
    limit: int,
    tube: Floats,
    arc_bound: float,
    prove: bool,
    solver: LaneSolver,
    out: Batch,
) -> None:
    """Solve every facet of a batch from a cold start.

    Parameters
    ----------
    case : ScaledCase
        The case.
    targets, normals : (n, 3) float
        Touchdown points (scaled) and outward facet normals, body axes.
    cuts : CutBatch
        Tangent planes of the ellipsoid; on return at their last position.
    keep_level : (n,) float
        |xi| that the planes keep.
    walls : WallBatch
        Planes off the terrain; they stay where they are.
    energy_weight : float
        Weight of J in the objective.
    tau_free : bool
        False: least J at full thrust. True: least thrust level, plus the weighted J.
    retake_from : int
        Iteration from which the planes follow the path.
    limit : int
        Most iterations a facet.
    tube, arc_bound : (N,) float, float
        Bounds of gravity for the certificate.
    prove : bool
        Bound the thrust level of the flights that keep to the planes; see :func:`free_solve.judge`.
    solver : Solver
        Work space for the case.
    out : Batch
        Filled.
    """
    lanes, facet, iteration = solver.lanes, solver.facet, solver.iteration
    n, loaded, marks = targets.shape[0], np.int64(0), lanes.marks
    order = np.empty(n, dtype=np.int64)
    _fill_order(cuts.planes, walls.walls, lanes.cuts.node.shape[0], order)
    first_plane = layout(case, 0, energy_weight, tau_free).first_plane
    fill_drift(case, lanes)
    facet[:] = -1
    while True:
        marks[0] = marks[1] = marks[2] = 0.0
        active, planes = False, np.int64(0)
        for place in range(WIDTH):
            if facet[place] < 0 and loaded < n:
                facet[place], iteration[place], solver.bound[place] = order[loaded], 0, 0.0
                loaded += 1
                _load(facet[place], place, targets, normals, cuts, keep_level, walls, first_plane, lanes)
                marks[0] = with_lane(marks[0], place, 1.0)
            if facet[place] < 0:
                continue
            active = True
            planes = max(planes, cuts.planes[facet[place]] + walls.walls[facet[place]])
            iteration[place] += 1
            if iteration[place] > 1 and iteration[place] % DEFECT_PERIOD == FIRST_DEFECT:
                marks[1] = with_lane(marks[1], place, 1.0)
            if iteration[place] >= retake_from:
                marks[2] = with_lane(marks[2], place, 1.0)
        if not active:
            break
        plan = layout(case, planes, energy_weight, tau_free)
        linearise(case, plan, lanes)
        numbers, goes_on = lanes.numbers, False
        for place in range(WIDTH):
            i = facet[place]
            if i < 0:
                continue
            residual = lane(numbers[PRIMAL], place), lane(numbers[DUAL], place), lane(numbers[GAP], place)
            outcome = judge(
                case, plan, place, residual, cuts.planes[i], tube, arc_bound, limit, prove, solver
            )
            if outcome.status < 0:
                goes_on = True
                continue
            out.status[i], out.iterations[i], out.bound[i] = outcome.status, iteration[place], outcome.bound
            out.energy[i] = lane(numbers[ENERGY], place)
            count = cuts.planes[i] + walls.walls[i]
            _keep(i, place, case, plan, lanes, lane(numbers[MASS_COSTATE], place), cuts, count, out)
            facet[place] = -1
        if goes_on:
            take_step(plan, lanes)
