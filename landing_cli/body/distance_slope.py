"""Signed distance to the surface together with its slope: the direction from the closest point."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from landing_cli.body.bvh import (
    CORNER_A,
    EDGE_AB,
    EDGE_BC,
    EDGE_CA,
    FACE,
    SurfaceIndex,
    closest_slot,
    triangle_distance2,
)
from landing_cli.body.vertex_distance import vertex_distance
from landing_cli.kernel import kernel, part

FloatArray = NDArray[np.float64]

_TOUCHING_M = 1e-6  # nearer than this, the offset from the closest point is rounding


def distances_with_slopes(surface: SurfaceIndex, points: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Signed distance from each point to the surface, and its gradient.

    The gradient is that of the closest feature. Where two features are equally close the distance has a kink
    and the gradient is one of its one-sided values.

    Parameters
    ----------
    surface : SurfaceIndex
        The surface.
    points : (n, 3) float, m, body frame
        The points; along a path, each helps the next.

    Returns
    -------
    distances : (n,) float, m
        Positive outside, negative inside.
    slopes : (n, 3) float, body frame
        Unit vectors along which the distance grows; on the surface itself the pseudonormal.
    """
    points = np.ascontiguousarray(points, dtype=np.float64).reshape(-1, 3)
    distances, slopes = np.zeros(len(points)), np.zeros((len(points), 3))
    _fill(surface, points, distances, slopes)
    return distances, slopes


@kernel
def _fill(surface: SurfaceIndex, points: FloatArray, distances: FloatArray, slopes: FloatArray) -> None:
    slot = np.int64(0)
    for i in range(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        distance2, feature = triangle_distance2(surface.triangles, slot, x, y, z)
        distance2, slot, feature = closest_slot(surface, x, y, z, distance2, slot, feature)
        t, normal = surface.triangles[slot], surface.pseudonormals[slot, feature]
        dx, dy, dz = _offset(t, feature, x, y, z)
        side = dx * normal[0] + dy * normal[1] + dz * normal[2]
        length = np.sqrt(dx * dx + dy * dy + dz * dz)
        if feature == FACE or length < _TOUCHING_M:
            scale = 1.0 / np.sqrt(normal[0] ** 2 + normal[1] ** 2 + normal[2] ** 2)
            dx, dy, dz = normal[0], normal[1], normal[2]
        else:
            scale = -1.0 / length if side < 0.0 else 1.0 / length
        slopes[i, 0], slopes[i, 1], slopes[i, 2] = scale * dx, scale * dy, scale * dz
        distances[i] = -np.sqrt(distance2) if side < 0.0 else np.sqrt(distance2)


@part
def _offset(t: FloatArray, feature: int, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Vector to a point from its closest point on a feature of a facet; of a face, along its normal."""
    if feature == FACE:
        height = (x - t[0]) * t[9] + (y - t[1]) * t[10] + (z - t[2]) * t[11]
        return height * t[9], height * t[10], height * t[11]
    tail = 3 * (feature - CORNER_A)
    head = tail
    if feature == EDGE_AB:
        tail, head = 0, 3
    elif feature == EDGE_BC:
        tail, head = 3, 6
    elif feature == EDGE_CA:
        tail, head = 6, 0
    px, py, pz = x - t[tail], y - t[tail + 1], z - t[tail + 2]
    if head == tail:
        return px, py, pz
    ex, ey, ez = t[head] - t[tail], t[head + 1] - t[tail + 1], t[head + 2] - t[tail + 2]
    along = (px * ex + py * ey + pz * ez) / (ex * ex + ey * ey + ez * ez)
    return px - along * ex, py - along * ey, pz - along * ez


def vertices_with_slopes(surface: SurfaceIndex, points: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Distance from each point to the nearest vertex, and its gradient.

    Parameters
    ----------
    surface : SurfaceIndex
        The surface.
    points : (n, 3) float, m, body frame
        The points; along a path, each helps the next.

    Returns
    -------
    distances : (n,) float, m
    slopes : (n, 3) float, body frame
        Unit vectors away from the vertex; zero on it.
    """
    points = np.ascontiguousarray(points, dtype=np.float64).reshape(-1, 3)
    distances, slopes = np.zeros(len(points)), np.zeros((len(points), 3))
    _fill_vertices(surface, points, distances, slopes)
    return distances, slopes


@kernel
def _fill_vertices(
    surface: SurfaceIndex, points: FloatArray, distances: FloatArray, slopes: FloatArray
) -> None:
    slot = np.int64(0)
    for i in range(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        distances[i], slot = vertex_distance(surface, x, y, z, slot)
        t, nearest = surface.triangles[slot], np.inf
        for corner in range(0, 9, 3):
            dx, dy, dz = x - t[corner], y - t[corner + 1], z - t[corner + 2]
            length = np.sqrt(dx * dx + dy * dy + dz * dz)
            if 0.0 < length < nearest:
                nearest = length
                slopes[i, 0], slopes[i, 1], slopes[i, 2] = dx / length, dy / length, dz / length
