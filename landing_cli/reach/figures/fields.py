"""What a case knows of every facet of the mesh, and the lines that part one kind from another."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.adjacency import facet_neighbours
from landing_cli.body.mesh import FloatArray, Mesh
from landing_cli.reach.records import Verdict
from landing_cli.reach.stored import CaseResult

Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class FacetFields:
    """The answers of a case spread over the mesh.

    Attributes
    ----------
    asked, reachable, unresolved, proved, rock : (m,) bool
        ``rock``: reachable, but the path cuts the mesh on its way.
    delta_v_m_s : (m,) float, m/s
        NaN where the facet is not reachable.
    """

    asked: Mask
    reachable: Mask
    unresolved: Mask
    proved: Mask
    rock: Mask
    delta_v_m_s: FloatArray

    @property
    def unreachable(self) -> Mask:
        """Asked and found unreachable, proved or not, (m,) bool."""
        return self.asked & ~self.reachable & ~self.unresolved


def spread_over_mesh(result: CaseResult) -> FacetFields:
    """Spread the rows of a case over the mesh.

    Parameters
    ----------
    result : CaseResult
        The case; the section method asks a part of the facets only.

    Returns
    -------
    FacetFields
    """
    rows, count = result.solutions.rows, len(result.case.asteroid.mesh.faces)
    facets, reachable = rows["facet"], rows["verdict"] == Verdict.REACHABLE

    def spread(chosen: Mask) -> Mask:
        mask = np.zeros(count, dtype=bool)
        mask[facets[chosen]] = True
        return mask

    delta_v = np.full(count, np.nan)
    delta_v[facets[reachable]] = rows["delta_v_m_s"][reachable]
    return FacetFields(
        asked=spread(np.ones(len(rows), dtype=bool)),
        reachable=spread(reachable),
        unresolved=spread(rows["verdict"] == Verdict.UNRESOLVED),
        proved=spread((rows["verdict"] == Verdict.UNREACHABLE) & (rows["proved"] == 1)),
        rock=spread(reachable & (rows["terrain_clearance_min_m"] < 0.0)),
        delta_v_m_s=delta_v,
    )


def border_segments(mesh: Mesh, inside: Mask, outside: Mask) -> FloatArray:
    """Find the edges between two kinds of facets.

    Parameters
    ----------
    mesh : Mesh
        The surface, m.
    inside, outside : (m,) bool
        The two kinds.

    Returns
    -------
    (n, 2, 3) float, m
        The ends of each edge.
    """
    facet, edge = np.nonzero(inside[:, None] & outside[facet_neighbours(mesh)])
    corners = mesh.corners[facet]
    row = np.arange(len(facet))
    return np.stack([corners[row, edge], corners[row, (edge + 1) % 3]], axis=1)


def level_segments(mesh: Mesh, values: FloatArray, levels: FloatArray) -> FloatArray:
    """Trace the level lines of facet values over the surface.

    Parameters
    ----------
    mesh : Mesh
        The surface, m.
    values : (m,) float
        One value a facet; NaN where there is none, and no line comes near.
    levels : (k,) float
        The levels.

    Returns
    -------
    (n, 2, 3) float, m
        The ends of each line's segments, one to a facet that it crosses.
    """
    at_vertex = _vertex_means(mesh, values)[mesh.faces]
    whole = np.isfinite(at_vertex).all(axis=1)
    corners, heights = mesh.corners[whole], at_vertex[whole]
    found = [np.zeros((0, 2, 3))]
    for level in levels:
        above = heights > level
        crossed = above.any(axis=1) & ~above.all(axis=1)
        high = above[crossed]
        lone = np.where(high.sum(axis=1) == 1, high.argmax(axis=1), (~high).argmax(axis=1))
        row = np.arange(len(lone))
        p, h = corners[crossed], heights[crossed]
        ends = []
        for step in (1, 2):
            other = (lone + step) % 3
            share = (level - h[row, lone]) / (h[row, other] - h[row, lone])
            ends.append(p[row, lone] + share[:, None] * (p[row, other] - p[row, lone]))
        found.append(np.stack(ends, axis=1))
    return np.concatenate(found)


def _vertex_means(mesh: Mesh, values: FloatArray) -> FloatArray:
    """Mean of the facets around each vertex, (v,); NaN where one of them has no value."""
    corners = mesh.faces.ravel()
    total = np.bincount(corners, np.repeat(values, 3), len(mesh.vertices))
    return np.asarray(total / np.bincount(corners, minlength=len(mesh.vertices)))
