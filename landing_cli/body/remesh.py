"""Even triangles on a star-shaped surface: vertices relaxed along it, edges flipped to Delaunay."""

from __future__ import annotations

import numpy as np

from landing_cli.body.adjacency import directed_edges, facet_neighbours
from landing_cli.body.mesh import FloatArray, IntArray, Mesh, facet_area_vectors, facet_centroids
from landing_cli.body.star_surface import StarSurface

_FLIP_SWEEPS = 50
_FLIP_EVERY = 2
_ANGLE_SLACK = 1e-4


def corner_angles(mesh: Mesh) -> FloatArray:
    """Interior angle at every corner of every facet, (m, 3) float, rad."""
    ahead = np.roll(mesh.corners, -1, axis=1) - mesh.corners
    back = np.roll(mesh.corners, 1, axis=1) - mesh.corners
    sine = np.linalg.norm(np.cross(ahead, back), axis=2)
    return np.arctan2(sine, np.einsum("fij,fij->fi", ahead, back))


def relaxed(surface: StarSurface, mesh: Mesh, rounds: int) -> Mesh:
    """Move every vertex towards the centre of its facets, along the surface, until triangles are even.

    Parameters
    ----------
    surface : StarSurface
        Where the vertices stay.
    mesh : Mesh
        Vertices on the surface, star-shaped about the origin.
    rounds : int
        Of moving all vertices once; edges are flipped every other round.

    Returns
    -------
    Mesh
        Same counts.

    Notes
    -----
    The centre is the mean of the centroids of the facets around the vertex, weighted by area: where
    facets are larger, vertices move in. Only the part of the move in the tangent plane is taken; the
    rest, met by a ray at grazing incidence, would carry the vertex far along the surface.
    """
    mesh = delaunay(mesh)
    for turn in range(rounds):
        vectors = facet_area_vectors(mesh)
        areas = np.linalg.norm(vectors, axis=1)
        normals = _gathered(mesh, vectors)
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        centers = _gathered(mesh, areas[:, None] * facet_centroids(mesh))
        moves = centers / _gathered(mesh, areas[:, None]) - mesh.vertices
        moves -= normals * np.einsum("ij,ij->i", moves, normals)[:, None]
        mesh = Mesh(surface.points_along(mesh.vertices + moves), mesh.faces)
        if turn % _FLIP_EVERY == 1:
            mesh = delaunay(mesh)
    return delaunay(mesh)


def _gathered(mesh: Mesh, per_facet: FloatArray) -> FloatArray:
    """Sum a quantity of the facets around each vertex."""
    total = np.zeros((len(mesh.vertices), per_facet.shape[1]))
    for corner in range(3):
        np.add.at(total, mesh.faces[:, corner], per_facet)
    return total


def delaunay(mesh: Mesh) -> Mesh:
    """Flip edges until no two angles opposite an edge exceed 180 degrees together.

    Parameters
    ----------
    mesh : Mesh
        Star-shaped about the origin; stays so.

    Returns
    -------
    Mesh
        Same vertices. Edges whose flip would fold the surface or double an edge stay.
    """
    for _ in range(_FLIP_SWEEPS):
        faces = mesh.faces.copy()
        if not _flip_some(mesh, faces):
            break
        mesh = Mesh(mesh.vertices, faces)
    return mesh


def _flip_some(mesh: Mesh, faces: IntArray) -> int:
    """Flip edges that share no facet, worst first, in place; return how many."""
    count = len(mesh.vertices)
    facet, corner = np.divmod(np.arange(faces.size), 3)
    other = facet_neighbours(mesh).ravel()
    start, end = directed_edges(mesh.faces).T
    partner_corner = np.argmax(mesh.faces[other] == end[:, None], axis=1)
    angles = corner_angles(mesh)
    apex, partner_apex = (corner + 2) % 3, (partner_corner + 2) % 3
    total = angles[facet, apex] + angles[other, partner_apex]
    wanted = np.flatnonzero((total > np.pi + _ANGLE_SLACK) & (facet < other))
    wanted = wanted[np.argsort(-total[wanted], kind="stable")]
    here, there = mesh.faces[facet, apex], mesh.faces[other, partner_apex]
    points = mesh.vertices
    first = np.einsum(
        "ij,ij->i", points[start[wanted]], np.cross(points[there[wanted]], points[here[wanted]])
    )
    second = np.einsum("ij,ij->i", points[there[wanted]], np.cross(points[end[wanted]], points[here[wanted]]))
    keys = np.minimum(here, there) * count + np.maximum(here, there)
    taken = np.isin(keys[wanted], np.minimum(start, end) * count + np.maximum(start, end))
    touched: set[int] = set()
    drawn: set[int] = set()
    for slot in wanted[(first > 0.0) & (second > 0.0) & ~taken].tolist():
        pair = (int(facet[slot]), int(other[slot]))
        if touched.intersection(pair) or int(keys[slot]) in drawn:
            continue
        faces[pair[0]] = start[slot], there[slot], here[slot]
        faces[pair[1]] = there[slot], end[slot], here[slot]
        touched.update(pair)
        drawn.add(int(keys[slot]))
    return len(drawn)
