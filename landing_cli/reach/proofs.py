"""Proofs that facets are out of reach where the multipliers of the search for a flight give none.

A bound on all flights outside the ellipsoid at once comes first (`keep_out_bound`): it is cheap, and it is
tight unless flights on several sides need about the same thrust. What it leaves is branched over the sides.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from landing_cli.reach.keep_out_ascent import POSITIVE, climb, first_weights
from landing_cli.reach.keep_out_bound import (
    Facets,
    Weights,
    descent_of,
    facets_of,
    least_value,
    thrust_level,
)
from landing_cli.reach.keep_out_gravity import with_known_gravity
from landing_cli.reach.records import Binding, FacetSolutions, Verdict
from landing_cli.reach.sides import bounds_around

if TYPE_CHECKING:
    from landing_cli.reach.free_descent import PreparedCase

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# No bound on so few nodes tells a thrust level from 1 that is nearer to it than this: none is tried.
LEAST_EXCESS = 0.003
# Where a climb ends between this and a proof, gravity is looked at where flights can be, so many times.
NEAR, ROUNDS, NEXT_BARRIER = -0.2, 2, 1e-3


def with_proofs(prepared: PreparedCase, solutions: FacetSolutions) -> FacetSolutions:
    """Prove facets unreachable, where it works out, that are so and are not proved yet.

    Parameters
    ----------
    prepared : PreparedCase
        The case.
    solutions : FacetSolutions
        Its answers.

    Returns
    -------
    FacetSolutions
        The same with more rows proved.
    """
    rows = solutions.rows
    stopped = (rows["verdict"] == Verdict.UNREACHABLE) & (rows["proved"] == 0)
    stopped &= rows["violation"] > LEAST_EXCESS
    # of flights through rock nothing is supposed in any bound
    places = np.flatnonzero(stopped & (rows["binding"] != Binding.TERRAIN))
    if len(places) == 0:
        return solutions
    rows = rows.copy()
    bounds, steps = bounds_outside(prepared, rows["facet"][places].astype(np.int64))
    rows["proved"][places] = bounds > 1.0
    rows["iterations"][places] += steps
    places = places[~(bounds > 1.0) & (rows["binding"][places] == Binding.ELLIPSOID)]
    if len(places):
        levels = 1.0 + rows["violation"][places]
        bounds, steps = bounds_around(prepared, rows["facet"][places].astype(np.int64), levels)
        rows["proved"][places] = bounds > 1.0
        rows["iterations"][places] += steps
    return FacetSolutions(rows, solutions.thrust_nodes_n)


def bounds_outside(prepared: PreparedCase, facets: Ints) -> tuple[Floats, Ints]:
    """Bound the thrust levels of facets from below, the keep-out ellipsoid included, without branching.

    Parameters
    ----------
    prepared : PreparedCase
        The case.
    facets : (n,) int
        0-based.

    Returns
    -------
    bounds : (n,) float
        Above 1 where no flight with the thrust bound exists; NaN where that was not proved.
    steps : (n,) int
        Newton steps.
    """
    shared = prepared.shared
    descent = descent_of(prepared.case, shared.bounds)
    if descent.ends_mass.min() <= 0.0:  # full thrust uses up the spacecraft: nothing bounds its mass
        return np.full(len(facets), np.nan), np.zeros(len(facets), dtype=np.int64)
    kept = facets_of(descent, shared.centroids_m[facets] / descent.case.length_m, shared.normals[facets])
    climbed = climb(descent, kept, first_weights(descent, kept))
    bounds = thrust_level(descent, kept, climbed.weights, climbed.value)
    value, steps = climbed.value, climbed.steps
    weights, places = climbed.weights, np.arange(len(facets))
    for _ in range(ROUNDS):
        near = (value[places] <= POSITIVE) & (value[places] > NEAR)
        if not near.any():
            break
        places = places[near]
        kept, weights = Facets(*(x[near] for x in kept)), Weights(*(x[near] for x in weights))
        least = least_value(descent, kept, weights)
        kept = with_known_gravity(descent, shared.surface, kept, least)
        climbed = climb(descent, kept, weights, NEXT_BARRIER)
        weights = climbed.weights
        value[places], bounds[places] = climbed.value, thrust_level(descent, kept, weights, climbed.value)
        steps[places] += climbed.steps
    return np.where(value > POSITIVE, bounds, np.nan), steps
