"""Who touches whom on a closed triangle mesh: edges, neighbours, typical lengths."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.mesh import FloatArray, IntArray, Mesh, facet_areas
from landing_cli.errors import InputRefused


def directed_edges(faces: IntArray) -> IntArray:
    """List the three directed edges of every facet.

    Parameters
    ----------
    faces : (m, 3) int
        0-based vertex indices.

    Returns
    -------
    (3 m, 2) int
        Row ``3 f + i`` runs from corner i to corner i + 1 of facet f.
    """
    return np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2)


def edges(mesh: Mesh) -> IntArray:
    """List every undirected edge once.

    Parameters
    ----------
    mesh : Mesh
        Closed surface.

    Returns
    -------
    (e, 2) int
        Vertex indices, the smaller first, in lexicographic order.
    """
    pairs = directed_edges(mesh.faces)
    rising = pairs[pairs[:, 0] < pairs[:, 1]]
    return rising[np.lexsort((rising[:, 1], rising[:, 0]))]


def facet_neighbours(mesh: Mesh) -> IntArray:
    """Find the facet across each edge.

    Parameters
    ----------
    mesh : Mesh
        Closed: every directed edge occurs once and so does its reverse.

    Returns
    -------
    (m, 3) int
        ``neighbours[f, i]`` shares with facet f the edge from its corner i to its corner i + 1.

    Raises
    ------
    InputRefused
        If an edge has no partner.
    """
    count = len(mesh.vertices)
    pairs = directed_edges(mesh.faces)
    keys = pairs[:, 0] * count + pairs[:, 1]
    order = np.argsort(keys, kind="stable")
    found = np.searchsorted(keys, pairs[:, 1] * count + pairs[:, 0], sorter=order)
    partner = order[np.minimum(found, len(keys) - 1)]
    lonely = np.flatnonzero((pairs[partner] != pairs[:, ::-1]).any(axis=1))
    if len(lonely):
        a, b = pairs[lonely[0]]
        raise InputRefused(
            f"the surface is open at the edge from vertex {a} to vertex {b} (0-based)",
            where=f"facet {lonely[0] // 3}",
            fix="run `landing shapes check` on the file",
        )
    return (partner // 3).reshape(-1, 3)


def edge_lengths_m(mesh: Mesh) -> FloatArray:
    """Length of every undirected edge, (e,) float, m, in the order of :func:`edges`."""
    ends = mesh.vertices[edges(mesh)]
    return np.asarray(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1))


def mean_edge_m(mesh: Mesh) -> float:
    """Mean length of the undirected edges, m: the step h of section and expansion (Zhao 2022)."""
    return float(edge_lengths_m(mesh).mean())


def equilateral_height_m(mesh: Mesh) -> float:
    """Mean over the facets of the height of the equilateral triangle of the same area, m."""
    return float(np.sqrt(np.sqrt(3.0) * facet_areas(mesh)).mean())


def components(neighbours: IntArray, kind: NDArray[Any]) -> IntArray:
    """Tell apart the parts of a surface that hang together along edges and are of one kind.

    Parameters
    ----------
    neighbours : (m, 3) int
        Facets across the edges.
    kind : (m,) int or bool
        What each facet is.

    Returns
    -------
    (m,) int
        Component of each facet, numbered from 0 by their first facet.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    count = len(neighbours)
    facet, slot = np.nonzero(kind[:, None] == kind[neighbours])
    other = neighbours[facet, slot]
    graph = coo_array((np.ones(len(facet), dtype=np.int8), (facet, other)), shape=(count, count))
    _, labels = connected_components(graph, directed=False)
    _, first, inverse = np.unique(labels, return_index=True, return_inverse=True)
    return np.asarray(np.argsort(np.argsort(first))[inverse], dtype=np.int64)
