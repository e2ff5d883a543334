"""What the truth needs of a shape, computed afresh: facets, moments, the least ellipsoid."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import minimize


@dataclass(frozen=True)
class Shape:
    """A closed mesh about its centre of mass, m."""

    vertices: np.ndarray
    faces: np.ndarray

    @property
    def corners(self) -> np.ndarray:
        return self.vertices[self.faces]

    @property
    def centroids(self) -> np.ndarray:
        return self.corners.mean(axis=1)

    @property
    def normals(self) -> np.ndarray:
        c = self.corners
        n = np.cross(c[:, 1] - c[:, 0], c[:, 2] - c[:, 0])
        return n / np.linalg.norm(n, axis=1)[:, None]


def read_obj(path: Path, unit_m: float = 1000.0) -> Shape:
    """Read v and f records and move the origin to the centre of mass."""
    vertices, faces = [], []
    for line in path.read_text().splitlines():
        words = line.split()
        if words[:1] == ["v"]:
            vertices.append([float(w) for w in words[1:4]])
        elif words[:1] == ["f"]:
            faces.append([int(w.split("/")[0]) - 1 for w in words[1:4]])
    v, f = np.array(vertices) * unit_m, np.array(faces)
    volume, first, _ = moments(v[f])
    return Shape(v - first / volume, f)


def moments(corners: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    """Volume, first and second moments of the solid: sums over tetrahedra with the origin."""
    a, b, c = np.moveaxis(corners, 1, 0)
    volumes = np.einsum("ij,ij->i", a, np.cross(b, c)) / 6
    total = a + b + c
    first = (volumes[:, None] * total).sum(axis=0) / 4
    outer = sum(np.einsum("i,ij,ik->jk", volumes, p, p) for p in (a, b, c, total))
    return float(volumes.sum()), first, outer / 20


def degree_two(shape: Shape, radius: float) -> tuple[float, float, float]:
    """Unnormalised C20, C22, S22 of the homogeneous solid about the origin."""
    volume, _, m = moments(shape.corners)
    m = m / (volume * radius**2)
    return m[2, 2] - (m[0, 0] + m[1, 1]) / 2, (m[0, 0] - m[1, 1]) / 4, m[0, 1] / 2


def least_ellipsoid(shape: Shape) -> np.ndarray:
    """Semi-axes of the least-volume axis-aligned ellipsoid about the origin, every vertex inside, m."""
    squares = (shape.vertices / 1.0) ** 2
    scale = squares.max(axis=0)
    rows = squares / scale
    found = minimize(
        lambda q: -np.log(q).sum(),
        np.full(3, 1 / 3),
        jac=lambda q: -1 / q,
        constraints={"type": "ineq", "fun": lambda q: 1 - rows @ q, "jac": lambda q: -rows},
        bounds=[(1e-6, None)] * 3,
        method="SLSQP",
        options={"ftol": 1e-14, "maxiter": 500},
    )
    semi = np.sqrt(scale / found.x)
    return semi * np.sqrt(((shape.vertices / semi) ** 2).sum(axis=1).max())
