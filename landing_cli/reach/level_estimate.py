"""The least thrust level of a facet that was not asked, from those that were.

The level tau depends on where a facet lies and on where it faces, smoothly in both; along a rough surface it
jumps, because normals do. So the asked facets are points in six dimensions, place and normal, and a level is
estimated by an affine fit to its nearest points there. Levels enter as logarithms: 0 is the boundary of the
domain. The fit's own residuals, widened by how far it is stretched, say how far it can be trusted.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

NEAREST = 16
# Weight of a neighbour at the distance of the farthest one, and a ridge that holds slopes back where the
# neighbours do not tell them, relative to that distance squared.
FAR_WEIGHT, RIDGE = np.exp(-2.0), 1e-2
BLOCK = 4096


class Estimates(NamedTuple):
    """Estimated logarithms of thrust levels, and how wrong each may be (one standard deviation)."""

    value: FloatArray  # (q,)
    error: FloatArray  # (q,)


def features(centroids_m: FloatArray, normals: FloatArray, radius_m: float) -> FloatArray:
    """Place facets in the space in which levels are smooth.

    Parameters
    ----------
    centroids_m : (m, 3) float, m
        Where they lie.
    normals : (m, 3) float
        Unit normals.
    radius_m : float, m
        The body's size: that far apart counts like a radian between the normals.

    Returns
    -------
    (m, 6) float
    """
    return np.hstack([centroids_m / radius_m, normals])


def estimate(known: FloatArray, values: FloatArray, asked_for: FloatArray) -> Estimates:
    """Estimate values from known ones nearby.

    Parameters
    ----------
    known : (k, 6) float
        Features of the facets whose value is known; at least one.
    values : (k,) float
        Their values.
    asked_for : (q, 6) float
        Features of the others.

    Returns
    -------
    Estimates
        Infinite errors where fewer points are known than a fit needs.
    """
    from scipy.spatial import cKDTree

    parts = [Estimates(np.zeros(0), np.zeros(0))]
    tree, nearest = cKDTree(known), min(NEAREST, len(known))
    for first in range(0, len(asked_for), BLOCK):
        block = asked_for[first : first + BLOCK]
        distance, which = tree.query(block, nearest)
        distance, which = distance.reshape(len(block), nearest), which.reshape(len(block), nearest)
        parts.append(_fit(known[which] - block[:, None], values[which], distance))
    return Estimates(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def _fit(offset: FloatArray, value: FloatArray, distance: FloatArray) -> Estimates:
    """Fit a plane to the neighbours of each point: (q, k, 6), (q, k) and (q, k) float."""
    count, size = offset.shape[1:]
    reach = np.maximum(distance[:, -1:], 1e-12)
    weight = FAR_WEIGHT ** ((distance / reach) ** 2)
    weight /= weight.sum(axis=1, keepdims=True)
    middle = np.einsum("qk,qki->qi", weight, offset)
    mean = np.einsum("qk,qk->q", weight, value)
    apart, rise = offset - middle[:, None], value - mean[:, None]
    spread = np.einsum("qk,qki,qkj->qij", weight, apart, apart)
    spread += (RIDGE * reach**2)[:, :, None] * np.eye(size) / size
    both = np.stack([np.einsum("qk,qki,qk->qi", weight, apart, rise), middle], axis=2)
    solved = np.linalg.solve(spread, both)
    slope, stretch = solved[..., 0], np.einsum("qi,qi->q", solved[..., 1], middle)
    residual = rise - np.einsum("qki,qi->qk", apart, slope)
    freedom = max(count - size - 1, 0) / count
    with np.errstate(divide="ignore", invalid="ignore"):
        variance = np.einsum("qk,qk->q", weight, residual**2) / freedom
    error = np.sqrt(variance * (1.0 + stretch)) if freedom else np.full(len(value), np.inf)
    return Estimates(mean - np.einsum("qi,qi->q", slope, middle), error)
