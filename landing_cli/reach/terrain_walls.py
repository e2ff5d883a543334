"""Planes off the terrain: which points of a flight come near rock, and to which side they are led.

A point above the surface is kept above the plane through the closest point of it, square to the line between
the two. A point in rock is led out: along that line too, or along a given direction to where a ray leaves the
body, under a plane square to the direction. One direction for a whole cut keeps its points together, where
lines to the closest points would lead some forwards and some back off a ridge.
"""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.bvh import SurfaceIndex
from landing_cli.body.clearance import signed_distances_into
from landing_cli.body.closest_points import closest_points
from landing_cli.body.ray_cast import first_hits
from landing_cli.reach.free_batch import WallBatch
from landing_cli.reach.scaled_case import ScaledCase

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

# Walls may stand at so many evenly spaced points of the final arc, and at every node of the descent.
ARC_POINTS = 32
# Closer to the surface than this, in mean edges, the line to the closest point has lost its direction.
ON_SURFACE = 1e-6


class Way(IntEnum):
    """Where the points of a flight that lie in rock are led."""

    CLOSEST = 0  # each the shortest way out
    OUTWARD = 1  # away from the body's centre
    NORMAL = 2  # along the normal of the facet to land on
    LEFT = 3  # sideways, seen along the flight with the centre below
    RIGHT = 4


class Terrain(NamedTuple):
    """The surface that flights keep clear of."""

    surface: SurfaceIndex
    corners_m: Floats  # (m, 3, 3) of every facet
    centroids_m: Floats  # (m, 3)
    normals: Floats  # (m, 3)
    mean_edge_m: float


class Flown(NamedTuple):
    """Points of n flights where walls may stand, in the order of flight, and the surface below them."""

    landing: Ints  # (n,) facets to land on
    node: Ints  # (P,) of the descent, or 0: on the final arc
    fraction: Floats  # (P,) of the final arc's time-to-go
    points_m: Floats  # (n, P, 3) body axes
    distance_m: Floats  # (n, P) to the surface, negative in rock
    closest_m: Floats  # (n, P, 3)
    facet: Ints  # (n, P) that is closest


def look_below(
    terrain: Terrain,
    scaled: ScaledCase,
    landing: Ints,
    position: Floats,
    handover: Floats,
    final_stage_s: float,
) -> Flown:
    """Take the points of some flights and find the surface below them.

    Parameters
    ----------
    terrain : Terrain
        The surface.
    scaled : ScaledCase
        The case.
    landing : (n,) int
        Facets to land on.
    position : (n, N + 1, 3) float
        Nodes of the descents, scaled, solver axes.
    handover : (n, 7) float
        Position (m) and rotating-frame velocity (m/s) at the handover, body axes.
    final_stage_s : float, s
        Duration of the final arc.
    """
    nodes = np.arange(1, position.shape[1] - 1)
    fraction = 1.0 - np.arange(ARC_POINTS) / ARC_POINTS
    descent = _in_body_axes(scaled, nodes, position[:, nodes] * scaled.length_m)
    arc = _arc_points(handover, terrain.centroids_m[landing], final_stage_s, fraction)
    points = np.ascontiguousarray(np.concatenate([descent, arc], axis=1))
    flat = points.reshape(-1, 3)
    distance, facet = np.zeros(len(flat)), np.zeros(len(flat), dtype=np.int64)
    signed_distances_into(terrain.surface, flat, distance, facet)
    closest = closest_points(terrain.corners_m[facet], flat)
    return Flown(
        landing,
        np.concatenate([nodes, np.zeros(ARC_POINTS, dtype=np.int64)]),
        np.concatenate([np.zeros(len(nodes)), fraction]),
        points,
        distance.reshape(points.shape[:2]),
        closest.reshape(points.shape),
        facet.reshape(points.shape[:2]),
    )


def _in_body_axes(scaled: ScaledCase, nodes: Ints, points: Floats) -> Floats:
    """Turn (n, K, 3) points at K nodes from solver axes into those of the body at that time."""
    c, s = scaled.node_cos[nodes], scaled.node_sin[nodes]
    x, y, z = np.moveaxis(points, 2, 0)
    return np.stack([c * x + s * y, c * y - s * x, z], axis=2)


def _in_solver_axes(scaled: ScaledCase, node: Ints, vectors: Floats) -> Floats:
    """Turn (n, P, 3) vectors from body axes at their nodes; those on the final arc stay."""
    c = np.where(node > 0, scaled.node_cos[node], 1.0)
    s = np.where(node > 0, scaled.node_sin[node], 0.0)
    x, y, z = np.moveaxis(vectors, 2, 0)
    return np.stack([c * x - s * y, s * x + c * y, z], axis=2)


def _arc_points(handover: Floats, targets_m: Floats, duration_s: float, fraction: Floats) -> Floats:
    """Points of final arcs, (n, P, 3) m: r - r_c = s^2 (A + B s)."""
    d, v, T = handover[:, None, :3] - targets_m[:, None], handover[:, None, 3:6], duration_s
    s = (fraction * T)[:, None]
    a, b = 3.0 * d / T**2 + v / T, -2.0 * d / T**3 - v / T**2
    return np.asarray(targets_m[:, None] + s**2 * (a + b * s))


def walls_along(
    terrain: Terrain, scaled: ScaledCase, flown: Flown, way: Way, reach_m: float, margin_m: Floats
) -> WallBatch:
    """Put up walls below the points of flights that come near the surface.

    Parameters
    ----------
    terrain : Terrain
        The surface.
    scaled : ScaledCase
        The case.
    flown : Flown
        The flights.
    way : Way
        Where points in rock are led.
    reach_m : float, m
        How near is near.
    margin_m : (n,) float, m
        What each flight keeps off the surface, beyond one mean edge from its touchdown.

    Returns
    -------
    walls : WallBatch
        Scaled by the ellipsoid, so that their numbers are of the order of 1.
    """
    targets = terrain.centroids_m[flown.landing][:, None]
    landing = np.linalg.norm(flown.points_m - targets, axis=2) <= terrain.mean_edge_m
    inside = flown.distance_m < 0.0
    normal, anchor = _lines_out(terrain, flown)
    if way is not Way.CLOSEST:
        _lead(terrain, flown, way, inside & ~landing, normal, anchor)
    near = flown.distance_m < reach_m
    # the facet to land on needs no wall where the glide slope stands on it
    near &= inside | ~landing | (flown.facet != flown.landing[:, None])
    offset = np.einsum("npi,npi->np", normal, anchor) + np.where(landing, 0.0, margin_m[:, None])
    rows, place = np.arange(len(near))[:, None], _places(near)
    size = float(scaled.inverse_axes.max())
    return WallBatch(
        near.sum(axis=1),
        np.ascontiguousarray(flown.node[place]),
        np.ascontiguousarray(flown.fraction[place]),
        np.ascontiguousarray(size * _in_solver_axes(scaled, flown.node, normal)[rows, place]),
        np.ascontiguousarray(size / scaled.length_m * offset[rows, place]),
    )


def _places(near: Flags) -> Ints:
    """Columns of the true values of each row, before the others; as many as the fullest row has."""
    return np.argsort(~near, axis=1, kind="stable")[:, : int(near.sum(axis=1).max(initial=0))]


def _lines_out(terrain: Terrain, flown: Flown) -> tuple[Floats, Floats]:
    """Unit vectors away from rock by the closest point of the surface, and that point."""
    away = np.sign(flown.distance_m)[:, :, None] * (flown.points_m - flown.closest_m)
    length = np.linalg.norm(away, axis=2, keepdims=True)
    on_it = length <= ON_SURFACE * terrain.mean_edge_m
    unit = np.where(on_it, terrain.normals[flown.facet], away / np.where(on_it, 1.0, length))
    return unit, flown.closest_m.copy()


def _lead(terrain: Terrain, flown: Flown, way: Way, inside: Flags, normal: Floats, anchor: Floats) -> None:
    """Lead points in rock along a direction, to where a ray leaves the body."""
    direction = _directions(terrain, flown, way)[inside]
    start = flown.points_m[inside]
    length, _ = first_hits(terrain.surface, start, direction)
    out = np.isfinite(length)
    whole = np.flatnonzero(inside.ravel())[out]
    normal.reshape(-1, 3)[whole] = direction[out]
    anchor.reshape(-1, 3)[whole] = start[out] + length[out, None] * direction[out]


def _directions(terrain: Terrain, flown: Flown, way: Way) -> Floats:
    """Unit vectors along which the points of each flight are led out, (n, P, 3)."""
    points = flown.points_m
    if way is Way.NORMAL:
        return np.broadcast_to(terrain.normals[flown.landing][:, None], points.shape)
    outward = points / np.linalg.norm(points, axis=2, keepdims=True)
    if way is Way.OUTWARD:
        return np.asarray(outward)
    deepest = np.argmin(flown.distance_m, axis=1)
    rows, last = np.arange(len(points)), points.shape[1] - 1
    along = points[rows, np.minimum(deepest + 1, last)] - points[rows, np.maximum(deepest - 1, 0)]
    left = np.cross(outward[rows, deepest], along)
    left /= np.maximum(np.linalg.norm(left, axis=1, keepdims=True), np.finfo(float).tiny)
    return np.broadcast_to((left if way is Way.LEFT else -left)[:, None], points.shape)
