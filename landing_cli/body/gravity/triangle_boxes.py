"""Which triangles reach into a box: the separating-axis test (Akenine-Moller 2001), for all at once."""

from __future__ import annotations

import numpy as np

from landing_cli.body.gravity.kernel_types import FloatArray

_TOUCHING = 1e-9  # of the box: triangles that touch its faces from outside stay outside


def triangles_in_box(corners: FloatArray, center: FloatArray, half: FloatArray) -> FloatArray:
    """Return the triangles that share inner points with an axis-aligned box.

    Parameters
    ----------
    corners : (m, 3, 3) float, m
        Corner i of triangle f is ``corners[f, i]``, in the axes of the box.
    center, half : (3,) float, m
        The box.

    Returns
    -------
    (k, 3, 3) float, m
        Their corners.
    """
    inner = half * (1.0 - _TOUCHING)
    apart = (corners.min(axis=1) >= center + inner).any(axis=1)
    apart |= (corners.max(axis=1) <= center - inner).any(axis=1)
    near = corners[~apart]
    local = near - center
    edges = np.roll(local, -1, axis=1) - local
    normals = np.cross(edges[:, 0], edges[:, 1])
    crossed = np.cross(edges[:, :, None], np.eye(3)[None, None]).reshape(len(near), 9, 3)
    axes = np.concatenate([normals[:, None], crossed], axis=1)
    along = np.einsum("fax,fcx->fac", axes, local)
    reach = np.abs(axes) @ inner
    separated = (along.min(axis=2) >= reach) | (along.max(axis=2) <= -reach)
    # an edge along a box axis makes no separating direction
    separated &= np.linalg.norm(axes, axis=2) > 0.0
    return np.asarray(near[~separated.any(axis=1)])
