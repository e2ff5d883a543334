"""What the ground of a facet is like: its slope against local gravity, and how rough it is around."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.gravity.field import GravityField
from landing_cli.body.gravity.field_values import accelerations
from landing_cli.body.mesh import Mesh, facet_areas, facet_centroids, facet_normals
from landing_cli.errors import InputRefused

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

# facets in a neighbourhood below which a plane through them says nothing about the ground
FEWEST_FACETS = 4
MOST_PAIRS, PAIRS_AT_ONCE = 20_000_000, 500_000


def slopes_deg(
    points_m: FloatArray, normals: FloatArray, field: GravityField, rotation_rate_rad_s: float
) -> FloatArray:
    """Angle between the outward normal and the local vertical: minus gravity and centrifugal acceleration.

    Parameters
    ----------
    points_m, normals : (n, 3) float, m and 1, body frame
        Points of the surface and its outward unit normals there.
    field : GravityField
        The gravity.
    rotation_rate_rad_s : float, rad/s
        About +z.

    Returns
    -------
    (n,) float, degree
        0 where the ground is level, above 90 where it overhangs.
    """
    pull = accelerations(field, points_m)
    pull[:, :2] += rotation_rate_rad_s**2 * points_m[:, :2]
    # by the tangent: the cosine is blind to small angles
    across = np.linalg.norm(np.cross(normals, pull), axis=1)
    return np.degrees(np.arctan2(across, -(normals * pull).sum(axis=1)))


def roughness_m(mesh: Mesh, radius_m: float) -> FloatArray:
    """Root mean square distance of the surface around each facet from its best plane there.

    The surface around a facet is made of the whole facets whose centroids are within the radius of its own
    and that do not face away from it (the other side of a thin body is no neighbourhood). The mean is over
    their area, exact on each triangle: the second moment of a triangle of corners v and centroid c about a
    point is A/12 (sum v v' + 9 c c'). The best plane is the one of least mean square distance.

    Parameters
    ----------
    mesh : Mesh
        The surface, m.
    radius_m : float, m
        Of the neighbourhood.

    Returns
    -------
    (m,) float, m
        One a facet.

    Raises
    ------
    InputRefused
        A facet has fewer than ``FEWEST_FACETS`` in its neighbourhood, itself included, or the
        neighbourhoods together are too many to be measured.
    """
    here, there = _neighbourhoods(mesh, radius_m)
    count = len(mesh.faces)
    held = np.bincount(here, minlength=count)
    if held.min() < FEWEST_FACETS:
        raise _too_small(mesh, radius_m, held)
    areas, corners, centroids = facet_areas(mesh), mesh.corners, facet_centroids(mesh)
    found = np.zeros(count)
    ends = np.concatenate([[0], np.cumsum(held)])
    first = 0
    while first < count:  # in pieces: bounds the memory
        last = max(first + 1, int(np.searchsorted(ends, ends[first] + PAIRS_AT_ONCE, side="right")) - 1)
        own = slice(ends[first], ends[last])
        about = corners[there[own]] - centroids[here[own], None]  # about the facet: nothing cancels
        found[first:last] = _root_mean_square(here[own] - first, areas[there[own]], about, last - first)
        first = last
    return found


def _root_mean_square(here: IntArray, area: FloatArray, corners: FloatArray, count: int) -> FloatArray:
    """Root mean square distance of triangles, grouped by ``here``, from the best plane of each group."""
    centroid = corners.mean(axis=1)
    total = np.bincount(here, area, count)
    middle = np.stack([np.bincount(here, area * centroid[:, i], count) / total for i in range(3)], axis=1)
    spread = np.zeros((count, 3, 3))
    for i in range(3):
        for k in range(i + 1):
            of_corners = (corners[:, :, i] * corners[:, :, k]).sum(axis=1)
            moment = area / 12.0 * (of_corners + 9.0 * centroid[:, i] * centroid[:, k])
            spread[:, i, k] = np.bincount(here, moment, count) / total - middle[:, i] * middle[:, k]
            spread[:, k, i] = spread[:, i, k]
    return np.sqrt(np.maximum(np.linalg.eigvalsh(spread)[:, 0], 0.0))


def _neighbourhoods(mesh: Mesh, radius_m: float) -> tuple[IntArray, IntArray]:
    """Pairs of a facet and one in its neighbourhood, itself included, (p,) int each."""
    from scipy.spatial import cKDTree

    normals = facet_normals(mesh)
    tree = cKDTree(facet_centroids(mesh))
    pairs = int(tree.count_neighbors(tree, radius_m))
    if pairs > MOST_PAIRS:
        raise InputRefused(
            f"neighbourhoods of {radius_m:g} m hold {pairs / len(mesh.faces):.0f} facets on average, "
            f"{pairs:.3g} together",
            where="--radius-m",
            fix=f"take a radius with fewer than {MOST_PAIRS:g}",
        )
    found = np.asarray(tree.query_pairs(radius_m, output_type="ndarray"), dtype=np.int64).reshape(-1, 2)
    alike = found[(normals[found[:, 0]] * normals[found[:, 1]]).sum(axis=1) > 0.0]
    every = np.arange(len(mesh.faces))
    here = np.concatenate([every, alike[:, 0], alike[:, 1]])
    there = np.concatenate([every, alike[:, 1], alike[:, 0]])
    order = np.lexsort((there, here))  # sums in one order, whatever the tree's
    return here[order], there[order]


def _too_small(mesh: Mesh, radius_m: float, held: IntArray) -> InputRefused:
    """Say where a radius holds too little, and which one would do."""
    lonely, extent = int(np.argmin(held)), float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))
    what = f"within {radius_m:g} m of facet {lonely} are {held[lonely]} facets, no plane to measure from"
    larger = radius_m
    while larger < extent:
        larger *= 1.25
        if np.bincount(_neighbourhoods(mesh, larger)[0]).min() >= FEWEST_FACETS:
            fix = f"{float(f'{larger:.2g}') * 1.05:.2g} m would do"
            return InputRefused(what, where="--radius-m", fix=fix)
    return InputRefused(what, where="--radius-m", fix="the shape is too coarse for a neighbourhood")
