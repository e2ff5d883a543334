"""The numbers that a case is summed up in."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.mesh import Mesh, facet_areas
from landing_cli.reach.boundary_lines import margin_lines
from landing_cli.reach.records import FacetSolutions, Verdict


def summarise(mesh: Mesh, solutions: FacetSolutions) -> dict[str, Any]:
    """Sum up the solved facets of a case: counts, area, delta-v, proofs, rock on the way.

    Where the margin was asked, also its spread and, of a whole surface, the boundary; where the final stage
    was free, its durations and what they add to the domain of the compared one.

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
        **(_margin(mesh, rows) if has_margin(rows) else {}),
        **_final_stages(mesh, rows, reachable),
    }


def has_margin(rows: NDArray[np.void]) -> bool:
    """Whether the least thrust levels of all rows were asked for."""
    return bool(
        np.isfinite(rows["thrust_level_bound"]).any() or np.isfinite(rows["thrust_level_flown"]).any()
    )


def _margin(mesh: Mesh, rows: NDArray[np.void]) -> dict[str, Any]:
    values = rows["thrust_margin"]
    found: dict[str, Any] = {
        "thrust_margin": {**_spread(values[np.isfinite(values)]), "unknown": int(np.isnan(values).sum())}
    }
    if len(rows) == len(mesh.faces):
        boundary = margin_lines(mesh, rows)
        found["boundary"] = {
            "lines": len(boundary.offsets) - 1,
            "length_m": boundary.length_m,
            "area_within_m2": boundary.area_within_m2,
        }
    return found


def _final_stages(mesh: Mesh, rows: NDArray[np.void], reachable: NDArray[np.bool_]) -> dict[str, Any]:
    durations, found = rows["final_stage_s"][reachable], {}
    compared = bool(rows["compared_verdict"].any())
    if compared or (len(durations) and np.ptp(durations) > 0.0):
        found["final_stage_s"] = _spread(durations)
    if compared:
        gained = reachable & (rows["compared_verdict"] != Verdict.REACHABLE)
        areas = facet_areas(mesh)[rows["facet"][gained]]
        found["gained_by_free_stage"] = {"facets": int(gained.sum()), "area_m2": float(areas.sum())}
    return found


def _spread(values: NDArray[np.float64]) -> dict[str, float | None]:
    if len(values) == 0:
        return {"min": None, "median": None, "max": None}
    return {"min": float(values.min()), "median": float(np.median(values)), "max": float(values.max())}
