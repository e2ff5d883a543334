"""The closest point of a triangle."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


def closest_points(corners_m: FloatArray, points_m: FloatArray) -> FloatArray:
    """Closest point of a triangle to each point.

    Parameters
    ----------
    corners_m : (n, 3, 3) float, m
        One triangle a point.
    points_m : (n, 3) float, m
        The points.

    Returns
    -------
    (n, 3) float, m
    """
    edges = np.roll(corners_m, -1, axis=1) - corners_m
    offsets = points_m[:, None] - corners_m
    share = np.clip((offsets * edges).sum(axis=2) / (edges * edges).sum(axis=2), 0.0, 1.0)
    on_edges = corners_m + share[:, :, None] * edges
    nearest = np.argmin(np.linalg.norm(points_m[:, None] - on_edges, axis=2), axis=1)
    normal = np.cross(edges[:, 0], edges[:, 1])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    inside = (np.einsum("nik,nk->ni", np.cross(edges, offsets), normal) >= 0.0).all(axis=1)
    on_plane = points_m - (offsets[:, 0] * normal).sum(axis=1, keepdims=True) * normal
    return np.where(inside[:, None], on_plane, on_edges[np.arange(len(points_m)), nearest])
