"""Upper bound of gravity on and above the mesh, for proofs that a place is out of reach.

Outside the masses |g| is largest on the surface. Each facet is a patch on which |g| is bounded by its value
at the centroid and the gradient there; patches that might hold more than is met elsewhere are split.
"""

from __future__ import annotations

import numpy as np

from landing_cli.body.gravity.bounds import room_for_fit
from landing_cli.body.gravity.field import GravityField
from landing_cli.body.gravity.field_values import accelerations, gradients
from landing_cli.body.gravity.kernel_types import FloatArray
from landing_cli.body.mesh import Mesh

TOLERANCE = 0.01  # how far the bound may lie above the largest value met
_GRADIENT_MARGIN = 2.0  # covers the change of the gradient within a patch
_MOST_SPLITS = 8


def largest_acceleration_on_mesh(field: GravityField, mesh: Mesh) -> float:
    """Bound |g| on the surface and everywhere above it.

    Parameters
    ----------
    field : GravityField
        The gravity model, its masses on or below the surface.
    mesh : Mesh
        The surface.

    Returns
    -------
    float, m/s2
        At most TOLERANCE above the least bound.
    """
    patches, attained, room = np.asarray(mesh.corners), 0.0, room_for_fit(field)
    for _ in range(_MOST_SPLITS):
        sizes, ceilings = _ceilings(field, patches)
        attained = max(attained, float(sizes.max()))
        patches = patches[ceilings > (1.0 + TOLERANCE) * attained]
        if len(patches) == 0:
            return (1.0 + TOLERANCE) * attained * room
        patches = _split(patches)
    return room * max((1.0 + TOLERANCE) * attained, float(_ceilings(field, patches)[1].max()))


def _ceilings(field: GravityField, patches: FloatArray) -> tuple[FloatArray, FloatArray]:
    """|g| at the centroid of each patch (n, 3, 3), and its bound over the patch."""
    centroids = patches.mean(axis=1)
    reaches = np.linalg.norm(patches - centroids[:, None], axis=2).max(axis=1)
    sizes = np.linalg.norm(accelerations(field, centroids), axis=1)
    slopes = np.linalg.norm(gradients(field, centroids).reshape(len(patches), -1), axis=1)
    return sizes, np.asarray(sizes + _GRADIENT_MARGIN * reaches * slopes)


def _split(patches: FloatArray) -> FloatArray:
    """Split each flat triangle into four at the middles of its sides."""
    a, b, c = np.moveaxis(patches, 1, 0)
    ab, bc, ca = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)
    quarters = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    return np.concatenate([np.stack(corners, axis=1) for corners in quarters])
