"""How triangles hang together, asked of the index array alone: which parts break the rules."""

from __future__ import annotations

import numpy as np

from landing_cli.body.adjacency import directed_edges
from landing_cli.body.mesh import IntArray


def facets_with_repeated_corner(faces: IntArray) -> IntArray:
    """List the facets that name a vertex twice, (k,) int."""
    a, b, c = faces.T
    return np.flatnonzero((a == b) | (b == c) | (c == a))


def duplicate_facets(faces: IntArray) -> tuple[int, int] | None:
    """Find two facets with the same three vertices in any order, the earlier first."""
    corners = np.sort(faces, axis=1)
    order = np.lexsort(corners.T)
    same = np.flatnonzero((corners[order[1:]] == corners[order[:-1]]).all(axis=1))
    if not len(same):
        return None
    second = int(order[same + 1].min())
    first = int(np.flatnonzero((corners == corners[second]).all(axis=1))[0])
    return first, second


def _edge_keys(faces: IntArray) -> tuple[IntArray, IntArray]:
    """Give each directed edge, and its reverse, one number."""
    pairs = directed_edges(faces)
    count = int(faces.max()) + 1
    return pairs[:, 0] * count + pairs[:, 1], pairs[:, 1] * count + pairs[:, 0]


def repeated_directed_edge(faces: IntArray) -> tuple[int, int, list[int]] | None:
    """Find a directed edge that several facets have: its two vertices and those facets."""
    keys, _ = _edge_keys(faces)
    order = np.argsort(keys, kind="stable")
    repeated = np.flatnonzero(keys[order[1:]] == keys[order[:-1]])
    if not len(repeated):
        return None
    slots = np.flatnonzero(keys == keys[order[repeated + 1].min()])
    a, b = directed_edges(faces)[slots[0]]
    return int(a), int(b), (slots // 3).tolist()


def facets_at_edge(faces: IntArray, a: int, b: int) -> int:
    """Count the facets that have the vertices a and b."""
    return int(((faces == a).any(axis=1) & (faces == b).any(axis=1)).sum())


def open_edges(faces: IntArray) -> IntArray:
    """List the directed edges without a partner, (k, 3) int: from, to, facet."""
    keys, reverse = _edge_keys(faces)
    lonely = np.flatnonzero(~np.isin(keys, reverse))
    return np.column_stack([directed_edges(faces)[lonely], lonely // 3])


def bodies(faces: IntArray, vertex_count: int) -> IntArray:
    """Tell the separate surfaces apart, (m,) int per facet; facet 0 belongs to surface 0."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    a, b = directed_edges(faces).T
    graph = coo_array((np.ones(len(a), dtype=np.int8), (a, b)), shape=(vertex_count, vertex_count))
    _, labels = connected_components(graph, directed=False)
    of_facet = labels[faces[:, 0]]
    _, first, numbered = np.unique(of_facet, return_index=True, return_inverse=True)
    rank = np.argsort(np.argsort(first))
    return rank[numbered]


def pinched_vertex(faces: IntArray, vertex_count: int) -> int | None:
    """Find a vertex whose facets form more than one fan, on a surface whose edges are sound."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    keys, reverse = _edge_keys(faces)
    order = np.argsort(keys)
    partner = order[np.searchsorted(keys, reverse, sorter=order)]
    # Slot s is corner s % 3 of facet s // 3 and the edge that starts there. Where the partner edge of
    # s ends, at the same vertex, the neighbour's corner follows in the fan.
    follower = partner - partner % 3 + (partner + 1) % 3
    count = faces.size
    graph = coo_array((np.ones(count, dtype=np.int8), (np.arange(count), follower)), shape=(count, count))
    fans, labels = connected_components(graph, directed=False)
    if fans == vertex_count:
        return None
    vertex_of_fan = np.zeros(fans, dtype=np.int64)
    vertex_of_fan[labels] = faces.ravel()
    return int(np.argmax(np.bincount(vertex_of_fan) > 1))
