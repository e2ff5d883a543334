"""The trace on a landing case: what it asks, what it found, and what it missed."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.adjacency import components, facet_neighbours
from landing_cli.body.boundary_loops import BoundaryLoops, boundary_loops
from landing_cli.body.mesh import facet_areas
from landing_cli.reach.free_descent import Surroundings
from landing_cli.reach.level_estimate import features
from landing_cli.reach.records import Binding, FacetSolutions, LandingCase, Verdict
from landing_cli.reach.section_sweep import compare_domains
from landing_cli.reach.trace import Answers, Ask, Ground, TraceResult, trace_domain
from landing_cli.results.tree import Dataset, Group

Mask = NDArray[np.bool_]
IntArray = NDArray[np.int64]

LEAST_COMPONENT = 3
"""Components of fewer facets are counted apart: they are finer than the mesh resolves."""


class FoundTrace(NamedTuple):
    """A trace of a case: the search's result, and the boundary of its domain."""

    result: TraceResult
    loops: BoundaryLoops
    neighbours: IntArray

    @property
    def loop_closed(self) -> Mask:
        """Whether the verdicts on both sides of every edge of a loop are known, (l,) bool."""
        known = self.result.resolved[self.loops.inside] & self.result.resolved[self.loops.outside]
        closed = np.ones(int(self.loops.loop.max(initial=-1)) + 1, dtype=bool)
        closed[self.loops.loop[~known]] = False
        return closed


def find_trace(case: LandingCase, shared: Surroundings, ask: Ask) -> FoundTrace:
    """Trace the boundary of a case's domain.

    Parameters
    ----------
    case : LandingCase
        The case.
    shared : Surroundings
        Of its asteroid.
    ask : callable
        Tells about facets; see :func:`landing_cli.reach.trace.trace_domain`.

    Returns
    -------
    FoundTrace
    """
    mesh = case.asteroid.mesh
    neighbours = facet_neighbours(mesh)
    radius_m = float(np.sqrt(facet_areas(mesh).sum() / (4.0 * np.pi)))
    place = features(shared.centroids_m, shared.normals, radius_m)
    found = trace_domain(Ground(place, neighbours, shared.surface.facets), ask)
    return FoundTrace(found, boundary_loops(mesh.faces, neighbours, found.domain), neighbours)


def answers_of(case: LandingCase, solutions: FacetSolutions) -> Answers:
    """Read what a trace needs to know out of solved facets, in their order.

    A bound on the propellant limits the domain too: its share takes part in the level.
    """
    rows = solutions.rows
    reachable = rows["verdict"] == Verdict.REACHABLE
    level = 1.0 - rows["thrust_margin"]
    if case.spacecraft.propellant_kg is not None:
        burnt = np.where(rows["binding"] == Binding.PROPELLANT, 1.0 + rows["violation"], np.nan)
        burnt[reachable] = rows["fuel_kg"][reachable] / case.spacecraft.propellant_kg
        level = np.fmax(level, burnt)
    return Answers(reachable, rows["verdict"] != Verdict.UNRESOLVED, level)


def trace_summary(case: LandingCase, found: FoundTrace) -> dict[str, Any]:
    """Count what a trace asked and found."""
    result, area = found.result, facet_areas(case.asteroid.mesh)
    closed = found.loop_closed
    sizes, reachable = _components(found.neighbours, result.domain)
    large = sizes >= LEAST_COMPONENT
    return {
        "seeds": len(result.seeds),
        "rounds": result.rounds,
        "N": result.solves,
        "ratio": result.ratio,
        "loops": len(closed),
        "closed": int(closed.all()),
        "boundary_edges": len(found.loops.loop),
        "reachable_components": int((large & reachable).sum()),
        "unreachable_components": int((large & ~reachable).sum()),
        "smaller_components": int((~large).sum()),
        "domain_facets": int(result.domain.sum()),
        "domain_area_m2": float(area[result.domain].sum()),
    }


def trace_misses(found: FoundTrace, solutions: FacetSolutions) -> Mask:
    """Tell where a trace's domain is wrong, (m,) bool, by the verdicts of every facet."""
    return np.asarray(found.result.domain != (solutions.rows["verdict"] == Verdict.REACHABLE))


def trace_comparison(case: LandingCase, found: FoundTrace, solutions: FacetSolutions) -> dict[str, Any]:
    """Compare a trace's domain with the traversal's, and count the components of which it knows nothing."""
    truth = solutions.rows["verdict"] == Verdict.REACHABLE
    area = facet_areas(case.asteroid.mesh)
    wrong = trace_misses(found, solutions)
    component = components(found.neighbours, truth)
    wholly = np.bincount(component, weights=~wrong) == 0
    large = np.bincount(component) >= LEAST_COMPONENT
    compared = compare_domains(found.result.domain, truth, area)
    return {
        "iou": compared.iou,
        "misclassified": compared.misclassified,
        "misclassified_m2": float(area[wrong].sum()),
        "missed_components": int((wholly & large).sum()),
        "missed_smaller": int((wholly & ~large).sum()),
    }


def trace_group(found: FoundTrace, missed: Mask | None) -> Group:
    """Lay the boundary, the domain and, where it is known, what is wrong with it out for the store."""
    loops, result = found.loops, found.result
    along_edges = {
        "loop": (loops.loop, "loop that the edge belongs to; the most edges first"),
        "reachable_facet": (loops.inside, "facet of the domain, to the left of the edge"),
        "unreachable_facet": (loops.outside, "facet across the edge"),
        "start_vertex": (loops.start, "vertex at which the edge begins"),
        "end_vertex": (loops.end, "vertex at which the edge ends: where the loop's next one begins"),
    }
    members: dict[str, Dataset | Group] = {
        name: Dataset(np.asarray(data, dtype=np.int32), "1", told, ("edge",))
        for name, (data, told) in along_edges.items()
    }
    told = "1 where the verdicts on both sides of every edge of the loop are known"
    members["loop_closed"] = Dataset(found.loop_closed, "1", told, ("boundary_loop",))
    members["seed_facets"] = Dataset(
        result.seeds.astype(np.int32), "1", "facets of the even covering that was asked first", ("seed",)
    )
    told = "1 where the facet lies in the domain"
    members["domain"] = Dataset(result.domain.astype(np.uint8), "1", told, ("surface",))
    if missed is not None:
        told = "facets on which the trace and the traversal disagree"
        data = np.flatnonzero(missed).astype(np.int32)
        members["missed_facets"] = Dataset(data, "1", told, ("missed",))
    return Group(members)


def _components(neighbours: IntArray, domain: Mask) -> tuple[IntArray, Mask]:
    """Facets of every component of the domain and of the rest, and whether it is of the domain."""
    labels = components(neighbours, domain)
    kind = np.zeros(int(labels.max()) + 1, dtype=bool)
    kind[labels] = domain
    return np.bincount(labels), kind
