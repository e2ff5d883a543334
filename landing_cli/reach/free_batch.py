"""The conic solve over a batch of facets, as one compiled loop.

Deciding what to solve next (which side of the ellipsoid, which planes, which objective) is left to
`free_flights`, batch by batch: the big kernel is compiled once and called from one place.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from landing_cli.kernel import kernel
from landing_cli.kernel_record import by_reference
from landing_cli.reach.descent_model import Layout, layout
from landing_cli.reach.free_solve import CERTIFIED, CONVERGED, Solver, solve
from landing_cli.reach.records import Binding
from landing_cli.reach.scaled_case import ScaledCase
from landing_cli.reach.shooting import pull_back

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
def keep_costates(case: ScaledCase, plan: Layout, solver: Solver, mass_costate: float, out: Floats) -> None:
    """Carry the multipliers back to the start and turn them into the rotating frame.

    With v_inertial = v + w x r the costates are lambda_v and lambda_r - w x lambda_v.
    """
    point, path = solver.point, solver.path
    m, scratch = point.multiplier, solver.step.node_residual
    n = path.gradient.shape[0]
    p = np.zeros(6)
    p[0], p[1], p[2], p[3], p[4], p[5] = pull_back(path, n, m[0], m[1], m[2], m[3], m[4], m[5], scratch)
    for c in range(plan.n_cuts + plan.n_walls):
        if solver.cuts.node[c] == 0:  # on the final arc
            continue
        eta, normal = m[plan.n_equal + c], solver.cuts.normal[c]
        t = pull_back(
            path,
            solver.cuts.node[c],
            eta * normal[0],
            eta * normal[1],
            eta * normal[2],
            0.0,
            0.0,
            0.0,
            scratch,
        )
        for i in range(6):
            p[i] += t[i]
    p[0] += case.spin * p[4]
    p[1] -= case.spin * p[3]
    c, s = case.node_cos[0], case.node_sin[0]
    for i in range(0, 6, 3):
        out[i], out[i + 1], out[i + 2] = c * p[i] + s * p[i + 1], c * p[i + 1] - s * p[i], p[i + 2]
    out[6] = mass_costate


@kernel
def keep_pressure(case: ScaledCase, plan: Layout, solver: Solver, out: Floats) -> None:
    """What a relative loosening of each constraint takes off the objective (envelope theorem)."""
    point = solver.point
    arcs = case.arc_fractions.shape[0]
    out[:] = 0.0
    for k in range(point.thrust.shape[0]):
        out[THRUST] += point.node_dual[k, 0] * point.y[0]
    for j in range(arcs):
        out[THRUST] += point.cone_dual[j, 0] * solver.model.cone_map[j, 0, 0] * point.y[0]
    for j in range(arcs, arcs + 2):
        out[GLIDE_SLOPE] += point.cone_dual[j, 0] * point.cone_slack[j, 0]
    for r in range(plan.n_equal, plan.n_equal + plan.n_cuts):
        out[ELLIPSOID] -= point.multiplier[r] * plan.level
    for c in range(plan.n_cuts, plan.n_cuts + plan.n_walls):
        out[TERRAIN] -= point.multiplier[plan.n_equal + c] * abs(solver.cuts.offset[c])
    if case.on_ellipsoid:
        out[HANDOVER] = abs(point.multiplier[6])
    if case.propellant < 1.0:
        out[PROPELLANT] = -point.multiplier[plan.n_rows - 1] * case.propellant


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
    solver: Solver,
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
        Bound the thrust level of the flights that keep to the planes; see :func:`free_solve.solve`.
    solver : Solver
        Work space for the case.
    out : Batch
        Filled.
    """
    for i in range(targets.shape[0]):
        count = cuts.planes[i]
        for c in range(count):
            solver.cuts.node[c] = cuts.node[i, c]
            for a in range(3):
                solver.cuts.normal[c, a] = cuts.normal[i, c, a]
        for w in range(walls.walls[i]):
            c = count + w
            solver.cuts.node[c], solver.cuts.fraction[c] = walls.node[i, w], walls.fraction[i, w]
            solver.cuts.offset[c] = walls.offset[i, w]
            for a in range(3):
                solver.cuts.normal[c, a] = walls.normal[i, w, a]
        plan = layout(case, count, energy_weight, tau_free, keep_level[i], walls.walls[i])
        outcome = solve(
            case, targets[i], normals[i], plan, retake_from, tube, arc_bound, limit, prove, solver
        )
        out.status[i], out.iterations[i] = outcome.status, outcome.iterations
        out.energy[i], out.level[i], out.bound[i] = outcome.energy, solver.point.y[0], outcome.bound
        for k in range(out.thrust.shape[1]):
            for a in range(3):
                out.thrust[i, k, a] = solver.point.thrust[k, a]
        for k in range(out.position.shape[1]):
            for a in range(3):
                out.position[i, k, a] = solver.path.position[k, a]
        for c in range(count):
            for a in range(3):
                cuts.normal[i, c, a] = solver.cuts.normal[c, a]
        if outcome.status == CONVERGED:
            keep_costates(case, plan, solver, outcome.mass_costate, out.costates[i])
        if outcome.status == CONVERGED or outcome.status == CERTIFIED:
            keep_pressure(case, plan, solver, out.pressure[i])
