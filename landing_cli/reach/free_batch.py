"""The conic solve over a batch of facets, as one compiled loop that keeps every lane at work.

Deciding what to solve next (which side of the ellipsoid, which planes, which objective) is left to
`free_flights`, batch by batch: the big kernel is compiled once and called from one place.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from landing_cli.kernel import inlined, kernel
from landing_cli.kernel_address import call
from landing_cli.kernel_lanes import WIDTH, with_lane
from landing_cli.kernel_record import by_reference
from landing_cli.reach.descent_model import Layout, layout
from landing_cli.reach.free_solve import (
    BEGINNING,
    BEGINS,
    DEFECT_PERIOD,
    FIRST_DEFECT,
    HALVED_FROM,
    MEASURED,
    NEW,
    RETAKEN,
    LaneSolver,
    Solver,
)
from landing_cli.reach.lane_contents import fill_order, keep, take_in
from landing_cli.reach.scaled_case import ScaledCase

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


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
    call(solver.linearise, (case, plan, lanes))
    goes_on = False
    for place in range(WIDTH):
        i = facet[place]
        if i < 0:
            continue
        of_facet = place, iteration[place], cuts.planes[i]
        bounds = tube, arc_bound, limit, prove, solver.single, bound[place]
        outcome = call(solver.judge, (case, plan, lanes, *of_facet, *bounds))
        bound[place] = outcome.bound
        if outcome.status < 0:
            goes_on = True
            continue
        out.status[i], out.iterations[i], out.bound[i] = outcome.status, iteration[place], outcome.bound
        count = cuts.planes[i] + walls.walls[i]
        keep(i, place, case, plan, lanes, solver.single, count, cuts, out)
        facet[place] = -1
    if goes_on:
        call(solver.take_step, (plan, lanes))
    return True


@inlined
def _fill_drift(case: ScaledCase, plan: Layout, solver: LaneSolver) -> None:
    """Fly without thrust: all facets' starts are reckoned from there."""
    lanes, begun = solver.lanes, solver.begun
    n = lanes.point.thrust.shape[0]
    for k in range(n):
        for i in range(3):
            lanes.point.thrust[k, i] = 0.0
    for i in range(6):
        lanes.path.defect[i] = 0.0
    for mark in range(4):
        lanes.marks[mark] = 0.0
    call(solver.linearise, (case, plan, lanes))
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
    fill_order(cuts.planes, walls.walls, lanes.cuts.node.shape[0], order)
    plan = layout(case, loaded, energy_weight, tau_free)
    _fill_drift(case, plan, solver)
    solver.facet[:, :] = -1
    halved = not prove and lanes.point.thrust.shape[0] >= HALVED_FROM
    while going:
        loaded, side = take_in(
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
