"""What a lane holds of a facet: how it gets there, goes on from the half grid, and is copied out."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from landing_cli.kernel import part
from landing_cli.kernel_lanes import WIDTH, lane, put_lane, take_lane
from landing_cli.reach.descent_model import Layout
from landing_cli.reach.free_solve import (
    BEGINNING,
    CERTIFIED,
    CONVERGED,
    ENERGY,
    MASS_COSTATE,
    LaneSolver,
    Single,
    Solver,
    hand_over,
)
from landing_cli.reach.records import Binding
from landing_cli.reach.scaled_case import ScaledCase

if TYPE_CHECKING:
    from landing_cli.reach.free_batch import Batch, CutBatch, WallBatch

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Places in Batch.pressure, less one for Binding.NONE.
THRUST = int(Binding.THRUST) - 1
ELLIPSOID = int(Binding.ELLIPSOID) - 1
GLIDE_SLOPE = int(Binding.GLIDE_SLOPE) - 1
PROPELLANT = int(Binding.PROPELLANT) - 1
TERRAIN = int(Binding.TERRAIN) - 1
HANDOVER = int(Binding.HANDOVER) - 1


@part
def keep_costates(case: ScaledCase, plan: Layout, single: Single, out: Floats) -> None:
    """Carry the multipliers back to the start and turn them into the rotating frame.

    With v_inertial = v + w x r the costates are lambda_v and lambda_r - w x lambda_v.
    """
    multiplier, mix = single.point.multiplier, single.model.row_mix
    out[:] = 0.0
    for b in range(6):
        weight = 0.0
        for r in range(plan.n_rows):
            weight += multiplier[r] * mix[r, b]
        for i in range(6):
            out[i] += weight * single.to_start[b, i]
    out[0] += case.spin * out[4]
    out[1] -= case.spin * out[3]
    c, s = case.node_cos[0], case.node_sin[0]
    for i in range(0, 6, 3):
        out[i], out[i + 1] = c * out[i] + s * out[i + 1], c * out[i + 1] - s * out[i]
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
def keep(
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
def load(
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
def fill_order(planes: Ints, walls: Ints, most: int, order: Ints) -> None:
    """Facets with many planes first: lanes with as many rows share less of what the others do not need."""
    at = np.int64(0)
    for many in range(most, -1, -1):
        for i in range(planes.shape[0]):
            if planes[i] + walls[i] == many:
                order[at] = i
                at += 1


@part
def take_in(
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
        load(i, place, targets, normals, cuts, keep_level, walls, first_plane, solver.lanes, solver.single)
        facet[0, place], iteration[0, place], solver.bound[0, place] = i, 0, 0.0
        if begun:
            hand_over(w, place, solver)
            iteration[0, place], solver.bound[0, place], facet[1, w] = BEGINNING, solver.bound[1, w], -1
        else:
            loaded += 1
    for place in range(WIDTH):
        if side == 1 and loaded < n:
            i = order[loaded]
            load(
                i, place, targets, normals, cuts, keep_level, walls, first_plane, solver.begun, solver.single
            )
            facet[1, place], iteration[1, place], solver.bound[1, place] = i, 0, 0.0
            loaded += 1
    return loaded, side
