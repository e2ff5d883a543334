"""Lines on the surface where a facet's value crosses a level: finer than the facets, exactly on the mesh.

Every facet is split at its centroid into three triangles. The centroid has the facet's value, a vertex what
a plane through the values around it says there; within a triangle the value is linear, so a level's line is
straight. The line parts the centroids below the level from those above it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.mesh import Mesh, facet_centroids, facet_normals

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# A plane is fitted only where the values around a vertex spread in every direction.
_LEAST_SPREAD = 1e-6


@dataclass(frozen=True, eq=False)
class SplitSurface:
    """The facets of a mesh split at their centroids, with a value at every corner.

    Attributes
    ----------
    points_m : (v + m, 3) float, m
        Vertices, then centroids.
    triangles : (3 m, 3) int
        Two vertices and the centroid; three triangles to a facet, in their order.
    values : (v + m,) float
        NaN where nothing is known around.
    """

    points_m: Floats
    triangles: Ints
    values: Floats


@dataclass(frozen=True, eq=False)
class LevelSet:
    """The lines of one level.

    Attributes
    ----------
    level : float
    points_m : (n, 3) float, m, body frame
        Line after line; lower values lie to the left, seen from outside. A closed line ends where it begins.
    offsets : (k + 1,) int
        Where each line begins and ends.
    area_within_m2 : float, m2
        Of the surface where the value is at most the level.
    """

    level: float
    points_m: Floats
    offsets: Ints
    area_within_m2: float

    def line(self, index: int) -> Floats:
        """Return the points of one line, (n, 3) float, m."""
        return self.points_m[self.offsets[index] : self.offsets[index + 1]]

    @property
    def length_m(self) -> float:
        """Of all lines together, m."""
        steps = np.linalg.norm(np.diff(self.points_m, axis=0), axis=1)
        steps[self.offsets[1:-1] - 1] = 0.0
        return float(steps.sum())


def split_surface(mesh: Mesh, values: Floats) -> SplitSurface:
    """Split a mesh at its centroids and carry facet values over to the vertices.

    Parameters
    ----------
    mesh : Mesh
        The surface, m.
    values : (m,) float
        One a facet; NaN where there is none.

    Returns
    -------
    SplitSurface
    """
    faces, count = mesh.faces, len(mesh.vertices)
    centre = count + np.arange(len(faces))
    corners = [np.stack([faces[:, i], faces[:, (i + 1) % 3], centre], axis=1) for i in range(3)]
    return SplitSurface(
        np.concatenate([mesh.vertices, facet_centroids(mesh)]),
        np.stack(corners, axis=1).reshape(-1, 3).astype(np.int64),
        np.concatenate([_at_vertices(mesh, values), values]),
    )


def _at_vertices(mesh: Mesh, values: Floats) -> Floats:
    """Value of the least-squares plane through the facets around each vertex, within their range, (v,).

    The plane is over the vertex's tangent plane; where the facets are too few or stand in a row, their mean.
    """
    count, known = len(mesh.vertices), np.isfinite(values)
    facet = np.repeat(np.flatnonzero(known), 3)
    vertex, value = mesh.faces[known].ravel(), values[facet]

    def summed(terms: Floats) -> Floats:
        return np.asarray(np.bincount(vertex, terms, count))

    flat = _tangent_places(mesh, vertex, facet)
    number, low, high = summed(np.ones(len(vertex))), np.full(count, np.inf), np.full(count, -np.inf)
    np.minimum.at(low, vertex, value)
    np.maximum.at(high, vertex, value)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = summed(value) / number
        place = np.stack([summed(flat[:, i]) / number for i in range(2)], axis=1)
        off, rise = flat - place[vertex], value - mean[vertex]
        xx, yy, xy = summed(off[:, 0] ** 2), summed(off[:, 1] ** 2), summed(off[:, 0] * off[:, 1])
        xh, yh = summed(off[:, 0] * rise), summed(off[:, 1] * rise)
        spread = xx * yy - xy * xy
        slope = np.stack([yy * xh - xy * yh, xx * yh - xy * xh], axis=1) / spread[:, None]
        fitted = np.clip(mean - np.einsum("ij,ij->i", slope, place), low, high)
        enough = (number >= 3) & (spread > _LEAST_SPREAD * (xx + yy) ** 2)
    return np.where(enough, fitted, mean)


def _tangent_places(mesh: Mesh, vertex: Ints, facet: Ints) -> Floats:
    """Centroids seen from vertices, in these vertices' tangent planes, (n, 2)."""
    normals = facet_normals(mesh)
    up = np.stack(
        [np.bincount(mesh.faces.ravel(), np.repeat(normals[:, i], 3), len(mesh.vertices)) for i in range(3)],
        axis=1,
    )
    up = up / np.linalg.norm(up, axis=1)[:, None]
    axis = np.eye(3)[np.argmin(np.abs(up), axis=1)]
    east = np.cross(up, axis)
    east /= np.linalg.norm(east, axis=1)[:, None]
    north = np.cross(up, east)
    offset = facet_centroids(mesh)[facet] - mesh.vertices[vertex]
    return np.stack(
        [np.einsum("ij,ij->i", offset, east[vertex]), np.einsum("ij,ij->i", offset, north[vertex])], axis=1
    )


class _Crossings(NamedTuple):
    """Triangles that a level crosses: one corner lies on one side, two on the other."""

    triangle: Ints  # (k,)
    ends: Ints  # (k, 2, 2) the corners of the two crossed edges, the smaller index first
    shares: Floats  # (k, 2) of the way from the lone corner
    lone_is_low: NDArray[np.bool_]  # (k,)


def _crossings(surface: SplitSurface, level: float) -> _Crossings:
    heights = surface.values[surface.triangles]
    above = heights > level
    crossed = np.isfinite(heights).all(axis=1) & above.any(axis=1) & ~above.all(axis=1)
    triangle = np.flatnonzero(crossed)
    corners, h, high = surface.triangles[triangle], heights[triangle], above[triangle]
    lone_is_low = high.sum(axis=1) == 2
    lone = np.where(lone_is_low, (~high).argmax(axis=1), high.argmax(axis=1))
    row = np.arange(len(triangle))
    ends, shares = [], []
    for step in (1, 2):
        other = (lone + step) % 3
        ends.append(np.sort(np.stack([corners[row, lone], corners[row, other]], axis=1), axis=1))
        shares.append((level - h[row, lone]) / (h[row, other] - h[row, lone]))
    return _Crossings(triangle, np.stack(ends, axis=1), np.stack(shares, axis=1), lone_is_low)


def level_set(mesh: Mesh, values: Floats, level: float) -> LevelSet:
    """Trace one level of facet values over the surface.

    Parameters
    ----------
    mesh : Mesh
        The surface, m.
    values : (m,) float
        One a facet; NaN where there is none: lines end there, and its area does not count.
    level : float
        The level.

    Returns
    -------
    LevelSet
        Its lines in a fixed order: by their first crossed facet.
    """
    return trace(split_surface(mesh, values), level)


def trace(surface: SplitSurface, level: float) -> LevelSet:
    """Trace one level over a surface that has been split; see :func:`level_set`.

    Parameters
    ----------
    surface : SplitSurface
        Points and values.
    level : float
        The level.

    Returns
    -------
    LevelSet
    """
    found = _crossings(surface, level)
    # a line runs with the lower values to its left, seen from outside, where triangles run leftwards: it
    # leaves a lone low corner to the left by coming in over the edge that follows it
    order = np.where(found.lone_is_low[:, None], [0, 1], [1, 0])
    row = np.arange(len(order))[:, None]
    ends = found.ends[row, order]
    keys = ends[..., 0] * len(surface.points_m) + ends[..., 1]
    crossed, place = np.unique(keys, return_inverse=True)
    place = place.reshape(-1, 2)
    a, b = np.divmod(crossed, len(surface.points_m))
    h = surface.values
    share = (level - h[a]) / (h[b] - h[a])
    points = surface.points_m[a] + share[:, None] * (surface.points_m[b] - surface.points_m[a])
    lines = _joined(place, len(crossed))
    offsets = np.concatenate([[0], np.cumsum([len(line) for line in lines], dtype=np.int64)])
    return LevelSet(
        level,
        points[np.concatenate([np.zeros(0, np.int64), *lines])],
        offsets,
        _area_within(surface, found, level),
    )


def _joined(segments: Ints, count: int) -> list[Ints]:
    """Join directed segments, (k, 2) int, into lines: every point begins at most one, and ends one."""
    following = np.full(count, -1, dtype=np.int64)
    following[segments[:, 0]] = segments[:, 1]
    ends = np.zeros(count, dtype=bool)
    ends[segments[:, 1]] = True
    done = np.zeros(count, dtype=bool)
    lines = []
    # open lines first: a walk from a point in the middle of one would cut it in two
    for start in (*segments[~ends[segments[:, 0]], 0].tolist(), *segments[:, 0].tolist()):
        if done[start]:
            continue
        line = [start]
        done[start] = True
        while (here := int(following[line[-1]])) >= 0:
            line.append(here)
            if done[here]:
                break
            done[here] = True
        lines.append(np.array(line, dtype=np.int64))
    return lines


def _area_within(surface: SplitSurface, found: _Crossings, level: float) -> float:
    """Area where the value is at most the level, m2."""
    corners = surface.points_m[surface.triangles]
    areas = 0.5 * np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    heights = surface.values[surface.triangles]
    whole = (heights <= level).all(axis=1)
    part = found.shares.prod(axis=1)
    part = np.where(found.lone_is_low, part, 1.0 - part)
    return float(areas[whole].sum() + (areas[found.triangle] * part).sum())
