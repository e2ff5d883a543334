"""Facets solved for a trace: the verdict as any run finds it, and the least thrust level beside it."""

from __future__ import annotations

import numpy as np

from landing_cli.reach.facet_work import Items, solve_items
from landing_cli.reach.free_descent import PreparedCase
from landing_cli.reach.margin import thrust_levels
from landing_cli.reach.records import FacetSolutions, Verdict

CHUNK_FACETS = 32
"""A round of a trace asks few facets: chunks are small enough to occupy every job."""


def solve_traced(prepared: tuple[PreparedCase, ...], facets: int, items: Items) -> FacetSolutions:
    """Solve a chunk of items, and fill in the thrust margin of each.

    Parameters
    ----------
    prepared : tuple of PreparedCase
        Every case.
    facets : int
        Facets of the mesh.
    items : (k,) int
        What to solve; see :mod:`landing_cli.reach.facet_work`.

    Returns
    -------
    FacetSolutions
        As of :func:`landing_cli.reach.facet_work.solve_items`. A reachable facet's margin is at least what
        its flight leaves of the thrust.
    """
    solutions = solve_items(prepared, facets, items)
    rows = solutions.rows
    cases, chosen = np.divmod(rows["facet"].astype(np.int64), facets)
    unknown = np.isnan(rows["thrust_margin"])
    for case in np.unique(cases[unknown]):
        own = np.flatnonzero(unknown & (cases == case))
        rows["thrust_margin"][own] = 1.0 - thrust_levels(prepared[case], chosen[own]).level
    reachable = rows["verdict"] == Verdict.REACHABLE
    spare = 1.0 - rows["peak_thrust_ratio"][reachable]
    rows["thrust_margin"][reachable] = np.fmax(rows["thrust_margin"][reachable], spare)
    return solutions
