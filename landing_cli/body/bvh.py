"""A bounding-volume hierarchy over the facets of a mesh, and the search for the closest facet.

The tree is a complete binary one in heap order (root 1, children 2i and 2i + 1), so it needs no pointers, and
the search walks back with one integer instead of a stack. Facets are stored in leaf order: a *slot* is a
facet's place in that order.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.adjacency import facet_neighbours
from landing_cli.body.mesh import Mesh, facet_centroids, facet_normals
from landing_cli.kernel import part
from landing_cli.kernel_record import by_reference

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

LEAF_FACETS = 2
"""Most facets in a leaf; measured fastest for path points."""

FACE, EDGE_AB, EDGE_BC, EDGE_CA, CORNER_A, CORNER_B, CORNER_C = range(7)
"""The feature of a facet on which the closest point lies."""


@by_reference
class SurfaceIndex(NamedTuple):
    """The surface of a closed mesh, arranged for distance queries (build_surface_index makes it).

    Plain arrays: it pickles, and kernels take it as one argument.

    Attributes
    ----------
    boxes : (2^(depth + 1), 15) float
        Oriented box of every node in heap order: three axes, the least and the greatest coordinate along them
        (m); row 0 is unused.
    triangles : (m, 12) float
        Corners a, b, c (m) and the outward unit normal of the facet in each slot.
    pseudonormals : (m, 7, 3) float
        Normal of each feature of the facet in each slot: the face, the edges ab, bc, ca, the corners a, b, c.
    facets : (m,) int
        Facet of the mesh in each slot.
    depth : int
        Levels below the root; leaf k holds the slots from (k m) >> depth to ((k + 1) m) >> depth.
    """

    boxes: FloatArray
    triangles: FloatArray
    pseudonormals: FloatArray
    facets: IntArray
    depth: int


def build_surface_index(mesh: Mesh) -> SurfaceIndex:
    """Arrange the facets of a closed mesh for distance queries; the same mesh gives the same arrays.

    Parameters
    ----------
    mesh : Mesh
        Closed, outward-wound, without degenerate facets.

    Returns
    -------
    SurfaceIndex

    Raises
    ------
    InputRefused
        An edge has no partner: outside and inside are not defined.
    """
    normals = facet_normals(mesh)
    pseudonormals = _pseudonormals(mesh, normals)
    count = len(mesh.faces)
    depth = max(0, int(np.ceil(np.log2(count / LEAF_FACETS))))
    facets = _leaf_order(facet_centroids(mesh), depth)
    triangles = np.concatenate([mesh.corners.reshape(count, 9), normals], axis=1)[facets]
    boxes = _node_boxes(mesh.corners[facets], depth)
    return SurfaceIndex(boxes, triangles, np.ascontiguousarray(pseudonormals[facets]), facets, depth)


def _leaf_order(centroids: FloatArray, depth: int) -> IntArray:
    """Halve the facets at the median along the longer side of each node, level by level."""
    order = np.arange(len(centroids))
    for level in range(depth):
        starts, node = _slots_of(level, len(centroids))
        placed = centroids[order]
        extent = np.maximum.reduceat(placed, starts) - np.minimum.reduceat(placed, starts)
        along = placed[np.arange(len(order)), np.argmax(extent, axis=1)[node]]
        order = order[np.lexsort((along, node))]
    return order


def _slots_of(level: int, count: int) -> tuple[IntArray, IntArray]:
    """First slot of each node of a level, and the node (within its level) of each slot."""
    bounds = (np.arange(2**level + 1) * count) >> level
    return bounds[:-1], np.repeat(np.arange(2**level), np.diff(bounds))


def _node_boxes(corners: FloatArray, depth: int) -> FloatArray:
    """Boxes along the principal axes of each node's corners: thin across the surface, so they prune well."""
    boxes = np.zeros((2 ** (depth + 1), 15))
    first = corners.sum(axis=1)
    second = np.swapaxes(corners, 1, 2) @ corners
    for level in range(depth + 1):
        starts, node = _slots_of(level, len(corners))
        total, weight = np.add.reduceat(first, starts), 3.0 * np.bincount(node)[:, None, None]
        spread = np.add.reduceat(second, starts) - total[:, :, None] * total[:, None, :] / weight
        axes = np.linalg.eigh(spread)[1]
        a, b, c = np.moveaxis(corners @ axes[node], 1, 0)
        rows = boxes[2**level : 2 ** (level + 1)]
        rows[:, :9] = np.swapaxes(axes, 1, 2).reshape(-1, 9)
        rows[:, 9:12] = np.minimum.reduceat(np.minimum(np.minimum(a, b), c), starts)
        rows[:, 12:] = np.maximum.reduceat(np.maximum(np.maximum(a, b), c), starts)
    return boxes


def _pseudonormals(mesh: Mesh, normals: FloatArray) -> FloatArray:
    """Give faces, edges (sum of the two faces) and corners (faces weighted by their angle) a normal.

    Baerentzen and Aanaes, "Signed distance computation using the angle weighted pseudonormal", IEEE TVCG
    11(3), 2005: the sign of (p - closest point) . pseudonormal tells outside from inside on every feature.
    """
    result = np.zeros((len(mesh.faces), 7, 3))
    result[:, FACE] = normals
    result[:, EDGE_AB : EDGE_CA + 1] = normals[:, None] + normals[facet_neighbours(mesh)]
    corners = mesh.corners
    following = np.roll(corners, -1, axis=1) - corners
    preceding = np.roll(corners, 1, axis=1) - corners
    sine = np.linalg.norm(np.cross(following, preceding), axis=2)
    angle = np.arctan2(sine, (following * preceding).sum(axis=2))
    weighted = (angle[:, :, None] * normals[:, None]).reshape(-1, 3)
    vertices = mesh.faces.ravel()
    summed = [np.bincount(vertices, weighted[:, k], minlength=len(mesh.vertices)) for k in range(3)]
    result[:, CORNER_A:] = np.stack(summed, axis=1)[mesh.faces]
    return result


@part
def box_distance2(boxes: FloatArray, node: int, x: float, y: float, z: float) -> float:
    """Squared distance from a point to the box of a node, m2."""
    b = boxes[node]
    u = b[0] * x + b[1] * y + b[2] * z
    v = b[3] * x + b[4] * y + b[5] * z
    w = b[6] * x + b[7] * y + b[8] * z
    du = max(max(b[9] - u, u - b[12]), 0.0)
    dv = max(max(b[10] - v, v - b[13]), 0.0)
    dw = max(max(b[11] - w, w - b[14]), 0.0)
    return du * du + dv * dv + dw * dw


@part
def _edge_distance2(px: float, py: float, pz: float, ex: float, ey: float, ez: float, along: float) -> float:
    """Squared distance of p (from the edge's tail) to the point at a share of the edge e."""
    dx, dy, dz = px - along * ex, py - along * ey, pz - along * ez
    return dx * dx + dy * dy + dz * dz


@part
def triangle_distance2(triangles: FloatArray, slot: int, x: float, y: float, z: float) -> tuple[float, int]:
    """Squared distance from a point to a facet, m2, and the feature that is closest.

    By Voronoi regions of the triangle (Ericson, Real-Time Collision Detection, 2005, section 5.1.5); above
    the face itself the distance is taken along the stored normal, which loses no digits near the surface.
    """
    t = triangles[slot]
    ax, ay, az = x - t[0], y - t[1], z - t[2]
    ux, uy, uz = t[3] - t[0], t[4] - t[1], t[5] - t[2]
    wx, wy, wz = t[6] - t[0], t[7] - t[1], t[8] - t[2]
    d1 = ux * ax + uy * ay + uz * az
    d2 = wx * ax + wy * ay + wz * az
    if d1 <= 0.0 and d2 <= 0.0:
        return ax * ax + ay * ay + az * az, CORNER_A
    bx, by, bz = x - t[3], y - t[4], z - t[5]
    d3 = ux * bx + uy * by + uz * bz
    d4 = wx * bx + wy * by + wz * bz
    if d3 >= 0.0 and d4 <= d3:
        return bx * bx + by * by + bz * bz, CORNER_B
    if d1 * d4 - d3 * d2 <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        return _edge_distance2(ax, ay, az, ux, uy, uz, d1 / (d1 - d3)), EDGE_AB
    cx, cy, cz = x - t[6], y - t[7], z - t[8]
    d5 = ux * cx + uy * cy + uz * cz
    d6 = wx * cx + wy * cy + wz * cz
    if d6 >= 0.0 and d5 <= d6:
        return cx * cx + cy * cy + cz * cz, CORNER_C
    if d5 * d2 - d1 * d6 <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        return _edge_distance2(ax, ay, az, wx, wy, wz, d2 / (d2 - d6)), EDGE_CA
    if d3 * d6 - d5 * d4 <= 0.0 and d4 >= d3 and d5 >= d6:
        share = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        return _edge_distance2(bx, by, bz, wx - ux, wy - uy, wz - uz, share), EDGE_BC
    height = ax * t[9] + ay * t[10] + az * t[11]
    return height * height, FACE


@part
def closest_slot(
    surface: SurfaceIndex, x: float, y: float, z: float, bound2: float, slot: int, feature: int
) -> tuple[float, int, int]:
    """Find the facet of a surface that is closest to a point, nearer child first.

    Parameters
    ----------
    surface : SurfaceIndex
        The surface.
    x, y, z : float, m, body frame
        The point.
    bound2 : float, m2
        Facets at this squared distance or farther are of no interest.
    slot, feature : int
        What to answer when no facet is closer than the bound.

    Returns
    -------
    (float, int, int)
        Squared distance (m2), slot and feature of the closest facet, or the three that came in.
    """
    boxes, triangles, depth = surface.boxes, surface.triangles, surface.depth
    count, leaves = triangles.shape[0], 1 << depth
    # pending: a sentinel, then one bit a level, set where the sibling has to be visited
    node, pending = np.int64(1), np.int64(1)
    if box_distance2(boxes, node, x, y, z) >= bound2:
        return bound2, slot, feature
    while True:
        descended = False
        if node < leaves:
            near, far = 2 * node, 2 * node + 1
            near2, far2 = box_distance2(boxes, near, x, y, z), box_distance2(boxes, far, x, y, z)
            if far2 < near2:
                near, near2, far2 = far, far2, near2
            if near2 < bound2:
                node, descended = near, True
                pending = 2 * pending + (1 if far2 < bound2 else 0)
        else:
            leaf = node - leaves
            for s in range((leaf * count) >> depth, ((leaf + 1) * count) >> depth):
                d2, f = triangle_distance2(triangles, s, x, y, z)
                if d2 < bound2:
                    bound2, slot, feature = d2, s, f
        while not descended:
            while pending & 1 == 0:
                node, pending = node >> 1, pending >> 1
            if pending == 1:
                return bound2, slot, feature
            node, pending = node ^ 1, pending ^ 1
            descended = box_distance2(boxes, node, x, y, z) < bound2
