"""A closed triangle mesh: the asteroid's surface as arrays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Mesh:
    """A closed, outward-wound triangle mesh.

    Attributes
    ----------
    vertices : (n, 3) float, m, body frame
        Read-only, C-contiguous.
    faces : (m, 3) int
        0-based vertex indices, counter-clockwise seen from outside.
    """

    vertices: FloatArray
    faces: IntArray

    def __post_init__(self) -> None:
        """Freeze the arrays in one dtype and memory order."""
        for name, dtype in (("vertices", np.float64), ("faces", np.int64)):
            array = np.array(getattr(self, name), dtype=dtype, order="C")
            array.setflags(write=False)
            object.__setattr__(self, name, array)

    @property
    def corners(self) -> FloatArray:
        """Corner positions, (m, 3, 3) float, m: ``corners[f, i]`` is corner i of facet f."""
        return self.vertices[self.faces]


def facet_centroids(mesh: Mesh) -> FloatArray:
    """Centroid of every facet, (m, 3) float, m (Zhao 2022, eq 3)."""
    return np.asarray(mesh.corners.mean(axis=1))


def facet_area_vectors(mesh: Mesh) -> FloatArray:
    """Outward normal of every facet times its area, (m, 3) float, m2."""
    a, b, c = np.moveaxis(mesh.corners, 1, 0)
    return np.asarray(0.5 * np.cross(b - a, c - a))


def facet_areas(mesh: Mesh) -> FloatArray:
    """Area of every facet, (m,) float, m2."""
    return np.asarray(np.linalg.norm(facet_area_vectors(mesh), axis=1))


def facet_normals(mesh: Mesh) -> FloatArray:
    """Outward unit normal of every facet, (m, 3) float."""
    vectors = facet_area_vectors(mesh)
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))
