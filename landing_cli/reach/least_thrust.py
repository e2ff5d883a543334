"""Flights at the least thrust level, flown accurately, and the margin's columns of a case's rows.

What is flown bounds tau from above, as the certificate does from below: the largest share of the thrust
bound in a flight that keeps every other limit is enough. For a reachable facet the stored least-energy
flight is such a flight too, and `verify` flies it again.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from landing_cli.reach.delivery import (
    LIMIT_TOLERANCE,
    VALUE_COLUMNS,
    Deliveries,
    deliver_many,
    new_deliveries,
)
from landing_cli.reach.free_descent import PreparedCase
from landing_cli.reach.margin import GridFlights, ThrustLevels, search_levels
from landing_cli.reach.records import FacetSolutions, LandingCase, Verdict, blank_rows

Flags = NDArray[np.bool_]

_ABOVE_FULL = math.nextafter(1.0, 2.0)


def fly_least_thrust(
    prepared: PreparedCase, facets: NDArray[np.integer]
) -> tuple[ThrustLevels, FacetSolutions]:
    """Find the least thrust levels of facets and fly what has them.

    Parameters
    ----------
    prepared : PreparedCase
        From :func:`landing_cli.reach.free_descent.prepare`.
    facets : (n,) int
        Facets, 0-based.

    Returns
    -------
    levels : ThrustLevels
        In the order given.
    flights : FacetSolutions
        In the order given, unresolved, with the flights' measures and thrust nodes where one was found and
        ``thrust_level_flown`` where it keeps every limit but that of the thrust and of the propellant.
    """
    indices, shared = np.asarray(facets, dtype=np.int64), prepared.shared
    levels, grids = search_levels(prepared, shared.centroids_m[indices], shared.normals[indices])
    rows = blank_rows(indices)
    rows["final_stage_s"] = prepared.case.final_stage_s
    nodes = [np.zeros((0, 3))] * len(rows)
    for grid in grids:
        out = _deliver(prepared, grid, indices)
        places = grid.points
        for column, name in enumerate(VALUE_COLUMNS):
            rows[name][places] = out.values[:, column]
        rows["handover_position_m"][places] = out.handover[:, :3]
        rows["handover_velocity_m_s"][places] = out.handover[:, 3:6]
        rows["handover_mass_kg"][places] = out.handover[:, 6]
        rows["thrust_nodes"][places] = len(grid.scaled.mid_cos)
        for place, thrust in zip(places.tolist(), grid.thrust, strict=True):
            nodes[place] = thrust * prepared.frame.thrust_max_n
    kept = _keeps_other_limits(prepared.case, rows)
    rows["thrust_level_flown"] = np.where(kept, rows["peak_thrust_ratio"], np.nan)
    return levels, FacetSolutions(rows, np.concatenate([np.zeros((0, 3)), *nodes]))


def _deliver(prepared: PreparedCase, grid: GridFlights, facets: NDArray[np.int64]) -> Deliveries:
    """Fly the flights of one grid accurately."""
    shared, chosen = prepared.shared, facets[grid.points]
    out = new_deliveries(len(chosen))
    if len(chosen):
        deliver_many(
            grid.scaled,
            prepared.frame,
            shared.surface,
            np.ascontiguousarray(grid.thrust),
            shared.centroids_m[chosen],
            shared.normals[chosen],
            out,
        )
    return out


def _keeps_other_limits(case: LandingCase, rows: NDArray[np.void]) -> Flags:
    """Whether flights keep the ellipsoid, the glide slope and the handover, as deliveries are judged."""
    kept = rows["ellipsoid_margin"] >= -LIMIT_TOLERANCE
    kept &= np.radians(rows["glide_slope_margin_deg"]) >= -LIMIT_TOLERANCE
    if case.handover == "on_ellipsoid":
        position = rows["handover_position_m"] / case.ellipsoid_m
        velocity = rows["handover_velocity_m_s"] / case.ellipsoid_m
        rising = np.einsum("ij,ij->i", position, velocity) * case.descent_s
        kept &= np.abs(np.einsum("ij,ij->i", position, position) - 1.0) <= LIMIT_TOLERANCE
        kept &= rising <= LIMIT_TOLERANCE
    return np.asarray(kept)


def with_margin(prepared: PreparedCase, solutions: FacetSolutions) -> FacetSolutions:
    """Fill the margin's columns of some rows.

    Parameters
    ----------
    prepared : PreparedCase
        The case.
    solutions : FacetSolutions
        Its answers; with `descent: extremal` the margin still is that of free control.

    Returns
    -------
    FacetSolutions
        With the same verdicts. A flight that was found and a proof count for the margin too.
    """
    rows = solutions.rows.copy()
    levels, flights = fly_least_thrust(prepared, rows["facet"])
    fill_margin(rows, levels, flights.rows["thrust_level_flown"])
    return FacetSolutions(rows, solutions.thrust_nodes_n)


def fill_margin(rows: NDArray[np.void], levels: ThrustLevels, flown: NDArray[np.float64]) -> None:
    """Fill the margin's columns, making use of the flights and proofs that the rows hold.

    Parameters
    ----------
    rows : (n,) structured array of FACET_DTYPE
        Filled.
    levels : ThrustLevels
        Of the rows' facets.
    flown : (n,) float
        Upper bounds on tau by flights, NaN where there is none.
    """
    reachable = rows["verdict"] == Verdict.REACHABLE
    used = np.where(reachable, np.minimum(rows["peak_thrust_ratio"], 1.0), np.inf)
    level = np.minimum(levels.level, used)
    rows["proved"] |= (rows["verdict"] == Verdict.UNREACHABLE) & (levels.bound > 1.0)
    proved = rows["proved"] == 1
    rows["thrust_margin"] = 1.0 - np.where(proved, np.maximum(level, _ABOVE_FULL), level)
    rows["thrust_level_bound"] = np.where(proved, np.maximum(levels.bound, 1.0), levels.bound)
    rows["thrust_level_flown"] = np.where(reachable, np.fmin(flown, used), flown)
