"""Small solids with closed forms, for the tests of the shape rooms."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull

from landing_cli.body.mesh import Mesh

CUBE_CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)


def convex_mesh(points: np.ndarray) -> Mesh:
    """Hull of points in convex position, wound outwards."""
    faces = ConvexHull(points).simplices.astype(np.int64)
    a, b, c = np.moveaxis(points[faces], 1, 0)
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), a - points.mean(axis=0)) < 0
    faces[inward] = faces[inward][:, ::-1]
    return Mesh(points, faces)


def box(size_m: tuple[float, float, float], corner_m: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Mesh:
    return convex_mesh(CUBE_CORNERS * size_m + corner_m)


def tetrahedron(scale_m: float = 1.0) -> Mesh:
    """The corner tetrahedron x, y, z >= 0, x + y + z <= scale."""
    points = scale_m * np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    return Mesh(points, np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]))


def fibonacci_ellipsoid(semi_axes_m: tuple[float, float, float], count: int) -> Mesh:
    index = np.arange(count) + 0.5
    z = 1.0 - 2.0 * index / count
    angle = np.pi * (1.0 + np.sqrt(5.0)) * index
    ring = np.sqrt(1.0 - z**2)
    sphere = np.stack([ring * np.cos(angle), ring * np.sin(angle), z], axis=1)
    return Mesh(sphere * semi_axes_m, convex_mesh(sphere).faces)
