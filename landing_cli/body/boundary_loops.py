"""The boundary of a part of a closed mesh as loops of edges."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.mesh import IntArray

BoolArray = NDArray[np.bool_]


class BoundaryLoops(NamedTuple):
    """Edges between a part and the rest, loop after loop, each in the order in which it is walked.

    The part lies to the left of every edge, seen from outside. Loops with more edges come first.
    """

    loop: IntArray  # (e,) which loop
    inside: IntArray  # (e,) facet of the part
    outside: IntArray  # (e,) facet across
    start: IntArray  # (e,) vertex at which the edge begins
    end: IntArray  # (e,) vertex at which it ends


def boundary_loops(faces: IntArray, neighbours: IntArray, part: BoolArray) -> BoundaryLoops:
    """Walk around the boundary of a part of a closed mesh.

    Parameters
    ----------
    faces : (m, 3) int
        0-based vertex indices, counter-clockwise seen from outside.
    neighbours : (m, 3) int
        Facets across the edges.
    part : (m,) bool
        Which facets are of the part.

    Returns
    -------
    BoundaryLoops
        Where parts of the boundary touch at a vertex, each loop keeps to the facets that hang together
        along edges there.
    """
    facet, corner = np.nonzero(part[:, None] & ~part[neighbours])
    edges = 3 * facet + corner
    following = _following(faces, neighbours, part, edges)
    successor = dict(zip(edges.tolist(), following.tolist(), strict=True))
    walks: list[list[int]] = []
    while successor:
        at = next(iter(successor))
        walk = []
        while at in successor:
            walk.append(at)
            at = successor.pop(at)
        walks.append(walk)
    walks.sort(key=lambda walk: (-len(walk), walk[0]))
    walked = np.array([edge for walk in walks for edge in walk], dtype=np.int64)
    loop = np.repeat(np.arange(len(walks)), [len(walk) for walk in walks])
    facet, corner = np.divmod(walked, 3)
    return BoundaryLoops(
        loop, facet, neighbours[facet, corner], faces[facet, corner], faces[facet, (corner + 1) % 3]
    )


def _following(faces: IntArray, neighbours: IntArray, part: BoolArray, edges: IntArray) -> IntArray:
    """Find the boundary edge that begins where each ends: turn about that vertex inside the part."""
    following = _next_corner(edges)
    turning = np.arange(len(edges))
    while True:
        facet, corner = np.divmod(following[turning], 3)
        across = neighbours[facet, corner]
        within = part[across]
        turning, facet, corner, across = turning[within], facet[within], corner[within], across[within]
        if len(turning) == 0:
            return following
        # across the edge lies its twin, which runs the other way: what follows it leaves the same vertex
        head = faces[facet, (corner + 1) % 3]
        twin = 3 * across + np.argmax(faces[across] == head[:, None], axis=1)
        following[turning] = _next_corner(twin)


def _next_corner(edges: IntArray) -> IntArray:
    return np.asarray(edges - edges % 3 + (edges + 1) % 3)
