"""The outline of a body in a plane, and the lines that graze it."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from landing_cli.body.mesh import FloatArray, Mesh


def plane_section(mesh: Mesh, origin_m: ArrayLike, normal: ArrayLike) -> FloatArray:
    """Cut a closed mesh with a plane.

    Parameters
    ----------
    mesh : Mesh
        Closed.
    origin_m : (3,) float, m, body frame
        A point of the plane.
    normal : (3,) float
        Unit normal of the plane.

    Returns
    -------
    (k, 2, 3) float, m
        One segment for each facet that the plane cuts, in the order of the facets; together they close.
        A vertex in the plane counts as above it.
    """
    height = (mesh.vertices - np.asarray(origin_m, dtype=np.float64)) @ np.asarray(normal, dtype=np.float64)
    above = (height >= 0.0)[mesh.faces]
    cut = np.flatnonzero(above.any(axis=1) & ~above.all(axis=1))
    corners, height, above = mesh.vertices[mesh.faces[cut]], height[mesh.faces[cut]], above[cut]
    following = np.roll(corners, -1, axis=1), np.roll(height, -1, axis=1), np.roll(above, -1, axis=1)
    crossed = above != following[2]
    tail, low = corners[crossed], height[crossed]
    head, high = following[0][crossed], following[1][crossed]
    return np.asarray(tail + (low / (low - high))[:, None] * (head - tail)).reshape(-1, 2, 3)


def grazing_angles(outline: FloatArray, eye: ArrayLike) -> tuple[float, float]:
    """Tangents from a point to an outline in its plane.

    Parameters
    ----------
    outline : (k, 2, 2) float, m
        Segments in the plane.
    eye : (2,) float, m
        The point; the outline lies within 90 degrees of the first axis, seen from it.

    Returns
    -------
    (float, float)
        Angles of the right and of the left tangent with the first axis, rad, counter-clockwise; NaN where
        nothing of the outline is ahead.
    """
    offset = outline.reshape(-1, 2) - np.asarray(eye, dtype=np.float64)
    ahead = offset[offset[:, 0] > 0.0]
    if not len(ahead):
        return np.nan, np.nan
    slopes = ahead[:, 1] / ahead[:, 0]
    return float(np.arctan(slopes.min())), float(np.arctan(slopes.max()))


def clip_outline(outline: FloatArray, least: float, greatest: float) -> FloatArray:
    """Keep the part of an outline between two values of its first coordinate.

    Parameters
    ----------
    outline : (k, 2, 2) float, m
        Segments in a plane.
    least, greatest : float, m
        Limits of the first coordinate.

    Returns
    -------
    (l, 2, 2) float, m
        Segments, cut at the limits.
    """
    first, last = outline[:, 0], outline[:, 1]
    run = last[:, 0] - first[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        shares = np.stack([(least - first[:, 0]) / run, (greatest - first[:, 0]) / run])
    inside = (first[:, 0] >= least) & (first[:, 0] <= greatest)
    still = run == 0.0
    enter = np.where(still, np.where(inside, 0.0, 1.0), np.clip(shares.min(axis=0), 0.0, 1.0))
    leave = np.where(still, np.where(inside, 1.0, 0.0), np.clip(shares.max(axis=0), 0.0, 1.0))
    kept = enter < leave
    way = (last - first)[kept]
    ends = [first[kept] + share[kept, None] * way for share in (enter, leave)]
    return np.stack(ends, axis=1)


def crossings(outline: FloatArray, least: float, greatest: float) -> int:
    """Count how often an outline crosses the open segment of the first axis between two values.

    Parameters
    ----------
    outline : (k, 2, 2) float, m
        Segments in a plane.
    least, greatest : float, m
        Ends of the segment on the first axis.

    Returns
    -------
    int
    """
    first, last = outline[:, 0], outline[:, 1]
    crossed = (first[:, 1] >= 0.0) != (last[:, 1] >= 0.0)
    low, high = first[crossed], last[crossed]
    x = low[:, 0] - low[:, 1] * (high[:, 0] - low[:, 0]) / (high[:, 1] - low[:, 1])
    return int(((x > least) & (x < greatest)).sum())
