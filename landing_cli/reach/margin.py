"""The least thrust level tau that reaches a facet, as a fraction of the thrust bound, and what bounds it.

A facet is reachable exactly when tau <= 1, so 1 - tau is a signed margin, continuous over the surface. The
time grid biases tau upwards by a few thousandths; where that could turn its sign, the fine grid is asked, as
the verdict does. With free descent control tau also bounds the paper's extremals from below: they are some
of the flights that it is taken over.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from landing_cli.reach.certificate import GravityBounds, gravity_tube
from landing_cli.reach.free_batch import Batch
from landing_cli.reach.free_descent import DOUBTFUL_LEVEL, PreparedCase
from landing_cli.reach.free_flights import Question, best_flights
from landing_cli.reach.free_solve import CONVERGED
from landing_cli.reach.scaled_case import ScaledCase

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

# Thrust levels that a bound above 1 is tried against.
TRIED_LEVELS = np.concatenate([1.0 + 0.005 * np.arange(40), np.geomspace(1.2, 20.0, 100)])


@dataclass(frozen=True, eq=False)
class ThrustLevels:
    """Least thrust levels of some facets or points, as fractions of the thrust bound.

    Attributes
    ----------
    level : (n,) float
        The least thrust level tau that a search found; NaN where none converged.
    bound : (n,) float
        No flight needs less: a certified lower bound on tau, of which the keep-out ellipsoid, the propellant
        and the terrain are left out.
    solved : (n,) bool
        Whether a search converged.
    """

    level: Floats
    bound: Floats
    solved: Flags


def thrust_levels(prepared: PreparedCase, facets: NDArray[np.integer]) -> ThrustLevels:
    """Find the least thrust levels that reach the centroids of some facets.

    Parameters
    ----------
    prepared : PreparedCase
        From :func:`landing_cli.reach.free_descent.prepare`.
    facets : (n,) int
        Facets, 0-based.

    Returns
    -------
    ThrustLevels
        In the order given; a facet's numbers depend on the facet alone.
    """
    indices = np.asarray(facets, dtype=np.int64)
    shared = prepared.shared
    return thrust_levels_at(prepared, shared.centroids_m[indices], shared.normals[indices])


def thrust_levels_at(prepared: PreparedCase, points_m: Floats, normals: Floats) -> ThrustLevels:
    """Find the least thrust levels that reach any points of the surface.

    Parameters
    ----------
    prepared : PreparedCase
        From :func:`landing_cli.reach.free_descent.prepare`.
    points_m : (n, 3) float, m, body frame
        Touchdown points, on the surface: the bound on gravity along the final arcs holds above it.
    normals : (n, 3) float
        Unit outward normals, the axes of the glide slope's cones.

    Returns
    -------
    ThrustLevels
        In the order given.
    """
    return search_levels(prepared, points_m, normals)[0]


class GridFlights(NamedTuple):
    """Flights of least thrust level on one time grid."""

    scaled: ScaledCase
    points: Ints  # (k,) which of the points they lead to
    thrust: Floats  # (k, N, 3) scaled, solver axes


def search_levels(
    prepared: PreparedCase, points_m: Floats, normals: Floats
) -> tuple[ThrustLevels, tuple[GridFlights, GridFlights]]:
    """Find the least thrust levels of points, and the flights that have them; see :func:`thrust_levels_at`.

    Parameters
    ----------
    prepared : PreparedCase
        From :func:`landing_cli.reach.free_descent.prepare`.
    points_m, normals : (n, 3) float
        Touchdown points, m, and unit outward normals, body frame.

    Returns
    -------
    levels : ThrustLevels
        In the order given.
    coarse, fine : GridFlights
        Every point that was solved is in one of them.
    """
    flights = least_thrust_flights(prepared, prepared.coarse, prepared.coarse_tube, points_m, normals)
    levels = _levels(prepared, prepared.coarse, flights)
    kept, finest = levels.solved.copy(), np.zeros(0, dtype=np.int64)
    thrust = np.zeros((0, len(prepared.fine.mid_cos), 3))
    again = np.flatnonzero(~(np.abs(levels.level - 1.0) > DOUBTFUL_LEVEL - 1.0))
    if len(again):
        fine = least_thrust_flights(
            prepared, prepared.fine, prepared.fine_tube, points_m[again], normals[again]
        )
        finer = _levels(prepared, prepared.fine, fine)
        # a search that fails on the fine grid leaves the coarse one's answer
        levels.level[again] = np.where(finer.solved, finer.level, levels.level[again])
        levels.bound[again] = np.maximum(finer.bound, levels.bound[again])
        levels.solved[again] |= finer.solved
        finest, thrust = again[finer.solved], fine.thrust[finer.solved]
        kept[finest] = False
    coarsest = np.flatnonzero(kept)
    return (
        ThrustLevels(np.maximum(levels.level, levels.bound), levels.bound, levels.solved),
        (
            GridFlights(prepared.coarse, coarsest, flights.thrust[coarsest]),
            GridFlights(prepared.fine, finest, thrust),
        ),
    )


def least_thrust_flights(
    prepared: PreparedCase, scaled: ScaledCase, tube: Floats, points_m: Floats, normals: Floats
) -> Batch:
    """Find the flights of least thrust level on one time grid.

    Parameters
    ----------
    prepared : PreparedCase
        The case.
    scaled, tube : ScaledCase, (N,) float
        Its coarse or its fine grid.
    points_m, normals : (n, 3) float, m, body frame
        Touchdown points and unit outward normals.

    Returns
    -------
    Batch
        CONVERGED where a flight was found.
    """
    arc_bound = prepared.shared.bounds.on_arcs_m_s2 / scaled.acceleration_m_s2
    plenty = scaled._replace(propellant=2.0)  # no least thrust level tells whether the propellant suffices
    flights, _ = best_flights(Question(plenty, points_m / scaled.length_m, normals, True, tube, arc_bound))
    return flights


def _levels(prepared: PreparedCase, scaled: ScaledCase, flights: Batch) -> ThrustLevels:
    solved = flights.status == CONVERGED
    level = np.where(solved, flights.level, np.nan)
    return ThrustLevels(level, bound_beyond_full(scaled, prepared.shared.bounds, flights.bound), solved)


def bound_beyond_full(scaled: ScaledCase, bounds: GravityBounds, bound: Floats) -> Floats:
    """Turn bounds that suppose tau <= 1 into bounds that suppose nothing.

    A certificate b bounds mass and gravity by what flights with tau <= 1 can meet, so that b > 1 contradicts
    tau <= 1 and tells no more. Supposing tau <= T instead, masses are less by (1 - T a) / (1 - a) at most,
    a being the share of the mass that full thrust uses in the whole flight, and gravity is stronger by what
    the wider tube lets in. Both only shift and scale the certificate: b(T) >= (b - shift) (1 - T a) / (1 - a)
    where that is positive, and tau >= min(T, b(T)) for any T.

    Parameters
    ----------
    scaled : ScaledCase
        The case on the certificates' grid.
    bounds : GravityBounds
        Of gravity around the asteroid.
    bound : (n,) float
        Certificates.

    Returns
    -------
    (n,) float
        Certified lower bounds on tau: the certificates themselves up to 1.
    """
    highest = bound.max(initial=0.0)
    if highest <= 1.0:
        return bound
    flow, free = scaled.mass_flow, scaled._replace(propellant=2.0)
    used = flow * (1.0 + scaled.final_time)
    # min(T, b(T)) is largest next to T = b(T) < b: no company makes it other than this
    enough = TRIED_LEVELS[: np.searchsorted(TRIED_LEVELS, highest, side="right") + 1]
    tried = enough[enough * used < 1.0]
    narrow = gravity_tube(free, bounds)
    # with this mass flow the tube's strongest thrust per mass is T / (1 - T flow)
    wide = [gravity_tube(free._replace(mass_flow=1.0 - (1.0 - T * flow) / T), bounds) for T in tried]
    shift = np.array([np.max(tube - narrow) for tube in wide])
    certified = (bound[:, None] - shift) * (1.0 - tried * used) / (1.0 - used)
    return np.where(bound > 1.0, np.minimum(tried, certified).max(axis=1), bound)
