"""The verdict on one facet with free descent control: free path, ways around the ellipsoid, margin."""

from __future__ import annotations

from typing import NamedTuple

from numba import njit

from landing_cli.reach.descent_model import layout
from landing_cli.reach.ellipsoid_arcs import UNDECIDED, arc_cuts, freeze_on_path, lowest_level
from landing_cli.reach.free_solve import CONVERGED, STALLED, Outcome, keep, solve

NEVER = 1 << 30
FREE_LIMIT, CUT_LIMIT, ROUNDS = 40, 36, 4
RETAKE_FROM = 5
# |xi| that the tangent planes keep: the path between two nodes may dip below their line
CUT_LEVEL = 1.0 + 2e-4
TOUCH = 1.0 - 1e-6
ENERGY_ONLY, MARGIN_WEIGHT = 1.0, 1e-3


class Found(NamedTuple):
    """The best solve of a facet; the solver's answer holds its flight."""

    status: int
    iterations: int
    energy: float
    level: float  # thrust level: 1 in energy mode, the least one in margin mode
    bound: float  # certified lower bound on the thrust level
    cuts: int  # tangent planes in the final solve


@njit(cache=True, nogil=True, error_model="numpy")
def _around(case, target, normal, side, weight, tau_free, free_position, tube, arc_bound, solver):
    """Solve with tangent planes on one side of the ellipsoid; normals follow the path, then freeze."""
    path, cuts = solver.path, solver.cuts
    path.position[:, :] = free_position
    count = arc_cuts(case, path, side, cuts)
    used, solved, frozen = 0, count, False
    outcome = Outcome(STALLED, 0, 0.0, 0.0, 0.0)
    retake_from = RETAKE_FROM
    for _ in range(ROUNDS):
        plan = layout(case, count, weight, tau_free, CUT_LEVEL)
        outcome = solve(case, target, normal, plan, retake_from, tube, arc_bound, CUT_LIMIT, solver)
        used += outcome.iterations
        if outcome.status == STALLED:
            frozen = True
            count, _added = freeze_on_path(case, path, cuts, count, TOUCH)
            plan = layout(case, count, weight, tau_free, CUT_LEVEL)
            outcome = solve(case, target, normal, plan, NEVER, tube, arc_bound, CUT_LIMIT, solver)
            used += outcome.iterations
        solved = count
        if outcome.status != CONVERGED:
            break
        count, added = freeze_on_path(case, path, cuts, count, TOUCH)
        if added == 0:
            break
        retake_from = 1
    return outcome, used, solved, frozen


@njit(cache=True, nogil=True, error_model="numpy")
def best_flight(case, target, normal, tau_free, tube, arc_bound, solver):
    """Best flight to one facet, free or around the ellipsoid on either side.

    Parameters
    ----------
    case : ScaledCase
        The case.
    target, normal : (3,) float
        Touchdown point (scaled) and outward normal, body axes.
    tau_free : bool
        False: least J at full thrust. True: least thrust level.
    tube, arc_bound : (N,) float, float
        Bounds of gravity for the certificate.
    solver : Solver
        Work space; its answer holds the best flight.

    Returns
    -------
    found : Found
        How the facet was settled.
    """
    weight = MARGIN_WEIGHT if tau_free else ENERGY_ONLY
    path, point = solver.path, solver.point
    plan = layout(case, 0, weight, tau_free, CUT_LEVEL)
    free = solve(case, target, normal, plan, NEVER, tube, arc_bound, FREE_LIMIT, solver)
    found = Found(free.status, free.iterations, free.energy, point.y[0], free.bound, 0)
    if free.status != CONVERGED:
        return found
    lowest = lowest_level(case, path)
    if lowest >= TOUCH:
        keep(case, plan, solver, free.mass_costate)
        return found
    position = path.position.copy()
    used, best_cuts, best_value, best_energy, best_level = free.iterations, 1, 1e9, 0.0, 0.0
    frozen = False
    for side in (1.0, -1.0):
        if side < 0.0 and best_value < 1e9 and not frozen and lowest >= UNDECIDED:
            break
        outcome, more, count, frozen = _around(
            case, target, normal, side, weight, tau_free, position, tube, arc_bound, solver
        )
        used += more
        value = point.y[0] if tau_free else outcome.energy
        if outcome.status == CONVERGED and value < best_value:
            best_value, best_cuts, best_energy, best_level = value, count, outcome.energy, point.y[0]
            keep(case, layout(case, count, weight, tau_free, CUT_LEVEL), solver, outcome.mass_costate)
    status = CONVERGED if best_value < 1e9 else STALLED
    return Found(status, used, best_energy, best_level, free.bound, best_cuts)
