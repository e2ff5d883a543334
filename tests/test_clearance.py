"""Signed distance against brute force over every facet, solid angles, trimesh and closed forms."""

from __future__ import annotations

import pickle
from itertools import pairwise

import numpy as np
import pytest
from kernel_calls import from_python
from shape_helpers import box, fibonacci_ellipsoid

from landing_cli.body.adjacency import mean_edge_m
from landing_cli.body.bvh import SurfaceIndex, build_surface_index
from landing_cli.body.clearance import (
    TOUCHDOWN_TOLERANCE_M,
    closest_facets,
    contains,
    path_clearance,
    signed_distance as signed_distance_part,
    signed_distances,
)
from landing_cli.body.mesh import Mesh, facet_areas, facet_centroids, facet_normals
from landing_cli.errors import InputRefused

signed_distance = from_python(signed_distance_part)


def brute_distances(mesh: Mesh, points: np.ndarray) -> np.ndarray:
    """Distance to every facet as a projection clamped onto face or edges, (n, m): no regions, no tree."""
    a, b, c = np.moveaxis(mesh.corners, 1, 0)
    n = facet_normals(mesh)
    least = np.full((len(points), len(a)), np.inf)
    p = points[:, None]
    for tail, head in ((a, b), (b, c), (c, a)):
        edge = head - tail
        share = np.clip(((p - tail) * edge).sum(-1) / (edge * edge).sum(-1), 0.0, 1.0)
        least = np.minimum(least, np.linalg.norm(p - tail - share[..., None] * edge, axis=-1))
    height = ((p - a) * n).sum(-1)
    foot = p - height[..., None] * n
    sides = [(np.cross(h - t, foot - t) * n).sum(-1) for t, h in ((a, b), (b, c), (c, a))]
    above = np.all([side >= 0 for side in sides], axis=0)
    return np.where(above, np.abs(height), least)


def solid_angle(mesh: Mesh, points: np.ndarray) -> np.ndarray:
    """Solid angle of the surface over 4 pi: 1 inside, 0 outside (van Oosterom and Strackee 1983)."""
    a, b, c = np.moveaxis(mesh.corners[None] - points[:, None, None], 2, 0)
    la, lb, lc = (np.linalg.norm(v, axis=-1) for v in (a, b, c))
    top = (a * np.cross(b, c)).sum(-1)
    low = la * lb * lc + (a * b).sum(-1) * lc + (b * c).sum(-1) * la + (c * a).sum(-1) * lb
    return np.asarray(2.0 * np.arctan2(top, low).sum(1) / (4.0 * np.pi))


def spiked_ball() -> Mesh:
    """A ball of 100 m with random pits and spikes: saddles, sharp edges, deep dents, still star-shaped."""
    ball = fibonacci_ellipsoid((100.0, 100.0, 100.0), 150)
    scale = np.random.default_rng(5).uniform(0.3, 1.7, 150)
    return Mesh(ball.vertices * scale[:, None], ball.faces)


def points_around(mesh: Mesh, count: int, seed: int) -> np.ndarray:
    """Far, near, on and inside the surface, and off every kind of feature by a little."""
    rng = np.random.default_rng(seed)
    size = np.abs(mesh.vertices).max()
    on = (
        mesh.corners[rng.integers(0, len(mesh.faces), count)] * rng.dirichlet(np.ones(3), count)[..., None]
    ).sum(1)
    corners = mesh.vertices[rng.integers(0, len(mesh.vertices), count)]
    ends = mesh.corners[rng.integers(0, len(mesh.faces), count)]
    middles = 0.5 * (ends[:, 0] + ends[:, 1])
    nudges = rng.normal(size=(3 * count, 3)) * size * 10.0 ** rng.uniform(-7, -1, (3 * count, 1))
    return np.concatenate(
        [
            rng.uniform(-1.2, 1.2, (count, 3)) * size,
            50 * rng.normal(size=(20, 3)) * size,
            np.concatenate([on, corners, middles]) + nudges,
        ]
    )


@pytest.fixture(scope="module")
def spiked() -> tuple[Mesh, SurfaceIndex]:
    mesh = spiked_ball()
    return mesh, build_surface_index(mesh)


@pytest.fixture(scope="module")
def rock() -> tuple[Mesh, SurfaceIndex]:
    mesh = fibonacci_ellipsoid((290.0, 270.0, 250.0), 700)
    return mesh, build_surface_index(mesh)


def test_distance_equals_brute_force_over_every_facet(spiked):
    mesh, surface = spiked
    points = points_around(mesh, 400, 1)
    every = brute_distances(mesh, points)
    scale = np.abs(points).max(axis=1) + np.abs(mesh.vertices).max()
    found = np.abs(signed_distances(surface, points))
    assert np.max(np.abs(found - every.min(axis=1)) / scale) < 2e-15
    at_facet = every[np.arange(len(points)), closest_facets(surface, points)]
    assert np.max(np.abs(at_facet - every.min(axis=1)) / scale) < 2e-15


def test_sign_is_that_of_the_solid_angle_at_faces_edges_and_corners(spiked):
    mesh, surface = spiked
    points = points_around(mesh, 1500, 2)
    inside = solid_angle(mesh, points)
    clear = np.abs(signed_distances(surface, points)) > 1e-9 * 170.0
    assert clear.sum() > 5000
    assert 0.2 < (inside[clear] > 0.5).mean() < 0.8
    np.testing.assert_array_equal(contains(surface, points)[clear], inside[clear] > 0.5)


def test_reference_shapes_agree_with_trimesh_and_solid_angle(reference_shapes):
    import trimesh

    for name in ("bennu_radar_1348.obj", "eros_near_3897.obj"):
        loaded = trimesh.load(reference_shapes / name, process=False)
        mesh = Mesh(np.asarray(loaded.vertices) * 1000.0, np.asarray(loaded.faces))
        surface = build_surface_index(mesh)
        points = points_around(mesh, 40, 3)
        found = signed_distances(surface, points)
        body = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
        oracle = [
            np.linalg.norm(
                trimesh.triangles.closest_point(mesh.corners, np.tile(p, (len(mesh.faces), 1))) - p, axis=1
            )
            for p in points
        ]
        extent = np.ptp(mesh.vertices, axis=0).max()
        far = np.linalg.norm(points, axis=1) > 3 * extent
        assert np.max(np.abs(np.abs(found) - np.min(oracle, axis=1))[~far]) < 1e-12 * extent
        clear = np.abs(found) > 1e-9 * extent
        np.testing.assert_array_equal((found < 0)[clear], solid_angle(mesh, points)[clear] > 0.5)
        shoot = clear & (np.abs(found) > 1e-4 * extent) & ~far  # rays in single precision
        np.testing.assert_array_equal((found < 0)[shoot], body.contains(points[shoot]))


def test_box_has_its_closed_form():
    mesh = box((2.0, 3.0, 4.0), (-1.0, -1.5, -2.0))
    surface = build_surface_index(mesh)
    points = np.random.default_rng(4).uniform(-5, 5, (2000, 3))
    beyond = np.abs(points) - [1.0, 1.5, 2.0]
    expected = np.linalg.norm(np.maximum(beyond, 0.0), axis=1) + np.minimum(beyond.max(axis=1), 0.0)
    np.testing.assert_allclose(signed_distances(surface, points), expected, rtol=0, atol=5e-15)


def test_bound_limits_the_search(rock):
    _, surface = rock
    point = (20.0, 30.0, 500.0)
    distance, facet = signed_distance(surface, *point, np.inf)
    assert signed_distance(surface, *point, distance * (1 + 1e-12)) == (distance, facet)
    assert signed_distance(surface, *point, distance * (1 - 1e-12)) == (distance * (1 - 1e-12), -1)


def test_nan_point_has_nan_distance(rock):
    _, surface = rock
    found = signed_distances(surface, [[0.0, np.nan, 0.0], [0.0, 0.0, 300.0]])
    assert np.isnan(found[0])
    assert found[1] > 0
    assert np.isnan(path_clearance(surface, np.full((3, 3), np.nan), 1.0, 0.0, np.inf)[0])


def test_index_is_deterministic_complete_and_survives_pickling(rock):
    mesh, surface = rock
    again = build_surface_index(mesh)
    back = pickle.loads(pickle.dumps(surface))
    for one, two, three in zip(surface, again, back, strict=True):
        np.testing.assert_array_equal(one, two)
        np.testing.assert_array_equal(one, three)
    np.testing.assert_array_equal(np.sort(surface.facets), np.arange(len(mesh.faces)))


def test_open_surface_is_refused(rock):
    mesh, _ = rock
    with pytest.raises(InputRefused, match="open"):
        build_surface_index(Mesh(mesh.vertices, mesh.faces[1:]))


def landing_path(start: np.ndarray, touchdown: np.ndarray, via: np.ndarray, count: int = 150) -> np.ndarray:
    s = np.linspace(0.0, 1.0, count)[:, None]
    return np.ascontiguousarray((1 - s) ** 2 * start + 2 * s * (1 - s) * via + s**2 * touchdown)


def random_paths(mesh: Mesh, count: int, seed: int):
    """Landings from 500 to 900 m away, some along the surface and some through the rock."""
    rng = np.random.default_rng(seed)
    centroids, normals = facet_centroids(mesh), facet_normals(mesh)
    for facet in rng.integers(0, len(centroids), count):
        start = rng.normal(size=3)
        start *= rng.uniform(500, 900) / np.linalg.norm(start)
        yield landing_path(start, centroids[facet], centroids[facet] + rng.uniform(0, 600) * normals[facet])


def expected_clearance(surface: SurfaceIndex, path: np.ndarray, free_radius: float) -> float:
    d = signed_distances(surface, path)
    counts = (np.linalg.norm(path - path[-1], axis=1) > free_radius) | (d < -TOUCHDOWN_TOLERANCE_M)
    return float(d[counts].min(initial=np.inf))


def test_path_clearance_is_that_of_looking_at_every_point(rock, spiked):
    for (mesh, surface), count in ((rock, 200), (spiked, 200)):
        edge = mean_edge_m(mesh)
        expected, found, facets = [], [], []
        for path in random_paths(mesh, count, 6):
            expected.append(expected_clearance(surface, path, edge))
            clearance, facet = path_clearance(surface, path, edge, TOUCHDOWN_TOLERANCE_M, np.inf)
            found.append(clearance)
            facets.append(facet)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-10)
        assert min(facets) >= 0
        assert 0 < np.sum(np.array(found) < 0) < count


def test_path_clearance_with_a_spacing_is_that_of_the_divided_chords(rock):
    mesh, surface = rock
    edge, spacing = mean_edge_m(mesh), 1.3
    for path in random_paths(mesh, 20, 7):
        coarse = np.ascontiguousarray(path[::-1][::30][::-1])  # chords of some 100 m
        pieces = [coarse[:1]]
        for p, q in pairwise(coarse):
            parts = int(np.ceil(np.linalg.norm(q - p) / spacing))
            pieces.append(p + (q - p) * (np.arange(1, parts + 1) / parts)[:, None])
        expected = expected_clearance(surface, np.concatenate(pieces), edge)
        found, _ = path_clearance(surface, coarse, edge, TOUCHDOWN_TOLERANCE_M, spacing)
        assert found == pytest.approx(expected, rel=0, abs=1e-9)
        fine, _ = path_clearance(surface, coarse, edge, TOUCHDOWN_TOLERANCE_M, 0.05)
        assert found - spacing <= fine <= found + 0.05


def test_vertical_landing_is_clear_by_the_free_radius(rock):
    mesh, surface = rock
    facet = 17
    touchdown, normal = facet_centroids(mesh)[facet], facet_normals(mesh)[facet]
    path = np.ascontiguousarray(touchdown + np.linspace(400, 0, 401)[:, None] * normal)
    found, nearest = path_clearance(surface, path, 20.5, TOUCHDOWN_TOLERANCE_M, np.inf)
    assert found == pytest.approx(21.0, rel=1e-12)
    assert nearest == facet


def test_rock_is_met_even_within_the_free_radius(rock):
    mesh, surface = rock
    touchdown, normal = facet_centroids(mesh)[17], facet_normals(mesh)[17]
    dip = np.array([400.0, 50.0, 10.0, 3.0, -2.0, 0.0])
    path = np.ascontiguousarray(touchdown + dip[:, None] * normal)
    assert path_clearance(surface, path, 25.0, TOUCHDOWN_TOLERANCE_M, np.inf)[0] == pytest.approx(
        -2.0, rel=1e-12
    )
    path[4] = touchdown - 0.5 * TOUCHDOWN_TOLERANCE_M * normal
    assert path_clearance(surface, path, 25.0, TOUCHDOWN_TOLERANCE_M, np.inf)[0] > 40.0


def test_path_within_the_free_radius_has_no_clearance(rock):
    mesh, surface = rock
    touchdown, normal = facet_centroids(mesh)[17], facet_normals(mesh)[17]
    path = np.ascontiguousarray(touchdown + np.array([5.0, 2.0, 0.0])[:, None] * normal)
    assert path_clearance(surface, path, 25.0, TOUCHDOWN_TOLERANCE_M, np.inf) == (np.inf, -1)


def test_closest_facet_of_a_large_mesh_lies_below_each_centroid():
    mesh = fibonacci_ellipsoid((560.0, 270.0, 260.0), 24578)
    assert len(mesh.faces) == 49152
    surface = build_surface_index(mesh)
    height = 0.01 * np.sqrt(facet_areas(mesh))
    points = facet_centroids(mesh) + height[:, None] * facet_normals(mesh)
    np.testing.assert_array_equal(closest_facets(surface, points), np.arange(49152))
    np.testing.assert_allclose(signed_distances(surface, points), height, rtol=1e-11)
