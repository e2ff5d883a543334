"""Facets by the paper's own method (`descent: extremal`): two-stage energy-optimal extremals.

The descent stage follows an unconstrained extremal of Zhao 2022, eqs 1 and 8-12, and the ellipsoid only
accepts or rejects it. Every start is tried until one leads to an optimum: the caller's costates first (the
multipliers of the conic solve, a neighbour's costates), then the paper's approximate costates (eq 13).

A facet is reachable when a flight was found that meets every limit, and unreachable, without proof, when
every search ended at a local least of the violation. Whatever did not converge is unresolved.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from landing_cli.flight.extremal import thrust_ratio
from landing_cli.kernel import inlined, kernel
from landing_cli.reach.delivery import VALUE_COLUMNS, new_deliveries
from landing_cli.reach.extremal_delivery import deliver_extremals
from landing_cli.reach.extremal_facet import (
    COARSE_STEPS,
    FEASIBLE,
    FINE_STEPS,
    OPTIMAL,
    STUCK,
    UNCONVERGED,
    Ended,
    Flight,
    new_flight,
    new_search,
    search_extremal,
)
from landing_cli.reach.extremal_terms import (
    MAX_ROWS,
    N_ARC,
    ROW_DIPS,
    ROW_GLIDE,
    ROW_HANDOVER,
    ROW_PROPELLANT,
    ExtremalProblem,
    extremal_problem,
    glide_weights,
    with_guard,
)
from landing_cli.reach.free_descent import PreparedCase, prepare, survey
from landing_cli.reach.records import Binding, FacetSolutions, LandingCase, Verdict, blank_rows

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Where the thrust is at its bound throughout, the costates' size means nothing and the energy is flat. A
# search that ends there goes on from costates small enough to throttle somewhere, at most so often.
PLATEAUS, OFF_PLATEAU = 2, 0.9

# A constraint binds when loosening it by a relative unit is worth more than this part of J.
SLIGHT_PRESSURE = 1e-5
_THRUST, _ELLIPSOID, _GLIDE_SLOPE, _PROPELLANT, _HANDOVER = (
    int(b) - 1
    for b in (
        Binding.THRUST,
        Binding.ELLIPSOID,
        Binding.GLIDE_SLOPE,
        Binding.PROPELLANT,
        Binding.HANDOVER,
    )
)


class Found(NamedTuple):
    """What the searches of a batch found."""

    status: Ints  # (n,) OPTIMAL, STUCK or UNCONVERGED
    rounds: Ints  # (n,)
    energy: Floats  # (n,) J over a0^2 t_p
    broken: Floats  # (n,) violation
    costates: Floats  # (n, 7)
    pressure: Floats  # (n, 6) by Binding: what loosening it by a relative unit takes off J


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


@inlined
def _pressures(
    problem: ExtremalProblem, target: Floats, flight: Flight, multipliers: Floats, out: Floats
) -> None:
    """Gather the multipliers by constraint; a saturated descent presses by rho - 1 per unit of time."""
    extremal = flight.extremal
    for b in range(out.shape[0]):
        out[b] = 0.0
    k, t = 0, 0.0
    while t < 1.0 - 1e-12:
        h = extremal.step[k]
        if extremal.saturated[k]:
            ahead, _ = thrust_ratio(problem.field.scale.flow, False, extremal.state[k + 1])
            behind, _ = thrust_ratio(problem.field.scale.flow, False, extremal.state[k])
            out[_THRUST] += 0.5 * h * max(ahead + behind - 2.0, 0.0)
        t += h
        k += 1
    x = extremal.state[k]
    for j in range(N_ARC):
        out[_THRUST] += multipliers[j]
    for end in range(2):
        wd, wv = glide_weights(end, problem.final_time)
        square = 0.0
        for i in range(3):
            square += (wd * (x[i] - target[i]) + wv * x[3 + i]) ** 2
        # per relative unit of the half-angle's tangent
        loosened = problem.cos_half_angle * (1.0 - problem.cos_half_angle**2) * math.sqrt(square)
        out[_GLIDE_SLOPE] += multipliers[ROW_GLIDE + end] * loosened
    at_handover = abs(multipliers[ROW_HANDOVER])
    out[_HANDOVER if problem.on_ellipsoid else _ELLIPSOID] += at_handover
    out[_PROPELLANT] += multipliers[ROW_PROPELLANT] * problem.propellant
    for r in range(ROW_DIPS, MAX_ROWS):
        out[_ELLIPSOID] += multipliers[r]


@inlined
def _least_ratio(flow: float, flight: Flight) -> float:
    """Least thrust that the costates ask for along an extremal; above 1 it is at its bound throughout."""
    extremal = flight.extremal
    least, _ = thrust_ratio(flow, False, extremal.state[0])
    k, t = 0, 0.0
    while t < 1.0 - 1e-12:
        least = min(least, thrust_ratio(flow, False, extremal.state[k + 1])[0])
        t += extremal.step[k]
        k += 1
    return least


@inlined
def _is_better(ended: Ended, status: int, energy: float, broken: float) -> bool:
    """Whether a search ended better than the best before it."""
    if ended.status == OPTIMAL and status == OPTIMAL:
        return ended.energy < energy
    return ended.status == OPTIMAL or (status != OPTIMAL and ended.broken < broken)


@kernel
def search_batch(
    problem: ExtremalProblem,
    targets: Floats,
    normals: Floats,
    starts: Floats,
    n_steps: int,
    guards: Floats,
    found: Found,
) -> None:
    """Search for the best extremal of each facet.

    Parameters
    ----------
    problem : ExtremalProblem
        The case.
    targets : (n, 3) float, scaled, body frame
        Touchdown points.
    normals : (n, 3) float
        Outward unit normals.
    starts : (n, k, 7) float, scaled
        Costates to start from, tried in turn until one leads to an optimum; NaN rows are passed over.
    n_steps : int
        Steps of an extremal.
    guards : (n,) float
        Kept from the thrust bound of the final arc, for what the thrust bulges between the points.
    found : Found
        Filled.
    """
    here, there, spare = new_flight(n_steps), new_flight(n_steps), new_flight(n_steps)
    search = new_search(problem, n_steps)
    costates = np.zeros(7)
    for i in range(targets.shape[0]):
        found.status[i], found.broken[i], found.energy[i] = UNCONVERGED, math.inf, math.inf
        guarded = with_guard(problem, guards[i])
        for s in range(starts.shape[1]):
            given = True
            for a in range(7):
                costates[a] = starts[i, s, a]
                given = given and math.isfinite(costates[a])
            if not given:
                continue
            for _ in range(1 + PLATEAUS):
                ended, last = search_extremal(
                    guarded, targets[i], normals[i], costates, here, there, spare, search
                )
                found.rounds[i] += ended.rounds
                if _is_better(ended, found.status[i], found.energy[i], found.broken[i]):
                    found.status[i], found.energy[i] = ended.status, ended.energy
                    found.broken[i] = ended.broken
                    for a in range(7):
                        found.costates[i, a] = costates[a]
                    _pressures(problem, targets[i], last, search.multipliers, found.pressure[i])
                least = _least_ratio(problem.field.scale.flow, last)
                if ended.status != OPTIMAL or least <= 1.0:
                    break
                for a in range(7):  # step off the plateau
                    costates[a] *= OFF_PLATEAU / least
            if found.status[i] == OPTIMAL:
                break


def _search(
    prepared: PreparedCase,
    problem: ExtremalProblem,
    facets: Ints,
    starts: Floats,
    n_steps: int,
    guards: Floats,
) -> Found:
    n = len(facets)
    found = Found(
        np.zeros(n, dtype=np.int64),
        np.zeros(n, dtype=np.int64),
        np.zeros(n),
        np.zeros(n),
        np.zeros((n, 7)),
        np.zeros((n, len(Binding) - 1)),
    )
    targets = prepared.shared.centroids_m[facets] / problem.field.scale.length_m
    starts = np.ascontiguousarray(starts, dtype=np.float64).reshape(n, -1, 7)
    search_batch(problem, targets, prepared.shared.normals[facets], starts, n_steps, guards, found)
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
