"""The numbers that a case is summed up in."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.mesh import Mesh, facet_areas
from landing_cli.reach.records import FacetSolutions, Verdict


def summarise(mesh: Mesh, solutions: FacetSolutions) -> dict[str, Any]:
    """Sum up the solved facets of a case: counts, area, delta-v, proofs, rock on the way.

    Parameters
    ----------
    mesh : Mesh
        The asteroid's surface.
    solutions : FacetSolutions
        Every solved facet.

    Returns
    -------
    dict
        As ``reach run --json`` prints it.
    """
    rows = solutions.rows
    reachable = rows["verdict"] == Verdict.REACHABLE
    unreachable = rows["verdict"] == Verdict.UNREACHABLE
    return {
        "facets": len(rows),
        "reachable": int(reachable.sum()),
        "unreachable": int(unreachable.sum()),
        "unresolved": int((rows["verdict"] == Verdict.UNRESOLVED).sum()),
        "proved": int((unreachable & (rows["proved"] == 1)).sum()),
        "reachable_area_m2": float(facet_areas(mesh)[rows["facet"][reachable]].sum()),
        "delta_v_m_s": _spread(rows["delta_v_m_s"][reachable]),
        "paths_through_rock": int((rows["terrain_clearance_min_m"][reachable] < 0.0).sum()),
    }


def _spread(values: NDArray[np.float64]) -> dict[str, float | None]:
    if len(values) == 0:
        return {"min": None, "median": None, "max": None}
    return {"min": float(values.min()), "median": float(np.median(values)), "max": float(values.max())}
