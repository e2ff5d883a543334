"""Distance to the nearest vertex of a mesh: not a clearance, but what some papers call one."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from landing_cli.body.bvh import FloatArray, SurfaceIndex, box_distance2
from landing_cli.kernel import kernel, part


def vertex_distances(surface: SurfaceIndex, points: ArrayLike) -> FloatArray:
    """Distance from each point to the nearest vertex of a surface.

    It exceeds the distance to the surface by up to the size of a facet, and has no sign.

    Parameters
    ----------
    surface : SurfaceIndex
        The surface.
    points : (n, 3) float, m, body frame
        The points.

    Returns
    -------
    (n,) float, m
    """
    points = np.ascontiguousarray(points, dtype=np.float64).reshape(-1, 3)
    distances = np.zeros(len(points))
    _vertex_distances_into(surface, points, distances)
    return distances


@part
def vertex_distance(surface: SurfaceIndex, x: float, y: float, z: float, slot: int) -> tuple[float, int]:
    """Distance from one point to the nearest vertex, and a slot whose facet has it.

    The tree of facets serves as it is: no vertex of a node's facets is closer than the node's box.

    Parameters
    ----------
    surface : SurfaceIndex
        The surface.
    x, y, z : float, m, body frame
        The point.
    slot : int
        Slot of the first guess: the answer for a point nearby, or 0.

    Returns
    -------
    (float, int)
        Distance (m) and slot.
    """
    boxes, triangles, depth = surface.boxes, surface.triangles, surface.depth
    count, leaves = triangles.shape[0], 1 << depth
    least2 = _corner_distance2(triangles, slot, x, y, z)
    node, pending = 1, 1  # as in bvh.closest_slot
    while True:
        descended = False
        if node < leaves:
            near, far = 2 * node, 2 * node + 1
            near2, far2 = box_distance2(boxes, near, x, y, z), box_distance2(boxes, far, x, y, z)
            if far2 < near2:
                near, near2, far2 = far, far2, near2
            if near2 < least2:
                node, descended = near, True
                pending = 2 * pending + (1 if far2 < least2 else 0)
        else:
            leaf = node - leaves
            for s in range((leaf * count) >> depth, ((leaf + 1) * count) >> depth):
                d2 = _corner_distance2(triangles, s, x, y, z)
                if d2 < least2:
                    least2, slot = d2, s
        while not descended:
            while pending & 1 == 0:
                node, pending = node >> 1, pending >> 1
            if pending == 1:
                return np.sqrt(least2), slot
            node, pending = node ^ 1, pending ^ 1
            descended = box_distance2(boxes, node, x, y, z) < least2


@part
def _corner_distance2(triangles: FloatArray, slot: int, x: float, y: float, z: float) -> float:
    """Squared distance from a point to the nearest corner of a facet, m2."""
    t = triangles[slot]
    a = (x - t[0]) ** 2 + (y - t[1]) ** 2 + (z - t[2]) ** 2
    b = (x - t[3]) ** 2 + (y - t[4]) ** 2 + (z - t[5]) ** 2
    c = (x - t[6]) ** 2 + (y - t[7]) ** 2 + (z - t[8]) ** 2
    return min(a, min(b, c))


@kernel
def _vertex_distances_into(surface: SurfaceIndex, points: FloatArray, distances: FloatArray) -> None:
    slot = 0
    for i in range(points.shape[0]):
        distances[i], slot = vertex_distance(surface, points[i, 0], points[i, 1], points[i, 2], slot)
