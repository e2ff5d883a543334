"""Do the facets at the outermost points face outwards? The question that shifted indices fail."""

from __future__ import annotations

import numpy as np

from landing_cli.body.mesh import FloatArray, IntArray


def support_areas(vertices: FloatArray, faces: IntArray) -> tuple[IntArray, FloatArray]:
    """Measure how the facets at each corner of the convex hull turn around it.

    Parameters
    ----------
    vertices : (n, 3) float
        Not all in one plane.
    faces : (m, 3) int
        A closed, consistently wound surface.

    Returns
    -------
    extreme : (k,) int
        Corners of the convex hull.
    areas : (k,) float
        Positive where the surface is sound and wound outwards.

    Notes
    -----
    In a direction d inside the normal cone of a hull corner v, all else lies below v. The facets at v,
    cut by the plane one unit below it, trace a polygon: simple, and counter-clockwise seen from outside,
    whatever the shape. Its signed area is returned. Facets that name the wrong vertices can be closed,
    consistently wound and of Euler number 2 (a table of 0-based indices read as 1-based, wrapping
    round), but at hundreds of hull corners they do not pass this.
    """
    from scipy.spatial import ConvexHull

    scaled = (vertices - vertices.mean(axis=0)) / np.ptp(vertices, axis=0).max()
    hull = ConvexHull(scaled)
    outward = np.zeros_like(scaled)
    for corner in range(3):
        np.add.at(outward, hull.simplices[:, corner], hull.equations[:, :3])
    length = np.linalg.norm(outward, axis=1)
    extreme = np.zeros(len(scaled), dtype=bool)
    extreme[hull.vertices] = length[hull.vertices] > 0.0
    areas = np.zeros(len(scaled))
    for corner in range(3):
        at, left, right = np.roll(faces, -corner, axis=1).T
        kept = extreme[at]
        at, left, right = at[kept], left[kept], right[kept]
        direction = outward[at] / length[at, None]
        to_left, depth_left = _below(scaled, at, left, direction)
        to_right, depth_right = _below(scaled, at, right, direction)
        # Corners in the middle of a flat part of the hull have neighbours at their own height: no polygon.
        extreme[at[np.minimum(depth_left, depth_right) < 1e-12]] = False
        triangle = 0.5 * np.einsum("ij,ij->i", np.cross(to_left, to_right), direction)
        np.add.at(areas, at, triangle / np.maximum(depth_left * depth_right, 1e-300))
    return np.flatnonzero(extreme), areas[extreme]


def _below(
    points: FloatArray, at: IntArray, other: IntArray, direction: FloatArray
) -> tuple[FloatArray, FloatArray]:
    offset = points[other] - points[at]
    return offset, -np.einsum("ij,ij->i", offset, direction)
