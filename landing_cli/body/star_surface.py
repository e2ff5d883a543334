"""A star-shaped surface as a function of direction: the radius along any ray from its centre."""

from __future__ import annotations

import numpy as np

from landing_cli.body.adjacency import facet_neighbours
from landing_cli.body.mass_properties import facets_hidden_from
from landing_cli.body.mesh import FloatArray, IntArray, Mesh, facet_area_vectors, facet_centroids
from landing_cli.errors import InputRefused

_STEPS = 300
_BLOCK = 512


class StarSurface:
    """A mesh that every ray from the origin meets once, prepared for casting rays.

    Parameters
    ----------
    mesh : Mesh
        Star-shaped about the origin.

    Raises
    ------
    InputRefused
        If a facet does not face away from the origin.
    """

    def __init__(self, mesh: Mesh) -> None:
        from scipy.spatial import cKDTree

        hidden = facets_hidden_from(mesh, np.zeros(3))
        if len(hidden):
            raise InputRefused(
                f"{len(hidden)} of {len(mesh.faces)} facets hide from the centre: not star-shaped",
                where=f"facet {hidden[0]}",
                fix="a radius per direction cannot represent overhangs: use the mesh as it is",
            )
        self._neighbours = facet_neighbours(mesh)
        corners = mesh.corners
        # A direction is inside a facet when it lies on the inner side of the three planes
        # through the origin and its edges.
        self._planes = _unit(np.cross(corners, np.roll(corners, -1, axis=1)))
        self._normals = facet_area_vectors(mesh)
        self._offsets = np.einsum("ij,ij->i", self._normals, corners[:, 0])
        self._tree = cKDTree(_unit(facet_centroids(mesh)))

    def facets_along(self, directions: FloatArray) -> IntArray:
        """Find the facet that each ray meets, (n,) int, for (n, 3) directions of any length."""
        directions = _unit(directions)
        _, facets = self._tree.query(directions)
        active = np.arange(len(directions))
        # Walk across the edge that is passed by most.
        for _ in range(_STEPS):
            sides = np.einsum("nj,nkj->nk", directions[active], self._planes[facets[active]])
            out = sides.min(axis=1) < -1e-13
            active, edge = active[out], sides[out].argmin(axis=1)
            if not len(active):
                return facets
            facets[active] = self._neighbours[facets[active], edge]
        # A walk can circle on a surface that is far from Delaunay: ask every facet.
        for start in range(0, len(active), _BLOCK):
            block = active[start : start + _BLOCK]
            sides = np.einsum("nj,mkj->nmk", directions[block], self._planes)
            facets[block] = sides.min(axis=2).argmax(axis=1)
        return facets

    def points_along(self, directions: FloatArray) -> FloatArray:
        """Find where each ray meets the surface, (n, 3) float, m, for (n, 3) directions of any length."""
        facets = self.facets_along(directions)
        scale = self._offsets[facets] / np.einsum("ij,ij->i", self._normals[facets], directions)
        return directions * scale[:, None]


def _unit(vectors: FloatArray) -> FloatArray:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))
