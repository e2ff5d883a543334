"""The section method on a landing case: which facets it asks, and how its domain compares."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.adjacency import facet_neighbours, mean_edge_m
from landing_cli.body.mesh import Mesh, facet_areas, facet_centroids
from landing_cli.reach.records import FacetSolutions, LandingCase, Verdict
from landing_cli.reach.section import SectionResult, section_and_expansion
from landing_cli.reach.section_sweep import compare_domains
from landing_cli.results.tree import Dataset, Group
from landing_cli.scenario.schema import SectionMethod

Mask = NDArray[np.bool_]


def find_section(
    case: LandingCase, method: SectionMethod, feasible: Callable[[NDArray[np.int64]], Mask]
) -> SectionResult:
    """Run section and expansion on a case.

    Parameters
    ----------
    case : LandingCase
        The case.
    method : SectionMethod
        Step and azimuth; ``h_m: auto`` is the mean edge.
    feasible : callable
        Tells which of the facets it is given are reachable.

    Returns
    -------
    SectionResult
        The boundary and the domain within.
    """
    mesh = case.asteroid.mesh
    h_m = mean_edge_m(mesh) if method.h_m == "auto" else float(method.h_m)
    return section_and_expansion(
        facet_centroids(mesh), facet_neighbours(mesh), case.position_m, h_m, method.azimuth_deg, feasible
    )


def section_summary(found: SectionResult) -> dict[str, Any]:
    """The section's counts, by the paper's names (Zhao 2022, table 1)."""
    return {
        "P_d": len(found.section_facets),
        "P_r": len(found.ring_facets),
        "P_e": len(found.expansion_facets),
        "n": found.expansions,
        "N": found.solves,
        "ratio": found.ratio,
        "radius_m": found.radius_m,
        "closed": int(found.closed),
    }


def section_comparison(mesh: Mesh, found: SectionResult, solutions: FacetSolutions) -> dict[str, Any]:
    """How the section's domain differs from the traversal's."""
    truth = np.zeros(len(mesh.faces), dtype=bool)
    rows = solutions.rows
    truth[rows["facet"][rows["verdict"] == Verdict.REACHABLE]] = True
    compared = compare_domains(found.domain, truth, facet_areas(mesh))
    return {"iou": compared.iou, "misclassified": compared.misclassified}


def section_group(found: SectionResult) -> Group:
    """Lay the boundary and the domain out for the store."""
    named = {
        "section_facets": (
            found.section_facets,
            "facets of the plane section P(d) that were asked, outwards",
        ),
        "ring_facets": (found.ring_facets, "facets of the ring P(r)"),
        "expansion_facets": (found.expansion_facets, "facets that the expansions P(e) asked"),
        "boundary_facets": (found.boundary_facets, "facets of the boundary, by azimuth about the axis"),
    }
    members: dict[str, Dataset | Group] = {
        name: Dataset(np.asarray(data, dtype=np.int32), "1", told, (f"{name}_point",))
        for name, (data, told) in named.items()
    }
    members["domain"] = Dataset(
        found.domain.astype(np.uint8), "1", "1 where the facet lies in the domain", ("surface",)
    )
    return Group(members)
