"""Rays against the surface of a mesh, in double precision and without leaks between facets."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from landing_cli.body.bvh import SurfaceIndex
from landing_cli.kernel import kernel, part

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

_PAD = 1e-12  # of a box's coordinates: what rounding may cut off a box without thickness
_ROUNDING = 16 * 2.0**-53  # of a coordinate, or of the products in a volume: more than six roundings each


def first_hits(
    surface: SurfaceIndex, origins: ArrayLike, directions: ArrayLike
) -> tuple[FloatArray, IntArray]:
    """Where rays first meet the surface, from outside or inside.

    Parameters
    ----------
    surface : SurfaceIndex
        The surface.
    origins, directions : (n, 3) float, m, body frame
        Directions of any length.

    Returns
    -------
    (n,) float
        How many lengths of the direction away; infinity where the ray meets no facet.
    (n,) int
        Facet of the mesh, or -1.
    """
    origins, directions = _rows(origins), _rows(directions)
    shares, facets = np.zeros(len(origins)), np.zeros(len(origins), dtype=np.int64)
    first_hits_into(surface, origins, directions, shares, facets)
    return shares, facets


def is_obstructed(
    surface: SurfaceIndex, starts: ArrayLike, ends: ArrayLike, offset_m: float
) -> NDArray[np.bool_]:
    """Whether the surface stands between two points.

    Parameters
    ----------
    surface : SurfaceIndex
        The surface.
    starts, ends : (n, 3) float, m, body frame
        The points.
    offset_m : float, m
        What is left out of the segment at either end, so that a point on the surface does not hide itself.

    Returns
    -------
    (n,) bool
        False where the segment is no longer than the two offsets.
    """
    starts, ends = _rows(starts), _rows(ends)
    obstructed = np.zeros(len(starts), dtype=np.bool_)
    obstructed_into(surface, starts, ends, offset_m, obstructed)
    return obstructed


def _rows(points: ArrayLike) -> FloatArray:
    return np.ascontiguousarray(points, dtype=np.float64).reshape(-1, 3)


@part
def _meets_box(
    b: FloatArray, ox: float, oy: float, oz: float, dx: float, dy: float, dz: float, least: float, most: float
) -> bool:
    """Whether the ray o + t d is inside a node's oriented box for some t in [least, most]."""
    for k in range(3):
        x, y, z = b[3 * k], b[3 * k + 1], b[3 * k + 2]
        at, along = x * ox + y * oy + z * oz, x * dx + y * dy + z * dz
        pad = _PAD * (abs(b[9 + k]) + abs(b[12 + k]) + abs(at))
        low, high = b[9 + k] - pad - at, b[12 + k] + pad - at
        if along == 0.0:
            if low > 0.0 or high < 0.0:
                return False
        elif along > 0.0:
            least, most = max(least, low / along), min(most, high / along)
        else:
            least, most = max(least, high / along), min(most, low / along)
    return least <= most


@part
def _triangle_hit(t: FloatArray, ox: float, oy: float, oz: float, dx: float, dy: float, dz: float) -> float:
    """Share of d at which the ray o + t d meets a facet (12 numbers of a slot); NaN where it does not.

    By the signs of the volumes of d with each edge, as seen from o (Pluecker's test; Segura and Feito, WSCG
    1998). A volume within rounding of zero counts for the facets on both sides, so that no ray slips through
    an edge or a corner. A ray that rounding cannot tell from one in the facet's plane does not meet it.
    """
    ax, ay, az = t[0] - ox, t[1] - oy, t[2] - oz
    bx, by, bz = t[3] - ox, t[4] - oy, t[5] - oz
    cx, cy, cz = t[6] - ox, t[7] - oy, t[8] - oz
    ab = dx * (ay * bz - az * by) + dy * (az * bx - ax * bz) + dz * (ax * by - ay * bx)
    bc = dx * (by * cz - bz * cy) + dy * (bz * cx - bx * cz) + dz * (bx * cy - by * cx)
    ca = dx * (cy * az - cz * ay) + dy * (cz * ax - cx * az) + dz * (cx * ay - cy * ax)
    a, b, c = max(abs(ax), abs(ay), abs(az)), max(abs(bx), abs(by), abs(bz)), max(abs(cx), abs(cy), abs(cz))
    zero = _ROUNDING * (abs(dx) + abs(dy) + abs(dz)) * max(a * b, b * c, c * a)
    if min(ab, bc, ca) < -zero and max(ab, bc, ca) > zero:
        return np.nan
    along = dx * t[9] + dy * t[10] + dz * t[11]
    if abs(along) <= _ROUNDING * (abs(ox) + abs(oy) + abs(oz) + max(a, b, c)):
        return np.nan
    return (ax * t[9] + ay * t[10] + az * t[11]) / along


@part
def ray_hit(
    surface: SurfaceIndex,
    ox: float,
    oy: float,
    oz: float,
    dx: float,
    dy: float,
    dz: float,
    least: float,
    most: float,
    any_hit: bool,
) -> tuple[float, int]:
    """First point of a ray on the surface.

    Parameters
    ----------
    surface : SurfaceIndex
        The surface.
    ox, oy, oz : float, m, body frame
        Where the ray begins.
    dx, dy, dz : float
        Its direction d, of any length.
    least, most : float
        Hits outside (least, most), in lengths of d, are of no interest.
    any_hit : bool
        Whether some hit will do instead of the first.

    Returns
    -------
    (float, int)
        Lengths of d to the hit, and its slot; ``(most, -1)`` where there is none.
    """
    boxes, triangles, depth = surface.boxes, surface.triangles, surface.depth
    count, leaves = triangles.shape[0], 1 << depth
    slot, node = -1, 1
    while True:
        if _meets_box(boxes[node], ox, oy, oz, dx, dy, dz, least, most):
            if node < leaves:
                node = 2 * node
                continue
            leaf = node - leaves
            for s in range((leaf * count) >> depth, ((leaf + 1) * count) >> depth):
                share = _triangle_hit(triangles[s], ox, oy, oz, dx, dy, dz)
                if least < share < most:
                    most, slot = share, s
                    if any_hit:
                        return most, slot
        # done with this node: climb while it is a right child, then go to its right sibling
        while node & 1:
            node >>= 1
        if node == 0:
            return most, slot
        node += 1


@kernel
def first_hits_into(
    surface: SurfaceIndex, origins: FloatArray, directions: FloatArray, shares: FloatArray, facets: IntArray
) -> None:
    """Write how many lengths of d away (n,), and on which facet (n,), rays first meet the surface."""
    for i in range(origins.shape[0]):
        o, d = origins[i], directions[i]
        shares[i], slot = ray_hit(surface, o[0], o[1], o[2], d[0], d[1], d[2], 0.0, np.inf, False)
        facets[i] = surface.facets[slot] if slot >= 0 else -1


@kernel
def obstructed_into(
    surface: SurfaceIndex, starts: FloatArray, ends: FloatArray, offset: float, obstructed: NDArray[np.bool_]
) -> None:
    """Write whether the surface stands between (n, 3) points, less an offset (m) at either end."""
    for i in range(starts.shape[0]):
        o, e = starts[i], ends[i]
        dx, dy, dz = e[0] - o[0], e[1] - o[1], e[2] - o[2]
        length = np.sqrt(dx * dx + dy * dy + dz * dz)
        if length <= 2.0 * offset:
            obstructed[i] = False
            continue
        share = offset / length
        slot = ray_hit(surface, o[0], o[1], o[2], dx, dy, dz, share, 1.0 - share, True)[1]
        obstructed[i] = slot >= 0
