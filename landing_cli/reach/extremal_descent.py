"""Facets by the paper's own method (`descent: extremal`): two-stage energy-optimal extremals.

The descent stage follows an unconstrained extremal of Zhao 2022, eqs 1 and 8-12, and the ellipsoid only
accepts or rejects it. Every start is tried until one leads to an optimum: the caller's costates first (the
multipliers of the conic solve, a neighbour's costates), then the paper's approximate costates (eq 13).

A facet is reachable when a flight was found that meets every limit, and unreachable, without proof, when
every search ended at a local least of the violation. Whatever did not converge is unresolved.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from landing_cli.reach.delivery import VALUE_COLUMNS, new_deliveries
from landing_cli.reach.extremal_delivery import deliver_extremals
from landing_cli.reach.extremal_search import FEASIBLE, STUCK, Found, new_found, new_searcher, search_batch
from landing_cli.reach.extremal_terms import ExtremalProblem, extremal_problem
from landing_cli.reach.free_descent import PreparedCase, prepare, survey
from landing_cli.reach.records import Binding, FacetSolutions, LandingCase, Verdict, blank_rows

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Steps of a search, and of one that goes on where these were too coarse.
COARSE_STEPS, FINE_STEPS = 30, 120

# A constraint binds when loosening it by a relative unit is worth more than this part of J.
SLIGHT_PRESSURE = 1e-5


def approximate_costates(case: LandingCase, targets_m: Floats) -> Floats:
    """Initial costates of a gravity-free, unbounded landing from the initial state (Zhao 2022, eq 13).

    Parameters
    ----------
    case : LandingCase
        The case; its whole time of flight goes into the formula.
    targets_m : (n, 3) float, m, body frame
        Touchdown points.

    Returns
    -------
    (n, 7) float
        Scaled as in ``records``.
    """
    tp = case.descent_s
    length = case.spacecraft.thrust_max_n / case.spacecraft.mass_kg * tp**2
    t = case.tof_s / tp
    offset = (case.position_m - targets_m) / length
    velocity = np.asarray(case.velocity_m_s) * tp / length
    of_position = 6.0 * (t * velocity + 2.0 * offset) / t**3
    of_velocity = 2.0 * (2.0 * t * velocity + 3.0 * offset) / t**2
    # lambda_m falls to 0 at the handover, one unit of time on
    of_mass = (of_position**2 / 3.0 - of_position * of_velocity + of_velocity**2).sum(axis=1)
    return np.concatenate([of_position, of_velocity, of_mass[:, None]], axis=1)


def _search(
    prepared: PreparedCase,
    problem: ExtremalProblem,
    facets: Ints,
    starts: Floats,
    n_steps: int,
    guards: Floats,
) -> Found:
    n, found = len(facets), new_found(len(facets))
    targets = prepared.shared.centroids_m[facets] / problem.field.scale.length_m
    starts = np.ascontiguousarray(starts, dtype=np.float64).reshape(n, -1, 7)
    searcher = new_searcher(problem, n_steps)
    search_batch(problem, targets, prepared.shared.normals[facets], starts, guards, searcher, found)
    return found


def _record(rows: NDArray[np.void], places: Ints, found: Found) -> None:
    """Fill what a search says by itself."""
    rows["iterations"][places] += found.rounds
    rows["violation"][places] = found.broken
    slight = found.pressure.max(axis=1) <= SLIGHT_PRESSURE * found.energy
    rows["binding"][places] = np.where(slight, int(Binding.NONE), np.argmax(found.pressure, axis=1) + 1)
    rows["verdict"][places] = np.where(found.status == STUCK, Verdict.UNREACHABLE, Verdict.UNRESOLVED)


def _deliver(
    prepared: PreparedCase,
    problem: ExtremalProblem,
    rows: NDArray[np.void],
    places: Ints,
    costates: Floats,
) -> Floats:
    """Fly feasible extremals at fine steps and fill the rows of those that meet every limit.

    Returns the violation of each, (n,).
    """
    facets, shared = rows["facet"][places], prepared.shared
    targets_m, normals = shared.centroids_m[facets], shared.normals[facets]
    out = new_deliveries(len(places))
    deliver_extremals(problem, prepared.frame, shared.surface, costates, targets_m, normals, out)
    excess = out.values[:, VALUE_COLUMNS.index("violation")]
    met = excess == 0.0
    depth = -out.values[:, VALUE_COLUMNS.index("terrain_clearance_min_m")]
    cuts = met & (depth > 0.0) & (prepared.case.terrain == "require")
    rows["verdict"][places[cuts]], rows["binding"][places[cuts]] = Verdict.UNREACHABLE, Binding.TERRAIN
    rows["violation"][places[cuts]] = depth[cuts] / problem.field.scale.length_m
    flown = met & ~cuts
    chosen = places[flown]
    rows["verdict"][chosen] = Verdict.REACHABLE
    for column, name in enumerate(VALUE_COLUMNS):
        rows[name][chosen] = out.values[flown, column]
    rows["handover_position_m"][chosen] = out.handover[flown, :3]
    rows["handover_velocity_m_s"][chosen] = out.handover[flown, 3:6]
    rows["handover_mass_kg"][chosen] = out.handover[flown, 6]
    rows["costates"][chosen] = costates[flown]
    return excess


def solve_prepared(
    prepared: PreparedCase, facets: NDArray[np.integer], starts: Floats | None = None
) -> FacetSolutions:
    """Solve some facets of a prepared case.

    Parameters
    ----------
    prepared : PreparedCase
        From ``free_descent.prepare``.
    facets : (n,) int
        Facets, 0-based.
    starts : (n, 7) or (n, k, 7) float, scaled, optional
        Initial costates to start from, tried in turn before the approximate ones; rows of NaN are passed
        over. The costates of ``free_descent``'s rows are in this scaling.

    Returns
    -------
    FacetSolutions
        One row a facet, in the order given; no thrust nodes, the costates suffice.
    """
    indices = np.asarray(facets, dtype=np.int64)
    rows = blank_rows(indices)
    problem = extremal_problem(prepared.case)
    every = approximate_costates(prepared.case, prepared.shared.centroids_m[indices])[:, None, :]
    if starts is not None:
        given = np.asarray(starts, dtype=np.float64).reshape(len(rows), -1, 7)
        every = np.concatenate([given, every], axis=1)
    found = _search(prepared, problem, indices, every, COARSE_STEPS, np.zeros(len(rows)))
    _record(rows, np.arange(len(rows)), found)
    feasible = np.flatnonzero(found.broken < FEASIBLE)
    excess = _deliver(prepared, problem, rows, feasible, found.costates[feasible])
    off, excess = feasible[excess > 0.0], excess[excess > 0.0]
    if len(off):
        # too coarse in the steps, or between the points of the final arc: go on from there, finely
        finer = _search(prepared, problem, indices[off], found.costates[off], FINE_STEPS, excess)
        _record(rows, off, finer)
        met = finer.broken < FEASIBLE
        _deliver(prepared, problem, rows, off[met], finer.costates[met])
    return FacetSolutions(rows, np.zeros((0, 3)))


def solve_from(prepared: PreparedCase, free: FacetSolutions) -> FacetSolutions:
    """Solve the facets of a conic solve again, by extremals.

    Extremals are a restriction of free control, so its proofs that a facet is unreachable hold for them; the
    other facets start from its multipliers where it found a flight.

    Parameters
    ----------
    prepared : PreparedCase
        The case.
    free : FacetSolutions
        From ``free_descent`` for the same case.

    Returns
    -------
    FacetSolutions
        One row for each of ``free``, in its order.
    """
    rows = free.rows.copy()
    rows["thrust_nodes"] = 0
    open_rows = np.flatnonzero(rows["proved"] == 0)
    solved = solve_prepared(prepared, rows["facet"][open_rows], rows["costates"][open_rows])
    rows[open_rows] = solved.rows
    return FacetSolutions(rows, np.zeros((0, 3)))


def solve_facets(
    case: LandingCase, facets: NDArray[np.integer], starts: Floats | None = None
) -> FacetSolutions:
    """Solve some facets of a case, preparing it each time (see ``solve_prepared``)."""
    return solve_prepared(prepare(case, survey(case)), facets, starts)
