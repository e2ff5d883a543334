"""A star-shaped body on a mesh of any number of vertices: even triangles, least deviation, same volume."""

from __future__ import annotations

import numpy as np

from landing_cli.body.mass_properties import is_star_shaped, mass_properties, translated
from landing_cli.body.mesh import FloatArray, IntArray, Mesh, facet_areas
from landing_cli.body.remesh import relaxed
from landing_cli.body.star_surface import StarSurface
from landing_cli.errors import InputRefused, UsageError

LEAST_VERTICES = 12
GREATEST_VERTICES = 100_000
_ROUNDS = 100
_GOLDEN_ANGLE = np.pi * (1.0 + np.sqrt(5.0))


def resampled(mesh: Mesh, vertex_count: int) -> Mesh:
    """Represent a body by another number of vertices.

    Parameters
    ----------
    mesh : Mesh
        Star-shaped about its centre of mass.
    vertex_count : int
        N, which gives 2 N - 4 facets.

    Returns
    -------
    Mesh
        About the same origin, with the same volume; the same on every run.

    Raises
    ------
    UsageError
        If the number of vertices is out of range.
    InputRefused
        If the body is not star-shaped, or too rugged for so few vertices.

    Notes
    -----
    A Fibonacci lattice that follows the body's area along its longest axis is relaxed on the surface
    (:mod:`landing_cli.body.remesh`). Then the vertices move along their rays to where the new facets,
    not only their corners, fit the old surface best.
    """
    if not LEAST_VERTICES <= vertex_count <= GREATEST_VERTICES:
        raise UsageError(
            f"{vertex_count} vertices asked for; {LEAST_VERTICES} to {GREATEST_VERTICES} are possible"
        )
    source = mass_properties(mesh)
    about_com = translated(mesh, -source.center_of_mass_m)
    surface = StarSurface(about_com)
    even = relaxed(surface, _lattice(surface, about_com, vertex_count), _ROUNDS)
    fitted = _fitted(surface, even, len(mesh.faces))
    scale = np.cbrt(source.volume_m3 / mass_properties(fitted).volume_m3)
    result = Mesh(fitted.vertices * scale, fitted.faces)
    if not is_star_shaped(result, np.zeros(3)):
        raise InputRefused(
            f"{vertex_count} vertices are too few for this body: the new surface would overlap itself",
            fix="ask for more vertices",
        )
    return translated(result, source.center_of_mass_m)


def facet_samples(mesh: Mesh, divisions: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Spread points evenly over every facet: the centroids of its ``divisions``^2 equal parts.

    Parameters
    ----------
    mesh : Mesh
        Surface to sample, of m facets.
    divisions : int
        Parts along an edge.

    Returns
    -------
    points : (m divisions^2, 3) float, m
        Facet by facet.
    areas_m2 : (m divisions^2,) float, m2
        Of the part that each stands for.
    weights : (divisions^2, 3) float
        Barycentric coordinates within any facet.
    """
    steps = np.arange(divisions)
    i, j = np.meshgrid(steps, steps, indexing="ij")
    upright = np.column_stack([i[i + j < divisions], j[i + j < divisions]]) + 1.0 / 3.0
    turned = np.column_stack([i[i + j < divisions - 1], j[i + j < divisions - 1]]) + 2.0 / 3.0
    pairs = np.concatenate([upright, turned]) / divisions
    weights = np.column_stack([pairs, 1.0 - pairs.sum(axis=1)])
    points = np.einsum("sk,fkd->fsd", weights, mesh.corners).reshape(-1, 3)
    return points, np.repeat(facet_areas(mesh) / len(weights), len(weights)), weights


def _lattice(surface: StarSurface, mesh: Mesh, count: int) -> Mesh:
    """Place a Fibonacci lattice around the longest axis, as dense as the body's area asks for."""
    half_extents = 0.5 * np.ptp(mesh.vertices, axis=0)
    axis = int(np.argmax(half_extents))
    points, areas, _ = facet_samples(mesh, 6)
    height = (points / half_extents)[:, axis] / np.linalg.norm(points / half_extents, axis=1)
    order = np.argsort(height, kind="stable")
    share = np.cumsum(areas[order]) / areas.sum()
    index = np.arange(count) + 0.5
    z = np.interp(index / count, share, height[order])
    ring = np.sqrt(np.maximum(0.0, 1.0 - z**2))
    turn = _GOLDEN_ANGLE * index
    lattice = np.roll(np.column_stack([z, ring * np.cos(turn), ring * np.sin(turn)]), axis, axis=1)
    return Mesh(surface.points_along(lattice * half_extents), _hull_faces(lattice))


def _hull_faces(points: FloatArray) -> IntArray:
    """Triangulate points on a sphere, wound outwards."""
    from scipy.spatial import ConvexHull

    faces = np.asarray(ConvexHull(points).simplices, dtype=np.int64)
    a, b, c = np.moveaxis(points[faces], 1, 0)
    inward = np.einsum("ij,ij->i", a, np.cross(b, c)) < 0.0
    faces[inward] = faces[inward][:, ::-1]
    return faces


def _fitted(surface: StarSurface, mesh: Mesh, source_facets: int) -> Mesh:
    """Scale each vertex along its ray so that the facets fit the surface in the least-squares sense.

    On a facet with corners p_k, a ray in direction d = sum b_k p_k is met at r with
    1/r = sum b_k x_k / |d|, where corner k moves to p_k / x_k. The inverse radius is thus linear in
    x, and (r_surface^2 (1/r - 1/r_surface))^2, weighted by area, is the squared radial deviation.
    """
    from scipy.sparse import csc_array
    from scipy.sparse.linalg import splu

    divisions = int(np.clip(np.ceil(np.sqrt(4.0 * source_facets / len(mesh.faces))), 4, 16))
    points, areas, barycentric = facet_samples(mesh, divisions)
    distance = np.linalg.norm(points, axis=1)
    radius = np.linalg.norm(surface.points_along(points), axis=1)
    weight = np.sqrt(areas) * radius**2
    rows = np.repeat(np.arange(len(points)), 3)
    columns = np.repeat(mesh.faces, len(barycentric), axis=0).ravel()
    values = np.tile(barycentric, (len(mesh.faces), 1)) * (weight / distance)[:, None]
    matrix = csc_array((values.ravel(), (rows, columns)), shape=(len(points), len(mesh.vertices)))
    shrink = splu((matrix.T @ matrix).tocsc()).solve(matrix.T @ (weight / radius))
    return Mesh(mesh.vertices / shrink[:, None], mesh.faces)
