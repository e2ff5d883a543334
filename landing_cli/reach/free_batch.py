"""The conic solve over a batch of facets, as one compiled loop that keeps every lane at work.

Deciding what to solve next (which side of the ellipsoid, which planes, which objective) is left to
`free_flights`, batch by batch: the big kernel is compiled once and called from one place.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from landing_cli.kernel import inlined, kernel, part
from landing_cli.kernel_lanes import WIDTH, lane, put_lane, take_lane, with_lane
from landing_cli.kernel_record import by_reference
from landing_cli.reach.descent_model import Layout, layout
from landing_cli.reach.free_solve import (
    BEGINNING,
    BEGINS,
    CERTIFIED,
    CONVERGED,
    DEFECT_PERIOD,
    ENERGY,
    FIRST_DEFECT,
    HALVED_FROM,
    MASS_COSTATE,
    MEASURED,
    NEW,
    RETAKEN,
    LaneSolver,
    Single,
    Solver,
    hand_over,
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


@part
def keep_costates(case: ScaledCase, plan: Layout, single: Single, out: Floats) -> None:
    """Carry the multipliers back to the start and turn them into the rotating frame.

    With v_inertial = v + w x r the costates are lambda_v and lambda_r - w x lambda_v.
    """
    multiplier, mix = single.point.multiplier, single.model.row_mix
    p = np.zeros(6)
    for b in range(6):
        weight = 0.0
        for r in range(plan.n_rows):
            weight += multiplier[r] * mix[r, b]
        for i in range(6):
            p[i] += weight * single.to_start[b, i]
    p[0] += case.spin * p[4]
    p[1] -= case.spin * p[3]
    c, s = case.node_cos[0], case.node_sin[0]
    for i in range(0, 6, 3):
        out[i], out[i + 1], out[i + 2] = c * p[i] + s * p[i + 1], c * p[i + 1] - s * p[i], p[i + 2]
    out[6] = single.numbers[MASS_COSTATE]


@part
def keep_pressure(
    case: ScaledCase, plan: Layout, single: Single, intervals: int, planes: int, out: Floats
) -> None:
    """What a relative loosening of each constraint takes off the objective (envelope theorem)."""
    point, cuts = single.point, single.cuts
    arcs = case.arc_fractions.shape[0]
    out[:] = 0.0
    for k in range(intervals):
        out[THRUST] += point.node_dual[k, 0] * point.y[0]
    for j in range(arcs):
        out[THRUST] += point.cone_dual[j, 0] * single.model.cone_map[j, 0, 0] * point.y[0]
    for j in range(arcs, arcs + 2):
        out[GLIDE_SLOPE] += point.cone_dual[j, 0] * point.cone_slack[j, 0]
    for c in range(planes):
        kind = ELLIPSOID if cuts.tangent[c] > 0.0 else TERRAIN
        out[kind] -= point.multiplier[plan.first_plane + c] * abs(cuts.offset[c])
    if case.on_ellipsoid:
        out[HANDOVER] = abs(point.multiplier[6])
    if case.propellant < 1.0:
        out[PROPELLANT] = -point.multiplier[plan.first_plane - 1] * case.propellant


@part
def _keep(
    i: int,
    place: int,
    case: ScaledCase,
    plan: Layout,
    solver: Solver,
    single: Single,
    planes: int,
    cuts: CutBatch,
    out: Batch,
) -> None:
    """Copy the answer in a lane to facet i of a batch; one that ended on the half grid has no flight."""
    point, own, status = solver.point, single.point, out.status[i]
    intervals = point.thrust.shape[0]
    out.energy[i], out.level[i] = lane(solver.numbers[ENERGY], place), lane(point.y[0], place)
    if intervals == out.thrust.shape[1]:
        take_lane(point.thrust, place, out.thrust[i])
        take_lane(solver.path.position, place, out.position[i])
        take_lane(solver.cuts.normal, place, cuts.normal[i])
    if status in (CONVERGED, CERTIFIED):
        take_lane(point.multiplier, place, own.multiplier)
        take_lane(point.y, place, own.y)
        take_lane(point.node_dual, place, own.node_dual)
        take_lane(point.cone_dual, place, own.cone_dual)
        take_lane(point.cone_slack, place, own.cone_slack)
        take_lane(solver.model.cone_map, place, single.model.cone_map)
        take_lane(solver.cuts.tangent, place, single.cuts.tangent)
        take_lane(solver.cuts.offset, place, single.cuts.offset)
        keep_pressure(case, plan, single, intervals, planes, out.pressure[i])
    if status == CONVERGED:
        take_lane(solver.model.row_mix, place, single.model.row_mix)
        take_lane(solver.path.to_start, place, single.to_start)
        take_lane(solver.numbers, place, single.numbers)
        keep_costates(case, plan, single, out.costates[i])


@part
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
    single: Single,
) -> None:
    """Put facet i of a batch into a lane: its place, and its planes."""
    own, live = single.cuts, single.model.row_live
    put_lane(solver.target, place, targets[i])
    put_lane(solver.normal, place, normals[i])
    own.node[:], own.fraction[:], own.offset[:], own.tangent[:] = 0.0, 0.0, 0.0, 0.0
    own.normal[:, :] = 0.0
    live[:] = 0.0
    live[:first_plane] = 1.0
    count = cuts.planes[i]
    for c in range(count):
        own.node[c], own.offset[c], own.tangent[c] = cuts.node[i, c], keep_level[i], 1.0
        for a in range(3):
            own.normal[c, a] = cuts.normal[i, c, a]
        live[first_plane + c] = 1.0
    for w in range(walls.walls[i]):
        c = count + w
        own.node[c], own.fraction[c], own.offset[c] = (
            walls.node[i, w],
            walls.fraction[i, w],
            walls.offset[i, w],
        )
        for a in range(3):
            own.normal[c, a] = walls.normal[i, w, a]
        live[first_plane + c] = 1.0
    put_lane(solver.cuts.node, place, own.node)
    put_lane(solver.cuts.normal, place, own.normal)
    put_lane(solver.cuts.fraction, place, own.fraction)
    put_lane(solver.cuts.offset, place, own.offset)
    put_lane(solver.cuts.tangent, place, own.tangent)
    put_lane(solver.model.row_live, place, live)


@part
def _fill_order(planes: Ints, walls: Ints, most: int, order: Ints) -> None:
    """Facets with many planes first: lanes with as many rows share less of what the others do not need."""
    at = np.int64(0)
    for many in range(most, -1, -1):
        for i in range(planes.shape[0]):
            if planes[i] + walls[i] == many:
                order[at] = i
                at += 1


@part
def _take_in(
    order: Ints,
    loaded: int,
    halved: bool,
    first_plane: int,
    targets: Floats,
    normals: Floats,
    cuts: CutBatch,
    keep_level: Floats,
    walls: WallBatch,
    solver: LaneSolver,
) -> tuple[int, int]:
    """Fill idle lanes: with begun facets, or with the next ones of the batch, which may have to begin.

    Returns
    -------
    loaded : int
        How many of the batch were taken so far.
    side : int
        What is to be iterated next: 0 the lanes, 1 the begun.
    """
    facet, iteration, n = solver.facet, solver.iteration, order.shape[0]
    for place in range(WIDTH):
        if facet[1, place] >= 0 and iteration[1, place] < BEGINNING:
            return loaded, 1
    side, w = 0, 0
    for place in range(WIDTH):
        while w < WIDTH and facet[1, w] < 0:
            w += 1
        begun = w < WIDTH
        i = facet[1, w] if begun else order[min(loaded, n - 1)]
        if facet[0, place] >= 0 or (not begun and loaded == n):
            continue
        if not begun and halved and cuts.planes[i] + walls.walls[i] == 0:
            side = 1
            break
        _load(i, place, targets, normals, cuts, keep_level, walls, first_plane, solver.lanes, solver.single)
        facet[0, place], iteration[0, place], solver.bound[0, place] = i, 0, 0.0
        if begun:
            hand_over(w, place, solver)
            iteration[0, place], solver.bound[0, place], facet[1, w] = BEGINNING, solver.bound[1, w], -1
        else:
            loaded += 1
    for place in range(WIDTH):
        if side == 1 and loaded < n:
            i = order[loaded]
            _load(
                i, place, targets, normals, cuts, keep_level, walls, first_plane, solver.begun, solver.single
            )
            facet[1, place], iteration[1, place], solver.bound[1, place] = i, 0, 0.0
            loaded += 1
    return loaded, side


@inlined
def _turn(
    case: ScaledCase,
    side: int,
    energy_weight: float,
    tau_free: bool,
    retake_from: int,
    limit: int,
    tube: Floats,
    arc_bound: float,
    prove: bool,
    cuts: CutBatch,
    walls: WallBatch,
    lanes: Solver,
    solver: LaneSolver,
    out: Batch,
) -> bool:
    """One iteration of the lanes, or of the begun; tells whether there was any facet."""
    facet, iteration, bound = solver.facet[side], solver.iteration[side], solver.bound[side]
    first, planes, active, marks = BEGINNING if side == 0 else 0, np.int64(0), False, lanes.marks
    for mark in range(4):
        marks[mark] = 0.0
    for place in range(WIDTH):
        i = facet[place]
        if i < 0:
            continue
        active = True
        planes = max(planes, cuts.planes[i] + walls.walls[i])
        if iteration[place] == 0:
            marks[BEGINS] = with_lane(marks[BEGINS], place, 1.0)
        if iteration[place] == 0 or iteration[place] == first:
            marks[NEW] = with_lane(marks[NEW], place, 1.0)
        iteration[place] += 1
        if iteration[place] > 1 and iteration[place] % DEFECT_PERIOD == FIRST_DEFECT:
            marks[MEASURED] = with_lane(marks[MEASURED], place, 1.0)
        if iteration[place] >= retake_from:
            marks[RETAKEN] = with_lane(marks[RETAKEN], place, 1.0)
    if not active:
        return False
    plan = layout(case, planes, energy_weight, tau_free)
    linearise(case, plan, lanes)
    goes_on = False
    for place in range(WIDTH):
        i = facet[place]
        if i < 0:
            continue
        outcome = judge(
            case,
            plan,
            lanes,
            place,
            iteration[place],
            cuts.planes[i],
            tube,
            arc_bound,
            limit,
            prove,
            solver.single,
            bound[place],
        )
        bound[place] = outcome.bound
        if outcome.status < 0:
            goes_on = True
            continue
        out.status[i], out.iterations[i], out.bound[i] = outcome.status, iteration[place], outcome.bound
        count = cuts.planes[i] + walls.walls[i]
        _keep(i, place, case, plan, lanes, solver.single, count, cuts, out)
        facet[place] = -1
    if goes_on:
        take_step(plan, lanes)
    return True


@inlined
def _fill_drift(case: ScaledCase, plan: Layout, lanes: Solver, begun: Solver) -> None:
    """Fly without thrust: all facets' starts are reckoned from there."""
    n = lanes.point.thrust.shape[0]
    for k in range(n):
        for i in range(3):
            lanes.point.thrust[k, i] = 0.0
    for i in range(6):
        lanes.path.defect[i] = 0.0
    for mark in range(4):
        lanes.marks[mark] = 0.0
    linearise(case, plan, lanes)
    for i in range(3):
        lanes.drift[i], lanes.drift[3 + i] = lanes.path.position[n, i], lanes.path.velocity[n, i]
    for i in range(6):
        begun.drift[i] = lanes.drift[i]


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
    lanes, begun, half = solver.lanes, solver.begun, solver.half
    loaded, going = np.int64(0), targets.shape[0] > 0
    order = np.empty(targets.shape[0], dtype=np.int64)
    _fill_order(cuts.planes, walls.walls, lanes.cuts.node.shape[0], order)
    plan = layout(case, loaded, energy_weight, tau_free)
    _fill_drift(case, plan, lanes, begun)
    solver.facet[:, :] = -1
    halved = not prove and lanes.point.thrust.shape[0] >= HALVED_FROM
    while going:
        loaded, side = _take_in(
            order, loaded, halved, plan.first_plane, targets, normals, cuts, keep_level, walls, solver
        )
        at, current = (half, begun) if side == 1 else (case, lanes)
        going = _turn(
            at,
            side,
            energy_weight,
            tau_free,
            retake_from,
            limit,
            tube,
            arc_bound,
            prove,
            cuts,
            walls,
            current,
            solver,
            out,
        )
