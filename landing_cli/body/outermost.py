"""Where a ray from the origin leaves a body for good."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from landing_cli.body.mesh import FloatArray, Mesh

_EDGE = 1e-12  # a ray through an edge belongs to both its facets


def outermost_point(mesh: Mesh, direction: ArrayLike) -> tuple[FloatArray, int] | None:
    """Find the farthest point of a surface along a ray from the origin.

    Parameters
    ----------
    mesh : Mesh
        The surface, m; it need not be star-shaped.
    direction : (3,) float
        Of any length.

    Returns
    -------
    ((3,) float, int) or None
        The point (m, body frame) and its facet; None where the ray meets no facet. By Moeller and Trumbore,
        Journal of Graphics Tools 2(1), 1997, on every facet.
    """
    d = np.asarray(direction, dtype=np.float64)
    d = d / np.linalg.norm(d)
    a, b, c = np.moveaxis(mesh.corners, 1, 0)
    along, across = b - a, c - a
    p = np.cross(d, across)
    determinant = np.einsum("ij,ij->i", along, p)
    with np.errstate(divide="ignore", invalid="ignore"):  # the ray may run along a facet
        u = -np.einsum("ij,ij->i", a, p) / determinant
        q = np.cross(-a, along)
        v = q @ d / determinant
        height = np.einsum("ij,ij->i", across, q) / determinant
        hit = (u >= -_EDGE) & (v >= -_EDGE) & (u + v <= 1.0 + _EDGE) & (height > 0.0)
    if not hit.any():
        return None
    facet = int(np.argmax(np.where(hit, height, -np.inf)))
    return height[facet] * d, facet
