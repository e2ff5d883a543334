"""Exact signed distance from points and paths to the surface: positive outside, negative inside."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from landing_cli.body.bvh import (
    CORNER_B,
    CORNER_C,
    EDGE_BC,
    FACE,
    SurfaceIndex,
    closest_slot,
    triangle_distance2,
)
from landing_cli.kernel import kernel, part

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

TOUCHDOWN_TOLERANCE_M = 0.01
"""Depth forgiven around the touchdown: far above rounding, far below what a lander could scrape."""


def signed_distances(surface: SurfaceIndex, points: ArrayLike) -> FloatArray:
    """Signed distance from each point to the surface; along a path, each point helps the next.

    Parameters
    ----------
    surface : SurfaceIndex
        The surface.
    points : (n, 3) float, m, body frame
        The points.

    Returns
    -------
    (n,) float, m
        Positive outside, negative inside; NaN where a coordinate is NaN.
    """
    points = np.ascontiguousarray(points, dtype=np.float64).reshape(-1, 3)
    distances = np.zeros(len(points))
    facets = np.zeros(len(points), dtype=np.int64)
    signed_distances_into(surface, points, distances, facets)
    return distances


def closest_facets(surface: SurfaceIndex, points: ArrayLike) -> IntArray:
    """Facet of the mesh closest to each point, (n,) int, for (n, 3) points in m, body frame."""
    points = np.ascontiguousarray(points, dtype=np.float64).reshape(-1, 3)
    facets = np.zeros(len(points), dtype=np.int64)
    signed_distances_into(surface, points, np.zeros(len(points)), facets)
    return facets


def contains(surface: SurfaceIndex, points: ArrayLike) -> NDArray[np.bool_]:
    """Whether each point lies inside the body, (n,) bool, for (n, 3) points in m, body frame."""
    return np.asarray(signed_distances(surface, points) < 0.0)


@part
def _with_sign(
    surface: SurfaceIndex, distance2: float, slot: int, feature: int, x: float, y: float, z: float
) -> float:
    """Give a distance its sign: the side of the pseudonormal on which the point lies.

    An edge's pseudonormal is normal to the edge, so any point of the edge will do.
    """
    corner = 0
    if feature in (EDGE_BC, CORNER_B):
        corner = 3
    elif feature == CORNER_C:
        corner = 6
    t, n = surface.triangles[slot], surface.pseudonormals[slot, feature]
    side = (x - t[corner]) * n[0] + (y - t[corner + 1]) * n[1] + (z - t[corner + 2]) * n[2]
    return -np.sqrt(distance2) if side < 0.0 else np.sqrt(distance2)


@part
def signed_distance(
    surface: SurfaceIndex, x: float, y: float, z: float, upper_bound: float
) -> tuple[float, int]:
    """Signed distance from one point to the surface, and the closest facet.

    Parameters
    ----------
    surface : SurfaceIndex
        The surface.
    x, y, z : float, m, body frame
        The point.
    upper_bound : float, m
        Facets at this distance or farther are of no interest; infinity to search them all.

    Returns
    -------
    (float, int)
        Signed distance (m) and facet of the mesh; ``(upper_bound, -1)`` where no facet is closer.
    """
    distance2, slot, feature = closest_slot(surface, x, y, z, upper_bound * upper_bound, -1, FACE)
    if slot < 0:
        return upper_bound, -1
    return _with_sign(surface, distance2, slot, feature, x, y, z), surface.facets[slot]


@part
def signed_distance_from(surface: SurfaceIndex, x: float, y: float, z: float, slot: int) -> tuple[float, int]:
    """Signed distance from one point to the surface, and the slot of the closest facet.

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
        Signed distance (m) and slot.
    """
    distance2, feature = triangle_distance2(surface.triangles, slot, x, y, z)
    distance2, slot, feature = closest_slot(surface, x, y, z, distance2, slot, feature)
    return _with_sign(surface, distance2, slot, feature, x, y, z), slot


@kernel
def signed_distances_into(
    surface: SurfaceIndex, points: FloatArray, distances: FloatArray, facets: IntArray
) -> None:
    """Write the signed distances (n,), m, and the closest facets (n,) of (n, 3) points."""
    slot = np.int64(0)
    for i in range(points.shape[0]):
        distances[i], slot = signed_distance_from(surface, points[i, 0], points[i, 1], points[i, 2], slot)
        facets[i] = surface.facets[slot]


@kernel
def path_clearance(
    surface: SurfaceIndex, path: FloatArray, free_radius: float, tolerance: float, spacing: float
) -> tuple[float, int]:
    """Least signed distance of a landing path to the surface, beyond the neighbourhood of its touchdown.

    A point counts when it is farther than `free_radius` from the touchdown, or when it lies deeper than
    `tolerance` inside the body wherever it is. Points that cannot be the least, because
    |d(p) - d(q)| <= |p - q|, are skipped; the answer is that of looking at all of them.

    Parameters
    ----------
    surface : SurfaceIndex
        The surface.
    path : (n, 3) float, m, body frame
        Points in the order of flight; the last one is the touchdown.
    free_radius : float, m
        Points as close as this to the touchdown count only when inside: one mean edge.
    tolerance : float, m
        Depth that is forgiven within `free_radius`, where rounding puts the touchdown on either side.
    spacing : float, m
        Chords between points are divided evenly so that no step is longer; infinity looks at the points
        alone. The chords come closer than the answer by at most half a step (a whole one where they leave
        `free_radius`); a path of acceleration a, sampled every dt, leaves them by at most a dt^2 / 8.

    Returns
    -------
    (float, int)
        Least signed distance (m) and the facet of the mesh it is measured to; infinity and -1 where no point
        counts, NaN and -1 where a coordinate is NaN.
    """
    last = path.shape[0] - 1
    tx, ty, tz = path[last, 0], path[last, 1], path[last, 2]
    least, facet, slot = np.inf, -1, np.int64(0)
    known, kx, ky, kz = -np.inf, tx, ty, tz  # the last distance that was computed, and where
    for k in range(last, -1, -1):
        j = min(k + 1, last)  # the chord from point j back to point k
        dx, dy, dz = path[k, 0] - path[j, 0], path[k, 1] - path[j, 1], path[k, 2] - path[j, 2]
        slack = known - least
        if slack > 0.0:  # a chord whose ends are this near to where the distance is known has no nearer point
            x, y, z = path[j, 0] - kx, path[j, 1] - ky, path[j, 2] - kz
            within = x * x + y * y + z * z <= slack * slack
            if within and (x + dx) ** 2 + (y + dy) ** 2 + (z + dz) ** 2 <= slack * slack:
                continue
        parts = max(1, int(np.ceil(np.sqrt(dx * dx + dy * dy + dz * dz) / spacing)))
        for i in range(1, parts + 1):
            back = (parts - i) / parts
            x, y, z = path[k, 0] - back * dx, path[k, 1] - back * dy, path[k, 2] - back * dz
            near = (x - tx) ** 2 + (y - ty) ** 2 + (z - tz) ** 2 <= free_radius * free_radius
            threshold = min(least, -tolerance) if near else least
            slack = known - threshold
            if slack > 0.0 and (x - kx) ** 2 + (y - ky) ** 2 + (z - kz) ** 2 <= slack * slack:
                continue
            known, slot = signed_distance_from(surface, x, y, z, slot)
            kx, ky, kz = x, y, z
            if known != known:
                return np.nan, -1
            if known < threshold:
                least, facet = known, surface.facets[slot]
    return least, facet
