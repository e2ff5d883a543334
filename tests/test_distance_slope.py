"""The slope of the distance to the surface against finite differences of the distance."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.testing import assert_allclose
from shape_helpers import fibonacci_ellipsoid

from landing_cli.body.bvh import build_surface_index
from landing_cli.body.clearance import signed_distances
from landing_cli.body.distance_slope import distances_with_slopes, vertices_with_slopes
from landing_cli.body.mesh import Mesh
from landing_cli.body.vertex_distance import vertex_distances

STEP_M = 1e-3


@pytest.fixture(scope="module")
def mesh() -> Mesh:
    """A lumpy potato of 240 facets, with ridges and hollows, tens of metres in size."""
    smooth = fibonacci_ellipsoid((60.0, 40.0, 30.0), 122)
    lumps = 1.0 + 0.15 * np.sin(5.0 * smooth.vertices[:, :1] / 20.0) * np.cos(smooth.vertices[:, 1:2] / 9.0)
    return Mesh(smooth.vertices * lumps, smooth.faces)


@pytest.fixture(scope="module")
def points(mesh: Mesh) -> np.ndarray:
    """Points outside, inside, and within a hair of the vertices, where edges and corners are closest."""
    rng = np.random.default_rng(1)
    size = np.abs(mesh.vertices).max()
    near = mesh.vertices[:100] + rng.normal(size=(100, 3)) * 0.05 * size
    return np.concatenate([rng.uniform(-2.0, 2.0, (400, 3)) * size, near])


def numeric(distance: Callable[[np.ndarray], np.ndarray], points: np.ndarray) -> np.ndarray:
    axes = STEP_M * np.eye(3)
    return np.stack([(distance(points + e) - distance(points - e)) / (2.0 * STEP_M) for e in axes], axis=1)


def test_distance_to_the_surface(mesh: Mesh, points: np.ndarray) -> None:
    surface = build_surface_index(mesh)
    distance, slope = distances_with_slopes(surface, points)
    assert_allclose(distance, signed_distances(surface, points), rtol=0, atol=0)
    assert_allclose(np.linalg.norm(slope, axis=1), 1.0, rtol=1e-12)
    error = np.abs(numeric(lambda p: signed_distances(surface, p), points) - slope).max(axis=1)
    assert (error < 1e-5).mean() > 0.98  # the others lie within a millimetre of a kink
    assert (distance < 0.0).sum() > 10


def test_on_the_surface_it_is_the_normal(mesh: Mesh) -> None:
    surface = build_surface_index(mesh)
    centres = mesh.corners.mean(axis=1)
    _, slope = distances_with_slopes(surface, centres)
    normals = np.cross(mesh.corners[:, 1] - mesh.corners[:, 0], mesh.corners[:, 2] - mesh.corners[:, 0])
    assert_allclose(slope, normals / np.linalg.norm(normals, axis=1)[:, None], atol=1e-9)


def test_distance_to_the_nearest_vertex(mesh: Mesh, points: np.ndarray) -> None:
    surface = build_surface_index(mesh)
    distance, slope = vertices_with_slopes(surface, points)
    assert_allclose(distance, vertex_distances(surface, points), rtol=1e-12)
    error = np.abs(numeric(lambda p: vertex_distances(surface, p), points) - slope).max(axis=1)
    assert (error < 1e-5).mean() > 0.98
