"""Facets of all cases as one list of work.

An item is one facet of one case, written as one integer (case times facets plus facet), so that a chunk of
work is an array that can be cut anywhere. A facet's answer depends on nothing but the facet: the same
numbers come out for any number of jobs, any backend and any order.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from landing_cli.reach.free_descent import PreparedCase, solve_prepared
from landing_cli.reach.free_stage import solve_free_stage
from landing_cli.reach.least_thrust import with_margin
from landing_cli.reach.proofs import with_proofs
from landing_cli.reach.records import FacetSolutions, join

Items = NDArray[np.int64]

CHUNK_FACETS = 256


def in_chunks(items: Items, size: int = CHUNK_FACETS) -> list[Items]:
    """Cut items into chunks of fixed size."""
    return [items[i : i + size] for i in range(0, len(items), size)]


def solve_items(prepared: tuple[PreparedCase, ...], facets: int, items: Items) -> FacetSolutions:
    """Solve a chunk of items.

    Parameters
    ----------
    prepared : tuple of PreparedCase
        Every case.
    facets : int
        Facets of the mesh.
    items : (k,) int
        What to solve.

    Returns
    -------
    FacetSolutions
        With the items in the place of facets; see :func:`of_case`.
    """
    cases, chosen = np.divmod(np.asarray(items, dtype=np.int64), facets)
    parts = []
    for case in np.unique(cases):
        solutions = _solve(prepared[case], chosen[cases == case])
        solutions.rows["facet"] += case * facets
        parts.append(solutions)
    return join(parts)


def _solve(prepared: PreparedCase, facets: Items) -> FacetSolutions:
    if prepared.case.free_final_stage is not None:
        return solve_free_stage(prepared, prepared.case.free_final_stage, facets)
    return _completed(prepared, with_proofs(prepared, solve_prepared(prepared, facets)))


def solve_without_proofs(prepared: PreparedCase, facets: Items) -> FacetSolutions:
    """Solve facets of one case, and prove no more of them unreachable than comes for free.

    Parameters
    ----------
    prepared : PreparedCase
        The case.
    facets : (k,) int
        Which facets.

    Returns
    -------
    FacetSolutions
        In the order given.
    """
    if prepared.case.free_final_stage is not None:
        return solve_free_stage(prepared, prepared.case.free_final_stage, facets)
    return _completed(prepared, solve_prepared(prepared, facets))


def _completed(prepared: PreparedCase, solutions: FacetSolutions) -> FacetSolutions:
    """Go on from free control to what the case asks: its family of flights, its margin."""
    case = prepared.case
    if case.descent == "extremal":
        from landing_cli.reach.extremal_descent import solve_from

        solutions = solve_from(prepared, solutions)
    solutions.rows["final_stage_s"] = case.final_stage_s
    return with_margin(prepared, solutions) if case.margin else solutions


def of_case(solutions: FacetSolutions, case: int, facets: int) -> FacetSolutions:
    """Take the rows of one case out of the answers of many items, and give them their facets.

    Parameters
    ----------
    solutions : FacetSolutions
        Rows by item, ascending.
    case : int
        Which case.
    facets : int
        Facets of the mesh.

    Returns
    -------
    FacetSolutions
        Rows by facet.
    """
    first, last = np.searchsorted(solutions.rows["facet"], [case * facets, (case + 1) * facets])
    offsets = solutions.node_offsets
    rows = solutions.rows[first:last].copy()
    rows["facet"] -= case * facets
    return FacetSolutions(rows, solutions.thrust_nodes_n[offsets[first] : offsets[last]])


def lost_of_case(lost: Mapping[int, str], case: int, facets: int) -> dict[int, str]:
    """Take the lost facets of one case out of lost items."""
    return {item - case * facets: why for item, why in lost.items() if item // facets == case}
